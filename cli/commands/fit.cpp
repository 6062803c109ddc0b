#include "pipeline/fit.h"

#include <memory>
#include <utility>
#include <vector>

#include <fmt/format.h>

#include "cli/commands.h"
#include "cli/console.h"
#include "cli/options.h"
#include "cli/outcome.h"
#include "pipeline/report_json.h"

namespace angiospline::cli {
namespace {

struct Arguments {
  std::filesystem::path model;  // or a mask, for closed surfaces
  std::filesystem::path image;
  std::vector<std::filesystem::path> outputs;
  FitFileOptions options;
  std::optional<DeformMethod> solver;  // set: the thesis's way
  DeformModelOptions deform;
  bool json = false;
};

std::string summary_of(const FittedFile& fitted) {
  if (fitted.edges) {
    const EdgeFit& fit = *fitted.edges;
    return fmt::format("{}: {} after {} iterations; {} nodes among {} edges, moved {:.3g} mm",
                       to_string(fit.options.method), to_string(fit.report.termination),
                       fitted.iterations, fit.nodes, fit.edges, fitted.parts.back().moved_mean_mm);
  }
  const FitReport& report = fitted.wall->report;
  return fmt::format(
      "{} noise, SNR {:.3g}; axes moved {:.3g} mm, walls {:.3g} mm; {:.3g} mm left; {} control "
      "points "
      "({} before data reduction)",
      report.noise_kind == NoiseKind::kRician ? "Rician" : "white", report.snr,
      report.mean_axis_move_mm, report.mean_move_mm, fitted.wall->mean_residual_mm,
      report.control_points, report.control_points_before_reduction);
}

void tell_truth(const MaskComparison& truth, const Console& console) {
  console.say(fmt::format(
      "truth: {:.3g} % missed, Dice {:.4f}, surface distance {:.3g} mm (mean), {:.3g} mm (95 %)",
      truth.missed_percent, truth.dice, truth.surface ? truth.surface->mean_mm : 0.0,
      truth.surface ? truth.surface->hausdorff95_mm : 0.0));
}

int run(const Arguments& arguments) {
  const Console console;
  FitFileOptions options = arguments.options;
  if (arguments.solver) {
    options.deform = arguments.deform;
    options.deform->method = *arguments.solver;
  }
  const auto fitted =
      fit_file(arguments.model, arguments.image, arguments.outputs, options, console.progress());
  if (!fitted) return report_error(fitted.error());
  console.say(summary_of(*fitted));
  if (fitted->truth) tell_truth(*fitted->truth, console);
  if (arguments.json) print_json(json_text(*fitted));
  return tell_outcome(fitted->model, fitted->certificate, fitted->files, console);
}

// The thesis's way; all of it belongs to --solver.
void add_solver_options(const Command& command, Arguments& a, const Option& refinements) {
  std::vector<std::pair<std::string, DeformMethod>> methods;
  for (const char* name : {"sparse", "euler-svd", "euler-dft", "euler-dft-phantom", "central",
                           "central-dft", "runge-kutta-1", "runge-kutta-4"}) {
    methods.emplace_back(name, *deform_method(name));
  }
  const Option solver =
      command.choose("--solver", a.solver, methods,
                     "deform by edges and potentials (the thesis's way) with this solver: sparse, "
                     "euler-svd, euler-dft, euler-dft-phantom, central, central-dft, runge-kutta-1 "
                     "or runge-kutta-4");
  solver.excludes(refinements);
  command
      .choose("--potential", a.deform.potential,
              std::vector<std::pair<std::string, PotentialKind>>{
                  {"gravity", PotentialKind::kGravity}, {"spring", PotentialKind::kSpring}},
              "gravity or spring")
      .needs(solver);
  command.add("--strength", a.deform.strength, "of the potential").needs(solver);
  command.add("--reach", a.deform.reach_vox, "of the potential, in voxels").needs(solver);
  command.add("--stiffness", a.deform.stiffness, "of the springs between nodes").needs(solver);
  command
      .add("--edges", a.deform.edge_percentile,
           "edges are stronger than so many percent of the voxels")
      .needs(solver);
  command.add("--iterations", a.deform.most_iterations, "at most").needs(solver);
}

}  // namespace

void add_fit(CommandLine& line) {
  const auto arguments = std::make_shared<Arguments>();
  Arguments& a = *arguments;
  const Command command = line.command("fit", "move a model's walls to where an image shows them");
  command
      .add("MODEL", a.model,
           "native model (.json); or a mask, of which each piece becomes a closed surface")
      .required();
  command.add("IMAGE", a.image, "the image it came from").required();
  command
      .add("-o,--output", a.outputs,
           "files to write, by suffix: .step .iges .brep .glb .stl .vtp .vtu .json .html .geo")
      .required();
  command.add("--truth", a.options.truth, "mask to measure the result by");
  command.add("--residual", a.options.residual,
              ".glb or .vtp to write with what is left of the distance as colours");
  command.flag(
      "--dark", [&a] { a.options.fit.dark = a.deform.dark = true; },
      "vessels are darker than their background");
  command.flag("!--no-capture", a.options.fit.capture,
               "refine the surfaces as they are; do not move centerlines and radii first");
  const Option refinements = add_refinements_option(command, a.options.fit.refinements);
  add_solver_options(command, a, refinements);
  add_writing_options(command, a.options.writing);
  add_json_flag(command, a.json);
  command.runs([arguments] { return run(*arguments); });
}

}  // namespace angiospline::cli
