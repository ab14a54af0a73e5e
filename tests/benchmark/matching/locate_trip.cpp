#include "locate_trip.hpp"

#include <algorithm>
#include <array>
#include <cstdio>
#include <ctime>

#include "map_matcher/locate/place_search.hpp"
#include "support/sensed_ride.hpp"

namespace railfix::measure {
namespace {

constexpr double kTripM = 5000;
constexpr double kRightM = 50;
constexpr double kMissed = 0.15;    // landmarks that are not sighted
constexpr double kMapSigmaM = 1.0;  // ... and are so far from where the map has them
constexpr double kFalsePerM = 0.0003;
constexpr std::array kFalseKinds{track::LandmarkKind::balise, track::LandmarkKind::frog, track::LandmarkKind::bridge,
                                 track::LandmarkKind::platform, track::LandmarkKind::portal_in};

constexpr double kOnM = 1500;     // then the train sets back
constexpr double kClearM = 30;    // a car is so far past a switch before that is thrown
constexpr double kAheadM = 8;     // of the foot a landmark is sighted
constexpr double kBeyondM = 150;  // a train that backs begins
constexpr double kStepM = 1.0;

constexpr double kGnssEveryM = 25;  // once a second
constexpr double kGnssSigmaM = 3;   // most of it lasts for a minute
constexpr double kGnssLastsM = 1500;

/// On over any leg of a switch, the straight one more often; false where the track ends before.
bool lengthen(track::Route& route, const track::Ways& ways, double to_m, core::Random& random) {
  while (route.end_m() < to_m) {
    const auto& next = ways.after(route.legs().back().run);
    if (next.empty() || route.legs().size() > 2000) return false;
    const bool turn = next.size() > 1 && random.uniform() < 0.15;
    route.push_ahead(next[turn ? 1 : 0]);
  }
  return true;
}

/// From anywhere on the map, in either direction, long enough; nothing where the track ends.
std::optional<track::Route> random_route(const track::Map& map, const track::Ways& ways, core::Random& random) {
  const auto& edge = map.edges[static_cast<size_t>(random.uniform(0, static_cast<double>(map.edges.size())))];
  track::Route route({&edge, random.uniform() < 0.5}, 0, 0);
  if (!route.legs().front().run.forward) route = track::Route(route.legs().front().run, edge.alignment.length_m(), 0);
  const double start_m = random.uniform(0, edge.alignment.length_m());
  if (!lengthen(route, ways, start_m + kTripM + kBeyondM + 50, random)) return std::nullopt;
  return route;
}

double apart_m(const Networks& networks, const track::EdgePosition& place, const track::EdgePosition& truth) {
  if (networks.known != networks.real) return INFINITY;
  const auto& map = networks.real->map();
  const auto p = map.edge(place.edge)->alignment.at(place.offset_m).pose;
  const auto q = map.edge(truth.edge)->alignment.at(truth.offset_m).pose;
  return std::hypot(p.easting_m - q.easting_m, p.northing_m - q.northing_m);
}

/// The real track wanders about the mapped one: its curvature, less the map's.
class MapError {
 public:
  MapError(double sigma_m, core::Random& random) {
    for (auto& wave : waves_) {
      wave = {random.normal() / kLengthM, random.uniform(0, 6.283)};
      wave.amplitude_m = sigma_m * std::sqrt(2.0 / static_cast<double>(waves_.size()));
    }
  }
  [[nodiscard]] double curvature_at(double m) const {
    double sum = 0;
    for (const auto& w : waves_) sum -= w.amplitude_m * w.per_m * w.per_m * std::sin(w.per_m * m + w.phase);
    return sum;
  }

 private:
  static constexpr double kLengthM = 60;
  struct Wave {
    double per_m = 0;
    double phase = 0;
    double amplitude_m = 0;
  };
  std::array<Wave, 24> waves_;
};

/// Where GNSS is not heard.
class Tunnels {
 public:
  Tunnels(const track::Map& map, const track::Route& route) {
    std::vector<std::pair<double, bool>> portals;  // out?
    for (const auto& leg : route.legs()) {
      for (const auto* landmark : map.landmarks_on(leg.run.edge->id)) {
        const auto kind = track::seen_along(landmark->kind, leg.run.forward);
        if (kind != track::LandmarkKind::portal_in && kind != track::LandmarkKind::portal_out) continue;
        portals.emplace_back(leg.begin_m + leg.run.into_m(landmark->offset_m), kind == track::LandmarkKind::portal_out);
      }
    }
    std::ranges::sort(portals);
    double begin_m = -INFINITY;
    for (const auto& [at_m, out] : portals) {
      if (out) tunnels_m_.emplace_back(begin_m, at_m);
      begin_m = out ? INFINITY : at_m;
    }
    if (begin_m < INFINITY && !portals.empty()) tunnels_m_.emplace_back(begin_m, INFINITY);
  }
  [[nodiscard]] bool hold(double at_m) const {
    return std::ranges::any_of(tunnels_m_, [&](const auto& t) { return t.first < at_m && at_m < t.second; });
  }

 private:
  std::vector<std::pair<double, double>> tunnels_m_;
};

/// How well the place can be known at all: the Cramer-Rao bound of place and scale with the locator's own noise.
double bound_m(const testing::VehicleHeading& heading, double begin_m, double end_m, double step_noise_rad) {
  const map_matcher::LocatorParameters p;
  const double bin_m = map_matcher::kBinM;
  const auto curvature = [&](double m) { return (heading.at(m + 5) - heading.at(m - 5)) / 10; };
  double place = 0;
  double both = 0;
  double scale = 3 / (p.scale_range * p.scale_range);
  for (double m = begin_m; m + bin_m <= end_m; m += bin_m) {
    const double turn = heading.at(m + bin_m) - heading.at(m);
    const double variance = 2 * std::pow(p.heading_sigma_rad, 2) * 0.4 + std::pow(p.curvature_share * turn, 2) +
                            bin_m * step_noise_rad * step_noise_rad;
    const double by_place = curvature(m + bin_m) - curvature(m);
    const double by_scale = curvature(m) * (end_m - m) - curvature(m + bin_m) * (end_m - m - bin_m);
    const double weight = 1 / (variance * p.correlated_bins);
    place += weight * by_place * by_place;
    both += weight * by_place * by_scale;
    scale += weight * by_scale * by_scale;
  }
  const double det = place * scale - both * both;
  return det > 0 ? std::sqrt(scale / det) : INFINITY;
}

/// The routes before the train sets back, while it does and behind that: mostly the same one. Where they part, a switch
/// was thrown.
struct Courses {
  track::Route on;
  track::Route back;
  track::Route on_again;
};

/// Another leg of a switch that is gone over twice; nothing where there is none.
std::optional<Courses> over_other_leg(const track::Route& route, const track::Ways& ways, double back_m,
                                      core::Random& random) {
  const double turn_m = route.begin_m() + kOnM;
  const auto& legs = route.legs();
  for (size_t i = 0; i + 1 < legs.size(); ++i) {
    const double switch_m = legs[i].end_m();
    if (switch_m < turn_m - back_m + kClearM || switch_m > turn_m - kClearM) continue;
    track::Route other = route;
    if (const auto& ahead = ways.after(legs[i].run); ahead.size() > 1) {
      while (other.legs().size() > i + 1) other.drop_ahead();
      other.push_ahead(ahead[ahead[0] == legs[i + 1].run ? 1 : 0]);
      if (!lengthen(other, ways, route.begin_m() + kTripM + kBeyondM + 50, random)) continue;
      return Courses{route, route, other};
    }
    if (const auto& behind = ways.before(legs[i + 1].run); behind.size() > 1) {
      for (size_t k = 0; k <= i; ++k) other.drop_behind();
      other.push_behind(behind[behind[0] == legs[i].run ? 1 : 0]);
      while (other.begin_m() > turn_m - back_m - 100) {
        const auto before = ways.before(other.legs().front().run);
        if (before.empty()) break;
        other.push_behind(before.front());
      }
      if (other.begin_m() > turn_m - back_m - 100) continue;
      return Courses{route, other, other};
    }
  }
  return std::nullopt;
}

/// Runs a train and asks the locator every now and then.
class TripRun {
 public:
  TripRun(const Networks& networks, const Courses& courses, const MatchingOptions& options, core::Random& random)
      : networks_(networks),
        options_(options),
        random_(random),
        first_m_(courses.on.begin_m() + 1),
        errors_(random_errors(random)),
        wander_(options.map_error_m, random),
        mapped_([&](double m) { return courses.on.curvature_at(m); }, first_m_, first_m_ + kTripM + kBeyondM + 10,
                errors_),
        on_{course_of(courses.on)},
        back_{course_of(courses.back)},
        on_again_{course_of(courses.on_again)},
        sensors_(errors_, random.next()),
        locator_({}, networks.known),
        gnss_({}, networks.known),
        gnss_random_(static_cast<uint64_t>(1000 * first_m_) + options.seed) {}

  Trip run() {
    const double every_m = map_matcher::PlaceSearchParameters{}.every_m;
    for (double m = first_m_; m < first_m_ + kTripM; m += 20) {
      trip_.turn_rad += std::abs(mapped_.at(m + 20) - mapped_.at(m));
    }
    const double way_m = kTripM + 2 * options_.back_m;
    double looked_m = 0;
    for (double run_m = 0; run_m < way_m; run_m += kStepM) {
      step(course_at(run_m), place_at(run_m), place_at(run_m + kStepM));
      if (options_.gnss) receive(course_at(run_m), run_m);
      const bool last = run_m + 1.5 * kStepM > way_m;
      if (!last && run_m - looked_m < every_m) {
        prepare();
        continue;
      }
      looked_m = run_m;
      look(course_at(run_m), run_m, place_at(run_m + kStepM));
    }
    return trip_;
  }

 private:
  struct Course {
    const track::Route* route;
    testing::VehicleHeading heading;
    Tunnels tunnels;
  };
  static testing::RideErrors random_errors(core::Random& random) {
    testing::RideErrors errors;
    errors.odometer_scale = random.uniform(-0.02, 0.02);
    errors.turn_bias_rps = 0.001 * random.normal();
    errors.turn_noise_rps = 0;
    errors.step_turn_noise_rad = 3e-4;
    return errors;
  }
  Course course_of(const track::Route& route) const {
    return {&route, heading_of(route), {networks_.real->map(), route}};
  }
  testing::VehicleHeading heading_of(const track::Route& route) const {
    const double begin_m = std::max(route.begin_m(), first_m_);
    return {[&](double m) { return route.curvature_at(m) + wander_.curvature_at(m); }, begin_m,
            first_m_ + kTripM + kBeyondM + 10, errors_};
  }
  const Course& course_at(double run_m) const {
    if (options_.back_m <= 0 || run_m < kOnM) return on_;
    return run_m < kOnM + options_.back_m ? back_ : on_again_;
  }
  double place_at(double run_m) const {
    if (options_.astern) return first_m_ + kBeyondM + kTripM - run_m;
    if (options_.back_m <= 0 || run_m < kOnM) return first_m_ + run_m;
    return first_m_ + (run_m < kOnM + options_.back_m ? 2 * kOnM - run_m : run_m - 2 * options_.back_m);
  }
  void step(const Course& course, double from_m, double to_m);
  void prepare();
  void look(const Course& course, double run_m, double here_m);
  void receive(const Course& course, double run_m);

  const Networks& networks_;
  const MatchingOptions& options_;
  core::Random& random_;
  double first_m_;
  testing::RideErrors errors_;
  MapError wander_;
  testing::VehicleHeading mapped_;
  Course on_;
  Course back_;
  Course on_again_;
  testing::RideSensors sensors_;
  map_matcher::NetworkLocator locator_;
  map_matcher::GnssSearch gnss_;
  core::Random gnss_random_;
  double gnss_east_m_ = 0;  // its lasting error
  double gnss_north_m_ = 0;
  double gnss_run_m_ = -kGnssEveryM;
  double odometer_m_ = 0;
  double prepared_s_ = 0;  // of the next search
  Trip trip_;
};

void TripRun::step(const Course& course, double from_m, double to_m) {
  const auto s = sensors_.step(course.heading, 0, from_m, to_m, kStepM / 20);
  locator_.move(s.way_m, s.turn_rad, s.turn_sigma_rad);
  odometer_m_ += s.way_m;
  const double behind_m = std::min(from_m, to_m) + kAheadM;
  const double ahead_m = std::max(from_m, to_m) + kAheadM;
  const auto& leg = course.route->leg_at(ahead_m);
  for (const auto& mark : networks_.real->marks_on(leg.run)) {
    const double mark_m = leg.begin_m + mark.along_m;
    if (mark_m <= behind_m || mark_m > ahead_m || random_.uniform() < kMissed) continue;
    locator_.sight({0, mark.kind, mark_m - to_m + kMapSigmaM * random_.normal(), mark.lateral_m, 0.2, 0.95});
  }
  if (random_.uniform() < kFalsePerM * kStepM) {
    const auto kind = kFalseKinds[static_cast<size_t>(random_.uniform(0, static_cast<double>(kFalseKinds.size())))];
    const double side = random_.uniform() < 0.5 ? -1 : 1;
    locator_.sight({0, kind, kAheadM, kind == track::LandmarkKind::frog ? 0.72 * side : 0, 0.2, 0.95});
  }
}

void TripRun::receive(const Course& course, double run_m) {
  const double here_m = place_at(run_m + kStepM);
  if (trip_.by_gnss_after_m || run_m - gnss_run_m_ < kGnssEveryM || course.tunnels.hold(here_m)) return;
  const double keep = gnss_run_m_ < 0 ? 0 : std::exp(-kGnssEveryM / kGnssLastsM);
  gnss_run_m_ = run_m;
  const double fresh_m = kGnssSigmaM * std::sqrt(1 - keep * keep);
  gnss_east_m_ = keep * gnss_east_m_ + fresh_m * gnss_random_.normal();
  gnss_north_m_ = keep * gnss_north_m_ + fresh_m * gnss_random_.normal();
  const auto truth = course.route->position_at(here_m);
  const auto pose = networks_.real->map().edge(truth.edge)->alignment.at(truth.offset_m).pose;
  gnss_.add({pose.easting_m + gnss_east_m_, pose.northing_m + gnss_north_m_}, odometer_m_, kGnssEveryM);
  const auto found = gnss_.place();
  if (!found) return;
  trip_.by_gnss_after_m = run_m;
  const auto on_route = course.route->distance_of(found->place, here_m);
  trip_.gnss_wrong = !on_route || std::abs(*on_route - here_m) > 4 * found->sigma_m;
  if (options_.each && trip_.gnss_wrong) {
    std::printf("  GNSS wrong at %.0f m: %u:%.0f for %u:%.0f, sigma %.0f m\n", run_m, found->place.edge,
                found->place.offset_m, truth.edge, truth.offset_m, found->sigma_m);
  }
}

void TripRun::prepare() {
  const double begin_s = processor_s();
  locator_.prepare();
  const double took_s = processor_s() - begin_s;
  trip_.most_prepared_s = std::max(trip_.most_prepared_s, took_s);
  prepared_s_ += took_s;
}

void TripRun::look(const Course& course, double run_m, double here_m) {
  const double end_m = options_.astern ? place_at(0) : here_m;
  const double begin_m = options_.astern ? here_m : first_m_;
  trip_.bound_m = std::min(trip_.bound_m, bound_m(mapped_, begin_m, end_m, errors_.step_turn_noise_rad));
  const double begin_s = processor_s();
  const auto location = locator_.locate();
  trip_.answers_s.push_back(processor_s() - begin_s);
  trip_.searches_s.push_back(prepared_s_ + trip_.answers_s.back());
  prepared_s_ = 0;
  if (location.places.empty()) return;
  const auto truth = course.route->position_at(here_m);
  const auto& best = location.places.front().place;
  const double apart = apart_m(networks_, best, truth);
  const bool near = apart < kRightM;
  // Near a joint of edges the place may lie on the next one: on the route it must be.
  const auto on_route = course.route->distance_of(best, here_m);
  const bool right = near && on_route && std::abs(*on_route - here_m) < kRightM;
  if (location.certain() && !trip_.found) {
    trip_.found = true;
    trip_.found_after_m = run_m;
  }
  if (location.place_certain() && !trip_.place_found) {
    trip_.place_found = true;
    trip_.place_after_m = run_m;
  }
  trip_.doubts.push_back(location.doubt);
  const double sigmas = apart / location.places.front().sigma_m;
  if (location.certain()) trip_.most_sigmas = std::max(trip_.most_sigmas, sigmas);
  if ((location.certain() && (!right || sigmas > 4)) || (location.place_certain() && !near)) trip_.wrong = true;
  trip_.best_right = near;
  if (options_.each && ((location.certain() && !right) || (location.place_certain() && !near))) {
    std::printf("  wrong at %.0f m: %u:%.0f for %u:%.0f, %.0f m apart, sigma %.0f m, misfit %.2f\n", run_m, best.edge,
                best.offset_m, truth.edge, truth.offset_m, apart, location.places.front().sigma_m,
                location.places.front().misfit);
  }
}

}  // namespace

double processor_s() {
  return static_cast<double>(std::clock()) / CLOCKS_PER_SEC;
}

std::optional<Trip> run_trip(const Networks& networks, const MatchingOptions& options, core::Random& random) {
  const auto& ways = networks.real->ways();
  const auto route = random_route(networks.real->map(), ways, random);
  if (!route) return std::nullopt;
  auto courses = std::optional(Courses{*route, *route, *route});
  if (options.other_leg) courses = over_other_leg(*route, ways, options.back_m, random);
  if (!courses) return std::nullopt;
  return TripRun(networks, *courses, options, random).run();
}

}  // namespace railfix::measure
