#include "frame_grabber/pace.hpp"

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

void LockStep::begin() {
  ++step_;
  next_ = 0;
}

bool LockStep::answered(const std::string& service, uint64_t step) {
  if (done() || step != step_ || service != turn()) return false;
  ++next_;
  return true;
}

}  // namespace railfix::frame_grabber
