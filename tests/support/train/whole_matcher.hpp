// The whole map_matcher in the loop with fusion, through their messages: it chooses the track, and finds a place that
// nobody has told, as on a train.
#pragma once

#include <deque>
#include <optional>
#include <utility>
#include <vector>

#include "map_matcher/map_matcher.hpp"
#include "support/train/matching.hpp"
#include "support/train/seen_shape.hpp"

namespace railfix::train {

class WholeMatcher : public Matching {
 public:
  /// REQUIRES: the simulation outlives this.
  explicit WholeMatcher(const TrainSimulation& simulation);

  std::vector<fusion::FixInput> see(const fusion::OdometryInput& step, const fusion::TrainEstimate& state,
                                    double arrival_s) override;
  void hear(const fusion::GnssInput& gnss, double arrival_s) override;
  void feel(const fusion::ImuInput& sample) override;
  std::vector<fusion::FixInput> run_on(const fusion::TrainEstimate& state, double arrival_s) override;

 private:
  [[nodiscard]] map_matcher::StepInput counted(const fusion::OdometryInput& step, double speed_mps);
  template <class Input>
  void give(const Input& input);
  void say(const map_matcher::PlaceFixes& fixes);
  void look(const fusion::OdometryInput& step, double speed_mps, double arrival_s);
  std::vector<fusion::FixInput> found() { return std::exchange(found_, {}); }

  const TrainSimulation& simulation_;
  map_matcher::MapMatcher matcher_;
  core::Random random_;
  SeenShape seen_;
  std::deque<std::pair<double, map_matcher::ViewInput>> views_;  // when they come
  size_t next_sighting_ = 0;
  std::optional<fusion::OdometryInput> last_;  // step that measured
  double counted_m_ = 0;                       // by all of them
  std::vector<fusion::FixInput> found_;
};

}  // namespace railfix::train
