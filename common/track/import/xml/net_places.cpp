#include "track/import/xml/net_places.hpp"

#include <algorithm>
#include <cmath>
#include <map>
#include <optional>

namespace railfix::track {
namespace {

bool reaches(const RailNet& net, const NetPlace& place, bool at_end) {
  return at_end ? place.to_m > net.tracks[place.track].length_m - kNetTouchM : place.from_m < kNetTouchM;
}

/// Where trains come to that leave a track at this end.
std::vector<NetEnd> next_to(const RailNet& net, const NetEnd& end) {
  std::vector<NetEnd> out;
  for (const NetLink& link : net.links) {
    if (link.passable && !link.crosses && (link.a == end || link.b == end))
      out.push_back(link.a == end ? link.b : link.a);
  }
  return out;
}

/// Where a train comes to that leaves the stretch over this end of its track; nowhere where that is not reached.
std::vector<NetEnd> next_to(const RailNet& net, const NetPlace& place, bool at_end) {
  return reaches(net, place, at_end) ? next_to(net, {place.track, at_end}) : std::vector<NetEnd>{};
}

bool is_at(const RailNet& net, const NetPlace& place, const NetEnd& end) {
  return place.track == end.track && reaches(net, place, end.at_end);
}

bool sides_agree(const NetPlace& place, const NetPlace& other, bool is_turned) {
  return place.lateral_m * (is_turned ? -other.lateral_m : other.lateral_m) >= 0;
}

/// Whether the other stretch is one of those that a train comes to over this end.
bool meets(const RailNet& net, const NetPlace& place, bool at_end, const NetPlace& other,
           const std::vector<NetEnd>& next) {
  if (place.track == other.track) {
    const double gap_m = at_end ? other.from_m - place.to_m : place.from_m - other.to_m;
    return place.to_m > place.from_m && other.to_m > other.from_m && std::abs(gap_m) < kNetTouchM &&
           sides_agree(place, other, false);
  }
  return std::any_of(next.begin(), next.end(), [&](const NetEnd& end) {
    return is_at(net, other, end) && sides_agree(place, other, end.at_end == at_end);
  });
}

bool meets(const RailNet& net, const NetPlace& place, bool at_end, const NetPlace& other) {
  return meets(net, place, at_end, other, next_to(net, place, at_end));
}

bool goes_on(const RailNet& net, const std::vector<NetPlace>& places, const NetPlace& place, bool at_end) {
  const std::vector<NetEnd> next = next_to(net, place, at_end);
  return std::any_of(places.begin(), places.end(),
                     [&](const NetPlace& other) { return &other != &place && meets(net, place, at_end, other, next); });
}

/// Ends of tracks on which trains leave the thing beside where it goes on: the other leg of a switch inside it.
std::vector<NetEnd> legs_outside(const RailNet& net, const std::vector<NetPlace>& places, const NetPlace& place,
                                 bool at_end) {
  if (!reaches(net, place, at_end) || !goes_on(net, places, place, at_end)) return {};
  std::vector<NetEnd> legs = next_to(net, {place.track, at_end});
  std::erase_if(legs, [&](const NetEnd& leg) {
    return std::any_of(places.begin(), places.end(), [&](const NetPlace& other) { return is_at(net, other, leg); });
  });
  return legs;
}

/// Those of one track that overlap or meet are one.
std::vector<NetPlace> merged(const std::vector<NetPlace>& places) {
  std::vector<NetPlace> out;
  for (NetPlace place : places) {
    std::erase_if(out, [&](const NetPlace& other) {
      if (other.track != place.track || !sides_agree(place, other, false) || other.from_m > place.to_m + kNetTouchM ||
          place.from_m > other.to_m + kNetTouchM)
        return false;
      place.from_m = std::min(place.from_m, other.from_m);
      place.to_m = std::max(place.to_m, other.to_m);
      return true;
    });
    out.push_back(place);
  }
  return out;
}

struct Stretch {
  NetPlace place;
  bool forward = true;  // as the way runs
  [[nodiscard]] double length_m() const { return place.to_m - place.from_m; }
};

/// Takes the one that goes on where the stretch leads out of the places; nothing where none does.
std::optional<Stretch> take_next(const RailNet& net, const Stretch& stretch, std::vector<NetPlace>& places) {
  for (auto next = places.begin(); next != places.end(); ++next) {
    if (!meets(net, stretch.place, stretch.forward, *next)) continue;
    const Stretch found{*next, meets(net, *next, false, stretch.place)};
    places.erase(next);
    return found;
  }
  return std::nullopt;
}

/// Takes the first place with all that follow one another on either side of it, in the order of the way.
std::vector<Stretch> way_over(const RailNet& net, std::vector<NetPlace>& places) {
  std::vector<Stretch> way{{places.front(), false}};
  places.erase(places.begin());
  while (const auto next = take_next(net, way.back(), places)) way.push_back(*next);
  std::ranges::reverse(way);
  for (Stretch& stretch : way) stretch.forward = !stretch.forward;
  while (const auto next = take_next(net, way.back(), places)) way.push_back(*next);
  return way;
}

}  // namespace

std::vector<NetSpot> ends_of(const RailNet& net, const std::vector<NetPlace>& places) {
  std::vector<NetSpot> out;
  for (size_t i = 0; i < places.size(); ++i) {
    const NetPlace& place = places[i];
    if (!goes_on(net, places, place, false)) out.push_back({place.track, place.from_m, true, i});
    if (!goes_on(net, places, place, true)) out.push_back({place.track, place.to_m, false, i});
  }
  return out;
}

std::vector<NetSpot> portals_of(const RailNet& net, const std::vector<NetPlace>& places) {
  std::vector<NetSpot> out = ends_of(net, places);
  std::map<NetEnd, size_t> legs;
  for (size_t i = 0; i < places.size(); ++i) {
    for (const bool at_end : {false, true}) {
      for (const NetEnd& leg : legs_outside(net, places, places[i], at_end)) legs.emplace(leg, i);
    }
  }
  for (const auto& [leg, place] : legs)
    out.push_back({leg.track, leg.at_end ? net.tracks[leg.track].length_m : 0.0, leg.at_end, place});
  return out;
}

TrackMark portal(const NetSpot& spot, double sigma_m, const std::string& name) {
  return {spot.begins ? LandmarkKind::portal_in : LandmarkKind::portal_out, spot.offset_m, 0, sigma_m, name};
}

std::vector<std::pair<size_t, double>> middles(const RailNet& net, const std::vector<NetPlace>& places) {
  std::vector<std::pair<size_t, double>> out;
  std::vector<NetPlace> rest = merged(places);
  while (!rest.empty()) {
    const std::vector<Stretch> way = way_over(net, rest);
    double left_m = 0;
    for (const Stretch& stretch : way) left_m += 0.5 * stretch.length_m();
    auto at = way.begin();
    for (; at + 1 != way.end() && left_m > at->length_m(); ++at) left_m -= at->length_m();
    out.emplace_back(at->place.track, at->forward ? at->place.from_m + left_m : at->place.to_m - left_m);
  }
  return out;
}

}  // namespace railfix::track
