// Simulated passages of switches for the choice of the track: a small random layout, a ride through it with sensors
// that err, and a fusion that is off along the track but follows the track that is declared.
#pragma once

#include <cmath>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "core/time.hpp"
#include "core/units.hpp"
#include "map_matcher/track_choice/gyro_turn.hpp"
#include "map_matcher/track_choice/track_chooser.hpp"
#include "support/failing_gyro.hpp"
#include "support/sensed_ride.hpp"

namespace railfix::testing {

enum class Manoeuvre : uint8_t { through, stop_on_switch, back_and_forth, just_clear, backwards };

struct PassagePlan {
  bool facing = true;
  bool diverging = false;
  Manoeuvre manoeuvre = Manoeuvre::through;
  int layout = 0;  // 0 a switch, 1 a crossover to a parallel track, 2 two switches behind each other
  double radius_m = 300;
  double side = 1;
  double main_curvature_per_m = 0;
  double speed_mps = 20;
  double sigma_m = 1;           // of the place along the track
  double switch_sigma_m = 0.5;  // of the switch on the map
  bool camera = true;           // else a cheap gyro
  bool frog_seen = true;
  bool views = true;         // the rails' curvature in the pictures, with a camera
  double sway_rad = 0.0015;  // of the body, 1 sigma at 72 km/h
  GyroFault gyro_fault = GyroFault::none;
  double gyro_fault_rps = 0;  // the error, or the noise of a sample
  double gyro_fault_m = 40;   // so far from the points it begins
  std::string text() const {
    return std::string(facing ? "facing" : "trailing") + (diverging ? " diverging" : " straight") + " layout " +
           std::to_string(layout) + " manoeuvre " + std::to_string(static_cast<int>(manoeuvre)) + " R " +
           std::to_string(radius_m) + " side " + std::to_string(side) + " main " +
           std::to_string(main_curvature_per_m) + " v " + std::to_string(speed_mps) + " sigma " +
           std::to_string(sigma_m) + (camera ? " camera" : " gyro") + (camera && views ? " views" : "");
  }
};

inline PassagePlan random_passage(core::Random& random) {
  PassagePlan p;
  constexpr double kRadii[] = {190, 215, 300, 500, 760, 1200};
  p.facing = random.uniform() < 0.7;
  p.diverging = random.uniform() < 0.5;
  p.layout = static_cast<int>(random.uniform(0, 3));
  p.radius_m = kRadii[static_cast<size_t>(random.uniform(0, 6))];
  p.side = random.uniform() < 0.5 ? -1 : 1;
  if (random.uniform() < 0.3 && p.layout != 1) {
    p.main_curvature_per_m = (random.uniform() < 0.5 ? -1 : 1) / random.uniform(600, 3000);
  }
  const double chance = random.uniform();
  p.manoeuvre = chance < 0.55   ? Manoeuvre::through
                : chance < 0.7  ? Manoeuvre::stop_on_switch
                : chance < 0.85 ? Manoeuvre::back_and_forth
                                : Manoeuvre::backwards;
  const double limit_kmh = p.diverging ? std::min(130.0, 2.9 * std::sqrt(p.radius_m)) : 160.0;
  p.speed_mps = core::mps_from_kmh(random.uniform(5, p.manoeuvre == Manoeuvre::through ? limit_kmh : 40));
  p.sigma_m = std::exp(random.uniform(std::log(0.2), std::log(6.0)));
  p.camera = random.uniform() < 0.5;
  p.frog_seen = random.uniform() < 0.7;
  p.views = random.uniform() < 0.8;
  return p;
}

struct PassageResult {
  bool wrong = false;     // a track was declared on which the train was not, ...
  double wrong_at_m = 0;  // ... so far behind the blades
  bool known_at_end = false;
  double behind_frog_m = 0;  // where it was declared for good
  int open_steps = 0;        // without knowing
  bool astray = false;       // the pictures showed the other leg
  /// How many sigmas of the turning's noise and of the unknown bias lie between the legs as far as 30 m behind the
  /// frog, for somebody who knows everything else exactly. Below 6.2 even the best test of the turning is wrong 1 time
  /// in 1000.
  double apart_sigmas = 0;
};

/// The switch is at distance 0 of its routes, which run as the cab looks; the train may also run backwards.
class SwitchPassage {
 public:
  SwitchPassage(const PassagePlan& plan, uint64_t seed) : plan_(plan), random_(seed) {
    make_map();
    ways_ = std::make_shared<const track::Ways>(*map_);
    errors_.odometer_scale = 0.01 * random_.normal();
    errors_.turn_bias_rps = plan.camera ? 0 : 0.002 * random_.normal();
    errors_.turn_noise_rps = plan.camera ? 0 : 0.01;
    errors_.step_turn_noise_rad = plan.camera ? 3e-4 : 0;
    const bool tram = random_.uniform() < 0.3;  // turns with the track below the foot
    errors_.bogies_behind_m = tram ? 0 : random_.uniform(0, 4);
    errors_.bogie_distance_m = tram ? 0 : random_.uniform(6, 17);
    if (plan.camera) errors_.bogies_behind_m += random_.uniform(-1, 1);  // odometry's turn is that of here +- 0.5 m
    errors_.sway_rad = plan.sway_rad;
    sensors_.emplace(errors_, seed * 7 + 1);
    gyro_.emplace(map_matcher::GyroParameters{errors_.turn_noise_rps / std::sqrt(kTicksPerS), 0.002, 1e-5, 0.2});
    result_.astray = plan.camera && random_.uniform() < 0.02;
    error_m_ = plan.sigma_m * std::clamp(random_.normal(), -3.0, 3.0);
    curvature_scale_ = 1 + 0.05 * random_.normal();
    map_shift_m_ = plan.switch_sigma_m * random_.normal();
  }

  PassageResult run(const map_matcher::TrackParameters& parameters = {}) {
    map_matcher::TrackChooser chooser(parameters, map_, ways_);
    chooser_ = &chooser;
    const double sign = plan_.manoeuvre == Manoeuvre::backwards ? -1 : 1;
    at_m_ = -sign * random_.uniform(80, 200);
    set_route(plan_.diverging);
    fusion_route_ = route(plan_.facing ? false : plan_.diverging);
    const double beyond_m = sign * random_.uniform(150, 250);
    if (plan_.manoeuvre == Manoeuvre::stop_on_switch) {
      drive(random_.uniform(-10, 40));
      rest(5);
    } else if (plan_.manoeuvre == Manoeuvre::back_and_forth) {
      drive(random_.uniform(5, 90));
      rest(3);
      drive(-(random_.uniform(10, 40) + 8 * plan_.sigma_m + 2));
      rest(3);
      if (plan_.facing && random_.uniform() < 0.5) set_route(!diverging_now_);  // it was thrown meanwhile
    }
    if (plan_.manoeuvre == Manoeuvre::just_clear) {
      drive(60);
      rest(3);
      drive(map_shift_m_ - 1);  // a metre before the points, wherever the map has them
      rest(3);
      set_route(!diverging_now_);
    }
    drive(beyond_m);
    result_.known_at_end = known_;
    result_.apart_sigmas = apart_.sigmas();
    return result_;
  }

 private:
  static constexpr double kLongM = 700;
  static constexpr double kTicksPerS = 30;
  static constexpr double kCameraBiasPerM = 1e-4;

  [[nodiscard]] bool looks_at_legs() const { return plan_.facing != (plan_.manoeuvre == Manoeuvre::backwards); }

  void make_map() {
    auto map = std::make_shared<track::Map>();
    const auto edge = [&](uint32_t from, uint32_t to, const track::PlanPose& start,
                          const std::vector<track::Element>& elements) {
      const auto id = static_cast<uint32_t>(map->edges.size() + 1);
      map->edges.push_back({id, "e" + std::to_string(id), from, to, "", track::Alignment::chained(start, elements)});
      return map->edges.back().alignment.at(map->edges.back().alignment.length_m()).pose;
    };
    const double k = plan_.main_curvature_per_m;
    const double turn = plan_.side / plan_.radius_m;
    const double arc_m = plan_.radius_m * std::atan(0.79 * std::sqrt(1 / plan_.radius_m) * 2.5);
    apart_m_ = random_.uniform(45, 90);
    const auto at_switch = edge(1, 2, {0, 0, 0}, {{kLongM, k, k}});  // edge 1: the stem
    // Edge 2: the straight leg, in layout 2 as far as the next switch.
    const double first_m = plan_.layout == 2 ? apart_m_ : kLongM;
    const auto at_second = edge(2, 3, at_switch, {{first_m, k, k}});
    map->connections = {{2, 1, 2, false}, {2, 1, 3, true}};
    if (plan_.layout == 1) {
      const double between_m = random_.uniform(5, 15);
      const auto joined = edge(2, 4, at_switch, {{arc_m, turn, turn}, {between_m, 0, 0}, {arc_m, -turn, -turn}});
      edge(4, 5, joined, {{kLongM, 0, 0}});  // edge 4: the parallel track beyond, edge 5: before the crossover
      const track::PlanPose before{joined.easting_m - kLongM * std::sin(joined.heading_rad),
                                   joined.northing_m - kLongM * std::cos(joined.heading_rad), joined.heading_rad};
      edge(6, 4, before, {{kLongM, 0, 0}});
      map->connections.push_back({4, 3, 4, true});
      map->connections.push_back({4, 5, 4, false});
    } else {
      edge(2, 4, at_switch, {{arc_m, k + turn, k + turn}, {30, k, k}, {arc_m, k - turn, k - turn}, {kLongM, k, k}});
      if (plan_.layout == 2) {
        edge(3, 5, at_second, {{kLongM, k, k}});  // edge 4: straight on, edge 5: the other leg of the second switch
        edge(3, 6, at_second, {{arc_m, k + turn, k + turn}, {kLongM, k, k}});
        map->connections.push_back({3, 2, 4, false});
        map->connections.push_back({3, 2, 5, true});
      }
    }
    for (uint32_t id = 1; id <= 6; ++id) map->nodes.push_back({id, track::NodeKind::end, "", 0, 0});
    frog_m_ = std::sqrt(2 * plan_.radius_m * 1.435);
    map->landmarks = {{1, track::LandmarkKind::frog, 2, frog_m_, plan_.side * 0.72, 0.3, ""},
                      {2, track::LandmarkKind::frog, 3, frog_m_, -plan_.side * 0.72, 0.3, ""}};
    if (frog_m_ > map->edges[1].alignment.length_m()) map->landmarks.erase(map->landmarks.begin());
    map_ = std::move(map);
  }

  [[nodiscard]] track::Route route(bool diverging) const {
    std::vector<uint32_t> legs{2};
    if (plan_.layout == 2) legs = {2, 4};
    if (diverging) legs = plan_.layout == 1 ? std::vector<uint32_t>{3, 4} : std::vector<uint32_t>{3};
    if (looks_at_legs()) {
      track::Route r({map_->edge(1), true}, kLongM, 0);
      for (const uint32_t id : legs) r.push_ahead({map_->edge(id), true});
      return r;
    }
    track::Route r({map_->edge(1), false}, kLongM, 0);
    for (const uint32_t id : legs) r.push_behind({map_->edge(id), false});
    return r;
  }

  void set_route(bool diverging) {
    diverging_now_ = diverging;
    route_ = route(diverging);
    frog_told_ = false;
    heading_.emplace([&](double m) { return curvature_scale_ * route_->curvature_at(m - map_shift_m_); }, -600, 600,
                     errors_);
  }

  // A constant speed with brakes at the end of every part; the last part is left at speed.
  void drive(double to_m) {
    const double sign = to_m > at_m_ ? 1 : -1;
    while (sign * (to_m - at_m_) > 0.02) {
      double speed = std::min(plan_.speed_mps, std::sqrt(2 * 0.7 * sign * (to_m - at_m_)) + 0.05);
      if (plan_.manoeuvre == Manoeuvre::through) speed = plan_.speed_mps;
      move_to(at_m_ + sign * speed / kTicksPerS);
    }
  }
  void rest(double time_s) {
    for (int i = 0; i < time_s * kTicksPerS; ++i) move_to(at_m_);
  }

  void move_to(double next_m) {
    auto sensed = sensors_->step(*heading_, time_s_, at_m_, next_m, 1 / kTicksPerS);
    gyro_failed_ = gyro_failed_ || std::abs(at_m_) < plan_.gyro_fault_m;
    if (!plan_.camera)
      sensed.turn_rad = failing_gyro_.told_rps(sensed.turn_rad * kTicksPerS, gyro_failed_, random_) / kTicksPerS;
    weigh_legs(next_m, sensed);
    at_m_ = next_m;
    time_s_ += 1 / kTicksPerS;
    window();
    const auto turn = turn_of(sensed);
    if (turn && sensed.way_m == 0) chooser_->stand(*turn);
    if (turn && std::abs(sensed.way_m) > 1e-4) chooser_->move(*turn);
    if (!turn) chooser_->move_blind(sensed.way_m);
    look_for_frog();
    look_at_rails();
    judge();
  }

  std::optional<map_matcher::Turn> turn_of(const SensedStep& sensed) {
    if (plan_.camera) {
      return map_matcher::Turn{.way_m = sensed.way_m,
                               .turn_rad = sensed.turn_rad,
                               .sigma_rad = sensed.turn_sigma_rad,
                               .bias_rad = kCameraBiasPerM * std::abs(sensed.way_m),
                               .duration_s = sensed.duration_s};
    }
    const int64_t from_ns = core::to_ns(time_s_ - 1 / kTicksPerS);
    const int64_t to_ns = core::to_ns(time_s_);
    if (time_s_ < 1.5 / kTicksPerS) gyro_->add(from_ns, 0);
    gyro_->add(to_ns, sensed.turn_rad * kTicksPerS);
    auto turn = gyro_->between(from_ns, to_ns);
    if (turn) turn->way_m = sensed.way_m;
    return turn;
  }

  // Fusion knows the place along the track to a sigma; which leg, it takes from the declared track.
  void window() {
    const double bound_m = 4 * plan_.sigma_m + 0.5;
    chooser_->follow({fusion_route_->position_at(at_m_ + error_m_), bound_m, bound_m, plan_.sigma_m});
  }

  void look_for_frog() {
    const double frog_m = looks_at_legs() ? frog_m_ : -frog_m_;
    if (frog_told_ || !plan_.frog_seen || at_m_ + 8 < frog_m || at_m_ > frog_m) return;
    frog_told_ = true;
    double side = (diverging_now_ != astray_now() ? -1 : 1) * plan_.side * (looks_at_legs() ? 1 : -1);
    if (random_.uniform() < 0.03) side = -side;
    chooser_->sight({0, track::LandmarkKind::frog, frog_m - at_m_, side * 0.72, 0.2, 0.95});
  }

  [[nodiscard]] bool astray_now() const {
    const double toward = (looks_at_legs() ? 1 : -1) * at_m_;
    return result_.astray && toward > -5 && toward < frog_m_ + 30;
  }

  // As measured on drawn pictures: the mean from 3 to 12 m ahead of the foot, 2e-4 1/m; each error lasts some metres.
  // Ahead of the blades the detector goes on along either leg.
  void look_at_rails() {
    if (!plan_.camera || !plan_.views) return;
    if (std::abs(at_m_ - viewed_m_) > 4) {
      viewed_m_ = at_m_;
      view_error_per_m_ = 2e-4 * random_.normal();
      leg_guess_ = random_.uniform() < 0.5;
    }
    const double toward = (looks_at_legs() ? 1 : -1) * at_m_;
    const bool ahead_of_blades = looks_at_legs() && toward < -2;
    const auto shown = route(ahead_of_blades ? leg_guess_ : diverging_now_ != astray_now());
    double sum = 0;
    for (double m = 3; m <= 12; m += 1) sum += curvature_scale_ * shown.curvature_at(at_m_ + m - map_shift_m_);
    chooser_->see(sum / 10 + view_error_per_m_, 2e-4);
  }

  // What separates the legs in the turning alone: sum of squares less what a constant bias takes away.
  struct Apart {
    double legs = 0;
    double legs_bias = 0;
    double bias = 0;
    [[nodiscard]] double sigmas() const { return std::sqrt(std::max(0.0, legs - legs_bias * legs_bias / bias)); }
  };
  void weigh_legs(double next_m, const SensedStep& sensed) {
    if (!legs_[0]) {
      for (const bool diverging : {false, true}) {
        const auto way = route(diverging);
        legs_[diverging ? 1 : 0].emplace([&](double m) { return way.curvature_at(m); }, -600, 600, errors_);
      }
      apart_.bias = plan_.camera ? 1 / (kCameraBiasPerM * kCameraBiasPerM) : 1 / (0.002 * 0.002);
    }
    if ((looks_at_legs() ? 1 : -1) * next_m > frog_m_ + 30) return;
    const bool back = (looks_at_legs() ? 1 : -1) * (next_m - at_m_) < 0;
    if (back) apart_.legs = apart_.legs_bias = 0;  // the switch may be thrown meanwhile
    if (sensed.turn_sigma_rad == 0) return;
    const double variance = sensed.turn_sigma_rad * sensed.turn_sigma_rad;
    const double unit = plan_.camera ? std::abs(sensed.way_m) : sensed.duration_s;
    const double difference = legs_[1]->at(next_m) - legs_[1]->at(at_m_) - legs_[0]->at(next_m) + legs_[0]->at(at_m_);
    apart_.legs += difference * difference / variance;
    apart_.legs_bias += difference * unit / variance;
    apart_.bias += unit * unit / variance;
  }

  void judge() {
    const auto choice = chooser_->choice();
    const bool was_known = known_;
    known_ = choice && choice->known;
    if (!known_) {
      ++result_.open_steps;
      return;
    }
    const auto& place = choice->options.front().place;
    const double toward = (looks_at_legs() ? 1 : -1) * at_m_;
    // Of two switches behind each other each is a choice of its own.
    const bool at_second = plan_.layout == 2 && !diverging_now_ && toward > apart_m_;
    if (!was_known) result_.behind_frog_m = toward - frog_m_ - (at_second ? apart_m_ : 0);
    const double tolerance_m = 4 * plan_.sigma_m + 2;
    const auto& legs = route_->legs();
    const bool right = std::any_of(legs.begin(), legs.end(), [&](const auto& leg) {
      return leg.run.edge->id == place.edge && at_m_ > leg.begin_m - tolerance_m && at_m_ < leg.end_m() + tolerance_m;
    });
    const bool before_points = plan_.manoeuvre == Manoeuvre::just_clear && toward < map_shift_m_;  // it is on no leg
    if (!right && !before_points) {
      result_.wrong = true;
      result_.wrong_at_m = toward;
    }
    for (const bool diverging : {false, true}) {
      const auto other = route(diverging);
      if (fusion_route_->distance_of(place, at_m_) || !other.distance_of(place, at_m_)) continue;
      fusion_route_ = other;
    }
  }

  PassagePlan plan_;
  core::Random random_;
  RideErrors errors_;
  std::shared_ptr<const track::Map> map_;
  std::shared_ptr<const track::Ways> ways_;
  std::optional<RideSensors> sensors_;
  std::optional<VehicleHeading> heading_;
  std::optional<track::Route> route_;
  std::optional<track::Route> fusion_route_;
  std::optional<VehicleHeading> legs_[2];
  FailingGyro failing_gyro_{plan_.gyro_fault, plan_.gyro_fault_rps};
  std::optional<map_matcher::GyroTurn> gyro_;
  Apart apart_;
  double viewed_m_ = -1e9;
  double view_error_per_m_ = 0;
  bool leg_guess_ = false;
  map_matcher::TrackChooser* chooser_ = nullptr;
  double frog_m_ = 0;
  double apart_m_ = 0;
  double at_m_ = 0;
  double time_s_ = 0;
  double error_m_ = 0;
  double curvature_scale_ = 1;
  double map_shift_m_ = 0;
  bool diverging_now_ = false;
  bool known_ = true;
  bool frog_told_ = false;
  bool gyro_failed_ = false;
  PassageResult result_;
};

}  // namespace railfix::testing
