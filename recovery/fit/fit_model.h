// A model fitted to the image it came from: every wall moved to where the grey values put it.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "base/progress.h"
#include "base/result.h"
#include "modeling/build/build_model.h"
#include "modeling/network/model.h"
#include "modeling/network/tessellation.h"
#include "recovery/fit/figures.h"
#include "recovery/imaging/image/any_image.h"
#include "recovery/wall/displacement_options.h"
#include "recovery/wall/rician_noise.h"

namespace angiospline {

struct FitOptions {
  bool capture = true;      // move the centerlines and radii to the image and seed anew, first
  bool dark = false;        // vessels are darker than their background
  int rounds = 1;           // of free-form refinement of the surface
  double body_spans = 1.0;  // length of a body's spans, in radii, while it is fitted
  // Times that bodies and closed surfaces get more freedom where their residual is larger than
  // noise explains, and are fitted there again (recovery/fit/refinement.h).
  int refinements = 3;
  // What data reduction may move a body's wall by afterwards, in voxels over SNR: about half of
  // what noise leaves. 0: no reduction.
  double reduction = 0.15;
  DisplacementOptions displacement;
  BuildOptions build;
};

struct FitReport {
  double contrast = 0.0;  // grey of the vessel above its background
  double noise = 0.0;     // standard deviation of a voxel's grey, or of Rician noise's two parts
  NoiseKind noise_kind = NoiseKind::kWhite;
  double snr = 0.0;    // contrast over noise, at most 20
  int iterations = 0;  // times that the wall was measured
  int nodes = 0;       // of the finite-element mesh
  int control_points = 0;
  int control_points_before_reduction = 0;
  double reduction_mm = 0.0;        // its tolerance; 0: none
  double wave_factor = 1.0;         // smoothing that the data chose (recovery/wall/displacement.h)
  double degrees_of_freedom = 0.0;  // of the refinement
  double mean_axis_move_mm = 0.0;   // of the centerlines in the capture
  double mean_move_mm = 0.0;        // of the surface, over its area, in the refinement
  std::vector<std::string> without_edge;  // regions near which the image shows no wall: as seeded
  std::vector<std::string> recaptured;  // branches that lay beside their vessel and were led there
  std::vector<HeldRegion> held;         // regions that would have folded: as seeded
  std::vector<std::string> refined;     // regions that got more knots where residuals were large
};

struct FittedModel {
  Model model;
  FitReport report;
};

// The voxels as floats. Errors, naming `file`: voxels that are NaN or infinite, an image without
// any contrast, fewer than 4 voxels along an axis.
Result<Image<float>> grey_image(const AnyImage& image, const std::string& file);

// What is wrong if fewer than half of the points lie in the image: their frames differ.
std::optional<Error> frames_apart(const Points3& points_mm, const ImageGrid& grid);

// Fits the whole network, bodies and junctions together (docs/fit.md). With `capture` the model is
// seeded anew from its tree, as fit_tree does; otherwise its surfaces are refined as they are. Open
// ends stay open and in their planes; patches keep their common tangent planes. Errors: the model
// lies outside the image or mostly so (their frames differ); no contrast at the model's wall;
// stopped on request. Time linear in the wall's area.
Result<FittedModel> fit_model(const Model& model, const Image<float>& image,
                              const FitOptions& options = {}, const Progress& progress = {});

// The same from centerlines with radii: they are moved to the image (recovery/capture/capture.h),
// then seeded (modeling/build/build_model.h), then the surfaces are refined. Errors: also those of
// seeding.
Result<FittedModel> fit_tree(const CenterlineTree& tree, const Image<float>& image,
                             const FitOptions& options = {}, const Progress& progress = {});

// How far the image would still move each point of a tessellation of the model, along its normal
// and smoothed by the rule of recovery/wall/displacement.h: "residual_mm", positive where the
// image's wall lies farther out; NaN inside caps and where nothing could be measured. Large values
// show where a fit needs a finer model, or the image another look. Without a meaning once the
// caller asked to stop. O(points).
MeshField wall_residual(const Model& model, const Tessellation& tessellation,
                        const Image<float>& image, const FitOptions& options = {},
                        const Progress& progress = {});

}  // namespace angiospline
