// The map file: Protobuf, checked on reading so that everybody else may rely on what the structs promise.
#include <algorithm>
#include <cmath>
#include <fstream>
#include <iterator>
#include <string_view>

#include "core/train_limits.hpp"
#include "core/whole_file.hpp"
#include "idl/map.pb.h"
#include "track/map.hpp"

namespace railfix::track {
namespace {

constexpr double kLongestEdgeM = 1e6;
constexpr double kSharpestPerM = 0.1;  // no track has a radius of less than 10 m
constexpr double kMostTurnRad = 20;    // of one element; to search along many turns takes as long as they are many

bool finite(std::initializer_list<double> values) {
  return std::all_of(values.begin(), values.end(), [](double value) { return std::isfinite(value); });
}

/// Length of the UTF-8 character (RFC 3629) that begins there; 0 where none does, or one that moves a terminal's
/// cursor.
size_t character_at(std::string_view text) {
  const auto byte = [&](size_t i) { return i < text.size() ? static_cast<uint8_t>(text[i]) : uint8_t{0}; };
  const auto follows = [&](size_t i) { return (byte(i) & 0xC0U) == 0x80U; };
  const uint8_t first = byte(0);
  if (first < 0x80) return first < 0x20 || first == 0x7F ? 0 : 1;
  if (first == 0xC2 && byte(1) < 0xA0) return 0;
  if (first >= 0xC2 && first <= 0xDF && follows(1)) return 2;
  const bool too_long = (first == 0xE0 && byte(1) < 0xA0) || (first == 0xF0 && byte(1) < 0x90);
  const bool beyond = (first == 0xED && byte(1) > 0x9F) || (first == 0xF4 && byte(1) > 0x8F);
  if (too_long || beyond || first < 0xE0 || first > 0xF4) return 0;
  const size_t length = first < 0xF0 ? 3 : 4;
  return follows(1) && follows(2) && (length == 3 || follows(3)) ? length : 0;
}

/// Names come from foreign files in any encoding; what is no UTF-8 would make the whole map unreadable, and control
/// characters would command the terminal that shows them.
std::string as_text(std::string text) {
  for (size_t i = 0; i < text.size();) {
    const size_t length = character_at(std::string_view(text).substr(i));
    if (length == 0) text[i] = '?';
    i += std::max<size_t>(1, length);
  }
  return text;
}

template <class Points>
bool sorted_by_offset(const Points& points) {
  return std::is_sorted(points.begin(), points.end(),
                        [](const auto& a, const auto& b) { return a.offset_m < b.offset_m; });
}

core::Status check_elements(const map::Edge& edge) {
  const std::string where = "edge " + std::to_string(edge.id());
  if (edge.elements().empty()) return core::Error{where + " has no elements"};
  double sum = 0;
  for (const map::Element& element : edge.elements()) {
    if (!finite({element.length_m(), element.curvature_start_per_m(), element.curvature_end_per_m(),
                 element.easting_m(), element.northing_m(), element.heading_rad()})) {
      return core::Error{where + " has an element with a value that is not a number"};
    }
    if (element.length_m() <= 0) return core::Error{where + " has an element without length"};
    const double sharpest =
        std::max(std::abs(element.curvature_start_per_m()), std::abs(element.curvature_end_per_m()));
    if (sharpest > kSharpestPerM) return core::Error{where + " has a radius of less than 10 m"};
    if (sharpest * element.length_m() > kMostTurnRad)
      return core::Error{where + " has an element that turns round several times"};
    sum += element.length_m();
  }
  if (sum > kLongestEdgeM) return core::Error{where + " is longer than 1000 km"};
  if (std::abs(sum - edge.length_m()) > 1e-3) return core::Error{where + " is not as long as its elements together"};
  return {};
}

core::Result<Edge> edge_from(const map::Edge& in) {
  if (const core::Status status = check_elements(in); !status) return status.error();
  std::vector<Element> elements;
  std::vector<PlanPose> starts;
  for (const map::Element& e : in.elements()) {
    elements.push_back({e.length_m(), e.curvature_start_per_m(), e.curvature_end_per_m()});
    starts.push_back({e.easting_m(), e.northing_m(), e.heading_rad()});
  }
  std::vector<GradePoint> profile;
  for (const map::GradePoint& p : in.profile())
    profile.push_back({p.offset_m(), p.elevation_m(), p.curve_length_m(), p.is_guess()});
  std::vector<CantPoint> cant;
  for (const map::CantPoint& p : in.cant()) cant.push_back({p.offset_m(), p.cant_m()});
  const bool numbers = std::all_of(profile.begin(), profile.end(),
                                   [](const GradePoint& p) {
                                     return finite({p.offset_m, p.elevation_m, p.curve_length_m});
                                   }) &&
                       std::all_of(cant.begin(), cant.end(), [](const CantPoint& p) {
                         return finite({p.offset_m, p.cant_m});
                       });
  if (!numbers || !sorted_by_offset(profile) || !sorted_by_offset(cant)) {
    return core::Error{"edge " + std::to_string(in.id()) + " has a profile or cant out of order"};
  }
  std::vector<SpeedLimit> limits;
  for (const map::SpeedLimit& l : in.speed_limits()) {
    if (!finite({l.from_m(), l.to_m()}) || !(l.speed_mps() > 0 && l.speed_mps() < core::kFastestTrainMps) ||
        !map::SpeedLimit::Direction_IsValid(l.direction())) {
      return core::Error{"edge " + std::to_string(in.id()) + " has a speed limit that is none"};
    }
    limits.push_back({l.from_m(), l.to_m(), l.speed_mps(), static_cast<Direction>(l.direction())});
  }
  Edge out{.id = in.id(),
           .name = as_text(in.name()),
           .from_node = in.from_node(),
           .to_node = in.to_node(),
           .line = as_text(in.line()),
           .alignment = {},
           .speed_limits = std::move(limits),
           .is_drawn = in.is_drawn()};
  out.alignment = Alignment(std::move(elements), std::move(starts), std::move(profile), std::move(cant));
  return out;
}

/// These fill the map's lists from the message; the error says which element is wrong.
core::Status read_nodes(const map::Map& in, Map& out) {
  for (const map::Node& n : in.nodes()) {
    if (n.id() != out.nodes.size() + 1) return core::Error{"its nodes are not numbered 1, 2, 3, ..."};
    if (!map::Node::Kind_IsValid(n.kind()))
      return core::Error{"node " + std::to_string(n.id()) + " is of an unknown kind"};
    if (!finite({n.easting_m(), n.northing_m()}))
      return core::Error{"node " + std::to_string(n.id()) + " has a coordinate that is not a number"};
    out.nodes.push_back({n.id(), static_cast<NodeKind>(n.kind()), as_text(n.name()), n.easting_m(), n.northing_m()});
  }
  return {};
}

/// A map made by hand may leave its nodes out: they are the ends of its tracks.
void add_missing_nodes(Map& map) {
  if (!map.nodes.empty()) return;
  const auto add = [&](uint32_t id, const PlanPose& pose) {
    if (id > 2 * map.edges.size()) return;
    while (map.nodes.size() < id) map.nodes.push_back({static_cast<uint32_t>(map.nodes.size() + 1), NodeKind::end, ""});
    if (id > 0) map.nodes[id - 1] = {id, NodeKind::end, "", pose.easting_m, pose.northing_m};
  };
  for (const Edge& edge : map.edges) {
    add(edge.from_node, edge.alignment.at(0).pose);
    add(edge.to_node, edge.alignment.at(edge.alignment.length_m()).pose);
  }
}

bool has_node(const Map& map, uint32_t id) {
  return id >= 1 && id <= map.nodes.size();
}

core::Status read_edges(const map::Map& in, Map& out) {
  for (const map::Edge& e : in.edges()) {
    if (e.id() != out.edges.size() + 1) return core::Error{"its edges are not numbered 1, 2, 3, ..."};
    core::Result<Edge> edge = edge_from(e);
    if (!edge) return edge.error();
    out.edges.push_back(std::move(edge).value());
  }
  if (out.edges.empty()) return core::Error{"it holds no track"};
  add_missing_nodes(out);
  for (const Edge& edge : out.edges) {
    if (!has_node(out, edge.from_node) || !has_node(out, edge.to_node))
      return core::Error{"edge " + std::to_string(edge.id) + " begins or ends at a node that does not exist"};
  }
  return {};
}

core::Status read_connections(const map::Map& in, Map& out) {
  for (const map::Connection& c : in.connections()) {
    if (!has_node(out, c.node()))
      return core::Error{"a connection lies at node " + std::to_string(c.node()) + ", which does not exist"};
    if (out.edge(c.edge_a()) == nullptr || out.edge(c.edge_b()) == nullptr) {
      return core::Error{"a connection at node " + std::to_string(c.node()) + " names an edge that does not exist"};
    }
    out.connections.push_back({c.node(), c.edge_a(), c.edge_b(), c.diverging()});
  }
  return {};
}

bool on_edge(const Map& map, uint32_t edge_id, double offset_m) {
  const Edge* edge = map.edge(edge_id);
  return edge != nullptr && offset_m >= -1e-3 && offset_m <= edge->alignment.length_m() + 1e-3;
}

/// No rounding puts it beyond an end, where nobody looks for it. REQUIRES: on_edge().
double within(const Map& map, uint32_t edge_id, double offset_m) {
  return std::clamp(offset_m, 0.0, map.edge(edge_id)->alignment.length_m());
}

core::Status read_landmarks(const map::Map& in, Map& out) {
  for (const map::Landmark& l : in.landmarks()) {
    const std::string where = "landmark " + std::to_string(l.id());
    if (l.id() != out.landmarks.size() + 1) return core::Error{"its landmarks are not numbered 1, 2, 3, ..."};
    if (!map::Landmark::Kind_IsValid(l.kind())) return core::Error{where + " is of an unknown kind"};
    if (!on_edge(out, l.edge(), l.offset_m()) || !finite({l.lateral_m(), l.sigma_m()})) {
      return core::Error{where + " is not on an edge"};
    }
    out.landmarks.push_back({l.id(), static_cast<LandmarkKind>(l.kind()), l.edge(), within(out, l.edge(), l.offset_m()),
                             l.lateral_m(), l.sigma_m(), as_text(l.name())});
  }
  return {};
}

core::Status read_groups(const map::Map& in, Map& out) {
  for (const map::BaliseGroup& g : in.balise_groups()) {
    const std::string where = "balise group " + std::to_string(g.nid_c()) + "/" + std::to_string(g.nid_bg());
    if (g.nid_c() > BaliseGroup::kLastNidC || g.nid_bg() > BaliseGroup::kLastNidBg)
      return core::Error{where + " has an identity that ETCS cannot carry"};
    if (!on_edge(out, g.edge(), g.offset_m())) return core::Error{where + " is not on an edge"};
    if (!std::isfinite(g.q_locacc_m()) || g.q_locacc_m() < 0)
      return core::Error{where + " has a location accuracy that is not a length of 0 m or more"};
    for (const uint32_t balise : g.balises()) {
      if (balise != 0 && out.landmark(balise) == nullptr)
        return core::Error{where + " names a balise that is not among the landmarks"};
    }
    out.balise_groups.push_back({g.nid_c(),
                                 g.nid_bg(),
                                 g.edge(),
                                 within(out, g.edge(), g.offset_m()),
                                 g.nominal_is_forward(),
                                 g.is_virtual(),
                                 g.q_locacc_m(),
                                 {g.balises().begin(), g.balises().end()}});
  }
  return {};
}

core::Status read_map(const map::Map& in, Map& out) {
  out.name = as_text(in.name());
  out.source = as_text(in.source());
  out.crs = as_text(in.crs());
  std::ranges::transform(in.problems(), std::back_inserter(out.problems), as_text);
  std::ranges::transform(in.learnt_runs(), std::back_inserter(out.learnt_runs), as_text);
  out.q_locacc_m = in.q_locacc_m();
  if (!std::isfinite(out.q_locacc_m) || out.q_locacc_m < 0)
    return core::Error{"its location accuracy is not a length of 0 m or more"};
  for (const auto& read : {read_nodes, read_edges, read_connections, read_landmarks, read_groups}) {
    if (core::Status status = read(in, out); !status) return status;
  }
  return {};
}

void write_edge(const Edge& edge, map::Edge& out) {
  out.set_id(edge.id);
  out.set_name(as_text(edge.name));
  out.set_from_node(edge.from_node);
  out.set_to_node(edge.to_node);
  out.set_line(as_text(edge.line));
  out.set_length_m(edge.alignment.length_m());
  out.set_is_drawn(edge.is_drawn);
  for (size_t i = 0; i < edge.alignment.elements().size(); ++i) {
    const Element& element = edge.alignment.elements()[i];
    const PlanPose& start = edge.alignment.starts()[i];
    map::Element& e = *out.add_elements();
    e.set_length_m(element.length_m);
    e.set_curvature_start_per_m(element.curvature_start_per_m);
    e.set_curvature_end_per_m(element.curvature_end_per_m);
    e.set_easting_m(start.easting_m);
    e.set_northing_m(start.northing_m);
    e.set_heading_rad(start.heading_rad);
  }
  for (const GradePoint& point : edge.alignment.profile()) {
    map::GradePoint& p = *out.add_profile();
    p.set_offset_m(point.offset_m);
    p.set_elevation_m(point.elevation_m);
    p.set_curve_length_m(point.curve_length_m);
    p.set_is_guess(point.is_guess);
  }
  for (const CantPoint& point : edge.alignment.cant()) {
    map::CantPoint& p = *out.add_cant();
    p.set_offset_m(point.offset_m);
    p.set_cant_m(point.cant_m);
  }
  for (const SpeedLimit& limit : edge.speed_limits) {
    map::SpeedLimit& l = *out.add_speed_limits();
    l.set_from_m(limit.from_m);
    l.set_to_m(limit.to_m);
    l.set_speed_mps(limit.speed_mps);
    l.set_direction(static_cast<map::SpeedLimit::Direction>(limit.direction));
  }
}

void write_network(const Map& map, map::Map& out) {
  for (const Edge& edge : map.edges) write_edge(edge, *out.add_edges());
  for (const Node& node : map.nodes) {
    map::Node& n = *out.add_nodes();
    n.set_id(node.id);
    n.set_kind(static_cast<map::Node::Kind>(node.kind));
    n.set_name(as_text(node.name));
    n.set_easting_m(node.easting_m);
    n.set_northing_m(node.northing_m);
  }
  for (const Connection& connection : map.connections) {
    map::Connection& c = *out.add_connections();
    c.set_node(connection.node);
    c.set_edge_a(connection.edge_a);
    c.set_edge_b(connection.edge_b);
    c.set_diverging(connection.diverging);
  }
}

void write_marks(const Map& map, map::Map& out) {
  for (const Landmark& landmark : map.landmarks) {
    map::Landmark& l = *out.add_landmarks();
    l.set_id(landmark.id);
    l.set_kind(static_cast<map::Landmark::Kind>(landmark.kind));
    l.set_edge(landmark.edge);
    l.set_offset_m(landmark.offset_m);
    l.set_lateral_m(landmark.lateral_m);
    l.set_sigma_m(landmark.sigma_m);
    l.set_name(as_text(landmark.name));
  }
  for (const BaliseGroup& group : map.balise_groups) {
    map::BaliseGroup& g = *out.add_balise_groups();
    g.set_nid_c(group.nid_c);
    g.set_nid_bg(group.nid_bg);
    g.set_edge(group.edge);
    g.set_offset_m(group.offset_m);
    g.set_nominal_is_forward(group.nominal_is_forward);
    g.set_is_virtual(group.is_virtual);
    g.set_q_locacc_m(group.q_locacc_m);
    for (const uint32_t balise : group.balises) g.add_balises(balise);
  }
}

}  // namespace

core::Result<Map> Map::load(const std::filesystem::path& file) {
  std::ifstream stream(file, std::ios::binary);
  const bool ends_at_once = stream.peek() == std::ifstream::traits_type::eof();
  if (!stream.is_open() || stream.bad()) return core::cannot_read("the map " + file.string());
  if (ends_at_once) return core::Error{file.string() + " is empty; make it again with `railfix map build`"};
  const google::protobuf::LogSilencer silence;  // the one sentence below is enough
  map::Map in;
  if (!in.ParseFromIstream(&stream)) {
    return core::Error{file.string() + " is not a compiled map or is cut short; make it with `railfix map build`"};
  }
  Map out;
  if (const core::Status status = read_map(in, out); !status)
    return core::Error{file.string() + " is not a sound map: " + status.error().message +
                       "; build it again with `railfix map build`"};
  out.index_landmarks();
  return out;
}

core::Status Map::save(const std::filesystem::path& file) const {
  map::Map out;
  out.set_name(as_text(name));
  out.set_source(as_text(source));
  out.set_crs(as_text(crs));
  for (const std::string& problem : problems) out.add_problems(as_text(problem));
  out.set_q_locacc_m(q_locacc_m);
  for (const std::string& run : learnt_runs) out.add_learnt_runs(as_text(run));
  write_network(*this, out);
  write_marks(*this, out);
  Map read_back;
  if (const core::Status status = read_map(out, read_back); !status)
    return core::Error{"the map " + file.string() + " cannot be stored: " + status.error().message +
                       "; is a coordinate of its source wrong?"};

  return core::write_whole(file, out.SerializeAsString());
}

}  // namespace railfix::track
