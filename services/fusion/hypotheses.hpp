// Several estimators side by side, so that the promised interval holds whichever single source is wrong.
//
// The main one uses everything. Doubters do without one of the last two places that landmarks gave, which may be false
// with full confidence, without both where the second was told by those before it, and without the last one of the
// track's shape; the interval holds their ends until later fixes agree with the main one. When such a fix fits a
// doubter alone, that becomes the main one, and the main one a doubter: either fix may be the false one. Where no
// odometer can be so far off as landmarks say, a doubter stays until they are too many to be wrong alike. Four rivals
// do without camera, wheel, IMU or GNSS: the interval holds their ends too (solution separation, as in receiver
// autonomous integrity monitoring: Brown and McBurney 1988), because a fault may be too slow for any test on
// innovations. A rival that contradicts itself, or has no odometer left, is not asked; what it said last is carried
// along until a fix confirms the main one. When the main one contradicts itself and one rival alone has two sensors
// that agree, or fits a fix that the main one refuses, that rival becomes the main one.
#pragma once

#include <algorithm>
#include <array>
#include <optional>
#include <vector>

#include "fusion/estimator.hpp"
#include "fusion/fix_residuals.hpp"
#include "fusion/odometer_scales.hpp"

namespace railfix::fusion {

/// What is promised: the two ends, and the way since the last place that is beyond doubt.
struct Promise {
  Interval interval;
  double since_sure_m = 0;

  /// From now on also what the other one promises.
  void hold(const Promise& other);
};

/// A plain value; the same events as Estimator.
class Hypotheses {
 public:
  /// scales: what is known of them when they are first used.
  Hypotheses(const FusionParameters* parameters, const OdometerScales& scales, std::shared_ptr<const track::Path> path,
             int64_t stamp_ns);

  void apply(const Event& event);
  void predict_to(int64_t stamp_ns);
  void rebase_clock(int64_t stamp_ns);
  void follow_on(const std::shared_ptr<const track::Path>& path, const std::shared_ptr<const track::Path>& longer);
  /// Which of the estimators have found that the wheel slips: a bit each.
  [[nodiscard]] uint32_t slipping() const;
  /// Those do without the wheel for that time; what one has found says nothing of the others.
  void block_wheel(const WheelBlock& block, uint32_t slipping);
  /// From now on none knows where on the map the train is.
  void give_place_up(Against because);
  [[nodiscard]] Promise promise() const;
  [[nodiscard]] TrainEstimate estimate(const Promise& promise) const;
  /// The last event was a fix that the main one used as it was (true), or not without giving something up (false).
  [[nodiscard]] std::optional<bool> fix_fitted() const { return fix_fitted_; }
  /// As the main one knows them, with what they would be if one of the last landmarks was wrong.
  [[nodiscard]] OdometerScales scales() const;

  [[nodiscard]] int64_t stamp_ns() const { return main_.stamp_ns(); }
  [[nodiscard]] const Estimator& main() const { return main_; }

 private:
  /// The main one without a fix that no later one has confirmed.
  struct Doubter {
    Estimator estimator;
    uint32_t landmark = 0;    // of that fix; a second sighting of it may have the same error
    bool of_shape = false;    // the fix is of kind curvature
    bool surprising = false;  // ... and was no small way off: the next one may be so likewise
    int agreed = 0;           // later fixes that both have used: these tell nothing of who is right
    bool of_two = false;      // also without the fix before that one
    double excused_m = 0;     // one motion sensor alone, or a slip, may be wrong by so much
    int confirmed_by = 0;     // landmarks before that fix
    int against = 0;          // that fix and later ones that the main one alone fits

    [[nodiscard]] bool fits() const { return estimator.fix().used() && !estimator.fix().corrected(); }
    [[nodiscard]] bool leaves_out(const FixInput& fix) const {
      return surprising ? fix.kind == FixKind::curvature : landmark != 0 && landmark == fix.landmark;
    }
  };
  struct Rival {
    Source without;
    std::optional<Estimator> estimator{};  // from the source's first sample on; until then it is the main one
    Sides excess{};                        // so far the interval must reach beyond the main one's ends for it
    Sides carried{};                       // when it came back
    Sides unseen{};                        // so far it may have been from the main one while it was away
    bool asked = false;                    // its word counts at present
    int64_t asked_ns = 0;                  // ... and counted last
    bool contradicted = false;             // itself, while it was not asked
    int64_t proven_since_ns = 0;           // two sensors have agreed in it since then; 0 = they do not
    double faster_mps = 0;                 // than the main one, when it was asked last
    int64_t excess_ns = 0;                 // its excess is of then

    void forget_excess() { excess = carried = unseen = {}; }
  };

  void apply_to_all(const Event& event);
  void apply_fix(const Event& event);
  bool adopt_by_fix(const FixInput& fix, const Estimator& before, const std::vector<Doubter>& doubters);
  bool adopt_doubter(const FixInput& fix, std::vector<Doubter> before);
  [[nodiscard]] std::vector<Doubter> without_two(const FixInput& fix, const std::vector<Doubter>& before) const;
  [[nodiscard]] Doubter without_one(const FixInput& fix, Estimator before, const Sides& most) const;
  void settle_doubters(const FixInput& fix, const std::vector<Doubter>& before);
  bool settle(Doubter& doubter, const Estimator& before, const FixInput& fix) const;
  [[nodiscard]] bool differs_in_scale(const Doubter& doubter) const;
  /// The main one is confirmed.
  void confirm_rivals();
  void exclude_faulty();
  [[nodiscard]] Estimator without_faulty(const Rival& rival) const;
  /// It becomes the main one as `next`.
  void adopt(Rival& rival, Estimator next);
  void take_along(Doubter& doubter, const Estimator& next) const;
  void begin_rival(Source source);
  void ask_rivals();
  void ask(Rival& rival);
  [[nodiscard]] bool can_say(const Rival& rival) const;
  [[nodiscard]] bool contradicts_itself(const Rival& rival) const;
  [[nodiscard]] bool main_is_sound_without(Source source) const;
  [[nodiscard]] bool stands_for_another(const Rival& rival) const;
  void begin_again(Rival& rival) const;
  void lose_sight(Rival& rival, int64_t now_ns) const;
  static void extrapolate(Rival& rival, int64_t now_ns);
  [[nodiscard]] bool is_in_dispute(const Rival& rival) const;
  /// So much further reaches that interval than mine; negative: less far.
  [[nodiscard]] static Sides beyond(const Interval& mine, const Interval& its);
  [[nodiscard]] Sides most_excess() const;
  [[nodiscard]] Interval promised(const Interval& main) const;

  const FusionParameters* parameters_;
  Estimator main_;
  std::vector<Doubter> doubters_;  // the latest one last
  std::array<Rival, 4> rivals_;
  std::optional<bool> fix_fitted_;
  FixResiduals residuals_;
};

}  // namespace railfix::fusion
