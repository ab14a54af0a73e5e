// What was sighted on the last hundreds of metres, and how well all of it fits the map at once where the train is taken
// to be: some of it may be false, some landmarks may have been missed, and the odometer's scale is unknown.
#pragma once

#include <cstdint>
#include <deque>
#include <map>
#include <optional>
#include <vector>

#include "map_matcher/landmark_parameters.hpp"
#include "map_matcher/match_types.hpp"
#include "track/aside.hpp"
#include "track/path.hpp"

namespace railfix::map_matcher {

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

class SightingHistory {
 public:
  struct Seen {
    Sighting sighting;
    double place_m = 0;  // of the object in distance run
  };

  explicit SightingHistory(const LandmarkParameters& parameters) : parameters_(parameters) {}

  /// A sighting comes: those too far behind are forgotten, and those of the same object. True where there were any.
  bool make_room(const Sighting& sighting, double place_m);
  void add(const Sighting& sighting, double place_m);
  /// Distances do not go on from those before.
  void begin_anew();
  /// Those that are within `history_m` of the place; the others lie up to 3 km behind.
  [[nodiscard]] SightingHistory lately(double place_m) const;
  /// As a train would have sighted it that runs along the same track, but looks the other way; distance run counts
  /// backwards in it.
  [[nodiscard]] SightingHistory turned_round() const;

  /// How well all of it fits the map when path distance = distance run + shift, against chance; mean over the scales of
  /// the odometer.
  [[nodiscard]] double fits(const track::Path& path, double shift_m, double now_m) const {
    return fits(path, shift_m, now_m, Against::chance);
  }
  /// Mean of fits() between two shifts.
  [[nodiscard]] double mean_fit(const track::Path& path, double from_m, double to_m, double now_m) const;
  /// How likely all of it is there, to be compared with other places. Chance differs from place to place.
  [[nodiscard]] double likelihood(const track::Path& path, double shift_m, double now_m) const {
    return fits(path, shift_m, now_m, Against::nothing);
  }

  [[nodiscard]] const std::deque<Seen>& seen() const { return seen_; }
  [[nodiscard]] double unmapped_per_m(track::LandmarkKind kind) const;
  UnmappedRate& unmapped(track::LandmarkKind kind) {
    return unmapped_.try_emplace(kind, parameters_.false_per_m).first->second;
  }

 private:
  enum class Against : uint8_t { nothing, chance };
  [[nodiscard]] double fits(const track::Path& path, double shift_m, double now_m, Against against) const;
  [[nodiscard]] double fits_at_scale(const track::Path& path, double shift_m, double scale, double now_m,
                                     Against against) const;
  [[nodiscard]] double sighting_fits(const track::Path& path, const Seen& seen, double path_m, double now_m,
                                     Against against) const;
  [[nodiscard]] bool has(track::LandmarkKind kind) const;
  /// Both are probably of one object.
  [[nodiscard]] bool is_of(const Seen& seen, const Sighting& sighting, double place_m) const;
  /// Of its place from another one's; `map_sigma_m` is that of either on the map.
  [[nodiscard]] double relative_sigma_m(const Seen& seen, double map_sigma_m, double now_m) const;

  LandmarkParameters parameters_;
  std::deque<Seen> seen_;
  std::map<track::LandmarkKind, UnmappedRate> unmapped_;
};

/// As far aside.
[[nodiscard]] inline bool fits_aside(const Sighting& sighting, const track::PathLandmark& mark) {
  return track::fits_aside(sighting.lateral_m, mark.lateral_m, track::is_aside_measured(*mark.landmark));
}
/// Mapped landmarks of a kind between two places of a path.
[[nodiscard]] std::vector<const track::PathLandmark*> landmarks_of_kind(const track::Path& path,
                                                                        track::LandmarkKind kind, double from_m,
                                                                        double to_m);
/// How many of them a metre there are around a place.
[[nodiscard]] double mapped_per_m(const track::Path& path, track::LandmarkKind kind, double path_m);

}  // namespace railfix::map_matcher
