#include "track/import/xml/railml2_stretches.hpp"

#include <algorithm>

#include "track/import/xml/railml_readers.hpp"

namespace railfix::track {
namespace {

constexpr double kShortestPartM = 0.5 * kAtEndM;  // of a stretch on a piece: it ends at the switch otherwise

}  // namespace

void Railml2Stretches::add(NetPlace place, const pugi::xml_node& of, RailNet& net) {
  const double length_m = net.tracks[place.track].length_m;
  const bool has_begin = is_on_track(place.from_m, length_m);
  const bool has_end = is_on_track(place.to_m, length_m);
  for (const bool is_on : {has_begin, has_end}) {
    if (!is_on) net.problems.push_back(not_on_its_track(of));
  }
  if (place.to_m < -kAtEndM || place.from_m > length_m + kAtEndM) return;
  place.from_m = std::clamp(place.from_m, 0.0, length_m);
  place.to_m = std::clamp(place.to_m, 0.0, length_m);
  stretches_.push_back({place, has_begin, has_end, of});
}

Railml2Stretches::Parts Railml2Stretches::parts(const Railml2Pieces& pieces, const RailNet& net) const {
  Parts out;
  for (const Stretch& stretch : stretches_) {
    const NetPlace& whole = stretch.place;
    const auto& of_track = pieces.at(whole.track);
    const bool is_spot = whole.to_m - whole.from_m < kAtEndM;
    for (auto piece = of_track.begin(); piece != of_track.end(); ++piece) {
      const auto& [begin_m, track] = *piece;
      const auto next = std::next(piece);
      const double end_m = next == of_track.end() ? begin_m + net.tracks[track].length_m : next->first;
      const double from_m = std::max(whole.from_m, begin_m);
      const double to_m = std::min(whole.to_m, end_m);
      const bool holds_spot = whole.from_m >= begin_m && (next == of_track.end() || whole.from_m < end_m);
      if (is_spot ? !holds_spot : to_m - from_m < kShortestPartM) continue;
      out.places.push_back({track, from_m - begin_m, to_m - begin_m, true, whole.lateral_m});
      out.of.push_back(&stretch);
    }
  }
  return out;
}

const Railml2Stretches::Stretch* Railml2Stretches::Parts::told_by(const NetSpot& spot) const {
  const Stretch& stretch = *of[spot.place];
  const bool is_leg = spot.track != places[spot.place].track;  // of a switch, beside the stretch
  return is_leg || (spot.begins ? stretch.has_begin : stretch.has_end) ? &stretch : nullptr;
}

void Railml2Stretches::add_portals(const Railml2Pieces& pieces, RailNet& net) const {
  const Parts all = parts(pieces, net);
  for (const NetSpot& spot : portals_of(net, all.places)) {
    if (const Stretch* stretch = all.told_by(spot))
      net.tracks[spot.track].track.marks.push_back(portal(spot, kRailmlSigmaM, railml_name(stretch->of)));
  }
}

void Railml2Stretches::add_ends(const Railml2Pieces& pieces, RailNet& net) const {
  const Parts all = parts(pieces, net);
  for (const NetSpot& spot : ends_of(net, all.places)) {
    if (const Stretch* stretch = all.told_by(spot)) {
      net.tracks[spot.track].track.marks.push_back(
          {LandmarkKind::platform, spot.offset_m, stretch->place.lateral_m, kRailmlSigmaM, railml_name(stretch->of)});
    }
  }
}

}  // namespace railfix::track
