#include <algorithm>
#include <cmath>
#include <map>
#include <set>

#include "core/units.hpp"
#include "track/import/xml/railml3_balises.hpp"
#include "track/import/xml/railml3_curves.hpp"
#include "track/import/xml/railml3_signals.hpp"
#include "track/import/xml/railml3_slopes.hpp"
#include "track/import/xml/railml_plane.hpp"
#include "track/import/xml/railml_readers.hpp"

namespace railfix::track {
namespace {

class Railml3Reader {
 public:
  explicit Railml3Reader(const XmlSource& source) : source_(source), places_(source, net_), plane_(source) {}

  RailNet read() {
    read_systems();
    read_elements();
    read_relations();
    read_switches();
    read_curves3(source_, places_, net_);
    read_slopes3(source_, places_, net_);
    tell_cant();
    read_marks();
    read_speeds();
    read_balises3(source_, places_, net_);
    return std::move(net_);
  }

 private:
  /// Which coordinate system every positioning system means.
  void read_systems() {
    for (const pugi::xml_node& system : descendants(source_.root(), "geometricPositioningSystem"))
      crs_of_[system.attribute("id").value()] = system.attribute("crsDefinition").value();
  }

  void read_elements() {
    for (const pugi::xml_node& element : descendants(source_.root(), "netElement")) {
      const auto length = source_.number(element, "length");
      // Elements made of others are the same tracks once more, coarser.
      const bool made_of_others =
          element.child("elementCollectionUnordered") || element.child("elementCollectionOrdered");
      if (made_of_others || !length) {
        const std::string coarse = element.attribute("id").value();
        places_.add_coarse(coarse);
        if (!made_of_others) net_.problems.push_back("net element " + coarse + " has no length and is left out");
        continue;
      }
      const std::string id = source_.required_text(element, "id");
      if (!(*length > 0 && *length < 1e6))
        throw source_.wrong(element, "net element \"" + id + "\" must be between 0 and 1000 km long");
      places_.add_track(element, net_.tracks.size());
      NetTrack& track = net_.tracks.emplace_back();
      track.track.name = id;
      track.length_m = *length;
      read_shape(element, track);
    }
    if (std::ranges::any_of(net_.tracks, &NetTrack::has_shape)) net_.crs = plane_.crs();
    if (net_.tracks.empty()) throw core::BadInput(source_.file_name() + " holds no <netElement> with a length");
    for (const pugi::xml_node& node : descendants(source_.root(), "track")) {
      for (const NetPlace& place : places_.of(node)) {
        ImportedTrack& track = net_.tracks[place.track].track;
        if (!track.line.empty()) continue;
        track.line = node.attribute("id").value();
        track.name += " " + railml_name(node);
      }
    }
  }

  /// In degrees x is the longitude and y the latitude.
  void read_shape(const pugi::xml_node& element, NetTrack& track) {
    std::vector<std::pair<double, Eigen::Vector2d>> points;
    for (const pugi::xml_node& place : descendants(element, "intrinsicCoordinate")) {
      for (const pugi::xml_node& at : place.children("geometricCoordinate")) {
        const std::string crs = crs_of_[at.attribute("positioningSystemRef").value()];
        if (crs.empty()) continue;
        const double x = source_.required(at, "x");
        const double y = source_.required(at, "y");
        points.emplace_back(source_.required(place, "intrinsicCoord"),
                            is_geographic(crs) ? plane_.at(at, crs, y, x) : plane_.at(at, crs, x, y));
      }
    }
    std::stable_sort(points.begin(), points.end(), [](const auto& a, const auto& b) { return a.first < b.first; });
    if (points.empty()) return;
    if (points.front().first * track.length_m > kNearEndM || (1 - points.back().first) * track.length_m > kNearEndM) {
      net_.problems.push_back("track " + track.track.name + " " + kNotFromEndToEnd + "; not used");
      return;
    }
    for (const auto& [along, at] : points) {
      if (track.shape.empty() || (track.shape.back() - at).norm() > 0.05) track.shape.push_back(at);
    }
  }

  static std::string names_no_element(const std::string& relation, const std::string& element) {
    return "net relation \"" + relation + "\" names the net element \"" + element + "\", which does not exist";
  }

  void read_relations() {
    for (const pugi::xml_node& relation : descendants(source_.root(), "netRelation")) {
      const std::string id = relation.attribute("id").value();
      const std::string a = relation.child("elementA").attribute("ref").value();
      const std::string b = relation.child("elementB").attribute("ref").value();
      for (const std::string& end : {a, b}) {
        if (!places_.track(end) && !places_.is_coarse(end)) {
          throw source_.wrong(relation, names_no_element(id, end));
        }
      }
      if (!places_.track(a) || !places_.track(b)) {
        places_.add_coarse(id);
        continue;
      }
      NetLink link;
      link.a = {*places_.track(a), source_.required(relation, "positionOnA") > 0.5};
      link.b = {*places_.track(b), source_.required(relation, "positionOnB") > 0.5};
      link.passable = std::string(relation.attribute("navigability").value()) != "None";
      link_of_[id] = net_.links.size();
      net_.links.push_back(link);
    }
  }

  void read_switches() {
    for (const pugi::xml_node& points : descendants(source_.root(), "switchIS")) {
      const std::string branch_course = points.attribute("branchCourse").value();
      const bool has_turning = points.child("turningBranch");
      bool has_branch = false;
      for (const pugi::xml_node& branch : points.children()) {
        const std::string relation = branch.attribute("netRelationRef").value();
        const auto link = link_of_.find(relation);
        if (link == link_of_.end()) {
          if (!relation.empty() && !places_.is_coarse(relation))
            places_.tell_missing(points, "net relation", relation,
                                 "its <" + std::string(branch.name()) + "> is left out");
          continue;
        }
        NetLink& way = net_.links[link->second];
        way.switch_name = railml_name(points);
        has_branch = true;
        const std::string kind = branch.name();
        if (has_turning) {
          way.diverging = way.diverging || kind == "turningBranch";
          if (way.side == 0) way.side = 1;
        } else if (!branch_course.empty()) {
          way.diverging = kind == branch_course + "Branch";
          way.side = kind == "leftBranch" ? 1 : -1;
        }
      }
      if (!has_branch)
        net_.problems.push_back(railml_called(points) + " has no branch over a net relation; it is left out");
    }
  }

  void add(LandmarkKind kind, const NetPlace& place, double offset_m, double lateral_m, const pugi::xml_node& of) {
    net_.tracks[place.track].track.marks.push_back(
        {kind, offset_m, place.same_direction ? lateral_m : -lateral_m, kRailmlSigmaM, railml_name(of)});
  }

  void add_portals(const pugi::xml_node& of) {
    for (const NetSpot& spot : portals_of(net_, places_.of(of)))
      net_.tracks[spot.track].track.marks.push_back(portal(spot, kRailmlSigmaM, railml_name(of)));
  }

  /// Where the whole platform begins and ends, not every net element's part of it.
  void add_platform(double lateral_m, const pugi::xml_node& of) {
    const std::vector<NetPlace> places = places_.of(of);
    for (const NetSpot& spot : ends_of(net_, places))
      add(LandmarkKind::platform, places[spot.place], spot.offset_m, lateral_m, of);
  }

  void add_middles(LandmarkKind kind, const pugi::xml_node& of) {
    for (const auto& [track, offset_m] : middles(net_, places_.of(of)))
      net_.tracks[track].track.marks.push_back({kind, offset_m, 0, kRailmlSigmaM, railml_name(of)});
  }

  void read_marks() {
    for (const pugi::xml_node& of : descendants(source_.root(), "overCrossing")) {
      if (std::string(of.attribute("constructionType").value()) == "tunnel") {
        add_portals(of);
      } else {
        add_middles(LandmarkKind::bridge, of);
      }
    }
    for (const pugi::xml_node& of : descendants(source_.root(), "underCrossing"))
      add_middles(LandmarkKind::underbridge, of);
    for (const pugi::xml_node& of : descendants(source_.root(), "levelCrossingIS"))
      add_middles(LandmarkKind::level_crossing, of);
    for (const pugi::xml_node& of : descendants(source_.root(), "platformEdge")) {
      const pugi::xml_node sided =
          of.find_node([](const pugi::xml_node& node) { return node.attribute("lateralSide"); });
      add_platform(kPlatformEdgeM * left_of(sided.attribute("lateralSide").value()), of);
    }
    read_signals3(source_, places_, net_);
  }

  /// The schemas of railML 3.1 to 3.3 have no word for cant (wiki3.railml.org, IS:geometryPoint and its neighbours):
  /// what says it is someone's extension, and its unit and sign are not guessed at.
  void tell_cant() {
    const pugi::xml_node first = source_.root().find_node([](const pugi::xml_node& node) {
      return std::string_view(node.name()) == "superelevationCurve" || node.attribute("superelevation");
    });
    if (!first) return;
    net_.problems.push_back(
        railml_called(first) +
        " says something of cant, perhaps as others do: railML 3 has no word for it and does not "
        "say its unit and sign; all of it is left out, cant is read from railML 2, ERJU and LandXML");
  }

  void read_speeds() {
    const std::set<std::string> special = special_speed_profiles(source_);
    for (const pugi::xml_node& section : descendants(source_.root(), "speedSection")) {
      const auto speed = source_.number(section, "maxSpeed");
      if (!speed) continue;
      const auto profiles = section.children("validForSpeedProfile");
      const bool is_special = !profiles.empty() && std::all_of(profiles.begin(), profiles.end(), [&](const auto& of) {
        return special.contains(of.attribute("ref").value());
      });
      if (is_special || section.attribute("isTemporary").as_bool()) continue;
      if (*speed <= 0 || !is_speed(*speed)) {
        net_.problems.push_back(railml_called(section) + " has maxSpeed " + section.attribute("maxSpeed").value() +
                                " km/h, " + kNoTrainRuns + "; it is left out");
        continue;
      }
      const pugi::xml_node location = section.child("linearLocation");
      const std::string applies = location.attribute("applicationDirection").value();
      for (const NetPlace& place : places_.of(section)) {
        Direction running = Direction::unknown;
        if (applies == "normal" || applies == "reverse")
          running = (applies == "normal") == place.same_direction ? Direction::forward : Direction::reverse;
        if (place.to_m > place.from_m) {
          net_.tracks[place.track].track.speed_limits.push_back(
              {place.from_m, place.to_m, core::mps_from_kmh(*speed), running});
        }
      }
    }
  }

  const XmlSource& source_;
  RailNet net_;
  Railml3Places places_;
  RailmlPlane plane_;
  std::map<std::string, size_t> link_of_;
  std::map<std::string, std::string> crs_of_;
};

}  // namespace

RailNet read_railml3(const XmlSource& source) {
  return Railml3Reader(source).read();
}

}  // namespace railfix::track
