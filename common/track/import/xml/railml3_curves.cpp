#include "track/import/xml/railml3_curves.hpp"

#include <algorithm>
#include <cmath>

#include "track/import/xml/railml_readers.hpp"

namespace railfix::track {
namespace {

/// One <horizontalCurve> on one track.
struct Railml3Curve {
  size_t track = 0;
  NetBend bend;
  pugi::xml_node node;
};

class Railml3CurveReader {
 public:
  Railml3CurveReader(const XmlSource& source, Railml3Places& places, RailNet& net)
      : source_(source), places_(places), net_(net) {}

  void read() {
    for (const pugi::xml_node& curve : descendants(source_.root(), "horizontalCurve")) read_curve(curve);
    for (const Railml3Curve& arc : arcs_) net_.tracks[arc.track].bends.push_back(arc.bend);
    for (Railml3Curve& transition : transitions_) join(transition);
    for (const Railml3Curve& transition : transitions_) net_.tracks[transition.track].bends.push_back(transition.bend);
    for (NetTrack& track : net_.tracks) std::ranges::stable_sort(track.bends, {}, &NetBend::from_m);
    tell_overlaps();
  }

 private:
  void read_curve(const pugi::xml_node& curve) {
    const std::string type = curve.attribute("curveType").value();
    if (type == "straight") return;
    const bool is_arc = type.empty() || type == "arc";
    const double radius_m = is_arc ? source_.number(curve, "radius").value_or(0) : 0;
    if (is_arc && radius_m == 0) return;
    if (is_arc && std::abs(radius_m) < 10) throw source_.wrong(curve, "a radius of less than 10 m is no railway's");
    for (const NetPlace& place : places_.of(curve)) {
      const double curvature = is_arc ? (place.same_direction ? -1.0 : 1.0) / radius_m : 0;
      const NetBend bend{place.from_m, place.to_m, curvature, curvature};
      if (is_arc && place.to_m > place.from_m) arcs_.push_back({place.track, bend, curve});
      if (!is_arc && place.to_m - place.from_m >= kNetTouchM) transitions_.push_back({place.track, bend, curve});
    }
  }

  /// Straight where the file has nothing there. All are taken as clothoids.
  void join(Railml3Curve& transition) {
    const NetTrack& track = net_.tracks[transition.track];
    NetBend& bend = transition.bend;
    bend.curvature_start_per_m = bend.from_m < kNetTouchM ? curvature_beyond({transition.track, false})
                                                          : curvature_touching(track, bend.from_m, &NetBend::to_m);
    bend.curvature_end_per_m = bend.to_m > track.length_m - kNetTouchM
                                   ? curvature_beyond({transition.track, true})
                                   : curvature_touching(track, bend.to_m, &NetBend::from_m);
    if (bend.curvature_start_per_m == 0 && bend.curvature_end_per_m == 0)
      net_.problems.push_back("horizontal curve \"" + std::string(transition.node.attribute("id").value()) +
                              "\" of type " + transition.node.attribute("curveType").value() +
                              " touches no arc; it is taken as a straight");
  }

  /// Of the arc that begins (`side` is from_m) or ends there.
  static double curvature_touching(const NetTrack& track, double offset_m, double NetBend::*side) {
    const auto arc = std::ranges::find_if(
        track.bends, [&](const NetBend& bend) { return std::abs(bend.*side - offset_m) < kNetTouchM; });
    return arc == track.bends.end() ? 0 : arc->curvature_start_per_m;
  }

  /// Where the straight way leads on from there, as this track counts it.
  [[nodiscard]] double curvature_beyond(const NetEnd& end) const {
    for (const bool diverging : {false, true}) {
      for (const NetLink& link : net_.links) {
        if (!link.passable || link.crosses || link.diverging != diverging || (link.a != end && link.b != end)) continue;
        const NetEnd& next = link.a == end ? link.b : link.a;
        const NetTrack& track = net_.tracks[next.track];
        const double curvature = next.at_end ? curvature_touching(track, track.length_m, &NetBend::to_m)
                                             : curvature_touching(track, 0, &NetBend::from_m);
        return next.at_end == end.at_end ? -curvature : curvature;
      }
    }
    return 0;
  }

  void tell_overlaps() {
    std::vector<Railml3Curve> all = arcs_;
    all.insert(all.end(), transitions_.begin(), transitions_.end());
    std::ranges::stable_sort(all, {}, [](const Railml3Curve& one) { return std::pair(one.track, one.bend.from_m); });
    double reached_m = 0;
    for (size_t i = 0; i < all.size(); ++i) {
      if (i == 0 || all[i].track != all[i - 1].track) reached_m = 0;
      if (all[i].bend.from_m < reached_m - kNetTouchM)
        net_.problems.push_back(railml_called(all[i].node) + " begins on another curve of track " +
                                net_.tracks[all[i].track].track.name + ", which holds up to its own end");
      reached_m = std::max(reached_m, all[i].bend.to_m);
    }
  }

  const XmlSource& source_;
  Railml3Places& places_;
  RailNet& net_;
  std::vector<Railml3Curve> arcs_;
  std::vector<Railml3Curve> transitions_;
};

}  // namespace

void read_curves3(const XmlSource& source, Railml3Places& places, RailNet& net) {
  Railml3CurveReader(source, places, net).read();
}

}  // namespace railfix::track
