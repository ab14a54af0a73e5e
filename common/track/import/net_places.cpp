#include "track/import/net_places.hpp"

#include <algorithm>
#include <cmath>

namespace railfix::track {
namespace {

bool reaches(const RailNet& net, const NetPlace& place, bool at_end) {
  return at_end ? place.to_m > net.tracks[place.track].length_m - kNetTouchM : place.from_m < kNetTouchM;
}

bool meets(const RailNet& net, const NetPlace& place, bool at_end, const NetPlace& other) {
  if (place.track == other.track) {
    const double gap_m = at_end ? other.from_m - place.to_m : place.from_m - other.to_m;
    return place.to_m > place.from_m && other.to_m > other.from_m && std::abs(gap_m) < kNetTouchM;
  }
  if (!reaches(net, place, at_end)) return false;
  const NetEnd end{place.track, at_end};
  return std::any_of(net.links.begin(), net.links.end(), [&](const NetLink& link) {
    if (!link.passable || (link.a != end && link.b != end)) return false;
    const NetEnd& next = link.a == end ? link.b : link.a;
    return next.track == other.track && reaches(net, other, next.at_end);
  });
}

}  // namespace

bool goes_on(const RailNet& net, const std::vector<NetPlace>& places, const NetPlace& place, bool at_end) {
  return std::any_of(places.begin(), places.end(),
                     [&](const NetPlace& other) { return &other != &place && meets(net, place, at_end, other); });
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
