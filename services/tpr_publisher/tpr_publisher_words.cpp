// The sentences that people read of what the reports cannot say.
#include <cstdio>

#include "core/time.hpp"
#include "tpr_publisher/tpr_publisher.hpp"

namespace railfix::tpr_publisher {
namespace {

constexpr double kLongUndeclaredM = 500;  // a switch every few kilometres, declared soon, is no trouble

}  // namespace

std::string TprPublisher::front_unknown() const {
  if (ends_.to_front_m(cab_)) return "";
  return is_turned() ? "the cab at the other end is active, and tpr_publisher.foot_to_rear_m is not set."
                     : "onboard_status has not said yet at which end the cab is active.";
}

std::string TprPublisher::left_out(int64_t now_ns) const {
  if (onboard_silent(now_ns))
    return "onboard_status is silent: mode and level as last heard, train integrity not known.";
  if (onboard_ahead_ns_ > kMostAheadNs) {
    char text[160];
    std::snprintf(
        text, sizeof text,
        "Train integrity is not reported: onboard_status is %.1f s ahead of this host's clock; synchronise the "
        "clocks, then confirm it again.",
        core::seconds(onboard_ahead_ns_));
    return text;
  }
  if (integrity_.forgotten())
    return "Train integrity is not reported: how far the train has gone since it was confirmed is not known, because "
           "train_state was away, unusable or began again, or the place was lost; confirm it again.";
  if (trigger_.rear_end_left_out())
    return "No reports where the rear end passes the locations of packet 58: the train's length is not known; the "
           "on-board unit must say it, or set tpr_publisher.train_length_m.";
  if (trigger_.locations_left_out())
    return "No reports at the locations of packet 58: it came while nobody listened, or the group that they count from "
           "is not on the way behind the train, or not yet, or the cab was changed since.";
  return "";
}

std::string TprPublisher::undeclared() const {
  const auto way_m = tracker_ ? tracker_->undeclared_m() : std::nullopt;
  if (!way_m || *way_m < kLongUndeclaredM) return "";
  char text[160];
  std::snprintf(text, sizeof text,
                "The LRBG stays the one before the switch: which way the train took there has not been declared for "
                "%.0f m.",
                *way_m);
  return text;
}

}  // namespace railfix::tpr_publisher
