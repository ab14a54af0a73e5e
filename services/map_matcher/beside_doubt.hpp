// Does the train run on the track beside the one that fusion follows? Somebody may have told its start one track off,
// and masts, bridges, curves and GNSS are much the same there. Balises and frogs are not: they lie between the train's
// own rails.
#pragma once

#include <memory>
#include <optional>
#include <utility>

#include "map_matcher/landmark_matcher.hpp"
#include "track/tracks_beside.hpp"

namespace railfix::map_matcher {

class BesideDoubt {
 public:
  BesideDoubt(const LandmarkParameters& parameters, std::shared_ptr<const track::TracksBeside> tracks)
      : parameters_(parameters), tracks_(std::move(tracks)) {}

  /// REQUIRES: it lies_in_track(); the prior is usable and not in doubt, and its track is declared.
  void sight(const track::Path& followed, const Sighting& sighting, const Prior& prior);
  /// What was sighted is of another ride.
  void begin_anew();
  /// How probable it is that the train runs on a track beside the one that is followed; 0 until something has spoken
  /// for that.
  [[nodiscard]] double probability() const { return odds_ > kSaid ? odds_ / (1 + odds_) : 0; }

 private:
  static constexpr double kTold = 5e-4;  // chance that somebody told the neighbour of the right track
  static constexpr double kSaid = 1.5 * kTold;
  /// Where one of a kind may lie about a place, as a train runs that looks ahead.
  struct Window {
    track::LandmarkKind kind = track::LandmarkKind::unknown;
    double behind_m = 0;
    double ahead_m = 0;
  };
  [[nodiscard]] bool is_beside(const track::Map& map, const track::EdgePosition& place, const Window& window) const;

  LandmarkParameters parameters_;
  std::shared_ptr<const track::TracksBeside> tracks_;
  double odds_ = kTold;
  std::optional<double> weighed_m_;  // of the distance run, the last one that said something
};

}  // namespace railfix::map_matcher
