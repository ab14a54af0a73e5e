// Two estimators side by side: one that believes the last position fix and one that does not. A fix may be false with
// full confidence; until the next one decides, the promised interval holds both.
#pragma once

#include <optional>

#include "fusion/estimator.hpp"

namespace railfix::fusion {

/// A plain value; the same events as Estimator.
class Hypotheses {
 public:
  Hypotheses(const FusionParameters* parameters, std::shared_ptr<const track::Path> path, int64_t stamp_ns)
      : main_(parameters, std::move(path), stamp_ns) {}

  void apply(const Event& event);
  void predict_to(int64_t stamp_ns);
  void rebase_clock(int64_t stamp_ns);
  void block_wheel_until(int64_t stamp_ns);
  [[nodiscard]] TrainEstimate estimate() const;

  [[nodiscard]] int64_t stamp_ns() const { return main_.stamp_ns(); }
  [[nodiscard]] const Estimator& main() const { return main_; }

 private:
  void apply_fix(const FixInput& fix, const Event& event);

  Estimator main_;
  std::optional<Estimator> without_last_fix_;
};

}  // namespace railfix::fusion
