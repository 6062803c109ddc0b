// The program: reads the command line, runs one subcommand, returns its exit code.
#include <cmath>
#include <functional>
#include <sstream>

#include <CLI/CLI.hpp>
#include <fmt/format.h>

#include "cli/commands.h"
#include "cli/console.h"

namespace angiospline::cli {
namespace {

// "1.5,-2,30" to a point; CLI11 prints what a ValidationError says.
Vec3 parse_point(const std::string& text) {
  std::istringstream stream(text);
  stream.imbue(std::locale::classic());
  Vec3 point;
  char comma = ',';
  for (int i = 0; i < 3; ++i) {
    if (i > 0) stream >> comma;
    if (!(stream >> point[i]) || comma != ',' || !std::isfinite(point[i])) {
      throw CLI::ValidationError(text, "a point is three finite numbers: x,y,z");
    }
  }
  if (stream >> comma) throw CLI::ValidationError(text, "a point is three finite numbers: x,y,z");
  return point;
}

void add_points(CLI::App* command, const std::string& flag, std::vector<Vec3>& points,
                const std::string& help) {
  command
      ->add_option_function<std::vector<std::string>>(
          flag,
          [&points](const std::vector<std::string>& texts) {
            points.clear();
            for (const std::string& text : texts) points.push_back(parse_point(text));
          },
          help)
      ->type_name("X,Y,Z")
      ->allow_extra_args(false)
      ->take_all();
}

void add_segment_options(CLI::App* command, SegmentArguments& a) {
  command
      ->add_option("IMAGE", a.image,
                   "image file, or folder of a DICOM series or of PNG, TIFF slices")
      ->required();
  command->add_option("--series", a.series_uid,
                      "SeriesInstanceUID to take of a folder with several DICOM series");
  command
      ->add_option_function<std::string>(
          "--stack-spacing",
          [&a](const std::string& text) { a.stack_spacing_mm = parse_point(text); },
          "voxel edges in mm of a stack of PNG or TIFF slices, which carries none")
      ->type_name("X,Y,Z");
  add_points(command, "--seed", a.seeds_mm, "point inside the vessel in mm, LPS; may be repeated");
  add_points(command, "--seed-voxel", a.seeds_vox, "the same in voxel indices");
  command->add_flag("--dark", a.dark, "vessels are darker than their background");
  command->add_option("-N,--neighborhood", a.neighborhood,
                      "size of the neighbourhood, odd, 3 to 15");
  command->add_option("-M,--deviations", a.deviations,
                      "standard deviations below the local mean that still count as vessel");
  command->add_option("--background", a.background, "grey values beyond this are never vessel");
  command->add_option("--smooth", a.smoothing_vox,
                      "Gaussian smoothing before growing, in voxels (0: none)");
  command->add_flag(
      "--cut-swellings", a.cut_swellings,
      "leave out what the growing reached through a neck and is much thicker than the "
      "vessel: tissue behind a leak");
  command->add_option("--limit", a.limit, "largest number of voxels to examine");
}

void add_root_option(CLI::App* command, std::optional<Vec3>& root_mm) {
  command
      ->add_option_function<std::string>(
          "--root", [&root_mm](const std::string& text) { root_mm = parse_point(text); },
          "the end nearest to this point, in mm, is the inlet (default: the thickest end)")
      ->type_name("X,Y,Z");
}

void add_cut_option(CLI::App* command, bool& cut_contacts) {
  command->add_flag(
      "--cut-contacts", cut_contacts,
      "part vessels that touch but do not join, and cut thin bridges between vessels");
}

void add_json_flag(CLI::App* command, bool& json) {
  command->add_flag("--json", json, "print the figures as one JSON object on standard output");
}

void add_schema_option(CLI::App* command, std::string& schema) {
  command->add_option("--step-schema", schema, "AP242 or AP214")
      ->check(CLI::IsMember({"AP242", "AP214"}));
}

// Everything the command line can hold; the chosen verb is run after parsing.
struct CommandLine {
  RecoverArguments recover;
  FitArguments fit;
  SeedArguments seed;
  SegmentArguments segment;
  ThinArguments thin;
  GraphArguments graph;
  SmoothArguments smooth;
  CheckArguments check;
  CompareArguments compare;
  CompareMasksArguments compare_masks;
  ConvertArguments convert;
  PhantomArguments phantom;
  ReproduceArguments reproduce;
  std::function<int()> verb;
};

CLI::Option* add_refinements_option(CLI::App* command, int& refinements) {
  return command
      ->add_option("--refinements", refinements,
                   "rounds, at most, in which walls get more freedom where they miss the image by "
                   "more than noise explains (default 3; 0 is quicker)")
      ->check(CLI::Range(0, 10));
}

void add_recover(CLI::App& app, CommandLine& line) {
  CLI::App* command =
      app.add_subcommand("recover", "from an image to a CAD model, every stage kept");
  add_segment_options(command, line.recover.segment);
  command->add_option("-o,--output", line.recover.output_folder, "folder for the results")
      ->required();
  add_root_option(command, line.recover.root_mm);
  add_cut_option(command, line.recover.cut_contacts);
  command->add_flag("!--no-fit", line.recover.fit,
                    "keep the walls of the mask; do not fit them to the image");
  add_refinements_option(command, line.recover.refinements);
  add_json_flag(command, line.recover.json);
  command->callback([&line] { line.verb = [&line] { return run_recover(line.recover); }; });
}

void add_seed(CLI::App& app, CommandLine& line) {
  CLI::App* command = app.add_subcommand("seed", "from a centerline+radius file to a CAD model");
  SeedArguments& a = line.seed;
  command
      ->add_option("TREE", a.trees,
                   "centerline file (.swc .csv ...); several .ctgr and .pth are one tree; with a "
                   "folder as output: any number of files, folders of them, and lists (.list)")
      ->required();
  command
      ->add_option(
          "-o,--output", a.outputs,
          "files to write, by suffix: .step .iges .brep .glb .stl .vtp .vtu .json .html .geo; or "
          "one folder, which gets the models of all trees and summary.csv and summary.json")
      ->required();
  command
      ->add_option("--extend-inlets", a.extend_inlets,
                   "straight round tube added at each inlet, in diameters")
      ->check(CLI::Range(0.0, 1e3));
  command->add_option("--extend-outlets", a.extend_outlets, "the same at each outlet")
      ->check(CLI::Range(0.0, 1e3));
  command
      ->add_option(
          "--clearance", a.clearance,
          "move apart and thin vessels that come nearer than this, in radii of the thinner")
      ->check(CLI::Range(0.0, 10.0));
  command->add_option("--format", a.formats,
                      "into a folder: what to write of each tree, as in step,glb,json");
  command->add_option("--jobs", a.jobs, "into a folder: trees at a time (default: one a processor)")
      ->check(CLI::Range(1, 1024));
  command->add_option("--threads", a.threads, "processors used for one tree (default: all)")
      ->check(CLI::Range(1, 1024));
  command->add_option("--unit", a.reading.unit,
                      "unit of the file: m, cm, mm, um, nm, inch or a number of them, like 0.04mm");
  command->add_flag("--radius-is-diameter", a.reading.radius_is_diameter,
                    "the radius column holds diameters");
  command
      ->add_option("--voxel-width", a.reading.voxel_width,
                   "VascuSynth only: width of a voxel in the unit of the radii")
      ->check(CLI::PositiveNumber);
  command->add_option("--frame", a.reading.frame, "coordinate frame of the file: LPS or RAS")
      ->check(CLI::IsMember({"LPS", "RAS"}));
  command->add_option("--name", a.name, "product name (default: the file's name)");
  add_schema_option(command, a.step_schema);
  add_json_flag(command, a.json);
  command->callback([&line] { line.verb = [&line] { return run_seed(line.seed); }; });
}

void add_fit(CLI::App& app, CommandLine& line) {
  CLI::App* command =
      app.add_subcommand("fit", "move a model's walls to where an image shows them");
  FitArguments& a = line.fit;
  command
      ->add_option("MODEL", a.model,
                   "native model (.json); or a mask, of which each piece becomes a closed surface")
      ->required();
  command->add_option("IMAGE", a.image, "the image it came from")->required();
  command
      ->add_option(
          "-o,--output", a.outputs,
          "files to write, by suffix: .step .iges .brep .glb .stl .vtp .vtu .json .html .geo")
      ->required();
  command->add_option("--truth", a.truth, "mask to measure the result by");
  command->add_option("--residual", a.residual,
                      ".glb or .vtp to write with what is left of the distance as colours");
  command->add_flag("--dark", a.dark, "vessels are darker than their background");
  command->add_flag("!--no-capture", a.capture,
                    "refine the surfaces as they are; do not move centerlines and radii first");
  CLI::Option* refinements = add_refinements_option(command, a.refinements);
  CLI::Option* solver =
      command
          ->add_option(
              "--solver", a.solver,
              "deform by edges and potentials (the thesis's way) with this solver: sparse, "
              "euler-svd, euler-dft, euler-dft-phantom, central, central-dft, runge-kutta-1 "
              "or runge-kutta-4")
          ->check(CLI::IsMember({"sparse", "euler-svd", "euler-dft", "euler-dft-phantom", "central",
                                 "central-dft", "runge-kutta-1", "runge-kutta-4"}))
          ->excludes(refinements);
  command->add_option("--potential", a.potential, "gravity (default) or spring")
      ->check(CLI::IsMember({"gravity", "spring"}))
      ->needs(solver);
  command->add_option("--strength", a.strength, "of the potential (default 10)")->needs(solver);
  command->add_option("--reach", a.reach_vox, "of the potential, in voxels (default 4)")
      ->needs(solver);
  command->add_option("--stiffness", a.stiffness, "of the springs between nodes")->needs(solver);
  command
      ->add_option("--edges", a.edge_percentile,
                   "edges are stronger than so many percent of the voxels (default 97)")
      ->needs(solver);
  command->add_option("--iterations", a.most_iterations, "at most (default 2000)")->needs(solver);
  add_schema_option(command, a.step_schema);
  add_json_flag(command, a.json);
  command->callback([&line] { line.verb = [&line] { return run_fit(line.fit); }; });
}

void add_segment(CLI::App& app, CommandLine& line) {
  CLI::App* command = app.add_subcommand("segment", "grow the vessel from seeds: image to mask");
  add_segment_options(command, line.segment);
  command->add_option("-o,--output", line.segment.output, "mask image to write")->required();
  command->add_option("--xray", line.segment.xray,
                      "JSON file of X-ray views: growing in IMAGE and all of them together; needs "
                      "--seed and --background");
  command
      ->add_option("--world-spacing", line.segment.world_spacing_mm,
                   "voxel edge of the mask in mm, with --xray (default: half of IMAGE's)")
      ->check(CLI::PositiveNumber);
  add_json_flag(command, line.segment.json);
  command->callback([&line] { line.verb = [&line] { return run_segment(line.segment); }; });
}

void add_thin(CLI::App& app, CommandLine& line) {
  CLI::App* command =
      app.add_subcommand("thin", "mask to skeleton, one voxel thick, same topology");
  command->add_option("MASK", line.thin.mask, "mask image, nonzero inside")->required();
  command->add_option("-o,--output", line.thin.output, "skeleton image to write")->required();
  add_json_flag(command, line.thin.json);
  command->callback([&line] { line.verb = [&line] { return run_thin(line.thin); }; });
}

void add_graph(CLI::App& app, CommandLine& line) {
  CLI::App* command = app.add_subcommand("graph", "skeleton to vessel graph with radii");
  GraphArguments& a = line.graph;
  command->add_option("SKELETON", a.skeleton, "skeleton image, or the mask itself")->required();
  command->add_option("--mask", a.mask, "mask the skeleton came from, for the radii");
  command->add_option("-o,--output", a.outputs,
                      "centerline files to write: .swc .csv .graphml .vtp");
  add_root_option(command, a.root_mm);
  add_cut_option(command, a.cut_contacts);
  command->add_flag("--keep-twigs", a.keep_twigs, "do not prune");
  command->add_flag("--table", a.table, "print the level-order table of nodes");
  add_json_flag(command, a.json);
  command->callback([&line] { line.verb = [&line] { return run_graph(line.graph); }; });
}

void add_smooth(CLI::App& app, CommandLine& line) {
  CLI::App* command =
      app.add_subcommand("smooth", "make a native model tangent-plane continuous again");
  SmoothArguments& a = line.smooth;
  command->add_option("MODEL", a.model, "native model (.json)")->required();
  command->add_option("-o,--output", a.outputs, "files to write, by suffix")->required();
  command
      ->add_option("--tolerance", a.clean_deg,
                   "parts whose normals nowhere differ by more degrees are left as they are")
      ->check(CLI::PositiveNumber);
  command->add_flag("--all", a.everything, "smooth every part, clean or not");
  add_schema_option(command, a.step_schema);
  add_json_flag(command, a.json);
  command->callback([&line] { line.verb = [&line] { return run_smooth(line.smooth); }; });
}

void add_check(CLI::App& app, CommandLine& line) {
  CLI::App* command = app.add_subcommand("check", "measure a model: native, STEP, IGES or BREP");
  command->add_option("MODEL", line.check.model, "model file")->required();
  add_json_flag(command, line.check.json);
  command->callback([&line] { line.verb = [&line] { return run_check(line.check); }; });
}

void add_compare(CLI::App& app, CommandLine& line) {
  CLI::App* command = app.add_subcommand("compare", "geometry regression between two models");
  command->add_option("A", line.compare.a, "model file")->required();
  command->add_option("B", line.compare.b, "model file")->required();
  command
      ->add_option("--tolerance", line.compare.tolerance_mm,
                   "exit 1 when the largest distance is above this, in mm")
      ->check(CLI::NonNegativeNumber);
  add_json_flag(command, line.compare.json);
  command->callback([&line] { line.verb = [&line] { return run_compare(line.compare); }; });
}

void add_compare_masks(CLI::App& app, CommandLine& line) {
  CLI::App* command = app.add_subcommand(
      "compare-masks", "how alike two masks are: voxels, surfaces, topology, centerlines");
  CompareMasksArguments& a = line.compare_masks;
  command->add_option("TRUTH", a.truth, "mask image, nonzero inside")->required();
  command->add_option("RESULT", a.result, "mask image on the same grid")->required();
  command->add_flag("--level-set", a.level_set, "TRUTH is a level set, negative inside");
  command->add_flag("--within-box", a.within_box,
                    "leave out what lies beyond the bounding box of TRUTH");
  command->add_flag("--no-centerlines", a.no_centerlines, "do not thin the masks");
  add_json_flag(command, a.json);
  command->callback(
      [&line] { line.verb = [&line] { return run_compare_masks(line.compare_masks); }; });
}

void add_convert(CLI::App& app, CommandLine& line) {
  CLI::App* command = app.add_subcommand("convert", "between model formats");
  command->add_option("IN", line.convert.input, "model file")->required();
  command->add_option("OUT", line.convert.outputs, "files to write, by suffix")->required();
  add_schema_option(command, line.convert.step_schema);
  command->callback([&line] { line.verb = [&line] { return run_convert(line.convert); }; });
}

void add_phantom(CLI::App& app, CommandLine& line) {
  CLI::App* command = app.add_subcommand("phantom", "synthetic images, seeded and repeatable");
  PhantomArguments& a = line.phantom;
  command->add_option("KIND", a.kind, "rings, cylinder, potato, bifurcation, bent-vessel or tree")
      ->required()
      ->check(CLI::IsMember({"rings", "cylinder", "potato", "bifurcation", "bent-vessel", "tree"}));
  command->add_option("-o,--output", a.output, "image to write")->required();
  command->add_option("--truth", a.truth, "truth mask to write");
  command->add_option("--truth-tree", a.truth_tree, "true centerlines to write (.swc, .csv)");
  command->add_option("--snr", a.snr, "signal to noise ratio (default: no noise)")
      ->check(CLI::PositiveNumber);
  command->add_option("--random-seed", a.random_seed, "of the noise and of the random shapes");
  command->add_option("--xray", a.xray,
                      "rings only: the experiment of two modalities (thesis 7.1); writes this JSON "
                      "file of four X-ray views and their images beside it; signal is lost in the "
                      "volume and in the views, and --truth has half the volume's voxel edge");
  command->callback([&line] { line.verb = [&line] { return run_phantom(line.phantom); }; });
}

void add_reproduce(CLI::App& app, CommandLine& line) {
  CLI::App* command = app.add_subcommand(
      "reproduce", "the thesis's experiments on phantoms, its figures beside ours");
  ReproduceArguments& a = line.reproduce;
  command->add_option("TABLE", a.tables,
                      "7.1 rings 7.2 7.3 7.4 7.5 cylinder potato 7.6 vessel bifurcation smoothing "
                      "(default: all)");
  command->add_flag("--quick", a.quick, "a few rows and iterations only, to see that it runs");
  command->add_option("--random-seed", a.random_seed, "of the noise");
  add_json_flag(command, a.json);
  command->callback([&line] { line.verb = [&line] { return run_reproduce(line.reproduce); }; });
}

int run(int argc, char** argv) {
  CLI::App app{"Angiospline: vessels to CAD, from an image or from centerlines with radii"};
  app.name("angiospline");
  app.set_version_flag("--version", ANGIOSPLINE_VERSION);
  app.require_subcommand(1);
  app.option_defaults()->always_capture_default();
  CommandLine line;
  for (const auto add :
       {add_recover, add_seed, add_fit, add_segment, add_thin, add_graph, add_smooth, add_check,
        add_compare, add_compare_masks, add_convert, add_phantom, add_reproduce}) {
    add(app, line);
  }
  try {
    app.parse(argc, argv);
  } catch (const CLI::Success& success) {  // --help, --version
    return app.exit(success);
  } catch (const CLI::ParseError& error) {
    std::string help = "angiospline";
    for (const CLI::App* command : app.get_subcommands()) help += " " + command->get_name();
    return report_error({ErrorKind::kBadInput, error.what(), {}, {}, "see " + help + " --help"});
  }
  return line.verb();
}

}  // namespace
}  // namespace angiospline::cli

int main(int argc, char** argv) {
  try {
    return angiospline::cli::run(argc, argv);
  } catch (const std::bad_alloc&) {
    return angiospline::cli::report_error(
        {angiospline::ErrorKind::kFailed, "out of memory", {}, {}, {}});
  } catch (const std::exception& error) {
    return angiospline::cli::report_error(
        {angiospline::ErrorKind::kFailed, error.what(), "internal error", {}, {}});
  }
}
