// Which mapped landmark was sighted? Sightings are judged together: the last ones must fit the map at the same time,
// some of them may be false, and some landmarks may have been missed.
#pragma once

#include <deque>
#include <map>
#include <memory>
#include <optional>
#include <vector>

#include "map_matcher/match_types.hpp"
#include "track/path.hpp"

namespace railfix::map_matcher {

struct LandmarkParameters {
  double detection = 0.8;        // chance that a mapped landmark is sighted
  double false_per_m = 0.0005;   // false sightings of one kind per metre, where the map has all of them
  double moved = 0.03;           // chance that a landmark stands elsewhere than the map says, ...
  double moved_m = 6.0;          // ... by so much at most
  double elsewhere = 1e-3;       // chance that the train is not in the window: somebody has told its start wrongly
  double scale_sigma = 0.01;     // of the distance run between sightings
  double window_margin_m = 2.0;  // beyond the promised interval of train_state
  double history_m = 600;        // sightings further back are forgotten
  double min_probability = 0.5;  // of a fix that is worth sending
};

/// How many sightings of one kind a metre are of nothing on the map: false ones, and of what the map lacks (many have
/// few masts). Learnt on the way: a Poisson rate with what is expected as its prior, forgotten over some kilometres.
class UnmappedRate {
 public:
  explicit UnmappedRate(double expected_per_m) : expected_way_m_(1 / expected_per_m) {}
  [[nodiscard]] double per_m() const { return (1 + count_) / (expected_way_m_ + way_m_); }
  /// Another sighting; it is of nothing on the map with so much probability.
  void learn(double place_m, double probability);
  /// Places do not go on from those before.
  void begin_way() { last_m_.reset(); }

 private:
  double expected_way_m_;
  double count_ = 0;
  double way_m_ = 0;
  std::optional<double> last_m_;
};

class LandmarkMatcher {
 public:
  LandmarkMatcher(const LandmarkParameters& parameters, std::shared_ptr<const track::Path> path)
      : parameters_(parameters), path_(std::move(path)) {
    forget();
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
  void forget() {
    seen_.clear();
    for (auto& [kind, rate] : unmapped_) rate.begin_way();
    odds_elsewhere_ = parameters_.elsewhere / (1 - parameters_.elsewhere);
    confirmed_ = false;
  }

 private:
  static constexpr double kDoubted = 0.5;
  struct Seen {
    Sighting sighting;
    double place_m = 0;         // of the object in distance run
    double unmapped_per_m = 0;  // of its kind, as it is known by now
  };
  /// How well all earlier sightings fit the map when path distance = distance run + shift, against chance; mean over
  /// the scales of the odometer, or at one.
  [[nodiscard]] double history_fits(double shift_m, double now_m) const;
  [[nodiscard]] double history_fits(double shift_m, double scale, double now_m) const;
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
                              const std::vector<const track::PathLandmark*>& candidates);
  void remember(const Sighting& sighting, double place_m);
  /// Both are probably of one object.
  [[nodiscard]] bool is_of(const Seen& seen, const Sighting& sighting, double place_m) const;
  /// Mean of history_fits between two shifts.
  [[nodiscard]] double mean_fit(double from_m, double to_m, double now_m) const;
  [[nodiscard]] double sighting_fits(const Seen& seen, double path_m, double now_m) const;
  /// Mapped landmarks of the kind per metre around a place.
  [[nodiscard]] double mapped_per_m(track::LandmarkKind kind, double path_m) const;
  [[nodiscard]] std::vector<const track::PathLandmark*> near(track::LandmarkKind kind, double from_m,
                                                             double to_m) const;
  [[nodiscard]] bool sighted_before(track::LandmarkKind kind) const;
  UnmappedRate& unmapped(track::LandmarkKind kind) {
    return unmapped_.try_emplace(kind, parameters_.false_per_m).first->second;
  }
  /// Of its place from another one's; `map_sigma_m` is that of either on the map.
  [[nodiscard]] double relative_sigma_m(const Seen& seen, double map_sigma_m, double now_m) const;

  LandmarkParameters parameters_;
  std::shared_ptr<const track::Path> path_;
  std::deque<Seen> seen_;
  std::map<track::LandmarkKind, UnmappedRate> unmapped_;
  double odds_elsewhere_ = 0;  // against that it is in the window
  bool confirmed_ = false;
};

}  // namespace railfix::map_matcher
