#include "replay/timeline.hpp"

namespace railfix::tool {

void Timeline::play(int64_t now_ns) {
  if (playing_) return;
  anchor_ns_ = now_ns;
  playing_ = true;
}

void Timeline::pause(int64_t now_ns) {
  at_anchor_ns_ = at_ns(now_ns);
  playing_ = false;
}

void Timeline::seek(int64_t at_ns, int64_t now_ns) {
  at_anchor_ns_ = at_ns;
  anchor_ns_ = now_ns;
}

void Timeline::set_rate(double rate, int64_t now_ns) {
  at_anchor_ns_ = at_ns(now_ns);
  anchor_ns_ = now_ns;
  rate_ = rate;
}

int64_t Timeline::at_ns(int64_t now_ns) const {
  if (!playing_) return at_anchor_ns_;
  return at_anchor_ns_ + static_cast<int64_t>(static_cast<double>(now_ns - anchor_ns_) * rate_);
}

int64_t Timeline::due_ns(int64_t recorded_ns) const {
  return anchor_ns_ + static_cast<int64_t>(static_cast<double>(recorded_ns - at_anchor_ns_) / rate_);
}

}  // namespace railfix::tool
