#include "track/import/xml/railml3_signals.hpp"

#include <algorithm>

#include "track/import/told.hpp"
#include "track/import/xml/railml_readers.hpp"

namespace railfix::track {
namespace {

/// Nothing stands there.
bool is_virtual(const pugi::xml_node& signal) {
  const auto constructions = descendants(signal, "signalConstruction");
  return std::ranges::any_of(constructions, [](const pugi::xml_node& of) {
    return std::string_view(of.attribute("type").value()) == "virtual";
  });
}

/// On which side the signals of a file stand: 1 left of the net element, -1 right, 0 not said.
class Sides {
 public:
  Sides(const Railml3Places& places, RailNet& net) : places_(places), net_(net) {}

  /// `positionAtTrack` is seen in the direction that the signal applies to, and counts before `lateralSide`.
  double of(const pugi::xml_node& signal, const NetPlace& place) {
    const double seen_by_trains = side_in(signal, "signalConstruction", "positionAtTrack");
    const pugi::xml_node spot = spot_of(signal, place);
    const double told_beside = side_in(spot, "linearCoordinate", "lateralSide");
    const std::string applies = spot.attribute("applicationDirection").value();
    if (seen_by_trains != 0 && (applies == "normal" || applies == "reverse")) {
      const double left = applies == "normal" ? seen_by_trains : -seen_by_trains;
      if (applies == "normal" && told_beside == -left) return open(on_both_sides_, signal);
      return left;
    }
    if (seen_by_trains != 0) return open(without_direction_, signal);
    return told_beside != 0 && applies == "reverse" ? open(against_, signal) : told_beside;
  }

  void tell() const {
    tell(on_both_sides_, "one side as positionAtTrack and the other as lateralSide");
    tell(without_direction_,
         "positionAtTrack and no spotLocation that applies in one direction, in which it would be seen");
    // The schema has it seen in the direction of application, files at hand along the net element.
    tell(against_, "lateralSide alone, which not all see the same way in reverse; positionAtTrack would say it");
  }

 private:
  /// Of the first of the children that says one.
  static double side_in(const pugi::xml_node& of, const char* child, const char* attribute) {
    for (const pugi::xml_node& one : of.children(child)) {
      if (const double side = left_of(one.attribute(attribute).value()); side != 0) return side;
    }
    return 0;
  }

  /// The location that the place was read from, or one that says the same.
  [[nodiscard]] pugi::xml_node spot_of(const pugi::xml_node& signal, const NetPlace& place) const {
    for (const pugi::xml_node& spot : signal.children("spotLocation")) {
      const bool is_normal = std::string_view(spot.attribute("applicationDirection").value()) != "reverse";
      if (places_.track(spot.attribute("netElementRef").value()) == place.track && is_normal == place.same_direction)
        return spot;
    }
    return {};
  }

  static double open(std::vector<pugi::xml_node>& signals, const pugi::xml_node& signal) {
    signals.push_back(signal);
    return 0;
  }

  void tell(const std::vector<pugi::xml_node>& signals, const std::string& what) const {
    if (signals.empty()) return;
    net_.problems.push_back(railml_called(signals.front()) + told_as_more(signals.size()) + " has " + what +
                            "; on which side it stands is left open");
  }

  const Railml3Places& places_;
  RailNet& net_;
  std::vector<pugi::xml_node> on_both_sides_;
  std::vector<pugi::xml_node> without_direction_;
  std::vector<pugi::xml_node> against_;
};

}  // namespace

void read_signals3(const XmlSource& source, Railml3Places& places, RailNet& net) {
  Sides sides(places, net);
  for (const pugi::xml_node& of : descendants(source.root(), "signalIS")) {
    if (is_virtual(of)) continue;
    for (const NetPlace& place : places.of(of)) {
      net.tracks[place.track].track.marks.push_back(
          {LandmarkKind::mast, place.from_m, kMastBesideM * sides.of(of, place), kRailmlSigmaM, railml_name(of)});
    }
  }
  sides.tell();
}

}  // namespace railfix::track
