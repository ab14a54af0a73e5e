#include <algorithm>
#include <cmath>
#include <map>
#include <set>

#include "core/units.hpp"
#include "track/import/xml/net_places.hpp"
#include "track/import/xml/railml_readers.hpp"

namespace railfix::track {
namespace {

class Reader {
 public:
  explicit Reader(const XmlSource& source) : source_(source) {}

  RailNet read() {
    read_systems();
    read_elements();
    read_relations();
    read_switches();
    read_plan();
    read_marks();
    read_speeds();
    read_balises();
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
      if (element.child("elementCollectionUnordered") || element.child("elementCollectionOrdered") || !length) {
        coarse_.insert(element.attribute("id").value());
        continue;
      }
      const std::string id = source_.required_text(element, "id");
      if (!(*length > 0 && *length < 1e6))
        throw source_.wrong(element, "net element \"" + id + "\" must be between 0 and 1000 km long");
      if (!index_.emplace(id, net_.tracks.size()).second)
        throw source_.wrong(element, "net element \"" + id + "\" is there twice");
      NetTrack& track = net_.tracks.emplace_back();
      track.track.name = id;
      track.length_m = *length;
      read_shape(element, track);
    }
    if (net_.tracks.empty()) throw core::BadInput(source_.file_name() + " holds no <netElement> with a length");
    for (const pugi::xml_node& node : descendants(source_.root(), "track")) {
      for (const NetPlace& place : places_of(node)) {
        ImportedTrack& track = net_.tracks[place.track].track;
        if (!track.line.empty()) continue;
        track.line = node.attribute("id").value();
        track.name += " " + railml_name(node);
      }
    }
  }

  void read_shape(const pugi::xml_node& element, NetTrack& track) {
    std::vector<std::pair<double, Eigen::Vector2d>> points;
    for (const pugi::xml_node& place : descendants(element, "intrinsicCoordinate")) {
      for (const pugi::xml_node& at : place.children("geometricCoordinate")) {
        const std::string crs = crs_of_[at.attribute("positioningSystemRef").value()];
        if (crs.empty()) continue;
        if (!net_.crs.empty() && crs != net_.crs) {
          throw source_.wrong(at, "coordinates in both " + net_.crs + " and " + crs + "; only one system can be read");
        }
        net_.crs = crs;
        points.emplace_back(source_.required(place, "intrinsicCoord"),
                            Eigen::Vector2d(source_.required(at, "x"), source_.required(at, "y")));
      }
    }
    std::stable_sort(points.begin(), points.end(), [](const auto& a, const auto& b) { return a.first < b.first; });
    for (const auto& [along, at] : points) {
      if (track.shape.empty() || (track.shape.back() - at).norm() > 0.05) track.shape.push_back(at);
    }
  }

  [[nodiscard]] size_t track_of(const pugi::xml_node& node, const std::string& id) const {
    const auto found = index_.find(id);
    if (found == index_.end())
      throw source_.wrong(
          node, "<" + std::string(node.name()) + "> names the net element \"" + id + "\", which does not exist");
    return found->second;
  }

  [[nodiscard]] std::optional<size_t> find_track(const pugi::xml_node& of, const pugi::xml_node& location) {
    const std::string id = location.attribute("netElementRef").value();
    const auto found = index_.find(id);
    if (found != index_.end()) return found->second;
    if (!coarse_.contains(id)) tell_missing(of, "net element", id, "it is left out there");
    return std::nullopt;
  }

  void tell_missing(const pugi::xml_node& of, const std::string& kind, const std::string& id,
                    const std::string& therefore) {
    net_.problems.push_back("<" + std::string(of.name()) + "> \"" + railml_name(of) + "\" names the " + kind + " \"" +
                            id + "\", which does not exist; " + therefore);
  }

  [[nodiscard]] double within(const pugi::xml_node& of, double at_m, double length_m) {
    if (at_m < -kNetTouchM || at_m > length_m + kNetTouchM) {
      net_.problems.push_back("<" + std::string(of.name()) + "> \"" + railml_name(of) + "\" lies at " +
                              std::to_string(at_m) + " m of a net element of " + std::to_string(length_m) +
                              " m; it is put to its end");
    }
    return std::clamp(at_m, 0.0, length_m);
  }

  /// Where an element lies; what lies on coarser net elements only is left out.
  [[nodiscard]] std::vector<NetPlace> places_of(const pugi::xml_node& node) {
    std::vector<NetPlace> out;
    for (const pugi::xml_node& part : descendants(node, "associatedNetElement")) {
      const std::optional<size_t> track = find_track(node, part);
      if (!track) continue;
      const double length = net_.tracks[*track].length_m;
      const auto along_m = [&](const char* pos, const char* part_of_length, double otherwise) {
        const double share = source_.number(part, part_of_length).value_or(otherwise);
        return source_.number(part, pos).value_or(share * length);
      };
      const double from = along_m("posBegin", "intrinsicCoordBegin", 0);
      const double to = along_m("posEnd", "intrinsicCoordEnd", 1);
      const bool turned = std::string(part.attribute("keepsOrientation").value()) == "false";
      out.push_back({*track, within(node, std::min(from, to), length), within(node, std::max(from, to), length),
                     from <= to && !turned});
    }
    if (!out.empty()) return out;
    for (const pugi::xml_node& spot : descendants(node, "spotLocation")) {
      const std::optional<size_t> track = find_track(node, spot);
      if (!track) continue;
      const double length = net_.tracks[*track].length_m;
      const auto along = source_.number(spot, "intrinsicCoord");
      const double at = within(node, source_.number(spot, "pos").value_or(along.value_or(0) * length), length);
      out.push_back({*track, at, at, std::string(spot.attribute("applicationDirection").value()) != "reverse"});
    }
    return out;
  }

  void read_relations() {
    for (const pugi::xml_node& relation : descendants(source_.root(), "netRelation")) {
      const std::string id = relation.attribute("id").value();
      const std::string a = relation.child("elementA").attribute("ref").value();
      const std::string b = relation.child("elementB").attribute("ref").value();
      for (const std::string& end : {a, b}) {
        if (!index_.contains(end) && !coarse_.contains(end)) {
          throw source_.wrong(
              relation, "net relation \"" + id + "\" names the net element \"" + end + "\", which does not exist");
        }
      }
      if (!index_.contains(a) || !index_.contains(b)) {
        coarse_.insert(id);
        continue;
      }
      NetLink link;
      link.a = {track_of(relation, a), source_.required(relation, "positionOnA") > 0.5};
      link.b = {track_of(relation, b), source_.required(relation, "positionOnB") > 0.5};
      link.passable = std::string(relation.attribute("navigability").value()) != "None";
      link_of_[id] = net_.links.size();
      net_.links.push_back(link);
    }
  }

  void read_switches() {
    for (const pugi::xml_node& points : descendants(source_.root(), "switchIS")) {
      const std::string branch_course = points.attribute("branchCourse").value();
      const bool has_turning = points.child("turningBranch");
      for (const pugi::xml_node& branch : points.children()) {
        const std::string relation = branch.attribute("netRelationRef").value();
        const auto link = link_of_.find(relation);
        if (link == link_of_.end()) {
          if (!relation.empty() && !coarse_.contains(relation))
            tell_missing(points, "net relation", relation, "its <" + std::string(branch.name()) + "> is left out");
          continue;
        }
        NetLink& way = net_.links[link->second];
        way.switch_name = railml_name(points);
        const std::string kind = branch.name();
        if (has_turning) {
          way.diverging = way.diverging || kind == "turningBranch";
          if (way.side == 0) way.side = 1;
        } else if (!branch_course.empty()) {
          way.diverging = kind == branch_course + "Branch";
          way.side = kind == "leftBranch" ? 1 : -1;
        }
      }
    }
  }

  void read_plan() {
    for (const pugi::xml_node& curve : descendants(source_.root(), "horizontalCurve")) {
      const std::string type = curve.attribute("curveType").value();
      const auto radius = source_.number(curve, "radius");
      if (!radius || *radius == 0 || (!type.empty() && type != "arc")) continue;
      if (std::abs(*radius) < 10) throw source_.wrong(curve, "a radius of less than 10 m is no railway's");
      for (const NetPlace& place : places_of(curve)) {
        const double curvature = (place.same_direction ? -1.0 : 1.0) / *radius;
        if (place.to_m > place.from_m)
          net_.tracks[place.track].bends.push_back({place.from_m, place.to_m, curvature, curvature});
      }
    }
    read_transitions();
    for (const pugi::xml_node& curve : descendants(source_.root(), "gradientCurve")) {
      const auto gradient = source_.number(curve, "gradient");
      if (!gradient) continue;
      for (const NetPlace& place : places_of(curve)) {
        const double grade = (place.same_direction ? 1e-3 : -1e-3) * *gradient;
        net_.tracks[place.track].slopes.push_back({place.from_m, grade});
      }
    }
    for (NetTrack& track : net_.tracks) {
      std::stable_sort(track.slopes.begin(), track.slopes.end(),
                       [](const NetSlope& a, const NetSlope& b) { return a.offset_m < b.offset_m; });
      std::sort(track.bends.begin(), track.bends.end(),
                [](const NetBend& a, const NetBend& b) { return a.from_m < b.from_m; });
    }
  }

  /// Clothoids and other transition curves lead from the curvature before them to the one behind; straight where the
  /// file has nothing there. All are taken as clothoids.
  void read_transitions() {
    std::vector<std::pair<size_t, NetBend>> found;
    for (const pugi::xml_node& curve : descendants(source_.root(), "horizontalCurve")) {
      const std::string type = curve.attribute("curveType").value();
      if (type.empty() || type == "arc" || type == "straight") continue;
      for (const NetPlace& place : places_of(curve)) {
        if (place.to_m - place.from_m < kNetTouchM) continue;
        NetBend bend{place.from_m, place.to_m, 0, 0};
        for (const NetBend& arc : net_.tracks[place.track].bends) {
          if (std::abs(arc.to_m - bend.from_m) < kNetTouchM) bend.curvature_start_per_m = arc.curvature_end_per_m;
          if (std::abs(arc.from_m - bend.to_m) < kNetTouchM) bend.curvature_end_per_m = arc.curvature_start_per_m;
        }
        if (bend.curvature_start_per_m == 0 && bend.curvature_end_per_m == 0) {
          net_.problems.push_back("horizontal curve \"" + std::string(curve.attribute("id").value()) + "\" of type " +
                                  type + " touches no arc; it is taken as a straight");
        }
        found.emplace_back(place.track, bend);
      }
    }
    for (const auto& [track, bend] : found) net_.tracks[track].bends.push_back(bend);
  }

  void add(LandmarkKind kind, const NetPlace& place, double offset_m, double lateral_m, const pugi::xml_node& of) {
    net_.tracks[place.track].track.marks.push_back(
        {kind, offset_m, place.same_direction ? lateral_m : -lateral_m, kRailmlSigmaM, railml_name(of)});
  }

  /// Where the whole thing begins and ends, not every net element's part of it.
  void add_ends(const std::vector<NetPlace>& places, LandmarkKind begin, LandmarkKind end, double lateral_m,
                const pugi::xml_node& of) {
    for (const NetPlace& place : places) {
      if (!goes_on(net_, places, place, false)) add(begin, place, place.from_m, lateral_m, of);
      if (!goes_on(net_, places, place, true)) add(end, place, place.to_m, lateral_m, of);
    }
  }

  /// A tunnel that goes on over one leg of a switch has its portal on the leg that leaves it: every way meets one.
  void add_portals(const pugi::xml_node& of) {
    const std::vector<NetPlace> places = places_of(of);
    add_ends(places, LandmarkKind::portal_in, LandmarkKind::portal_out, 0, of);
    std::set<NetEnd> legs;
    for (const NetPlace& place : places) {
      for (const bool at_end : {false, true}) {
        for (const NetEnd& leg : legs_outside(net_, places, place, at_end)) legs.insert(leg);
      }
    }
    for (const NetEnd& leg : legs) {
      NetTrack& outside = net_.tracks[leg.track];
      outside.track.marks.push_back({leg.at_end ? LandmarkKind::portal_in : LandmarkKind::portal_out,
                                     leg.at_end ? outside.length_m : 0.0, 0, kRailmlSigmaM, railml_name(of)});
    }
  }

  void add_middles(LandmarkKind kind, const pugi::xml_node& of) {
    for (const auto& [track, offset_m] : middles(net_, places_of(of)))
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
      const double lateral_m = platform_lateral_m(sided.attribute("lateralSide").value());
      add_ends(places_of(of), LandmarkKind::platform, LandmarkKind::platform, lateral_m, of);
    }
    for (const pugi::xml_node& of : descendants(source_.root(), "signalIS")) {
      for (const NetPlace& place : places_of(of)) add(LandmarkKind::mast, place, place.from_m, 0, of);
    }
  }

  void read_speeds() {
    const std::set<std::string> special = special_speed_profiles(source_);
    for (const pugi::xml_node& section : descendants(source_.root(), "speedSection")) {
      const auto speed = source_.number(section, "maxSpeed");
      if (!speed || *speed <= 0 || core::mps_from_kmh(*speed) >= SpeedLimit::kFastestMps) continue;
      const auto profiles = section.children("validForSpeedProfile");
      const bool is_special = !profiles.empty() && std::all_of(profiles.begin(), profiles.end(), [&](const auto& of) {
        return special.contains(of.attribute("ref").value());
      });
      if (is_special || section.attribute("isTemporary").as_bool()) continue;
      const pugi::xml_node location = section.child("linearLocation");
      const std::string applies = location.attribute("applicationDirection").value();
      for (const NetPlace& place : places_of(section)) {
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

  using PlacedBalises = std::vector<std::pair<NetPlace, pugi::xml_node>>;

  void read_balises() {
    std::map<std::string, PlacedBalises> of_group;
    const std::vector<pugi::xml_node> groups = descendants(source_.root(), "baliseGroup");
    for (const pugi::xml_node& group : groups) of_group[group.attribute("id").value()];
    for (const pugi::xml_node& balise : descendants(source_.root(), "balise")) {
      const std::vector<NetPlace> places = places_of(balise);
      if (places.empty()) continue;
      const std::string group = balise_group_of(balise);
      const bool is_known = of_group.contains(group);
      if (!group.empty() && !is_known) tell_missing(balise, "balise group", group, "it is kept as a landmark");
      if (group.empty() || !is_known) {
        add(LandmarkKind::balise, places.front(), places.front().from_m, 0, balise);
      } else {
        of_group[group].emplace_back(places.front(), balise);
      }
    }
    for (const pugi::xml_node& node : groups) {
      const auto identity = etcs_identity(source_, node);
      PlacedBalises& balises = of_group[node.attribute("id").value()];
      const std::vector<NetPlace> own = places_of(node);
      if (balises.empty() && !own.empty()) balises.emplace_back(own.front(), node);
      if (balises.empty()) continue;
      if (!identity) {
        net_.problems.push_back("balise group \"" + railml_name(node) +
                                "\" has no ETCS identity (countryID and groupID); its balises are kept as landmarks");
        for (const auto& [place, balise] : balises) add(LandmarkKind::balise, place, place.from_m, 0, balise);
        continue;
      }
      add_group(node, *identity, balises);
    }
  }

  /// A group lies on one track, that of its first balise.
  void add_group(const pugi::xml_node& of, const EtcsIdentity& identity, const PlacedBalises& balises) {
    const NetPlace& first = balises.front().first;
    ImportedTrack& track = net_.tracks[first.track].track;
    TrackGroup group{identity.nid_c, identity.nid_bg, first.from_m, first.same_direction, kRailmlSigmaM, {}};
    for (const auto& [place, balise] : balises) {
      if (place.track != first.track) {
        add(LandmarkKind::balise, place, place.from_m, 0, balise);
      } else {
        group.balises.push_back({LandmarkKind::balise, place.from_m, 0, kRailmlSigmaM, railml_name(balise)});
      }
    }
    if (group.balises.size() < balises.size())
      net_.problems.push_back("balise group \"" + railml_name(of) +
                              "\" lies on two net elements; only its balises on \"" + track.name +
                              "\" are kept in it, the others as landmarks");
    track.groups.push_back(std::move(group));
  }

  const XmlSource& source_;
  RailNet net_;
  std::map<std::string, size_t> index_;
  std::set<std::string> coarse_;  // net elements made of others, and relations between them
  std::map<std::string, size_t> link_of_;
  std::map<std::string, std::string> crs_of_;
};

}  // namespace

RailNet read_railml3(const XmlSource& source) {
  return Reader(source).read();
}

}  // namespace railfix::track
