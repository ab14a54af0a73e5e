#include "frame_grabber/pace.hpp"

#include <algorithm>

namespace railfix::frame_grabber {

RealPace::Verdict RealPace::ask(int64_t stamp_ns, int64_t wall_ns) {
  if (!newest_ns_) {
    wall_minus_data_ns_ = wall_ns - stamp_ns;
    newest_ns_ = stamp_ns;
    return {wall_ns, false};
  }
  if (stamp_ns <= *newest_ns_) return {wall_ns, false};
  const int64_t period_ns = stamp_ns - *newest_ns_;
  newest_ns_ = stamp_ns;
  const int64_t due_ns = stamp_ns + wall_minus_data_ns_;
  return {due_ns, wall_ns - due_ns > period_ns};
}

LockStep::LockStep(std::vector<std::string> services) {
  for (const std::string& service : services) used_[service] = INT64_MIN;
}

void LockStep::answered(const std::string& service, int64_t data_ns) {
  const auto found = used_.find(service);
  if (found != used_.end()) found->second = std::max(found->second, data_ns);
}

bool LockStep::done() const {
  return std::all_of(used_.begin(), used_.end(), [this](const auto& one) { return one.second >= data_ns_; });
}

std::string LockStep::missing() const {
  std::string names;
  for (const auto& [service, used_ns] : used_) {
    if (used_ns < data_ns_) names += (names.empty() ? "" : ", ") + service;
  }
  return names;
}

}  // namespace railfix::frame_grabber
