#include "track/import/xml/erju.hpp"

#include <algorithm>
#include <cmath>
#include <map>

#include "core/units.hpp"
#include "track/import/told.hpp"
#include "track/import/xml/erju_unread.hpp"
#include "track/import/xml/net_places.hpp"
#include "track/import/xml/xml_source.hpp"

namespace railfix::track {
namespace {

constexpr double kSurveyedM = 0.5;
constexpr double kLongestEdgeM = 1e6;
constexpr double kSlopePerUnit = 1e-4;  // slopes are tenths of a per mille
constexpr double kNearCoordinateM = 0.1;
constexpr double kSharpestRadiusM = 10.0;
constexpr double kOnEdgeM = 0.01;

double metres(double millimetres) {
  return 1e-3 * millimetres;
}

/// Values that are none.
struct LeftOut {
  size_t count = 0;
  std::string first{};  // "VALUE at 12.00 m"
  void add(const std::string& value, double at_m) {
    if (count++ == 0) first = value + " at " + told_m(at_m);
  }
};

class Reader {
 public:
  Reader(const std::filesystem::path& infra, const std::filesystem::path* map) : infra_(infra) {
    if (map != nullptr) map_.emplace(*map);
  }

  RailNet read() {
    read_edges();
    if (map_) read_coordinates();
    read_plan();
    tell_unread(infra_, net_.problems);
    read_links();
    read_balises();
    read_tunnels();
    read_marks("bridge", LandmarkKind::underbridge);
    read_marks("levelCrossing", LandmarkKind::level_crossing);
    read_marker_boards();
    read_platforms();
    read_speeds();
    return std::move(net_);
  }

 private:
  void read_edges() {
    for (const pugi::xml_node& edge : descendants(infra_.root(), "trackEdge")) {
      const std::string id = infra_.required_text(edge, "id");
      const double length = metres(infra_.required(edge, "trackEdgeLength"));
      if (!(length > 0 && length < kLongestEdgeM))
        throw infra_.wrong(edge, "track edge \"" + id + "\" must be between 0 and 1000 km long");
      if (!index_.emplace(id, net_.tracks.size()).second)
        throw infra_.wrong(edge, "track edge \"" + id + "\" is there twice");
      NetTrack& track = net_.tracks.emplace_back();
      track.track.name = id;
      track.length_m = length;
    }
    if (net_.tracks.empty()) throw core::BadInput(infra_.file_name() + " holds no <trackEdge>");
  }

  [[nodiscard]] size_t track_of(const XmlSource& source, const pugi::xml_node& node, const char* attribute) const {
    const std::string id = source.required_text(node, attribute);
    const auto found = index_.find(id);
    if (found == index_.end())
      throw source.wrong(
          node, "<" + std::string(node.name()) + "> names the track edge \"" + id + "\", which does not exist");
    return found->second;
  }

  void read_coordinates() {
    const pugi::xml_node area = map_->root().child("mapAreas").child("mapArea");
    const std::string epsg = map_->required_text(area, "epsg");
    net_.crs = "EPSG:" + epsg;
    for (const pugi::xml_node& edge : descendants(area, "trackEdgeProjection")) {
      NetTrack& track = net_.tracks[track_of(*map_, edge, "id")];
      for (const pugi::xml_node& point : descendants(edge, "coordinate")) {
        const Eigen::Vector2d at(map_->required(point, "x"), map_->required(point, "y"));
        if (track.shape.empty() || (track.shape.back() - at).norm() > kNearCoordinateM) track.shape.push_back(at);
      }
      if (track.shape.size() < 2)
        net_.problems.push_back("track edge \"" + track.track.name + "\" has fewer than two coordinates");
    }
    replace_old_system();
  }

  /// Old numbers of the German Gauss-Krueger zones, which PROJ has not: the zone stands before the easting.
  void replace_old_system() {
    if (net_.crs < "EPSG:31491" || net_.crs > "EPSG:31495" || net_.crs.size() != 10) return;
    if (Projection::open(net_.crs).ok() || net_.tracks.front().shape.empty()) return;
    const int zone = static_cast<int>(net_.tracks.front().shape.front().x() / 1e6);
    if (zone < 2 || zone > 5) return;
    const std::string known = "EPSG:" + std::to_string(31464 + zone);
    net_.problems.push_back("the map says " + net_.crs + ", which PROJ does not know; its eastings are of zone " +
                            std::to_string(zone) + ", so " + known + " is taken");
    net_.crs = known;
  }

  /// Cant, slopes, and the azimuths where there are no coordinates.
  void read_plan() {
    for (const pugi::xml_node& geometry : descendants(infra_.root(), "trackEdgeGeometry")) {
      NetTrack& track = net_.tracks[track_of(infra_, geometry, "id")];
      read_cant(geometry, track);
      if (track.shape.size() < 2) read_azimuths(geometry, track);
    }
    for (const pugi::xml_node& sampled : descendants(infra_.root(), "sampledTrackEdgeGeometry")) {
      NetTrack& track = net_.tracks[track_of(infra_, sampled, "id")];
      for (const pugi::xml_node& slope : descendants(sampled, "slope")) {
        track.slopes.push_back(
            {metres(infra_.required(slope, "pos")), kSlopePerUnit * infra_.required(slope, "samplePointSlope")});
      }
    }
    for (NetTrack& track : net_.tracks) {
      const auto by_offset = [](const auto& a, const auto& b) { return a.offset_m < b.offset_m; };
      std::stable_sort(track.cant.begin(), track.cant.end(), by_offset);
      std::stable_sort(track.slopes.begin(), track.slopes.end(), by_offset);
    }
  }

  void read_cant(const pugi::xml_node& geometry, NetTrack& track) {
    LeftOut left_out;
    for (const pugi::xml_node& point : descendants(geometry, "cantPoint")) {
      const CantPoint cant{metres(infra_.required(point, "trackGeometryPos")),
                           metres(infra_.required(point, "appliedCant"))};
      if (is_cant(cant.cant_m)) {
        track.cant.push_back(cant);
      } else {
        left_out.add(std::string("appliedCant ") + point.attribute("appliedCant").value() + " mm", cant.offset_m);
      }
    }
    tell(left_out, std::string(kNoTrackHas) + "; left out", track);
  }

  /// Headings of short straights, walked from the origin.
  void read_azimuths(const pugi::xml_node& geometry, NetTrack& track) {
    std::vector<std::pair<double, double>> stations;  // metres, radians
    for (const char* kind : {"horizontalSegmentLine", "horizontalSegmentArc", "horizontalSegmentTransition"}) {
      for (const pugi::xml_node& item : descendants(geometry, kind)) {
        stations.emplace_back(metres(infra_.required(item, "trackGeometryPos")),
                              core::rad_from_deg(infra_.required(item, "azimuth")));
      }
    }
    std::sort(stations.begin(), stations.end());
    add_bends(stations, track);
  }

  /// A track measured to and fro turns back for a metre or two: such azimuths are left out.
  void add_bends(const std::vector<std::pair<double, double>>& stations, NetTrack& track) {
    std::vector<std::pair<double, double>> crooked;  // station, turn
    const auto turn_of = [&](size_t a, size_t b) { return core::wrap_pi(stations[b].second - stations[a].second); };
    const auto is_crooked = [&](size_t a, size_t b) {
      return std::abs(turn_of(a, b)) * kSharpestRadiusM > stations[b].first - stations[a].first;
    };
    size_t before = 0;
    if (stations.size() > 2 && is_crooked(0, 1) && is_crooked(0, 2) && !is_crooked(1, 2)) {
      crooked.emplace_back(stations[0].first, std::abs(turn_of(0, 1)));
      before = 1;  // it is the first one that is wrong
    }
    for (size_t i = before + 1; i < stations.size(); ++i) {
      const double length = stations[i].first - stations[before].first;
      if (length < kNearCoordinateM) continue;
      const double turn = turn_of(before, i);
      if (is_crooked(before, i)) {
        crooked.emplace_back(stations[i].first, std::abs(turn));
        continue;
      }
      track.bends.push_back({stations[before].first, stations[i].first, -turn / length, -turn / length});
      before = i;
    }
    if (crooked.empty()) return;
    const auto sharpest = std::ranges::max_element(crooked, {}, [](const auto& one) { return one.second; });
    net_.problems.push_back("track edge \"" + track.track.name + "\" turns at once by up to " +
                            told_deg(sharpest->second) + " at " + std::to_string(crooked.size()) +
                            " of its azimuths, the first at " + told_m(crooked.front().first) +
                            "; left out, as a track that was measured to and fro");
  }

  void read_links() {
    std::map<std::string, std::pair<size_t, std::string>> branch;  // link -> side, switch
    std::map<std::string, std::string> switch_of;
    for (const pugi::xml_node& point : descendants(infra_.root(), "simplePoint")) {
      for (const auto& [side, name] : {std::pair(1, "pointLeft"), std::pair(2, "pointRight")})
        branch[infra_.required_text(point, name)] = {side, infra_.required_text(point, "id")};
    }
    for (const pugi::xml_node& node : descendants(infra_.root(), "trackEdgeLink")) {
      NetLink link;
      link.a = {track_of(infra_, node, "trackEdgeA"), !node.attribute("startOfA").as_bool()};
      link.b = {track_of(infra_, node, "trackEdgeB"), !node.attribute("startOfB").as_bool()};
      const auto found = branch.find(node.attribute("id").value());
      if (found != branch.end()) {
        link.switch_name = found->second.second;
        link.side = found->second.first == 1 ? 1 : -1;
      }
      net_.links.push_back(link);
    }
  }

  void read_balises() {
    for (const pugi::xml_node& node : descendants(infra_.root(), "baliseGroup")) {
      const std::string id = node.attribute("id").value();
      const auto identity = etcs_identity(infra_.required(node, "nid_c"), infra_.required(node, "nid_bg"));
      if (!identity) throw infra_.wrong(node, "balise group \"" + id + "\" has " + kNoEtcsIdentity);
      TrackGroup group;
      group.nid_c = identity->nid_c;
      group.nid_bg = identity->nid_bg;
      group.nominal_is_forward = std::string(node.attribute("linkOrientationDirection").value()) != "dirReverse";
      group.q_locacc_m = 1;
      std::optional<size_t> on;
      for (const pugi::xml_node& balise : node.child("balises").children("balise")) {
        const pugi::xml_node spot = balise.child("spotLocation");
        const size_t track = track_of(infra_, spot, "trackEdge");
        if (on && *on != track) {
          net_.problems.push_back("balise group \"" + id + "\" lies on two track edges; only its balises on \"" +
                                  net_.tracks[*on].track.name + "\" are kept");
          continue;
        }
        on = track;
        const double at = metres(infra_.required(spot, "pos"));
        if (at > net_.tracks[track].length_m + kOnEdgeM)
          net_.problems.push_back("balise \"" + std::string(balise.attribute("id").value()) +
                                  "\" lies beyond the end of its track edge");
        group.balises.push_back({LandmarkKind::balise, at, 0, kSurveyedM, balise.attribute("id").value()});
      }
      if (!on) {
        net_.problems.push_back("balise group \"" + id + "\" has no balises; it is left out");
        continue;
      }
      group.offset_m = group.balises.front().offset_m;
      net_.tracks[*on].track.groups.push_back(std::move(group));
    }
  }

  static std::string id_of(const pugi::xml_node& node) {
    const std::string id = node.attribute("id").value();
    return id.empty() ? node.attribute("tunnelIdentification").value() : id;  // all that a tunnel has by the schema
  }

  void read_tunnels() {
    for (const pugi::xml_node& node : descendants(infra_.root(), "tunnel")) {
      for (const NetSpot& spot : portals_of(net_, places_of(node)))
        net_.tracks[spot.track].track.marks.push_back(portal(spot, kSurveyedM, id_of(node)));
    }
  }

  /// Things in the middle of a section of a track edge (bridge), or at a spot of it (level crossing).
  void read_marks(const char* name, LandmarkKind kind) {
    for (const pugi::xml_node& node : descendants(infra_.root(), name)) {
      for (const NetPlace& place : places_of(node)) {
        net_.tracks[place.track].track.marks.push_back(
            {kind, 0.5 * (place.from_m + place.to_m), 0, kSurveyedM, id_of(node)});
      }
    }
  }

  /// Sections and spots; those that are not on their track edge are told.
  std::vector<NetPlace> places_of(const pugi::xml_node& node) {
    std::vector<NetPlace> out;
    const auto add = [&](size_t track, double from_m, double to_m) {
      const double length_m = net_.tracks[track].length_m;
      if (from_m < 0 || to_m > length_m + kOnEdgeM || from_m > to_m + kOnEdgeM) {
        net_.problems.push_back("<" + std::string(node.name()) + "> \"" + id_of(node) +
                                "\" is not on its track edge \"" + net_.tracks[track].track.name +
                                "\"; it is left out there");
      } else {
        out.push_back({track, from_m, std::max(from_m, to_m)});
      }
    };
    for (const pugi::xml_node& section : descendants(node, "trackEdgeSection")) {
      const size_t track = track_of(infra_, section, "trackEdge");
      const double skipped_m = metres(infra_.number(section, "skipFromEnd").value_or(0));
      add(track, metres(infra_.number(section, "skipFromStart").value_or(0)), net_.tracks[track].length_m - skipped_m);
    }
    for (const pugi::xml_node& spot : descendants(node, "spotLocation")) {
      const double at_m = metres(infra_.required(spot, "pos"));
      add(track_of(infra_, spot, "trackEdge"), at_m, at_m);
    }
    return out;
  }

  /// Boards of ETCS stand on masts, as signals do. Which side they stand on is not said.
  void read_marker_boards() {
    for (const pugi::xml_node& board : descendants(infra_.root(), "etcsMarker")) {
      const pugi::xml_node spot = board.child("dirSpotLocation");
      if (!spot) continue;  // elsewhere the element only names one
      NetTrack& track = net_.tracks[track_of(infra_, spot, "trackEdge")];
      const double at_m = metres(infra_.required(spot, "pos"));
      const std::string id = board.attribute("id").value();
      if (at_m >= 0 && at_m <= track.length_m) {
        track.track.marks.push_back({LandmarkKind::mast, at_m, 0, kSurveyedM, id});
      } else {
        net_.problems.push_back("ETCS marker board \"" + id + "\" is not on its track edge; it is left out");
      }
    }
  }

  /// Both ends of every edge of a platform, along a path of track edges. Which side it lies on is not said.
  void read_platforms() {
    for (const pugi::xml_node& node : descendants(infra_.root(), "platformEdge")) {
      const pugi::xml_node location = node.child("linearLocation");
      const std::vector<pugi::xml_node> path = descendants(location, "dirTrackEdge");
      double length_m = 0;
      for (const pugi::xml_node& edge : path) length_m += net_.tracks[track_of(infra_, edge, "trackEdge")].length_m;
      const double from_m = metres(infra_.number(location, "skipFromPathStart").value_or(0));
      const double to_m = length_m - metres(infra_.number(location, "skipFromPathEnd").value_or(0));
      if (from_m < 0 || to_m > length_m || from_m > to_m) {
        net_.problems.push_back("platform edge \"" + platform_name(node) +
                                "\" is not on its track edges; it is left out");
        continue;
      }
      add_on_path(path, from_m, platform_name(node));
      add_on_path(path, to_m, platform_name(node));
    }
  }

  static std::string platform_name(const pugi::xml_node& edge) {
    const std::string name = edge.attribute("name").value();
    return name.empty() ? edge.attribute("platformId").value() : name;
  }

  void add_on_path(const std::vector<pugi::xml_node>& path, double along_m, const std::string& name) {
    for (const pugi::xml_node& edge : path) {
      NetTrack& track = net_.tracks[track_of(infra_, edge, "trackEdge")];
      if (along_m > track.length_m && edge != path.back()) {
        along_m -= track.length_m;
        continue;
      }
      const bool same = edge.attribute("sameDir").as_bool(true);
      const double offset_m = std::clamp(same ? along_m : track.length_m - along_m, 0.0, track.length_m);
      track.track.marks.push_back({LandmarkKind::platform, offset_m, 0, kSurveyedM, name});
      return;
    }
  }

  /// A static limit holds from its place on, as the train runs, up to the next one.
  void read_speeds() {
    for (const pugi::xml_node& profile : descendants(infra_.root(), "teSpeedProfile")) {
      NetTrack& track = net_.tracks[track_of(infra_, profile, "id")];
      for (const Direction running : {Direction::forward, Direction::reverse}) {
        const char* way = running == Direction::forward ? "sameDirProfile" : "oppositeDirProfile";
        std::vector<std::pair<double, double>> changes;  // metres, m/s
        LeftOut left_out;
        for (const pugi::xml_node& item : descendants(profile.child(way), "staticSpeedProfileItem")) {
          const double at_m = metres(infra_.required(item, "pos"));
          const double kmh = infra_.required(item, "speed");
          if (!is_speed(kmh))
            left_out.add(std::string(way) + " speed " + item.attribute("speed").value() + " km/h", at_m);
          changes.emplace_back(at_m, core::mps_from_kmh(is_speed(kmh) ? kmh : 0));
        }
        tell(left_out, std::string(kNoTrainRuns) + "; no limit begins there", track);
        add_speeds(changes, running, track.length_m, track.track);
      }
    }
  }

  /// One sentence for all of a kind on one track edge: where one value is in the wrong unit, they all are.
  void tell(const LeftOut& left_out, const std::string& why, const NetTrack& track) {
    if (left_out.count == 0) return;
    const std::string more = left_out.count > 1 ? " and " + std::to_string(left_out.count - 1) + " more like it" : "";
    net_.problems.push_back("track edge \"" + track.track.name + "\" has " + left_out.first + more + ", " + why);
  }

  XmlSource infra_;
  std::optional<XmlSource> map_;
  RailNet net_;
  std::map<std::string, size_t> index_;
};

}  // namespace

core::Result<RailNet> read_erju(const std::filesystem::path& infra, const std::filesystem::path* map) {
  try {
    return Reader(infra, map).read();
  } catch (const core::BadInput& bad) {
    return core::Error{bad.what()};
  }
}

}  // namespace railfix::track
