#include "track/import/xml/erju.hpp"

#include <algorithm>
#include <cmath>
#include <map>

#include "core/units.hpp"
#include "track/import/xml/erju_plan.hpp"
#include "track/import/xml/erju_unread.hpp"
#include "track/import/xml/net_places.hpp"
#include "track/import/xml/xml_source.hpp"

namespace railfix::track {
namespace {

constexpr double kSurveyedM = 0.5;
constexpr double kNearCoordinateM = 0.1;
constexpr double kOnEdgeM = 0.01;

class ErjuReader {
 public:
  ErjuReader(const std::filesystem::path& infra, const std::filesystem::path* map)
      : infra_(infra), edges_(infra_, net_) {
    if (map != nullptr) map_.emplace(*map);
  }

  RailNet read() {
    if (map_) read_coordinates();
    read_erju_plan(infra_, edges_, net_);
    tell_unread(infra_, net_.problems);
    read_links();
    read_balises();
    read_tunnels();
    read_marks("bridge", LandmarkKind::underbridge);
    read_underpasses();
    read_marks("levelCrossing", LandmarkKind::level_crossing);
    read_marker_boards();
    read_platforms();
    read_speeds();
    return std::move(net_);
  }

 private:
  void read_coordinates() {
    const pugi::xml_node area = map_->root().child("mapAreas").child("mapArea");
    const std::string epsg = map_->required_text(area, "epsg");
    net_.crs = "EPSG:" + epsg;
    for (const pugi::xml_node& edge : descendants(area, "trackEdgeProjection")) {
      NetTrack& track = net_.tracks[edges_.track_of(*map_, edge, "id")];
      for (const pugi::xml_node& point : descendants(edge, "coordinate")) {
        const Eigen::Vector2d at(map_->required(point, "x"), map_->required(point, "y"));
        if (!is_place(at)) throw map_->wrong(point, "<coordinate> has " + std::string(kNoPlace));
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

  void read_links() {
    std::map<std::string, std::pair<size_t, std::string>> branch;  // link -> side, switch
    std::map<std::string, std::string> switch_of;
    for (const pugi::xml_node& point : descendants(infra_.root(), "simplePoint")) {
      for (const auto& [side, name] : {std::pair(1, "pointLeft"), std::pair(2, "pointRight")})
        branch[infra_.required_text(point, name)] = {side, infra_.required_text(point, "id")};
    }
    for (const pugi::xml_node& node : descendants(infra_.root(), "trackEdgeLink")) {
      NetLink link;
      link.a = {edges_.track_of(infra_, node, "trackEdgeA"), !node.attribute("startOfA").as_bool()};
      link.b = {edges_.track_of(infra_, node, "trackEdgeB"), !node.attribute("startOfB").as_bool()};
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
      const std::string called = "balise group \"" + std::string(node.attribute("id").value()) + "\"";
      const auto identity = etcs_identity(infra_.required(node, "nid_c"), infra_.required(node, "nid_bg"));
      if (!identity) throw infra_.wrong(node, called + " has " + kNoEtcsIdentity);
      bool has_reference = true;
      const auto [track, balises] = balises_of(node, called, has_reference);
      if (balises.empty()) {
        net_.problems.push_back(called + " has no balises on a track edge; it is left out");
        continue;
      }
      ImportedTrack& on = net_.tracks[track].track;
      if (!has_reference) {
        net_.problems.push_back(
            called + " lacks its first balise, which its place counts from; its other balises are kept as landmarks");
        on.marks.insert(on.marks.end(), balises.begin(), balises.end());
        continue;
      }
      const bool is_forward = std::string(node.attribute("linkOrientationDirection").value()) != "dirReverse";
      on.groups.push_back(
          {identity->nid_c, identity->nid_bg, balises.front().offset_m, is_forward, kUnsaidLocationM, balises});
    }
  }

  /// Those on the track edge of its first one that lies on any, and that.
  std::pair<size_t, std::vector<TrackMark>> balises_of(const pugi::xml_node& group, const std::string& called,
                                                       bool& has_reference) {
    size_t on = 0;
    std::vector<TrackMark> balises;
    for (const pugi::xml_node& balise : group.child("balises").children("balise")) {
      const pugi::xml_node spot = balise.child("spotLocation");
      const std::string id = balise.attribute("id").value();
      const size_t track = edges_.track_of(infra_, spot, "trackEdge");
      const double at_m = metres(infra_.required(spot, "pos"));
      if (!balises.empty() && on != track) {
        net_.problems.push_back(called + " lies on two track edges; only its balises on \"" +
                                net_.tracks[on].track.name + "\" are kept");
      } else if (at_m < 0 || at_m > net_.tracks[track].length_m + kOnEdgeM) {
        net_.problems.push_back("balise \"" + id + "\" is not on its track edge; it is left out");
        has_reference = has_reference && !balises.empty();
      } else {
        on = track;
        balises.push_back({LandmarkKind::balise, at_m, 0, kSurveyedM, id});
      }
    }
    return {on, balises};
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

  /// Things in the middle of sections of track edges (bridge), or at spots of them (level crossing). One that goes on
  /// over a joint is one.
  void read_marks(const char* name, LandmarkKind kind) {
    for (const pugi::xml_node& node : descendants(infra_.root(), name)) {
      for (const auto& [track, offset_m] : middles(net_, places_of(node)))
        net_.tracks[track].track.marks.push_back({kind, offset_m, 0, kSurveyedM, id_of(node)});
    }
  }

  void read_underpasses() {
    read_marks("underpass", LandmarkKind::underbridge);
    const size_t count = descendants(infra_.root(), "underpass").size();
    if (count == 0) return;
    net_.problems.push_back(std::to_string(count) +
                            " <underpass>: whether the track leads over or under them the schema does not say; they "
                            "are taken as under the track, where no camera looks for them");
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
      const size_t track = edges_.track_of(infra_, section, "trackEdge");
      const double skipped_m = metres(infra_.number(section, "skipFromEnd").value_or(0));
      add(track, metres(infra_.number(section, "skipFromStart").value_or(0)), net_.tracks[track].length_m - skipped_m);
    }
    for (const pugi::xml_node& spot : descendants(node, "spotLocation")) {
      const double at_m = metres(infra_.required(spot, "pos"));
      add(edges_.track_of(infra_, spot, "trackEdge"), at_m, at_m);
    }
    return out;
  }

  /// Boards of ETCS stand on masts, as signals do. Which side they stand on is not said.
  void read_marker_boards() {
    for (const pugi::xml_node& board : descendants(infra_.root(), "etcsMarker")) {
      const pugi::xml_node spot = board.child("dirSpotLocation");
      if (!spot) continue;  // elsewhere the element only names one
      NetTrack& track = net_.tracks[edges_.track_of(infra_, spot, "trackEdge")];
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
      for (const pugi::xml_node& edge : path)
        length_m += net_.tracks[edges_.track_of(infra_, edge, "trackEdge")].length_m;
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
      NetTrack& track = net_.tracks[edges_.track_of(infra_, edge, "trackEdge")];
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
      NetTrack& track = net_.tracks[edges_.track_of(infra_, profile, "id")];
      for (const Direction running : {Direction::forward, Direction::reverse}) {
        const char* way = running == Direction::forward ? "sameDirProfile" : "oppositeDirProfile";
        std::vector<std::pair<double, double>> changes;  // metres, m/s
        ErjuLeftOut left_out;
        for (const pugi::xml_node& item : descendants(profile.child(way), "staticSpeedProfileItem")) {
          const double at_m = metres(infra_.required(item, "pos"));
          const double kmh = infra_.required(item, "speed");
          if (!is_speed(kmh))
            left_out.add(std::string(way) + " speed " + item.attribute("speed").value() + " km/h", at_m);
          changes.emplace_back(at_m, core::mps_from_kmh(is_speed(kmh) ? kmh : 0));
        }
        left_out.tell(std::string(kNoTrainRuns) + "; no limit begins there", track, net_.problems);
        add_speeds(changes, running, track.length_m, track.track);
      }
    }
  }

  XmlSource infra_;
  std::optional<XmlSource> map_;
  RailNet net_;
  ErjuEdges edges_;
};

}  // namespace

core::Result<RailNet> read_erju(const std::filesystem::path& infra, const std::filesystem::path* map) {
  try {
    return ErjuReader(infra, map).read();
  } catch (const core::BadInput& bad) {
    return core::Error{bad.what()};
  }
}

}  // namespace railfix::track
