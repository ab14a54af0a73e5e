#include "fusion/stamp_watch.hpp"

#include <algorithm>
#include <utility>

#include "core/time.hpp"

namespace railfix::fusion {
namespace {

constexpr int kAheadToBelieve = 3;
constexpr int kBehindToBelieve = 5;
constexpr int kOfImuToBelieve = 200;  // while an odometer may only be slow
constexpr int kOfGnssToBelieve = 5;
constexpr int kLeftOutToTell = 5;
constexpr double kLatelyS = 5.0;
constexpr double kLagsS = 0.3;
constexpr size_t kMostHeld = 1000;

constexpr size_t kImu = 0;
constexpr size_t kWheel = 1;
constexpr size_t kCamera = 3;
static_assert(std::is_same_v<std::variant_alternative_t<kImu, Event>, ImuInput>);
static_assert(std::is_same_v<std::variant_alternative_t<kWheel, Event>, WheelInput>);
static_assert(std::is_same_v<std::variant_alternative_t<kCamera, Event>, OdometryInput>);

/// Who decides what time it is: an odometer (2) before an IMU (1) before what only says a place.
int rank_of(size_t kind) {
  if (kind == kWheel || kind == kCamera) return 2;
  return kind == kImu ? 1 : 0;
}

}  // namespace

bool StampWatch::has_odometer(int64_t now_ns) const {
  const int64_t newest_ns = newest_of_rank(2);
  return newest_ns != 0 && core::seconds(now_ns - newest_ns) < kLatelyS;
}

int64_t StampWatch::newest_of_rank(int least) const {
  int64_t newest_ns = 0;
  for (size_t kind = 0; kind < kKinds; ++kind) {
    if (rank_of(kind) >= least) newest_ns = std::max(newest_ns, newest_ns_[kind]);
  }
  return newest_ns;
}

// Samples of one sensor come in order, so what is older than its own kind's newest is out of its time. GNSS and fixes
// may be late, and are used as long as they are not too late.
StampWatch::Verdict StampWatch::judge(const Event& event, int64_t now_ns, int64_t oldest_ns, double max_jump_s) {
  const size_t kind = event.index();
  const int64_t stamp_ns = stamp_of(event);
  const bool moves = rank_of(kind) > 0;
  const bool is_behind = stamp_ns <= oldest_ns || (moves && newest_ns_[kind] != 0 && stamp_ns <= newest_ns_[kind]);
  const bool is_ahead = core::seconds(stamp_ns - now_ns) > max_jump_s;
  if (!is_behind && !is_ahead) {
    hear_sound(event);
    return {};
  }
  if (is_ahead || stamp_ns <= oldest_ns) leave_out(kind, now_ns);
  // What has just begun to measure may be late by as much as its pictures take.
  const bool just_begun = newest_ns_[kind] == 0 && core::seconds(oldest_ns - stamp_ns) < max_jump_s;
  if (is_behind && (!moves || just_begun)) return {Stamp::behind, false};
  const Stamp stamp = is_behind ? Stamp::behind : Stamp::ahead;
  Side& side = is_behind ? behind_ : ahead_;
  if (core::seconds(now_ns - side.last_ns) > kLatelyS || side.held.size() >= kMostHeld) side = {};
  // A stamp that comes again says nothing of the time; in a new one they grow.
  const bool again = stamp_ns == newest_ns_[kind] || (side.in_row[kind] > 0 && stamp_ns <= side.last_held_ns[kind]);
  if (again) return {stamp, false};
  side.last_ns = now_ns;
  side.last_held_ns[kind] = stamp_ns;
  side.held.push_back(event);
  return {stamp, ++side.in_row[kind] >= enough(event, stamp, now_ns), side.held.size() == 1};
}

// One that lags behind the others may itself be of the time that was set back.
void StampWatch::hear_sound(const Event& event) {
  auto& newest_ns = newest_ns_[event.index()];
  newest_ns = std::max(newest_ns, stamp_of(event));
  left_out_[event.index()] = {};
  const int rank = rank_of(event.index());
  if (core::seconds(newest_of_rank(rank) - stamp_of(event)) > kLagsS) return;
  for (Side* side : {&ahead_, &behind_}) {
    for (size_t kind = 0; kind < kKinds; ++kind) {
      if (rank_of(kind) <= rank) side->in_row[kind] = 0;
    }
    if (std::ranges::all_of(side->in_row, [](int count) { return count == 0; })) side->held.clear();
  }
}

void StampWatch::leave_out(size_t kind, int64_t now_ns) {
  ++left_out_[kind].in_row;
  left_out_[kind].last_ns = now_ns;
}

std::string StampWatch::left_out(int64_t now_ns) const {
  static const std::array<std::string, kKinds> names{"IMU", "wheel", "picture", "camera", "GNSS", "map_matcher"};
  std::string out;
  for (size_t kind = 0; kind < kKinds; ++kind) {
    if (left_out_[kind].in_row < kLeftOutToTell || core::seconds(now_ns - left_out_[kind].last_ns) > kLatelyS) continue;
    out += (out.empty() ? "" : ", ") + names[kind];
  }
  return out;
}

int StampWatch::enough(const Event& event, Stamp side, int64_t now_ns) const {
  const int rank = rank_of(event.index());
  const int alone = side == Stamp::ahead ? kAheadToBelieve : kBehindToBelieve;
  // An IMU that has set the clock back alone is put right by the next odometer.
  if (rank == 2 || (rank == 1 && side == Stamp::behind)) return alone;
  if (rank == 1) return has_odometer(now_ns) ? kOfImuToBelieve : alone;
  return newest_motion_ns() != 0 ? kOfGnssToBelieve : alone;
}

std::vector<Event> StampWatch::take_held(Stamp side) {
  Side& of = side == Stamp::ahead ? ahead_ : behind_;
  of.in_row.fill(0);
  return std::exchange(of.held, {});
}

}  // namespace railfix::fusion
