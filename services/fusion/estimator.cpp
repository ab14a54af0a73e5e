#include "fusion/estimator.hpp"

#include <algorithm>
#include <cmath>

#include "core/time.hpp"

namespace railfix::fusion {
namespace {

constexpr double kAtWorkS = 0.3;
constexpr double kRebaseS = 0.1;     // lost when the clock is set
constexpr double kPointsOffM = 5.0;  // from where the map has them, or the wheels behind the foot

template <class Input>
constexpr bool tells_place = std::is_same_v<Input, GnssInput> || std::is_same_v<Input, FixInput>;

}  // namespace

Estimator::Estimator(const FusionParameters* parameters, const OdometerScales& scales,
                     std::shared_ptr<const track::Path> path, int64_t stamp_ns)
    : parameters_(parameters),
      filter_(*parameters, scales, stamp_ns, path != nullptr),
      stamp_ns_(stamp_ns),
      start_ns_(stamp_ns),
      standstill_(stamp_ns) {
  if (!path) return;
  place_.path = std::move(path);
  place_.told.tell(ToldBy::start);
  doubt_points_behind();
}

// The train may stand in front of points that the place which was told lies behind.
void Estimator::doubt_points_behind() {
  const double here_m = filter_.path_distance_m();
  place_.track_doubt.begin_at(here_m - known_to_m() - kPointsOffM);
  place_.track_doubt.move(*place_.path, here_m);
}

void Estimator::predict_to(int64_t stamp_ns) {
  filter_.predict_to(stamp_ns, *parameters_);
}

void Estimator::rebase_clock(int64_t stamp_ns) {
  filter_.rebase_clock(stamp_ns);
  stamp_ns_ = stamp_ns;
  for (auto& watch : watches_) watch.set_clock(stamp_ns);
  accel_ = {};
  yaw_ = {};
  gyro_watch_.set_clock(stamp_ns);
  wheel_.blocks.clear();
  wheel_.window_begin_ns = 0;
  wheel_.counts_since_ns = std::min(wheel_.counts_since_ns, stamp_ns);
  gap_.set_clock(stamp_ns);
  filter_.doubt_time(kRebaseS);
  slip_watch_ = {};
  sudden_change_ = {};
  standstill_.set_clock(stamp_ns);
  start_ns_ = std::min(start_ns_, stamp_ns);
}

void Estimator::apply(const Event& event, const FixContext& context) {
  context_ = context;
  slip_began_ = false;
  fix_ = {};
  notice_gap(stamp_of(event));
  const double before_m = distance_m();
  std::visit(
      [this](const auto& input) {
        // Inertial samples are many and only their mean is used: they move the filter when it is complete.
        if constexpr (!std::is_same_v<std::decay_t<decltype(input)>, ImuInput>) predict_to(input.stamp_ns);
        stamp_ns_ = std::max(stamp_ns_, input.stamp_ns);
        const double here_m = distance_m();
        use(input);
        if constexpr (tells_place<std::decay_t<decltype(input)>>) standstill_.corrected(distance_m() - here_m);
      },
      event);
  if (place_.path) {
    place_.track_doubt.move(*place_.path, filter_.path_distance_m());
    const double way_m = standstill_.stands() ? 0 : std::abs(distance_m() - before_m);
    const bool turns_otherwise = place_.track_doubt.turns_otherwise() && !gnss_proven();
    place_.wrong_place.move(
        way_m, {turns_otherwise, place_.track_doubt.turns_otherwise_now(), gnss_denies_place(), is_off_map()});
  }
  standstill_.look(distance_m(), filter_.sigma(StateIndex::speed), stamp_ns_);
}

// Wherever in its interval it is.
bool Estimator::is_off_map() const {
  const auto& path = *place_.path;
  const double here_m = filter_.path_distance_m();
  if (here_m >= path.begin_m() && here_m <= path.end_m()) return false;
  const auto known = widened(interval());
  return known.rear_m > path.end_m() || known.front_m < path.begin_m();
}

bool Estimator::used_within(Source source, double time_s) const {
  return watch(source).used_within(time_s, filter_.stamp_ns());
}

bool Estimator::knows_motion(double bridge_s) const {
  const bool lately = used_within(Source::camera, bridge_s) || used_within(Source::wheel, bridge_s);
  return used_within(Source::camera, kLatelyS) || used_within(Source::wheel, kLatelyS) ||
         (lately && used_within(Source::imu, kLatelyS));
}

bool Estimator::in_the_dark() const {
  return !measures(Source::camera) && !measures(Source::wheel);
}

// A sample that comes out of rhythm may have another clock behind it: then what was predicted by time alone is in doubt
// by as much, and the sample itself says how far the train ran.
void Estimator::doubt_time(const SensorWatch& watch, Rhythm& rhythm, int64_t stamp_ns) {
  if (watch.seen_ns == 0 || stamp_ns <= watch.seen_ns) return;
  const double off_s = rhythm.add(core::seconds(stamp_ns - watch.seen_ns));
  if (off_s > 0) filter_.doubt_time(off_s);
}

uint32_t Estimator::isolated() const {
  uint32_t bits = 0;
  for (const auto source : kMotionSources) {
    if (watch(source).isolated) bits |= 1U << static_cast<unsigned>(source);
  }
  return bits;
}

bool Estimator::is_consistent(uint32_t excepted) const {
  return (isolated() & ~excepted) == 0;
}

bool Estimator::measures(Source source) const {
  return used_within(source, kAtWorkS);
}

bool Estimator::disputes(std::span<const Source> sources, std::optional<Source> but_for) const {
  return std::ranges::any_of(
      sources, [&](Source source) { return source != but_for && watch(source).isolated_without_proof(); });
}

int Estimator::sensors_at_work() const {
  return static_cast<int>(std::ranges::count_if(kMotionSources, [&](Source source) { return measures(source); }));
}

void Estimator::exclude(Source source, const Estimator& other) {
  watched(source) = other.watch(source);
  watched(source).isolated = false;
  watched(source).isolate(stamp_ns_);
  watched(source).convicted = true;
  slip_began_ = false;
  if (source == Source::camera) pictures_ = other.pictures_;
  if (source == Source::imu) {
    accel_repeated_ = other.accel_repeated_;
    gyro_watch_ = other.gyro_watch_;
  }
  if (source != Source::wheel) return;
  pulses_ = other.pulses_;
  WheelOdometer odometer = wheel_.odometer;
  odometer.go_on_from(other.wheel_.odometer);
  wheel_ = other.wheel_;
  wheel_.odometer = odometer;
  wheel_.good_windows = 0;
  wheel_.window_begin_ns = filter_.stamp_ns();
  wheel_.window_m.reset();
}

void Estimator::doubt_place(const Sides& beyond) {
  const auto known = interval();
  if (beyond.behind_m > 0) doubts_.refused.behind_m = centre_m() - known.rear_m + beyond.behind_m;
  if (beyond.ahead_m > 0) doubts_.refused.ahead_m = known.front_m - centre_m() + beyond.ahead_m;
}

// Who has refused what stays its own: fixes are told to all of them.
void Estimator::place_like(const Estimator& other) {
  filter_.place_like(other.filter_);
  place_ = other.place_;
  doubts_.odometers_m = other.doubts_.odometers_m;
  gap_.hold(other.gap_.way_m());
  unwatched_.go_on_from(other.unwatched_);
}

// Distance and speed run on. What a false place has taught of the scales is forgotten with it. What GNSS said against a
// wheel stays held: the wheel may have slid, and then the distance is as wrong as the place was.
void Estimator::give_place_up(Against because) {
  filter_.forget_references();
  place_ = {};
  place_.given_up = because;
  doubts_.refused = {};
  for (const auto source : {Source::gnss, Source::landmark, Source::curvature}) watched(source) = {};
  gnss_agreed_ = 0;
  refused_fix_.reset();
  off_path_.reset();
  corrected_ = false;
}

void Estimator::notice_gap(int64_t stamp_ns) {
  const double gap_s = core::seconds(stamp_ns - stamp_ns_);
  if (gap_s <= 0) return;
  for (auto* rhythm : {&pictures_, &pulses_}) rhythm->pause(gap_s);
  gap_.add(stamp_ns_, stamp_ns, filter_.speed_mps());
}

}  // namespace railfix::fusion
