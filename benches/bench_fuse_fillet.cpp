// The same random junctions made twice: by make_junction, and by OpenCASCADE as CAD users do it:
// cylinders fused (BRepAlgoAPI_Fuse), their seams filleted (BRepFilletAPI_MakeFillet), the result
// checked. Each of OpenCASCADE's runs is a process of its own, because some of them crash or never
// end. Seconds are of CPU time. bench_fuse_fillet [COUNT [SEED [SECONDS]]]
#include <array>
#include <cmath>
#include <csignal>
#include <cstdlib>
#include <ctime>

#include <BRepAdaptor_Surface.hxx>
#include <BRepAlgoAPI_Fuse.hxx>
#include <BRepCheck_Analyzer.hxx>
#include <BRepFilletAPI_MakeFillet.hxx>
#include <BRepGProp.hxx>
#include <BRepPrimAPI_MakeCylinder.hxx>
#include <GProp_GProps.hxx>
#include <Standard_Failure.hxx>
#include <TopExp.hxx>
#include <TopTools_IndexedDataMapOfShapeListOfShape.hxx>
#include <TopTools_ListOfShape.hxx>
#include <TopoDS.hxx>
#include <fmt/core.h>
#include <gp_Ax2.hxx>
#include <sys/resource.h>
#include <sys/wait.h>
#include <unistd.h>

#include "benches/junction_classes.h"
#include "modeling/junction/junction.h"

namespace {

using namespace angiospline;

constexpr double kFilletRadius = 0.15;  // of the thinnest branch, as JunctionOptions::blend

enum class Outcome { kDone, kNotFused, kNotFilleted, kInvalid, kCrashed, kTooSlow };
constexpr std::array<const char*, 6> kNames{"done",    "not fused", "not filleted",
                                            "invalid", "crashed",   "too slow"};

// Whether the edge parts two cylinders.
bool is_seam(const TopTools_ListOfShape& faces) {
  int cylinders = 0;
  for (const TopoDS_Shape& face : faces) {
    cylinders += BRepAdaptor_Surface(TopoDS::Face(face)).GetType() == GeomAbs_Cylinder;
  }
  return cylinders == 2 && !faces.First().IsSame(faces.Last());
}

Outcome fuse_and_fillet(const JunctionSpec& spec, const std::vector<double>& lengths) {
  try {
    double thinnest = spec.branches.front().radius_mm;
    TopoDS_Shape body;
    for (std::size_t b = 0; b < spec.branches.size(); ++b) {
      const JunctionBranch& branch = spec.branches[b];
      thinnest = std::min(thinnest, branch.radius_mm);
      const gp_Ax2 axis(gp_Pnt(0, 0, 0),
                        gp_Dir(branch.direction.x(), branch.direction.y(), branch.direction.z()));
      const TopoDS_Shape cylinder =
          BRepPrimAPI_MakeCylinder(axis, branch.radius_mm, lengths[b]).Shape();
      if (b == 0) {
        body = cylinder;
        continue;
      }
      BRepAlgoAPI_Fuse fuse(body, cylinder);
      if (!fuse.IsDone()) return Outcome::kNotFused;
      body = fuse.Shape();
    }
    TopTools_IndexedDataMapOfShapeListOfShape faces;
    TopExp::MapShapesAndAncestors(body, TopAbs_EDGE, TopAbs_FACE, faces);
    BRepFilletAPI_MakeFillet fillet(body);
    int seams = 0;
    for (int e = 1; e <= faces.Extent(); ++e) {
      if (!is_seam(faces(e))) continue;
      fillet.Add(kFilletRadius * thinnest, TopoDS::Edge(faces.FindKey(e)));
      ++seams;
    }
    if (seams == 0) return Outcome::kNotFused;
    fillet.Build();
    if (!fillet.IsDone()) return Outcome::kNotFilleted;
    if (!BRepCheck_Analyzer(fillet.Shape()).IsValid()) return Outcome::kInvalid;
    GProp_GProps properties;
    BRepGProp::VolumeProperties(fillet.Shape(), properties);
    return properties.Mass() > 0 ? Outcome::kDone : Outcome::kInvalid;
  } catch (const Standard_Failure&) {
    return Outcome::kNotFilleted;
  }
}

struct Run {
  Outcome outcome;
  double seconds;
};

Run in_child(const JunctionSpec& spec, const std::vector<double>& lengths, unsigned most_seconds) {
  const pid_t child = fork();
  if (child == 0) {
    rlimit limit{most_seconds, most_seconds};
    setrlimit(RLIMIT_CPU, &limit);
    _exit(static_cast<int>(fuse_and_fillet(spec, lengths)));
  }
  int status = 0;
  rusage usage{};
  wait4(child, &status, 0, &usage);
  const double seconds =
      static_cast<double>(usage.ru_utime.tv_sec + usage.ru_stime.tv_sec) +
      1e-6 * static_cast<double>(usage.ru_utime.tv_usec + usage.ru_stime.tv_usec);
  if (WIFEXITED(status)) return {static_cast<Outcome>(WEXITSTATUS(status)), seconds};
  const bool slow = WTERMSIG(status) == SIGXCPU || WTERMSIG(status) == SIGKILL;
  return {slow ? Outcome::kTooSlow : Outcome::kCrashed, seconds};
}

}  // namespace

int main(int argc, char** argv) {
  const int count = argc > 1 ? std::atoi(argv[1]) : 10;
  const std::uint64_t seed = argc > 2 ? std::strtoull(argv[2], nullptr, 10) : 1;
  const auto most_seconds = static_cast<unsigned>(argc > 3 ? std::atoi(argv[3]) : 20);
  fmt::print(
      "| class | junctions | ours: done | s | OpenCASCADE: done | s | its failures |\n"
      "|---|---|---|---|---|---|---|\n");
  for (const JunctionClass& family : junction_classes()) {
    Random random(seed);
    int ours = 0;
    double our_seconds = 0, their_seconds = 0;
    std::array<int, kNames.size()> outcomes{};
    for (int k = 0; k < count; ++k) {
      const JunctionSpec spec = family.make(random);
      const auto lengths = opening_distances_mm(spec);
      if (!lengths) continue;
      const std::clock_t start = std::clock();
      ours += make_junction(spec).has_value();
      our_seconds += static_cast<double>(std::clock() - start) / CLOCKS_PER_SEC;
      std::fflush(stdout);
      const Run run = in_child(spec, *lengths, most_seconds);
      ++outcomes[static_cast<std::size_t>(run.outcome)];
      their_seconds += run.seconds;
    }
    std::string failures;
    for (std::size_t o = 1; o < kNames.size(); ++o) {
      if (outcomes[o] == 0) continue;
      failures += fmt::format("{}{} {}", failures.empty() ? "" : ", ", outcomes[o], kNames[o]);
    }
    fmt::print("| {} | {} | {} | {:.3f} | {} | {:.3f} | {} |\n", family.name, count, ours,
               our_seconds / count, outcomes[0], their_seconds / count, failures);
    std::fflush(stdout);
  }
}
