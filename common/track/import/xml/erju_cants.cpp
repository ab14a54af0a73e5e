#include "track/import/xml/erju_cants.hpp"

#include <algorithm>
#include <cmath>

#include "track/import/told.hpp"

namespace railfix::track {
namespace {

constexpr double kCurvePerM = 1.0 / 3000;  // wider ones have little cant, and azimuths scatter as much
constexpr double kCantM = 0.005;           // of what says which rail is higher
constexpr size_t kFewAgainst = 10;         // one in so many may lie against the curve, as on the branch of a switch

/// How a kind of cant is called in the file, and in sentences.
struct Names {
  const char* pos;
  const char* value;
  const char* one;
};

/// Those that are some and lie on the track.
std::vector<CantPoint> cants_of(const XmlSource& infra, const std::vector<pugi::xml_node>& nodes, const Names& names,
                                const NetTrack& track, std::vector<std::string>& problems) {
  ErjuLeftOut left_out;
  ErjuLeftOut outside;
  std::vector<CantPoint> out;
  for (const pugi::xml_node& node : nodes) {
    const CantPoint cant{metres(infra.required(node, names.pos)), metres(infra.required(node, names.value))};
    if (!is_on(track, cant.offset_m)) {
      outside.add(names.one, cant.offset_m);
    } else if (is_cant(cant.cant_m)) {
      out.push_back(cant);
    } else {
      left_out.add(std::string(names.value) + " " + node.attribute(names.value).value() + " mm", cant.offset_m);
    }
  }
  left_out.tell(std::string(kNoTrackHas) + "; left out", track, problems);
  outside.tell("outside its " + told_m(track.length_m) + "; left out", track, problems);
  return out;
}

}  // namespace

ErjuCants::ErjuCants(const XmlSource& infra, const ErjuEdges& edges, RailNet& net)
    : infra_(infra), edges_(edges), net_(net) {
  for (const pugi::xml_node& geometry : descendants(infra.root(), "trackEdgeGeometry")) read_points(geometry);
  for (const pugi::xml_node& sampled : descendants(infra.root(), "sampledTrackEdgeGeometry")) read_samples(sampled);
  for (NetTrack& track : net.tracks) std::ranges::stable_sort(track.cant, {}, &CantPoint::offset_m);
  if (sampled_.empty()) return;
  net.problems.push_back(std::to_string(sampled_.size()) +
                         " track edges have their cant from samples, taken as millimetres that hold up to the next "
                         "one, as sampled slopes do; the schema does not say it");
}

void ErjuCants::read_points(const pugi::xml_node& geometry) {
  NetTrack& track = net_.tracks[edges_.track_of(infra_, geometry, "id")];
  const auto points = cants_of(infra_, descendants(geometry, "cantPoint"),
                               {"trackGeometryPos", "appliedCant", "a cantPoint"}, track, net_.problems);
  track.cant.insert(track.cant.end(), points.begin(), points.end());
}

/// Nothing where the plan has points.
void ErjuCants::read_samples(const pugi::xml_node& sampled) {
  const size_t number = edges_.track_of(infra_, sampled, "id");
  NetTrack& track = net_.tracks[number];
  if (!track.cant.empty()) return;
  const auto samples = sampled.child("cants").children("cant");
  track.cant = cants_of(infra_, {samples.begin(), samples.end()}, {"pos", "samplePointCant", "a sampled cant"}, track,
                        net_.problems);
  if (!track.cant.empty()) sampled_.insert(number);
}

/// How the track curves there: 0 where it is nearly straight.
double ErjuCants::bend(size_t track, double offset_m) const {
  const auto found = azimuths_.find(track);
  const double curvature_per_m = found == azimuths_.end() ? 0 : curvature_about(found->second, offset_m);
  return std::abs(curvature_per_m) < kCurvePerM ? 0 : curvature_per_m;
}

ErjuCants::Votes ErjuCants::votes() const {
  Votes out;
  for (size_t track = 0; track < net_.tracks.size(); ++track) {
    for (const CantPoint& point : net_.tracks[track].cant) {
      if (std::abs(point.cant_m) < kCantM) continue;
      out.any = true;
      out.below_0 = out.below_0 || point.cant_m < 0;
      const double curvature_per_m = bend(track, point.offset_m);
      if (curvature_per_m == 0) continue;
      ++(point.cant_m * curvature_per_m > 0 ? out.as_map : out.turned);
    }
  }
  return out;
}

ErjuCants::Sign ErjuCants::sign_of(const Votes& votes) const {
  const size_t all = votes.as_map + votes.turned;
  if (all == 0) {
    net_.problems.push_back(
        "no azimuths show the curves that cant is on, and the schema does not say which rail is higher where it is "
        "positive: it is taken as the right one, as in a left curve");
    return Sign::as_map;
  }
  if (!votes.below_0) return Sign::amount;
  const size_t against = std::min(votes.as_map, votes.turned);
  if (against * kFewAgainst > all) {
    net_.problems.push_back("cant makes the inner rail of a curve the higher one at " + std::to_string(against) +
                            " of " + std::to_string(all) +
                            " places in curves, whatever its sign means: look at the "
                            "source");
  }
  return votes.turned > votes.as_map ? Sign::turned : Sign::as_map;
}

/// Never below 0, in left curves and right ones: which rail it is only the curve says; beside one, the nearest.
void ErjuCants::take_as_amounts(NetTrack& on, size_t track) {
  std::vector<CantPoint>& cant = on.cant;
  std::vector<std::pair<double, double>> curves;  // offset, curvature
  for (const CantPoint& point : cant) {
    if (const double curvature_per_m = bend(track, point.offset_m); curvature_per_m != 0)
      curves.emplace_back(point.offset_m, curvature_per_m);
  }
  if (curves.empty() && std::ranges::any_of(cant, [](const CantPoint& point) { return point.cant_m != 0; })) {
    net_.problems.push_back("track edge \"" + on.track.name +
                            "\" has cant and no curve that says which rail is higher; left out");
    cant.clear();
  }
  for (CantPoint& point : cant) {
    const auto nearest =
        std::ranges::min_element(curves, {}, [&](const auto& curve) { return std::abs(curve.first - point.offset_m); });
    if (nearest != curves.end()) point.cant_m = std::copysign(point.cant_m, nearest->second);
  }
}

void ErjuCants::settle() {
  const Votes all = votes();
  const Sign sign = all.any ? sign_of(all) : Sign::as_map;
  for (size_t track = 0; track < net_.tracks.size(); ++track) {
    if (sign == Sign::amount) take_as_amounts(net_.tracks[track], track);
    if (sign != Sign::turned) continue;
    for (CantPoint& point : net_.tracks[track].cant) point.cant_m = -point.cant_m;
  }
  for (const size_t track : sampled_) net_.tracks[track].cant = held(std::move(net_.tracks[track].cant));
}

}  // namespace railfix::track
