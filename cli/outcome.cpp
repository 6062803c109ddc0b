#include "cli/outcome.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include "pipeline/finish_model.h"

namespace angiospline::cli {

int tell_outcome(const Model& model, const Certificate& certificate,
                 const std::vector<std::string>& targets, const Console& console) {
  for (const std::string& text : model.assumptions) console.say("note: " + text);
  for (const Warning& warning : model.warnings) console.warn(warning);
  for (const FailedPart& part : model.failed) {
    console.say(fmt::format("failed: {}: {}", part.name, part.why));
  }

  const bool sound = is_sound(certificate);
  console.say(
      fmt::format("{} branches, {} patches, {} solid{}: {:.6g} mm3, {}, largest normal angle "
                  "{:.2g} degrees -> {}",
                  model.tree.branches.size(), model.network.patches.size(), certificate.solids,
                  certificate.solids == 1 ? "" : "s", certificate.volume_mm3,
                  sound                           ? "closed and valid"
                  : certificate.self_intersecting ? "self-intersecting"
                  : certificate.closed            ? "closed but not valid"
                                                  : "not closed",
                  certificate.max_normal_angle_deg, fmt::join(targets, " ")));
  return model.failed.empty() && sound ? kSuccess : kFailure;
}

}  // namespace angiospline::cli
