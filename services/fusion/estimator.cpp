#include "fusion/estimator.hpp"

#include <cmath>
#include <type_traits>
#include <utility>
#include <variant>

namespace railfix::fusion {

Estimator::Estimator(const FusionParameters* parameters, const OdometerScales& scales,
                     std::shared_ptr<const track::Path> path, int64_t stamp_ns)
    : parameters_(parameters), motion_(parameters, scales, stamp_ns, path != nullptr), place_(parameters) {
  if (path) place_.start_on(std::move(path), motion_);
}

void Estimator::apply(const Event& event, const FixContext& context) {
  const double before_m = motion_.distance_m();
  motion_.begin(stamp_of(event));
  place_.begin();
  // Inertial samples are many and only their mean is used: they move the filter when it is complete.
  if (!std::holds_alternative<ImuInput>(event)) motion_.predict_to(stamp_of(event));
  std::visit(
      [&](const auto& input) {
        using Input = std::decay_t<decltype(input)>;
        if constexpr (std::is_same_v<Input, FixInput>) {
          use(input, context);
        } else if constexpr (std::is_same_v<Input, GnssInput> || std::is_same_v<Input, ImuInput>) {
          use(input);
        } else {
          motion_.use(input);
        }
      },
      event);
  place_.move(motion_.stands() ? 0 : std::abs(motion_.distance_m() - before_m), motion_);
  motion_.watch_standstill();
}

void Estimator::use(const ImuInput& sample) {
  if (const auto rate = motion_.use(sample, place_.path().get())) place_.use(*rate, motion_);
}

void Estimator::use(const GnssInput& sample) {
  const double before_m = motion_.distance_m();
  place_.use(sample, motion_);
  motion_.moved(motion_.distance_m() - before_m);
}

void Estimator::use(const FixInput& fix, const FixContext& context) {
  const double before_m = motion_.distance_m();
  place_.use(fix, context, motion_);
  motion_.moved(motion_.distance_m() - before_m);
}

void Estimator::rebase_clock(int64_t stamp_ns) {
  motion_.rebase_clock(stamp_ns);
  place_.set_clock(stamp_ns);
}

const SensorWatch& Estimator::watch(Source source) const {
  switch (source) {
    case Source::gnss:
      return place_.gnss();
    case Source::landmark:
      return place_.landmarks();
    case Source::curvature:
      return place_.curves();
    case Source::camera:
    case Source::wheel:
    case Source::imu:
      break;
  }
  return motion_.sensors()[source];
}

void Estimator::exclude(Source source, const Estimator& other) {
  if (source == Source::gnss) {
    place_.exclude_gnss(other.place_, stamp_ns());
  } else {
    motion_.exclude(source, other.motion_);
  }
}

void Estimator::do_without(Source source) {
  if (source == Source::gnss) {
    place_.do_without_gnss();
  } else {
    motion_.do_without(source);
  }
}

void Estimator::place_like(const Estimator& other) {
  motion_.place_like(other.motion_);
  place_.place_like(other.place_);
}

// Distance and speed run on. What a false place has taught of the scales is forgotten with it.
void Estimator::give_place_up(Against because) {
  motion_.forget_references();
  place_.give_up(because);
}

}  // namespace railfix::fusion
