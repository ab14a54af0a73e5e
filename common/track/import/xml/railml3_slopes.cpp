#include "track/import/xml/railml3_slopes.hpp"

#include <algorithm>
#include <cmath>

#include "track/import/told.hpp"
#include "track/import/xml/railml_readers.hpp"

namespace railfix::track {
namespace {

/// One <gradientCurve> on one track.
struct Piece {
  double from_m = 0;
  double to_m = 0;
  std::optional<double> grade;
  std::optional<double> change;  // of the grade along it
  pugi::xml_node node;
};

/// Of an arc without a gradient; radii are positive on hills, where the grade falls.
std::optional<double> change_of(const XmlSource& source, const pugi::xml_node& curve, double part_m, double whole_m) {
  if (const auto delta = source.number(curve, "deltaGradient"); delta && whole_m > 0)
    return 1e-3 * *delta * part_m / whole_m;
  const auto radius = source.number(curve, "radius");
  return radius && *radius != 0 ? std::optional(-part_m / *radius) : std::nullopt;
}

/// The slopes of one track, from its begin to its end.
class Slopes {
 public:
  Slopes(NetTrack& track, std::vector<std::string>& problems) : track_(track), problems_(problems) {}

  void add(std::vector<Piece> pieces) {
    std::stable_sort(pieces.begin(), pieces.end(), [](const Piece& a, const Piece& b) { return a.from_m < b.from_m; });
    for (size_t i = 0; i < pieces.size(); ++i) {
      Piece& piece = pieces[i];
      if (piece.from_m < reached_m_ - kNetTouchM) {
        problems_.push_back(railml_called(piece.node) + " begins on another gradient of track " + track_.track.name +
                            "; left out");
        continue;
      }
      const Piece* next = i + 1 < pieces.size() ? &pieces[i + 1] : nullptr;
      // A slope at a spot holds up to the next one.
      if (piece.grade && piece.to_m == piece.from_m) piece.to_m = next != nullptr ? next->from_m : track_.length_m;
      level_up_to(piece.from_m);
      if (piece.grade) {
        go_on(piece.from_m, *piece.grade, 0);
      } else {
        add_arc(piece, next != nullptr && next->from_m - piece.to_m < kNetTouchM ? next->grade : std::nullopt);
      }
      reached_m_ = std::max(reached_m_, piece.to_m);
    }
    level_up_to(track_.length_m);
    if (level_m_ > kNetTouchM)
      problems_.push_back("track " + track_.track.name + " has no gradient on " + told_m(level_m_) + " of its " +
                          told_m(track_.length_m) + "; it is level there: a guess");
  }

 private:
  void level_up_to(double offset_m) {
    if (offset_m - reached_m_ < kNetTouchM) return;
    level_m_ += offset_m - reached_m_;
    guess_level(reached_m_);
  }

  void add_arc(const Piece& arc, std::optional<double> after) {
    std::optional<double> before = grade_;
    if (!after && before && arc.change) after = *before + *arc.change;
    if (!before && after && arc.change) before = *after - *arc.change;
    if (!before || !after) {
      problems_.push_back(railml_called(arc.node) + " has no gradient, and no slopes that it lies between; track " +
                          track_.track.name + " is level there: a guess");
      guess_level(arc.from_m);
      return;
    }
    if (!grade_) go_on(arc.from_m, *before, 0);
    go_on(0.5 * (arc.from_m + arc.to_m), *after, arc.to_m - arc.from_m);
  }

  void go_on(double offset_m, double grade, double curve_length_m) {
    if (track_.slopes.empty() || track_.slopes.back().grade != grade || track_.slopes.back().is_guess)
      track_.slopes.push_back({offset_m, grade, curve_length_m});
    grade_ = grade;
  }

  void guess_level(double offset_m) {
    track_.slopes.push_back({offset_m, 0, 0, true});
    grade_.reset();
  }

  NetTrack& track_;
  std::vector<std::string>& problems_;
  std::optional<double> grade_;  // at the place that is reached; nothing where the file says none
  double reached_m_ = 0;
  double level_m_ = 0;
};

}  // namespace

void read_slopes3(const XmlSource& source, Railml3Places& places, RailNet& net) {
  std::map<size_t, std::vector<Piece>> of_track;
  for (const pugi::xml_node& curve : descendants(source.root(), "gradientCurve")) {
    const auto gradient = source.number(curve, "gradient");
    const std::vector<NetPlace> stretches = places.of(curve);
    double whole_m = 0;
    for (const NetPlace& place : stretches) whole_m += place.to_m - place.from_m;
    for (const NetPlace& place : stretches) {
      Piece piece{place.from_m, place.to_m, {}, {}, curve};
      if (gradient) piece.grade = (place.same_direction ? 1e-3 : -1e-3) * *gradient;
      // Turned round, an arc begins with the other sign of its last grade: the change is the same.
      piece.change = change_of(source, curve, place.to_m - place.from_m, whole_m);
      of_track[place.track].push_back(piece);
    }
  }
  for (auto& [track, pieces] : of_track) Slopes(net.tracks[track], net.problems).add(std::move(pieces));
}

}  // namespace railfix::track
