#include <algorithm>
#include <cmath>
#include <map>
#include <set>

#include "core/units.hpp"
#include "track/import/xml/railml2_balises.hpp"
#include "track/import/xml/railml2_coordinates.hpp"
#include "track/import/xml/railml2_radii.hpp"
#include "track/import/xml/railml2_signals.hpp"
#include "track/import/xml/railml2_stretches.hpp"
#include "track/import/xml/railml_readers.hpp"

namespace railfix::track {
namespace {

constexpr int kMostHops = 20;  // switches directly behind one another

/// One <connection>: at a track's end, or at a switch on it.
struct Connector {
  std::string ref{};
  size_t track = 0;     // first piece of its track
  bool at_end = false;  // of the track
  bool is_branch = false;
  bool outgoing = false;  // the branch leaves where offsets grow
  double offset_m = 0;
  double side = 0;
  bool is_crossing = false;
  bool only_crosses = false;  // ... without slips
  std::string switch_name{};
  pugi::xml_node node{};
};

class Railml2Reader {
 public:
  explicit Railml2Reader(const XmlSource& source) : source_(source), coordinates_(source) {}

  RailNet read() {
    special_profiles_ = special_speed_profiles(source_);
    for (const pugi::xml_node& track : descendants(source_.root(), "track")) {
      if (std::string(track.parent().name()) == "tracks") read_track(track);
    }
    if (net_.tracks.empty()) throw core::BadInput(source_.file_name() + " holds no <track> with <trackTopology>");
    cut_at_switches();
    shape_pieces();
    link();
    tunnels_.add_portals(pieces_, net_);
    platforms_.add_ends(pieces_, net_);
    return std::move(net_);
  }

 private:
  [[nodiscard]] double pos(const pugi::xml_node& node) const { return source_.required(node, "pos"); }

  void read_track(const pugi::xml_node& node) {
    const pugi::xml_node topology = node.child("trackTopology");
    const pugi::xml_node begin = topology.child("trackBegin");
    const pugi::xml_node end = topology.child("trackEnd");
    if (!begin || !end) throw source_.wrong(node, "track \"" + railml_name(node) + "\" needs trackBegin and trackEnd");
    const size_t index = net_.tracks.size();
    NetTrack& track = net_.tracks.emplace_back();
    const std::string id = source_.required_text(node, "id");
    const std::string name = railml_name(node);
    track.track.name = name == id ? id : id + " " + name;
    track.track.line = id;
    origin_m_ = pos(begin);
    track.length_m = pos(end) - origin_m_;
    if (!(track.length_m > 0 && track.length_m < 1e6))
      throw source_.wrong(end, "track \"" + railml_name(node) + "\" must be between 0 and 1000 km long");
    read_connection(begin, {.track = index, .at_end = false});
    read_connection(end, {.track = index, .at_end = true});
    for (const pugi::xml_node& points : topology.child("connections").children()) {
      if (points.type() == pugi::node_element) read_switch(points, index);
    }
    read_plan(node.child("trackElements"), track);
    read_speeds(node.child("trackElements"), track);
    read_marks(node, track);
    read_balises2(source_, node.child("ocsElements").child("balises"), origin_m_, track, net_.problems);
    points_.push_back(coordinates_.points_of(node, origin_m_));
  }

  void read_connection(const pugi::xml_node& at, Connector connector) {
    const pugi::xml_node connection = at.child("connection");
    if (!connection) return;
    connector.ref = source_.required_text(connection, "ref");
    connector.node = connection;
    connectors_[source_.required_text(connection, "id")] = connector;
  }

  void read_switch(const pugi::xml_node& points, size_t track) {
    switches_.push_back(points);
    const std::string course = points.attribute("trackContinueCourse").value();
    for (const pugi::xml_node& connection : points.children("connection")) {
      const std::string orientation = connection.attribute("orientation").value();
      if (orientation != "incoming" && orientation != "outgoing") continue;  // not known, or neither
      Connector connector{.ref = source_.required_text(connection, "ref"), .track = track};
      connector.is_branch = true;
      connector.is_crossing = std::string(points.name()) == "crossing";
      connector.only_crosses =
          connector.is_crossing && std::string(points.attribute("type").value()) == "simpleCrossing";
      connector.outgoing = orientation == "outgoing";
      connector.offset_m = pos(points) - origin_m_;
      const double length = net_.tracks[track].length_m;
      if (!is_on_track(connector.offset_m, length))
        throw source_.wrong(points, "switch \"" + railml_name(points) + "\" is not on its track");
      connector.offset_m = std::clamp(connector.offset_m, 0.0, length);
      const std::string way = connection.attribute("course").value();
      connector.side = way == "left" || (way == "straight" && course == "right") ? 1 : -1;
      connector.switch_name = railml_name(points);
      connector.node = connection;
      connectors_[source_.required_text(connection, "id")] = connector;
    }
  }

  void read_plan(const pugi::xml_node& elements, NetTrack& track) {
    read_radii2(source_, elements.child("radiusChanges"), origin_m_, track, net_.problems);
    for (const pugi::xml_node& change : elements.child("gradientChanges").children("gradientChange")) {
      if (lies_on(change, track))
        track.slopes.push_back({pos(change) - origin_m_, 1e-3 * source_.required(change, "slope")});
    }
    std::ranges::stable_sort(track.slopes, {}, &NetSlope::offset_m);
  }

  /// Every profile for itself: the lowest holds. "end" as speed ends a limit. On its own track only.
  void read_speeds(const pugi::xml_node& elements, NetTrack& track) {
    struct Changes {
      std::vector<std::pair<double, double>> up;  // offset, m/s
      std::vector<std::pair<double, double>> down;
    };
    std::map<std::string, Changes> profiles;
    for (const pugi::xml_node& change : elements.child("speedChanges").children("speedChange")) {
      const std::string profile = change.attribute("profileRef").value();
      if (special_profiles_.contains(profile) || !lies_on(change, track)) continue;
      const bool is_end = std::string(change.attribute("vMax").value()) == "end";
      const double kmh = is_end ? 0 : source_.number(change, "vMax").value_or(0);
      if (!is_speed(kmh))
        tell_impossible(change, "vMax", std::string("km/h, ") + kNoTrainRuns + "; no limit begins there", track);
      const std::string direction = change.attribute("dir").value();
      const std::pair limit(pos(change) - origin_m_, core::mps_from_kmh(is_speed(kmh) ? kmh : 0));
      if (direction != "down") profiles[profile].up.push_back(limit);
      if (direction != "up") profiles[profile].down.push_back(limit);
    }
    for (const auto& [name, changes] : profiles) {
      add_speeds(changes.up, Direction::forward, track.length_m, track.track);
      add_speeds(changes.down, Direction::reverse, track.length_m, track.track);
    }
  }

  void read_marks(const pugi::xml_node& node, NetTrack& track) {
    const pugi::xml_node elements = node.child("trackElements");
    const auto add = [&](LandmarkKind kind, double offset_m, const pugi::xml_node& of) {
      if (!is_on_track(offset_m, track.length_m)) {
        net_.problems.push_back(not_on_its_track(of));
        return;
      }
      track.track.marks.push_back({kind, std::clamp(offset_m, 0.0, track.length_m), 0, kRailmlSigmaM, railml_name(of)});
    };
    const auto length = [&](const pugi::xml_node& of) -> std::optional<double> {
      const double length_m = source_.number(of, "length").value_or(0);
      if (length_m >= 0) return length_m;
      tell_impossible(of, "length", "m; it is left out", track);
      return std::nullopt;
    };
    const size_t index = net_.tracks.size() - 1;
    const auto add_stretch = [&](Railml2Stretches& stretches, const pugi::xml_node& of, double lateral_m) {
      const auto length_m = length(of);
      if (!length_m) return;
      const double from_m = pos(of) - origin_m_;
      stretches.add({index, from_m, from_m + *length_m, true, lateral_m}, of, net_);
    };
    for (const pugi::xml_node& of : elements.child("tunnels").children("tunnel")) add_stretch(tunnels_, of, 0);
    // The schema of railML 2 spells the element "brigde"; files by hand may not.
    for (const char* spelling : {"brigde", "bridge"}) {
      for (const pugi::xml_node& of : elements.child("bridges").children(spelling)) {
        // Only what says that it crosses the track leads over it (kind as wiki2.railml.org, IS:brigde, suggests).
        const bool is_over = std::string(of.attribute("kind").value()) == "crossing";
        const LandmarkKind kind = is_over ? LandmarkKind::bridge : LandmarkKind::underbridge;
        if (const auto length_m = length(of)) add(kind, pos(of) - origin_m_ + 0.5 * *length_m, of);
      }
    }
    for (const pugi::xml_node& of : elements.child("levelCrossings").children("levelCrossing"))
      add(LandmarkKind::level_crossing, pos(of) - origin_m_, of);
    for (const pugi::xml_node& of : elements.child("platformEdges").children("platformEdge"))
      add_stretch(platforms_, of, kPlatformEdgeM * left_of(of.attribute("side").value()));
    read_signals2(source_, node.child("ocsElements"), origin_m_, track, net_.problems);
  }

  bool lies_on(const pugi::xml_node& of, const NetTrack& track) {
    const bool lies = is_on_track(pos(of) - origin_m_, track.length_m);
    if (!lies) net_.problems.push_back(not_on_its_track(of));
    return lies;
  }

  void tell_impossible(const pugi::xml_node& of, const char* attribute, const std::string& why, const NetTrack& track) {
    net_.problems.push_back(railml_has(of, track, attribute, why));
  }

  /// Pieces of every track, by the offset of their begin.
  void cut_at_switches() {
    std::map<size_t, std::set<double>> cuts;
    for (const auto& [id, connector] : connectors_) {
      const double length = net_.tracks[connector.track].length_m;
      if (connector.is_branch && connector.offset_m > kAtEndM && connector.offset_m < length - kAtEndM)
        cuts[connector.track].insert(connector.offset_m);
    }
    const size_t count = net_.tracks.size();
    for (size_t i = 0; i < count; ++i) {
      pieces_[i][0.0] = i;
      const std::string name = net_.tracks[i].track.name;
      double begin = 0;
      size_t piece = i;
      for (const double cut : cuts[i]) {
        if (cut - begin < kAtEndM) continue;
        piece = split(net_, piece, cut - begin, name + "#" + std::to_string(pieces_[i].size() + 1));
        pieces_[i][cut] = piece;
        begin = cut;
      }
    }
  }

  /// A track whose coordinates do not fit its length, or end on the way, is laid out without them; so is a piece of it.
  void shape_pieces() {
    for (const auto& [track, pieces] : pieces_) {
      const auto last = pieces.rbegin();
      const double length_m = last->first + net_.tracks[last->second].length_m;
      const std::string called = "track " + net_.tracks[track].track.name;
      if (told_shape(called, track, 0, length_m).empty()) continue;
      net_.crs = coordinates_.crs();
      for (const auto& [begin_m, piece] : pieces) {
        NetTrack& part = net_.tracks[piece];
        const bool is_first = piece == track && pieces.size() > 1;
        part.shape = told_shape(is_first ? called + " up to its first switch" : "track " + part.track.name, track,
                                begin_m, begin_m + part.length_m);
      }
    }
  }

  /// Of a stretch of the track.
  std::vector<Eigen::Vector2d> told_shape(const std::string& called, size_t track, double from_m, double to_m) {
    std::string why;
    std::vector<Eigen::Vector2d> shape = shape_between(points_[track], from_m, to_m, why);
    if (!why.empty()) net_.problems.push_back(called + " " + why + "; not used");
    return shape;
  }

  [[nodiscard]] std::optional<size_t> piece_after(const Connector& at) const {
    for (const auto& [begin, piece] : pieces_.at(at.track)) {
      if (std::abs(begin - at.offset_m) < kAtEndM) return piece;
    }
    return std::nullopt;
  }
  [[nodiscard]] std::optional<size_t> piece_before(const Connector& at) const {
    std::optional<size_t> before;
    for (const auto& [begin, piece] : pieces_.at(at.track)) {
      if (begin < at.offset_m - kAtEndM) before = piece;
    }
    return before;
  }
  [[nodiscard]] NetEnd end_of(const Connector& at) const {
    const auto& pieces = pieces_.at(at.track);
    return at.at_end ? NetEnd{pieces.rbegin()->second, true} : NetEnd{pieces.begin()->second, false};
  }

  /// The end that a train comes from which runs over this connection out of its track.
  [[nodiscard]] std::optional<NetEnd> facing(const Connector& at, int hops = 0) const {
    if (!at.is_branch) return end_of(at);
    if (at.outgoing) {
      if (const auto before = piece_before(at)) return NetEnd{*before, true};
    } else if (const auto after = piece_after(at)) {
      return NetEnd{*after, false};
    }
    // The switch is the very end of its track: the train comes from the next one.
    for (const auto& [id, other] : connectors_) {
      if (other.is_branch || other.track != at.track || other.at_end == at.outgoing || hops > kMostHops) continue;
      const auto next = connectors_.find(other.ref);
      if (next != connectors_.end()) return facing(next->second, hops + 1);
    }
    return std::nullopt;
  }

  void link() {
    std::map<std::string, std::vector<const Connector*>> crossings;
    for (const auto& [id, connector] : connectors_) {
      if (connector.is_crossing) crossings[connector.switch_name].push_back(&connector);
      const auto other = connectors_.find(connector.ref);
      if (other == connectors_.end()) {
        net_.problems.push_back("connection \"" + id + "\" of track " + net_.tracks[connector.track].track.name +
                                " leads to \"" + connector.ref + "\", which does not exist");
        continue;
      }
      if (id < connector.ref) add_link(connector, other->second);
    }
    // Over a crossing straight through, from branch to branch.
    for (const auto& [name, branches] : crossings) {
      for (const Connector* in : branches) {
        for (const Connector* out : branches) {
          if (!in->outgoing && out->outgoing) add_crossing_link(*in, *out);
        }
      }
    }
    for (const pugi::xml_node& points : switches_) {
      if (!linked_.contains(points))
        net_.problems.push_back(railml_called(points) + " connects its track with no other; it is left out");
    }
  }

  void add_link(const Connector& a, const Connector& b) {
    const auto from = facing(a);
    const auto to = facing(b);
    if (!from || !to) {
      net_.problems.push_back("connections \"" + b.ref + "\" and \"" + a.ref +
                              "\" meet at a switch at the very end of its track, behind which there is none; they are "
                              "left out");
      return;
    }
    for (const Connector* end : {&a, &b}) linked_.insert(end->node.parent());
    const Connector& branch = a.is_branch ? a : b;
    net_.links.push_back({.a = *from,
                          .b = *to,
                          .crosses = branch.only_crosses,
                          .diverging = branch.is_branch,
                          .side = branch.side,
                          .switch_name = branch.switch_name});
  }

  void add_crossing_link(const Connector& in, const Connector& out) {
    const auto a = connectors_.find(in.ref);
    const auto b = connectors_.find(out.ref);
    if (a == connectors_.end() || b == connectors_.end()) return;
    const auto from = facing(a->second);
    const auto to = facing(b->second);
    if (from && to)
      net_.links.push_back({.a = *from, .b = *to, .diverging = false, .side = 0, .switch_name = in.switch_name});
  }

  const XmlSource& source_;
  RailNet net_;
  Railml2Coordinates coordinates_;
  std::vector<std::vector<Railml2Coordinates::Point>> points_;  // of every track
  double origin_m_ = 0;
  std::set<std::string> special_profiles_;
  std::map<std::string, Connector> connectors_;
  std::vector<pugi::xml_node> switches_;  // and crossings
  std::set<pugi::xml_node> linked_;       // those that trains leave their track on
  Railml2Pieces pieces_;
  Railml2Stretches tunnels_;
  Railml2Stretches platforms_;
};

}  // namespace

RailNet read_railml2(const XmlSource& source) {
  return Railml2Reader(source).read();
}

}  // namespace railfix::track
