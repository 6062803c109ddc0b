// The candidates of region growing, the brightest first. Not installed.
#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <queue>
#include <vector>

#include "base/progress.h"
#include "base/result.h"

namespace angiospline::region_growing {

// A priority queue of places by their grey value; of equal ones the one queued first, so that the
// order is the same on every machine.
template <typename Place>
class GrowingFront {
 public:
  struct Candidate {
    double grey;
    std::uint64_t order;  // of queueing
    Place at;
  };

  void push(double grey, const Place& at) { queue_.push({grey, order_++, at}); }

  // Calls examine(candidate), which may push others, until none is left or `examined`, which
  // `examine` counts, has reached `most`: whether that ended it. Error: kCancelled; looked for and
  // progress reported whenever `examined` is a multiple of `report_every`.
  template <typename Examine>
  Result<bool> grow(const std::size_t& examined, std::optional<std::size_t> most,
                    std::size_t report_every, const Progress& progress, Examine&& examine) {
    bool limit_reached = false;
    while (!queue_.empty() && !limit_reached) {
      if (most && examined >= *most) {
        limit_reached = true;
        continue;
      }
      if (examined % report_every == 0) {
        if (progress.should_stop()) return fail(cancelled("segment"));
        const double done = static_cast<double>(examined);
        progress.at("segment", done / (done + static_cast<double>(queue_.size())));
      }
      const Candidate c = queue_.top();
      queue_.pop();
      examine(c);
    }
    progress.at("segment", 1);
    return limit_reached;
  }

 private:
  struct LaterInQueue {
    bool operator()(const Candidate& a, const Candidate& b) const {
      return a.grey != b.grey ? a.grey < b.grey : a.order > b.order;
    }
  };
  std::priority_queue<Candidate, std::vector<Candidate>, LaterInQueue> queue_;
  std::uint64_t order_ = 0;
};

}  // namespace angiospline::region_growing
