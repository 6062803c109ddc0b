#include "cli/options.h"

#include <string>
#include <utility>

namespace angiospline::cli {

void add_segment_options(const Command& command, std::filesystem::path& image,
                         SegmentFileOptions& options) {
  // How the file is read.
  command.add("IMAGE", image, "image file, or folder of a DICOM series or of PNG, TIFF slices")
      .required();
  command.add("--series", options.reading.series_uid,
              "SeriesInstanceUID to take of a folder with several DICOM series");
  command.point(
      "--stack-spacing",
      [&options](const Vec3& edges_mm) { options.reading.stack_spacing_mm = edges_mm; },
      "voxel edges in mm of a stack of PNG or TIFF slices, which carries none");

  // How a vessel is told from its background.
  SegmentOptions& segment = options.segment;
  command.points("--seed", segment.seeds_mm, "point inside the vessel in mm, LPS; may be repeated");
  command.points("--seed-voxel", options.seeds_vox, "the same in voxel indices");
  command.flag(
      "--dark", [&segment] { segment.polarity = Polarity::kDark; },
      "vessels are darker than their background");
  command.add("-N,--neighborhood", segment.neighbourhood_vox,
              "size of the neighbourhood, odd, 3 to 15");
  command.add("-M,--deviations", segment.deviations,
              "standard deviations below the local mean that still count as vessel");
  command.add("--background", segment.background, "grey values beyond this are never vessel");
  command.add("--smooth", segment.smoothing_vox,
              "Gaussian smoothing before growing, in voxels (0: none)");
  command.flag("--cut-swellings", segment.cut_swellings,
               "leave out what the growing reached through a neck and is much thicker than the "
               "vessel: tissue behind a leak");
  command.add("--limit", segment.max_examined, "largest number of voxels to examine");
}

void add_vessel_options(const Command& command, VesselsOptions& options) {
  command.point(
      "--root", [&options](const Vec3& at_mm) { options.roots_mm = {at_mm}; },
      "the end nearest to this point, in mm, is the inlet (default: the thickest end)");
  command.flag("--cut-contacts", options.cut_contacts,
               "part vessels that touch but do not join, and cut thin bridges between vessels");
}

void add_writing_options(const Command& command, ExportOptions& options) {
  options.step_in_side_process = true;
  command.choose("--step-schema", options.step_schema,
                 std::vector<std::pair<std::string, StepSchema>>{{"AP242", StepSchema::kAp242},
                                                                 {"AP214", StepSchema::kAp214}},
                 "AP242 or AP214");
}

Option add_refinements_option(const Command& command, int& refinements) {
  return command
      .add("--refinements", refinements,
           "rounds, at most, in which walls get more freedom where they miss the image by "
           "more than noise explains (0 is quicker)")
      .between(0, 10);
}

void add_json_flag(const Command& command, bool& json) {
  command.flag("--json", json, "print the figures as one JSON object on standard output");
}

}  // namespace angiospline::cli
