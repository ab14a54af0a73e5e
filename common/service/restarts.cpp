#include "service/restarts.hpp"

#include <cstdlib>

#include "core/time.hpp"

namespace railfix::service {
namespace {

// Two players of one recording agree this well; a new one that does not plays something else.
constexpr int64_t kAgreeNs = 2 * core::kNsPerSecond;
// So long may a sample be under way: through a whole chain of services, on a busy machine.
constexpr int64_t kUnderWayNs = core::kNsPerSecond;
// In lock step no time runs: what is left of before is used up in the first turns.
constexpr uint64_t kUnderWaySteps = 2;

}  // namespace

bool Restarts::begins_anew(const msg::DataClock& clock, uint64_t writer) const {
  if (!last_) return false;
  if (writer != writer_) {
    const int64_t expected_ns = last_->data_ns() + (clock.wall_ns() - last_->wall_ns());
    return clock.lock_step() != 0 || std::llabs(clock.data_ns() - expected_ns) > kAgreeNs;
  }
  // Whoever plays counts from 1 again. In lock step each turn of one step has the step's number.
  if (clock.seq() != last_->seq()) return clock.seq() < last_->seq();
  return clock.lock_step() == 0 || clock.data_ns() != last_->data_ns();
}

bool Restarts::heard(const msg::DataClock& clock, uint64_t writer, int64_t now_ns) {
  const bool anew = begins_anew(clock, writer);
  if (anew) restart_ = {last_->data_ns(), now_ns};
  last_ = clock;
  writer_ = writer;
  return anew;
}

bool Restarts::outdated(int64_t stamp_ns, int64_t now_ns) const {
  if (!restart_ || stamp_ns == 0) return false;
  const bool over = last_->lock_step() != 0 ? last_->seq() > kUnderWaySteps : now_ns - restart_->at_ns > kUnderWayNs;
  return !over && std::llabs(stamp_ns - restart_->before_ns) < std::llabs(stamp_ns - last_->data_ns());
}

}  // namespace railfix::service
