// The real matchers of map_matcher in the loop with fusion: of the track's shape, and of what stands beside it. The
// simulation says the track itself, and how long that takes (WholeMatcher chooses it).
#pragma once

#include <deque>
#include <optional>
#include <vector>

#include "fusion/fusion.hpp"
#include "map_matcher/followed_path.hpp"
#include "map_matcher/landmark_matcher.hpp"
#include "map_matcher/locate/place_search.hpp"
#include "map_matcher/shape/curvature_matcher.hpp"
#include "map_matcher/step_chain.hpp"
#include "map_matcher/track_choice/gyro_turn.hpp"
#include "support/train/matching.hpp"
#include "support/train/seen_shape.hpp"

namespace railfix::train {

class MatcherLoop : public Matching {
 public:
  /// REQUIRES: the simulation outlives this.
  explicit MatcherLoop(const TrainSimulation& simulation);

  std::vector<fusion::FixInput> see(const fusion::OdometryInput& step, const fusion::TrainEstimate& state,
                                    double arrival_s) override;
  void hear(const fusion::GnssInput& gnss, double arrival_s) override;
  void feel(const fusion::ImuInput& sample) override { gyro_.add(sample.stamp_ns, sample.rate_z_rps); }
  std::vector<fusion::FixInput> run_on(const fusion::TrainEstimate& state, double arrival_s) override;

 private:
  void match_shape(int64_t stamp_ns, const fusion::TrainEstimate& state, double arrival_s);
  void shape_in_the_dark(int64_t stamp_ns, const fusion::TrainEstimate& state);
  std::vector<fusion::FixInput> due_now(double arrival_s);
  [[nodiscard]] double shape_m() const { return chain_.odometer_m() + unseen_m_; }
  void match_sightings(const fusion::TrainEstimate& state, double arrival_s);
  void look_for_place(const fusion::OdometryInput& step, const fusion::TrainEstimate& state, double arrival_s);
  void doubt_place(const fusion::TrainEstimate& state, double due_s);
  void found(const map_matcher::Fix& fix, fusion::FixKind kind, double due_s);
  void found(const map_matcher::LocatedPlace& located, fusion::FixKind kind, int64_t stamp_ns, double due_s);
  /// False while the place is not known.
  bool follow(const fusion::TrainEstimate& state);
  void look(double arrival_s, const Motion& truth);

  const TrainSimulation& simulation_;
  map_matcher::FollowedPath followed_;
  map_matcher::StepChain chain_;
  map_matcher::GyroTurn gyro_{{}};
  double unseen_m_ = 0;          // way that no camera measured
  int64_t shaped_ns_ = 0;        // the shape's matcher has come to this time
  int64_t stands_since_ns_ = 0;  // at the last state; 0: it runs
  std::optional<map_matcher::CurvatureMatcher> shape_;
  std::optional<map_matcher::LandmarkMatcher> landmarks_;
  map_matcher::PlaceSearch search_;
  std::optional<fusion::TrainEstimate> state_;  // the last one
  int64_t moved_ns_ = 0;
  double moved_m_ = 0;
  size_t next_sighting_ = 0;
  double matched_m_ = 0;
  std::deque<std::pair<double, fusion::FixInput>> found_;  // when they are due
  core::Random random_;
  SeenShape seen_;
};

}  // namespace railfix::train
