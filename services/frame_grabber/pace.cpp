#include "frame_grabber/pace.hpp"

#include <tuple>

namespace railfix::frame_grabber {

namespace {
// A camera keeps so many in its buffers while the host is held up; so many find room in front of a handler, too.
constexpr int kPicturesHeld = 3;
}  // namespace

RealPace::Verdict RealPace::ask(int64_t stamp_ns, int64_t now_ns) {
  if (!newest_ns_) {
    if (!begun_) due_minus_stamp_ns_ = now_ns - stamp_ns;
    begun_ = true;
    newest_ns_ = stamp_ns;
    return {stamp_ns + due_minus_stamp_ns_, false};
  }
  if (stamp_ns <= *newest_ns_) return {now_ns, false};
  const int64_t period_ns = stamp_ns - *newest_ns_;
  newest_ns_ = stamp_ns;
  const int64_t due_ns = stamp_ns + due_minus_stamp_ns_;
  return {due_ns, now_ns - due_ns > kPicturesHeld * period_ns};
}

void LockStep::begin() {
  ++step_;
  next_ = 0;
}

bool LockStep::answered(const std::string& service, uint64_t step) {
  if (done() || step != step_ || service != turn()) return false;
  ++next_;
  return true;
}

bool Gathering::complete(const messaging::Connections& here) {
  const auto seen = [](const messaging::Connections& c) { return std::tie(c.matches, c.remote_endpoints, c.pairs); };
  const bool steady = seen(here) == seen(before_) && heard_ == heard_before_;
  steady_looks_ = steady ? steady_looks_ + 1 : 0;
  before_ = here;
  heard_before_ = heard_;
  for (const auto& service : services_) {
    if (!heard_.contains(service)) return false;
  }
  uint32_t endpoints = 0;
  uint32_t matches = 0;
  for (const auto& [service, one] : heard_) {
    endpoints += one.endpoints;
    matches += one.matches;
  }
  return messaging::all_connected(here, endpoints, matches) || steady_looks_ >= kSteadyLooks;
}

}  // namespace railfix::frame_grabber
