// How the train turned, from the IMU: for the moments when the camera cannot say. The constant error of a cheap gyro is
// learnt while the train stands. One that says the same again and again, or scatters more than it should, has failed.
#pragma once

#include <cstdint>
#include <deque>
#include <optional>

#include "core/repeated.hpp"
#include "map_matcher/match_types.hpp"

namespace railfix::map_matcher {

struct GyroParameters {
  double noise_rad = 1e-3;      // random walk of the heading, rad after a second
  double bias_rps = 0.002;      // constant error before it is learnt, one sigma
  double bias_walk_rps = 1e-5;  // it wanders by so much in a second
  double longest_gap_s = 0.2;   // between two samples
  double jump_rps = 0.05;       // a failed one's constant error, one sigma
};

class GyroTurn {
 public:
  explicit GyroTurn(const GyroParameters& parameters) : parameters_(parameters) {}

  /// Turning about the axis up, left positive. Samples that are not newer than the last one begin anew.
  void add(int64_t stamp_ns, double rate_rps);
  /// The turn between two moments, without its way; nothing where samples are missing or the gyro is stuck.
  [[nodiscard]] std::optional<Turn> between(int64_t from_ns, int64_t to_ns) const;
  /// The same for a train that stands, whose gyro may be taken for stuck.
  [[nodiscard]] std::optional<Turn> at_rest(int64_t from_ns, int64_t to_ns) const;
  /// The train stood between two moments: whatever turned is the gyro's own error.
  void stood(int64_t from_ns, int64_t to_ns);

 private:
  struct Sample {
    int64_t stamp_ns = 0;
    double heading_rad = 0;
    bool is_stuck = false;
  };
  void watch(int64_t stamp_ns, double rate_rps);
  [[nodiscard]] bool is_stuck(int64_t from_ns, int64_t to_ns) const;
  [[nodiscard]] std::optional<double> heading_at(int64_t stamp_ns) const;
  [[nodiscard]] double bias_variance_at(int64_t stamp_ns) const;

  GyroParameters parameters_;
  std::deque<Sample> samples_;
  core::Repeated rate_;
  double scatter_ = 0;  // variance of the heading after a second, as the samples differ from each other
  double bias_rps_ = 0;
  std::optional<double> bias_variance_;  // at learnt_ns_; nothing before the first learning
  int64_t learnt_ns_ = 0;
};

}  // namespace railfix::map_matcher
