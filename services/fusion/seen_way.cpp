#include "fusion/seen_way.hpp"

#include <algorithm>

namespace railfix::fusion {
namespace {

constexpr size_t kPictures = 4;

}  // namespace

std::optional<SeenWay::Picture> SeenWay::add(const OdometryInput& step) {
  const auto reference = std::ranges::find(pictures_, step.reference_stamp_ns, &Picture::stamp_ns);
  if (reference == pictures_.end()) return std::nullopt;
  const Picture picture{step.stamp_ns, reference->way_m + step.step_m,
                        reference->variance_m2 + step.step_sigma_m * step.step_sigma_m};
  // The reference may be kept for long; of the others the oldest goes.
  if (pictures_.size() >= kPictures) pictures_.erase(pictures_.begin() + (reference == pictures_.begin() ? 1 : 0));
  pictures_.push_back(picture);
  return picture;
}

}  // namespace railfix::fusion
