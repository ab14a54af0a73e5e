// Follows things in the ground plane over the way that was run, and settles each once, at a reference distance.
#pragma once

#include <array>
#include <optional>
#include <vector>

#include "track_detector/landmark_types.hpp"

namespace railfix::track_detector {

struct GroundTracking {
  double reference_m = 8;  // ahead: seen in front of it and behind it, a thing is settled
  double reach_m = 3.2;    // measurements so far from it count
  double spot_sigma_m = 0.02;
  double worst_fit_m = 0.06;  // what does not stay in its place is none
  double follow_m = 0.20;     // a known thing may be off its place by so much
  double sideways_m = 0.10;
  bool log_odds = false;     // the score is the log of a likelihood ratio; else a share
  double usual_score = 0.1;  // of a candidate; of log odds: where right and wrong ones are equally many
  double trust_a_look = 0.5;
  int fewest_pictures = 4;
  double lowest_confidence = 0.88;
};

/// A thing that is measured as well as it will be, on the scale of the way.
struct SettledThing {
  double place_m = 0;
  double lateral_m = 0;
  double sigma_m = 0;  // of the measurements alone
  double confidence = 0;
  double reference_m = 0;      // ahead, where it was settled
  double lasting_sigma_m = 0;  // as the last candidate's
};

class GroundTracker {
 public:
  GroundTracker(const GroundTracking& tracking, double way_sigma);

  /// What was found in the picture at way_m. Gives what is settled now; valid until the next call.
  const std::vector<SettledThing>& follow(const std::vector<GroundCandidate>& found, double way_m);
  void forget() { things_.clear(); }

 private:
  struct Look {
    double place_m, lateral_m;  // place less first_m
    double weight;
  };
  static constexpr size_t kMostLooks = 32;
  struct Thing {
    std::array<Look, kMostLooks> looks{};  // near the reference
    double clearness = 0, score = 0;       // weighted sums: near looks show most
    double first_m = 0;                    // place as first seen
    double first_ahead_m = 0;
    double reference_m = 0;
    double lasting_sigma_m = 0;
    double last_m = 0;
    double last_ahead_m = 0;
    double last_lateral_m = 0;
    int seen = 0;
    size_t used = 0;
    int missed = 0;
    int gaps = 0;
    bool hit = false;
    bool settled = false;
  };
  void add(Thing& thing, const GroundCandidate& candidate, double way_m) const;
  [[nodiscard]] std::optional<SettledThing> settle(const Thing& thing) const;
  struct Mean {
    double place_m = 0, lateral_m = 0;
    double rms_m = 0;
    double agreeing = 0;  // looks
  };
  [[nodiscard]] Mean mean_of(const Thing& thing) const;
  [[nodiscard]] double confidence(const Thing& thing) const;

  GroundTracking tracking_;
  double way_sigma_;
  std::vector<Thing> things_;
  std::vector<SettledThing> settled_;
};

}  // namespace railfix::track_detector
