#include "track/import/xml/net_places.hpp"

#include <algorithm>
#include <cmath>

namespace railfix::track {
namespace {

bool reaches(const RailNet& net, const NetPlace& place, bool at_end) {
  return at_end ? place.to_m > net.tracks[place.track].length_m - kNetTouchM : place.from_m < kNetTouchM;
}

/// Where trains come to that leave a track at this end.
std::vector<NetEnd> next_to(const RailNet& net, const NetEnd& end) {
  std::vector<NetEnd> out;
  for (const NetLink& link : net.links) {
    if (link.passable && (link.a == end || link.b == end)) out.push_back(link.a == end ? link.b : link.a);
  }
  return out;
}

bool is_at(const RailNet& net, const NetPlace& place, const NetEnd& end) {
  return place.track == end.track && reaches(net, place, end.at_end);
}

bool meets(const RailNet& net, const NetPlace& place, bool at_end, const NetPlace& other) {
  if (place.track == other.track) {
    const double gap_m = at_end ? other.from_m - place.to_m : place.from_m - other.to_m;
    return place.to_m > place.from_m && other.to_m > other.from_m && std::abs(gap_m) < kNetTouchM;
  }
  if (!reaches(net, place, at_end)) return false;
  const std::vector<NetEnd> next = next_to(net, {place.track, at_end});
  return std::any_of(next.begin(), next.end(), [&](const NetEnd& end) { return is_at(net, other, end); });
}

}  // namespace

bool goes_on(const RailNet& net, const std::vector<NetPlace>& places, const NetPlace& place, bool at_end) {
  return std::any_of(places.begin(), places.end(),
                     [&](const NetPlace& other) { return &other != &place && meets(net, place, at_end, other); });
}

std::vector<NetEnd> legs_outside(const RailNet& net, const std::vector<NetPlace>& places, const NetPlace& place,
                                 bool at_end) {
  if (!reaches(net, place, at_end) || !goes_on(net, places, place, at_end)) return {};
  std::vector<NetEnd> legs = next_to(net, {place.track, at_end});
  std::erase_if(legs, [&](const NetEnd& leg) {
    return std::any_of(places.begin(), places.end(), [&](const NetPlace& other) { return is_at(net, other, leg); });
  });
  return legs;
}

std::vector<std::pair<size_t, double>> middles(const RailNet& net, const std::vector<NetPlace>& places) {
  std::vector<std::pair<size_t, double>> out;
  for (auto first = places.begin(); first != places.end();) {
    auto last = first;
    double left_m = 0;
    do {
      left_m += 0.5 * (last->to_m - last->from_m);
      ++last;
    } while (last != places.end() && (meets(net, *(last - 1), true, *last) || meets(net, *(last - 1), false, *last)));
    auto at = first;
    for (; at + 1 != last && left_m > at->to_m - at->from_m; ++at) left_m -= at->to_m - at->from_m;
    const bool forward =
        at + 1 != last ? meets(net, *at, true, *(at + 1)) : at == first || meets(net, *at, false, *(at - 1));
    out.emplace_back(at->track, forward ? at->from_m + left_m : at->to_m - left_m);
    first = last;
  }
  return out;
}

}  // namespace railfix::track
