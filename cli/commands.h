// The subcommands: what each is asked, and the verb that does it. Each returns the exit code.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "base/vector.h"

namespace angiospline::cli {

// How a centerline file is to be read where it cannot say so itself.
struct CenterlineArguments {
  std::string unit;  // mm, cm, m, um, or empty: as the format has it
  bool radius_is_diameter = false;
  std::string frame;                  // LPS, RAS, or empty: as the format has it
  std::optional<double> voxel_width;  // as CenterlineFileOptions has it
};

// How a vessel is told from its background.
struct SegmentArguments {
  std::string image;
  std::string series_uid;                // of a DICOM folder with several
  std::optional<Vec3> stack_spacing_mm;  // of a stack of PNG or TIFF slices
  std::vector<Vec3> seeds_mm;
  std::vector<Vec3> seeds_vox;
  bool dark = false;
  std::optional<int> neighborhood;   // N
  std::optional<double> deviations;  // M
  std::optional<double> background;  // grey values beyond it are never vessel
  std::optional<double> smoothing_vox;
  bool cut_swellings = false;
  std::optional<std::int64_t> limit;  // voxels examined
  std::string xray;                   // views and their geometry, for growing in several modalities
  std::optional<double> world_spacing_mm;
  std::string output;
  bool json = false;
};

struct SeedArguments {
  std::vector<std::string> trees;  // files, folders, or lists of them
  CenterlineArguments reading;
  std::vector<std::string> outputs;  // model files of one tree, or one folder for many
  std::string formats = "step";      // of many trees: suffixes with commas between
  int jobs = 0;                      // trees at a time; 0: as many as there are processors
  int threads = 0;                   // of one tree; 0: as many as there are processors
  double extend_inlets = 0.0;        // in diameters
  double extend_outlets = 0.0;
  std::optional<double> clearance;  // in radii of the thinner vessel
  std::string name;
  std::string step_schema = "AP242";
  bool json = false;
};

struct RecoverArguments {
  SegmentArguments segment;
  std::optional<Vec3> root_mm;
  bool cut_contacts = false;
  std::string output_folder;
  bool fit = true;  // the model to the image, after it is seeded
  int refinements = 3;
  bool json = false;
};

struct FitArguments {
  std::string model;  // or a mask, for closed surfaces
  std::string image;
  std::vector<std::string> outputs;
  std::string truth;     // a mask to measure the result by; may be empty
  std::string residual;  // .glb or .vtp with what is left as colours; may be empty
  bool dark = false;
  bool capture = true;
  int refinements = 3;
  // The thesis's way, by edges that pull a mesh; no solver: the default fit.
  std::string solver;
  std::string potential = "gravity";
  double strength = 10.0;
  double reach_vox = 4.0;
  std::optional<double> stiffness;
  double edge_percentile = 97.0;
  int most_iterations = 2000;
  std::string step_schema = "AP242";
  bool json = false;
};

struct ThinArguments {
  std::string mask;
  std::string output;
  bool json = false;
};

struct GraphArguments {
  std::string skeleton;
  std::string mask;  // empty: `skeleton` is the mask itself and is thinned first
  std::vector<std::string> outputs;
  std::optional<Vec3> root_mm;
  bool keep_twigs = false;
  bool cut_contacts = false;
  bool table = false;
  bool json = false;
};

struct CheckArguments {
  std::string model;
  bool json = false;
};

struct SmoothArguments {
  std::string model;
  std::vector<std::string> outputs;
  double clean_deg = 1e-3;  // parts no rougher than this are left alone
  bool everything = false;
  std::string step_schema = "AP242";
  bool json = false;
};

struct CompareArguments {
  std::string a;
  std::string b;
  std::optional<double> tolerance_mm;
  bool json = false;
};

struct CompareMasksArguments {
  std::string truth;
  std::string result;
  bool level_set = false;   // `truth` is a level set, negative inside
  bool within_box = false;  // what lies beyond the bounding box of the truth does not count
  bool no_centerlines = false;
  bool json = false;
};

struct ConvertArguments {
  std::string input;
  std::vector<std::string> outputs;
  std::string step_schema = "AP242";
};

struct PhantomArguments {
  std::string kind;
  std::string output;
  std::string truth;
  std::string truth_tree;
  std::string xray;  // views to write; only for rings
  std::optional<double> snr;
  std::uint64_t random_seed = 1;
};

struct ReproduceArguments {
  std::vector<std::string> tables;  // none: all
  bool quick = false;
  std::uint64_t random_seed = 1;
  bool json = false;
};

int run_recover(const RecoverArguments& arguments);
int run_fit(const FitArguments& arguments);
int run_seed(const SeedArguments& arguments);
int run_seed_batch(const SeedArguments& arguments);
int run_segment(const SegmentArguments& arguments);
int run_thin(const ThinArguments& arguments);
int run_graph(const GraphArguments& arguments);
int run_smooth(const SmoothArguments& arguments);
int run_check(const CheckArguments& arguments);
int run_compare(const CompareArguments& arguments);
int run_compare_masks(const CompareMasksArguments& arguments);
int run_convert(const ConvertArguments& arguments);
int run_phantom(const PhantomArguments& arguments);
int run_reproduce(const ReproduceArguments& arguments);

}  // namespace angiospline::cli
