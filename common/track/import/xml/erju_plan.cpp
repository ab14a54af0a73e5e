#include "track/import/xml/erju_plan.hpp"

#include <algorithm>

#include "track/import/told.hpp"
#include "track/import/xml/erju_cants.hpp"

namespace railfix::track {
namespace {

constexpr double kSlopePerUnit = 1e-4;  // slopes are tenths of a per mille

void read_slopes(const XmlSource& infra, const ErjuEdges& edges, RailNet& net) {
  for (const pugi::xml_node& sampled : descendants(infra.root(), "sampledTrackEdgeGeometry")) {
    NetTrack& track = net.tracks[edges.track_of(infra, sampled, "id")];
    ErjuLeftOut outside;
    for (const pugi::xml_node& slope : descendants(sampled, "slope")) {
      const NetSlope read{metres(infra.required(slope, "pos")),
                          kSlopePerUnit * infra.required(slope, "samplePointSlope")};
      if (is_on(track, read.offset_m)) {
        track.slopes.push_back(read);
      } else {
        outside.add("a sampled slope", read.offset_m);
      }
    }
    outside.tell("outside its " + told_m(track.length_m) + "; left out", track, net.problems);
  }
  for (NetTrack& track : net.tracks) std::ranges::stable_sort(track.slopes, {}, &NetSlope::offset_m);
}

}  // namespace

void read_erju_plan(const XmlSource& infra, const ErjuEdges& edges, RailNet& net) {
  ErjuCants cants(infra, edges, net);
  for (const pugi::xml_node& geometry : descendants(infra.root(), "trackEdgeGeometry")) {
    const size_t track = edges.track_of(infra, geometry, "id");
    std::vector<ErjuAzimuth> azimuths = azimuths_of(infra, geometry);
    NetTrack& on = net.tracks[track];
    if (on.has_shape()) {
      on.plan = plan_of(azimuths, on.length_m);
    } else {
      add_bends(azimuths, on, net.problems);
    }
    cants.add_curves(track, std::move(azimuths));
  }
  cants.settle();
  read_slopes(infra, edges, net);
}

}  // namespace railfix::track
