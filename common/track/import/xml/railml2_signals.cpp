#include "track/import/xml/railml2_signals.hpp"

#include <algorithm>

#include "track/import/told.hpp"
#include "track/import/xml/railml_readers.hpp"

namespace railfix::track {
namespace {

/// The schema itself has no such attribute of signals: whichever prefix an extension has, or none, it says nothing else
/// by it.
double side_of(const pugi::xml_node& signal) {
  for (const pugi::xml_attribute& attribute : signal.attributes()) {
    const std::string_view name = attribute.name();
    if (name == "side" || name.ends_with(":side")) return left_of(attribute.value());
  }
  return 0;
}

std::vector<pugi::xml_node> signals_of(const pugi::xml_node& control) {
  std::vector<pugi::xml_node> out;
  for (const auto& [all, one] : {std::pair("signals", "signal"), std::pair("stopPosts", "stopPost")}) {
    for (const pugi::xml_node& of : control.child(all).children(one)) {
      const bool nothing_stands_there = of.attribute("virtual").as_bool();
      if (!nothing_stands_there) out.push_back(of);
    }
  }
  return out;
}

}  // namespace

void read_signals2(const XmlSource& source, const pugi::xml_node& control, double origin_m, NetTrack& track,
                   std::vector<std::string>& problems) {
  std::vector<pugi::xml_node> without_side;
  for (const pugi::xml_node& of : signals_of(control)) {
    const double offset_m = source.required(of, "pos") - origin_m;
    if (!is_on_track(offset_m, track.length_m)) {
      problems.push_back(not_on_its_track(of));
      continue;
    }
    const double side = side_of(of);
    if (side == 0 && of.attribute("trackDist")) without_side.push_back(of);
    track.track.marks.push_back({LandmarkKind::mast, std::clamp(offset_m, 0.0, track.length_m), kMastBesideM * side,
                                 kRailmlSigmaM, railml_name(of)});
  }
  if (without_side.empty()) return;
  const std::string more = told_as_more(without_side.size());
  problems.push_back(railml_has(without_side.front(), track, "trackDist",
                                "m" + more +
                                    " and no side that the schema would know; on which side it stands is left "
                                    "open"));
}

}  // namespace railfix::track
