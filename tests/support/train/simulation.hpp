// A train on a line with imperfect sensors, at the level of measurements (no pictures), fast enough for thousands of
// kilometres. Everything follows from the seed; each sensor has random numbers of its own, so that a fault in one
// leaves the others as they were.
//
// Odometry comes at 20 Hz where the camera has 60: steps count from picture to picture at speed, so three errors of
// 1.7 mm become one of 3 mm; a key frame is kept below 3 m/s as in the train mouse. Nothing else in fusion knows rates.
#pragma once

#include <memory>
#include <optional>
#include <utility>
#include <vector>

#include "core/random.hpp"
#include "core/time.hpp"
#include "fusion/fusion.hpp"
#include "map_matcher/match_types.hpp"
#include "support/train/drive.hpp"
#include "support/train/faults.hpp"
#include "support/train/line.hpp"
#include "track/path.hpp"

namespace railfix::train {

/// Which sensors there are and how wrong they may be; sizes are those of one standard deviation unless they say
/// otherwise.
struct SimulationPlan {
  double duration_s = 120;
  double max_speed_mps = 42;
  DriveStyle style;
  bool camera = true;
  bool wheel = true;
  bool imu = true;
  bool gnss = true;
  double landmark_spacing_m = 400;                                    // 0 = none
  double landmark_spread = 0;                                         // spacing varies by this share to either side
  std::vector<std::pair<track::LandmarkKind, double>> map_landmarks;  // instead: those of the map, with their sigma (m)
  double visual_scale_error = 0.007;
  double visual_wander = 0.001;  // of the camera's scale, lasting about 3 km
  double wheel_scale_error = 0.007;
  std::optional<uint64_t> train;  // trips of the same one have its scales, but for what changes from trip to trip
  double step_noise_m = 0.002;
  double outlier_share = 0.003;   // of odometry steps: one sleeper more or less
  double false_fix_share = 0.02;  // of fixes: somewhere else, with full confidence
  double fix_sigma_m = 0.15;
  double fix_probability = 0.99;
  double switch_spacing_m = 0;  // of a random line, 0 = none; the way takes either leg
  bool track_fixes = false;     // map_matcher says the track once a second, and which leg behind facing points
  bool shape = false;           // map_matcher finds places from the shape that the camera sees (MatcherLoop)
  bool sightings = false;       // ... and from what it sees beside a random line, masts and balises
  bool whole_matcher = false;   // ... and chooses the track, and searches for a start that nobody told (WholeMatcher)
  double map_shape_m = 0.7;     // curves lie so far from where the map has them, if there is `shape`
  bool blind_spells = true;     // 5 to 15 s without camera, now and then
  bool slip = true;             // wheel turns up to 30 % too fast or slow for some seconds
  double start_sigma_m = 0.3;
  double start_wrong_m = 0;  // the start is told up to so much too far ahead, and never less than a fifth of it
  bool start_told = true;    // otherwise map_matcher finds the place after some way
  Fault fault;
};

/// What runs of the confidence campaign have in common.
SimulationPlan campaign_plan();
/// The whole map_matcher says all there is to say of the map; the simulation says nothing in its place.
void leave_to_map_matcher(SimulationPlan& plan);
/// Seed of one run of a campaign.
uint64_t seed_of_run(uint64_t campaign_seed, uint64_t number);
/// What is drawn for that run beside the errors of its sensors.
core::Random draws_of_run(uint64_t seed);
/// The next fault that is drawn. Slip is a fault of its own: not while another motion sensor is wrong, unless always
/// (tunnels, outages and false fixes stay).
void draw_fault(SimulationPlan& plan, core::Random& draws, Sensor sensor, FaultKind kind, bool slip_always = false);

/// A measurement with the time at which it comes to fusion.
struct Arrival {
  double arrival_s = 0;
  fusion::Event event;
};

/// Of what the camera sees beside the track, for map_matcher.
struct SightingArrival {
  double arrival_s = 0;
  map_matcher::Sighting sighting;
};

/// Random numbers of one sensor's own.
core::Random stream(uint64_t seed, uint64_t number);

class TrainSimulation {
 public:
  static constexpr double kStartOffsetM = 200;

  /// On a random line.
  TrainSimulation(const SimulationPlan& plan, uint64_t seed);
  /// From a place on a given map, until the track ends.
  TrainSimulation(const SimulationPlan& plan, uint64_t seed, std::shared_ptr<const track::Map> map,
                  const track::EdgePosition& start);

  /// What fusion is told of the start, if anything.
  [[nodiscard]] std::optional<track::EdgePosition> start() const;
  /// Truth at a stamp; arrival_s: when fusion said it (a clock that was set back gives every stamp twice).
  [[nodiscard]] Motion truth_at(int64_t stamp_ns, double arrival_s = 1e9) const;
  /// The same of what a picture of this stamp shows, whose clock may be late.
  [[nodiscard]] Motion pictured_at(int64_t stamp_ns, double arrival_s) const;
  /// Place minus truth, along the way, or along the other leg of points that the train has run over; nothing when the
  /// place lies elsewhere.
  [[nodiscard]] std::optional<double> error_m(const track::EdgePosition& place, const Motion& truth) const;
  [[nodiscard]] bool on_way(const track::EdgePosition& place) const;
  /// What map_matcher says of the track, which follows the place that fusion has told: error_m from the truth.
  [[nodiscard]] fusion::FixInput said_of_track(const fusion::FixInput& fix, double error_m, double arrival_s) const;
  /// Of the track as it lies, not as it is mapped.
  [[nodiscard]] double curvature_at(double distance_m, double t_s) const;
  /// The camera shows what is there.
  [[nodiscard]] bool sees(double t_s) const;
  [[nodiscard]] core::Random stream_of(uint64_t number) const { return stream(seed_, number); }
  [[nodiscard]] int64_t stamp_ns(double t_s) const;
  [[nodiscard]] double duration_s() const { return drive_.duration_s(); }
  [[nodiscard]] double way_m() const { return drive_.way_m(); }
  [[nodiscard]] const Drive& drive() const { return drive_; }
  [[nodiscard]] const track::Path& path() const { return *path_; }
  [[nodiscard]] const SimulationPlan& plan() const { return plan_; }

  std::shared_ptr<const track::Map> map;
  std::vector<Arrival> arrivals;  // in the order in which they come
  std::vector<SightingArrival> sightings;
  double start_error_m = 0;
  /// True over measured metres, less 1; the camera's wander beside it.
  double camera_scale_error = 0;
  double wheel_scale_error = 0;

 private:
  static constexpr int64_t kBeginNs = 1'700'000'000'000'000'000;
  static constexpr double kPictureS = 0.05;
  static constexpr double kSureProbability = 0.9999;
  class PlaceErrors;
  struct Spell {
    double begin_s;
    double end_s;
    double size;
  };
  /// Facing points on the way.
  struct Points {
    double distance_m = 0;
    track::Run other;  // the leg that the way does not take
  };
  /// What map_matcher says of the track.
  struct SaidTrack {
    track::EdgePosition place;
    double probability = 0;
    bool known = false;
  };
  /// How it comes to that behind one of the points.
  struct Declaration {
    double after_m = 0;        // of the way behind the points it is known
    double wrong_until_m = 0;  // that far behind them it is the other leg
    double leaning = 0;        // probability of the likelier leg before that
    bool leans_wrong = false;
    double declared = 0;
  };
  TrainSimulation(const SimulationPlan& plan, uint64_t seed, std::shared_ptr<const track::Map> map,
                  const track::EdgePosition& start, const std::vector<uint32_t>& via);
  TrainSimulation(const SimulationPlan& plan, uint64_t seed, const RandomLine& line);
  void find_points();
  void measure();
  [[nodiscard]] double scale_error_of(double usual, double trip_change, core::Random& random, uint64_t number) const;
  void lay_track();
  void make_steps();
  void make_pulses();
  void make_inertial();
  void make_gnss();
  void make_fixes();
  void make_fixes_of_map();
  void make_network_fixes();
  void make_sightings(const std::vector<Thing>& things);
  void make_declarations();
  void make_track_fixes();
  /// The place as who follows fusion says it, which is so far off.
  [[nodiscard]] SaidTrack track_at(double way_m, double error_m = 0) const;
  void add(Sensor sensor, double t_s, fusion::Event event);
  /// Its stamps are so late, s.
  [[nodiscard]] double lag_of(Sensor sensor, double t_s) const;
  [[nodiscard]] bool faulty(Sensor sensor, FaultKind kind, double t_s) const;
  [[nodiscard]] double offset_of(Sensor sensor, double t_s) const;
  std::vector<Spell> spells(core::Random& random, double every_s, double shortest_s, double longest_s,
                            double size) const;
  static const Spell* within(const std::vector<Spell>& all, double t_s);

  SimulationPlan plan_;
  uint64_t seed_;
  track::EdgePosition start_;
  std::shared_ptr<const track::Path> path_;
  Drive drive_;
  std::vector<Spell> blind_;
  std::vector<double> shape_errors_m_;  // every kShapeM of the way
  std::vector<Points> points_;
  std::vector<Declaration> declarations_;  // one for each of the points
  bool misled_landmarks_ = false;          // the landmarks are looked for on the leg that is wrongly declared
};

}  // namespace railfix::train
