// The fusion of all sensors: takes measurements in any order, uses each at its own time, and gives the train's state.
//
// The state after a set of measurements does not depend on the order in which they came: late ones are put where they
// belong and everything behind them is replayed from a snapshot, when the next state is wanted. Not so LagRoom, which
// looks at what has come so far.
#pragma once

#include <cstdint>
#include <deque>
#include <memory>
#include <optional>
#include <vector>

#include "fusion/fusion_parameters.hpp"
#include "fusion/fusion_types.hpp"
#include "fusion/lag_room.hpp"
#include "fusion/odometer_scales.hpp"
#include "fusion/scale_trial.hpp"
#include "fusion/stamp_watch.hpp"
#include "track/path.hpp"
#include "track/tracks_beside.hpp"

namespace railfix::fusion {

/// What was not used, since the start.
struct FusionCounts {
  uint64_t used = 0;
  uint64_t too_late = 0;   // older than the history
  uint64_t repeated = 0;   // the same sensor and stamp again
  uint64_t jumped = 0;     // stamp too far ahead to be believed
  uint64_t nonsense = 0;   // not a number, or none that a train can have
  uint64_t elsewhere = 0;  // tracks that are not where the train is
  uint64_t clock_resets = 0;
};

class Fusion {
 public:
  /// map may be nullptr; start: nothing = unknown, then a network fix starts the position; saved: scales of an earlier
  /// trip. Fails when there is no such place.
  static core::Result<Fusion> create(const FusionParameters& parameters, std::shared_ptr<const track::Map> map,
                                     const std::optional<track::EdgePosition>& start,
                                     const std::optional<SavedScales>& saved = std::nullopt);

  /// Uses a measurement. Gives a state for every odometry step, and every output_period_s from the other sensors while
  /// there is no camera. Stamps of the states only grow.
  std::optional<TrainEstimate> add(Event event);
  /// Nothing came until now_ns: gives a state with what is left when the last one is older than output_period_s
  /// (sensor_timeout_s before an odometer has measured).
  std::optional<TrainEstimate> tick(int64_t now_ns);
  /// Stamp of the newest measurement; nothing before the first.
  [[nodiscard]] std::optional<int64_t> latest_stamp_ns() const;
  /// With everything that was added; nullptr before the first measurement.
  [[nodiscard]] const Estimator* estimator();
  [[nodiscard]] const FusionCounts& counts() const { return counts_; }
  [[nodiscard]] SavedScalesAre saved_scales() const;
  /// The sensors are others than those whose scales were saved; those that this trip has confirmed stay.
  void drop_saved_scales();
  /// What this trip has taught of the scales, fit to be saved.
  [[nodiscard]] std::optional<OdometerScales> learnt_scales() const;
  /// ... and of how late the camera is, by this trip or one before it. Nothing where that is vague or more than may be.
  [[nodiscard]] std::optional<CameraLag::Lag> camera_lag() const;

 private:
  /// What it blocks follows from the stamps of the data before it, as does everything else.
  struct FoundSlip {
    WheelBlock block;
    uint32_t slipping = 0;  // bits of those that found it
  };
  Fusion(const FusionParameters& parameters, std::shared_ptr<const track::Map> map,
         std::shared_ptr<const track::Path> path, const std::optional<SavedScales>& saved);
  void begin_with(const Event& event);
  void begin_before(const Event& event);
  std::optional<TrainEstimate> use(Event event);
  std::optional<TrainEstimate> hear_ahead(const Event& event, bool believed);
  std::optional<TrainEstimate> set_clock_back(size_t decided_by);
  std::optional<TrainEstimate> set_clock(const std::vector<Event>& held, size_t decided_by, double since_s);
  [[nodiscard]] std::optional<double> time_since_counted(const std::vector<Event>& held) const;
  [[nodiscard]] bool is_early(const Event& event) const;
  void wait_with(const GnssInput& gnss);
  void use_waiting();
  void anchor(OdometryInput& step);
  void start_position(FixInput& fix) const;
  bool change_track(FixInput& fix);
  void look_beside(Event& event);
  void follow_path_on();
  void remember_reference(const OdometryInput& step);
  std::optional<TrainEstimate> insert(const Event& event);
  std::optional<TrainEstimate> catch_up(std::ptrdiff_t wanted = -1);
  std::optional<TrainEstimate> run_from(std::ptrdiff_t next, std::ptrdiff_t wanted);
  void run(const Event& event);
  std::ptrdiff_t rewind_before(int64_t stamp_ns);
  [[nodiscard]] bool take_slip_back();
  int64_t undo_slips_since(int64_t stamp_ns);
  void forget_old();
  [[nodiscard]] bool due(const Event& event) const;
  std::optional<TrainEstimate> give(TrainEstimate estimate);

  std::shared_ptr<const FusionParameters> parameters_;
  std::shared_ptr<const track::Map> map_;
  std::shared_ptr<const track::Path> path_;
  std::optional<track::Ways> ways_;            // made when they are first asked for
  std::optional<track::TracksBeside> beside_;  // likewise
  std::optional<double> followed_on_at_m_;     // where the path was followed on last, or could not be
  std::optional<SavedScales> saved_;
  std::optional<ScaleTrial> now_;
  std::deque<Event> events_;               // by stamp, then kind
  std::deque<ScaleTrial> snapshots_;       // each has used all events up to its stamp
  std::vector<FoundSlip> slips_;           // found within the history, in the order of their stamps
  std::optional<int64_t> replay_from_ns_;  // late events since then are not used yet
  FusionCounts counts_;
  int64_t last_output_ns_ = 0;
  int64_t last_odometry_ns_ = 0;
  StampWatch stamps_;
  std::optional<ScaleTrial> before_behind_;  // the state before those that are behind
  std::deque<GnssInput> early_;              // GNSS that waits for what measures motion
  std::optional<WheelInput> last_wheel_;
  LagRoom lag_room_;
  std::optional<OdometryInput> anchor_;  // the first step that counts from a picture before all that is known
};

}  // namespace railfix::fusion
