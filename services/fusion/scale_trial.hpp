// Scales that an earlier trip has taught, on trial: they may be wrong (another wheelset, lens or mount).
//
// Beside the hypotheses that begin with them runs a second set that knows nothing of them, and the interval holds the
// ends of both until references of this trip have shown that the saved scales are good within what the interval allows
// for drift anyway. When a reference, or camera and wheel against each other, contradict them, the second set goes on
// alone: then nothing is worse than without saved scales.
#pragma once

#include <optional>

#include "fusion/hypotheses.hpp"
#include "fusion/odometer_scales.hpp"

namespace railfix::fusion {

enum class SavedScalesAre : uint8_t { none, on_trial, confirmed, contradicted };

/// A plain value; the same events as Estimator. Without saved scales it is Hypotheses alone.
class ScaleTrial {
 public:
  ScaleTrial(const FusionParameters* parameters, const std::optional<OdometerScales>& saved,
             std::shared_ptr<const track::Path> path, int64_t stamp_ns);

  void apply(const Event& event);
  void predict_to(int64_t stamp_ns);
  void rebase_clock(int64_t stamp_ns);
  /// An estimator has found that the wheel slips.
  [[nodiscard]] bool slip_began() const;
  [[nodiscard]] uint32_t slipping() const;
  void block_wheel(const WheelBlock& block, uint32_t slipping);
  /// The path below the train is longer now, and the same otherwise.
  void follow_on(const std::shared_ptr<const track::Path>& path, const std::shared_ptr<const track::Path>& longer);
  /// The saved scales are known to be of other sensors.
  void drop_saved();

  [[nodiscard]] TrainEstimate estimate() const;
  [[nodiscard]] int64_t stamp_ns() const { return main_.stamp_ns(); }
  [[nodiscard]] const Estimator& main() const { return main_.main(); }
  [[nodiscard]] SavedScalesAre saved_scales() const { return state_; }
  /// What references have taught of the scales, fit to be saved; nothing when it is not much, or on trial.
  [[nodiscard]] std::optional<OdometerScales> learnt() const;

 private:
  void give_place_up();
  [[nodiscard]] bool contradicted(const Event& event);
  [[nodiscard]] bool ratio_is_another() const;
  [[nodiscard]] bool was_saved(Odometer odometer) const;
  [[nodiscard]] bool missing(Odometer odometer) const;
  [[nodiscard]] bool confirmed() const;

  const FusionParameters* parameters_;
  OdometerScales saved_;
  SavedScalesAre state_;
  Hypotheses main_;
  std::optional<Hypotheses> unlearnt_;  // while the saved scales are on trial
  int64_t apart_since_ns_ = 0;          // camera against wheel is another ratio than the saved one since then; 0 = not
};

}  // namespace railfix::fusion
