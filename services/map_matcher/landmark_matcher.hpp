// Which mapped landmark was sighted? Sightings are judged together: the last ones must fit the map at the same time,
// some of them may be false, and some landmarks may have been missed.
#pragma once

#include <memory>
#include <optional>
#include <vector>

#include "map_matcher/alike_places.hpp"
#include "map_matcher/landmark_parameters.hpp"
#include "map_matcher/match_types.hpp"
#include "map_matcher/sighting_history.hpp"
#include "track/path.hpp"

namespace railfix::map_matcher {

class LandmarkMatcher {
 public:
  /// told_m: travelled distance where the place was told.
  LandmarkMatcher(const LandmarkParameters& parameters, std::shared_ptr<const track::Path> path, double told_m = 0)
      : parameters_(parameters), path_(std::move(path)), seen_(parameters) {
    forget(told_m);
  }

  /// Another way with distances that go on from the old one's; the sightings so far stay.
  void change_path(std::shared_ptr<const track::Path> path) { path_ = std::move(path); }

  /// Nothing when no mapped landmark fits or it cannot be told which one, nor where the window has too many of its
  /// kind.
  std::optional<Fix> add(const Sighting& sighting, const Prior& prior);
  /// How probable it is, by all sightings so far, that the train is not in the window; 0 from where they confirm it
  /// until they speak against it again.
  [[nodiscard]] double doubt() const { return confirmed_ ? 0 : odds_elsewhere_ / (1 + odds_elsewhere_); }
  /// The same where it is more probable than not, which is worth saying; else 0.
  [[nodiscard]] double place_doubt() const { return doubt() > kDoubted ? doubt() : 0; }
  /// The travelled distance does not go on from the one before: earlier sightings say nothing any more.
  void forget(double told_m) {
    seen_.begin_anew();
    told_m_ = told_m;
    odds_elsewhere_ = parameters_.elsewhere / (1 - parameters_.elsewhere);
    confirmed_ = told_apart_ = false;
  }

 private:
  static constexpr double kDoubted = 0.5;
  /// Where the object may be on the path.
  struct Window {
    double expected_m = 0;
    double from_m = 0;
    double to_m = 0;
  };
  /// What the sighting may be of, not normalised.
  struct Weights {
    const track::PathLandmark* best = nullptr;
    double of_best = 0;
    double nothing = 0;    // on the map
    double here = 0;       // all together while the train is in the window
    double elsewhere = 0;  // it is not
  };
  [[nodiscard]] Weights weigh(const Sighting& sighting, double place_m, const Window& window,
                              const std::vector<const track::PathLandmark*>& candidates) const;
  /// No other place near would fit as well as the one where this is the landmark.
  [[nodiscard]] bool is_told_apart(const track::PathLandmark& landmark, double place_m, const Window& window,
                                   const Prior& prior) const;

  LandmarkParameters parameters_;
  std::shared_ptr<const track::Path> path_;
  SightingHistory seen_;
  double told_m_ = 0;
  double odds_elsewhere_ = 0;  // against that it is in the window
  bool confirmed_ = false;
  bool told_apart_ = false;  // since then, from the places near where the sightings would be alike
};

}  // namespace railfix::map_matcher
