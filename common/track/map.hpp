// The compiled map in memory: edges with their geometry, what connects them, what stands beside them.
#pragma once

#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "core/result.hpp"
#include "track/alignment.hpp"
#include "track/projection.hpp"

namespace railfix::track {

enum class LandmarkKind : uint8_t {
  unknown,
  frog,
  balise,
  portal_in,
  portal_out,
  mast,
  bridge,  // over the track: a road's, a footway's, another line's
  platform,
  level_crossing,  // this and the next are known from maps only
  underbridge      // carries the track; nobody sees it from the cab
};
/// "frog", "balise", "portal_in", ... as in the run tables; and back.
std::string to_string(LandmarkKind kind);
std::optional<LandmarkKind> landmark_kind_from(const std::string& text);
/// All of them, as in "balise, mast, frog"; and those that a camera sights.
std::string landmark_kinds();
std::string sighted_kinds();
/// As a train meets it that runs along growing offsets, or against them: a portal in is a portal out the other way.
LandmarkKind seen_along(LandmarkKind kind, bool forward);
/// Does a camera in the cab tell it? The other kinds are on the map for people, and no reference.
constexpr bool can_be_sighted(LandmarkKind kind) {
  return kind >= LandmarkKind::frog && kind <= LandmarkKind::platform;
}

enum class NodeKind : uint8_t { end, joint, railway_switch, crossing };
/// "end", "joint", "switch", "crossing".
std::string to_string(NodeKind kind);

enum class Direction : uint8_t { unknown, forward, reverse };

/// What trains may run on a stretch of an edge; direction unknown = both ways.
struct SpeedLimit {
  double from_m = 0;
  double to_m = 0;
  double speed_mps = 0;
  Direction direction = Direction::unknown;
};

struct Edge {
  uint32_t id = 0;
  std::string name;
  uint32_t from_node = 0;
  uint32_t to_node = 0;
  std::string line;
  Alignment alignment;
  std::vector<SpeedLimit> speed_limits{};
  bool is_drawn = false;  // laid out as a drawing: length and links are the source's, coordinates are not
  /// The lowest limit there for a train running this way (REQUIRES: not unknown); nothing when the source says none.
  [[nodiscard]] std::optional<double> speed_limit_mps(double offset_m, Direction running) const;
};

struct Node {
  uint32_t id = 0;
  NodeKind kind = NodeKind::end;
  std::string name;
  double easting_m = 0;
  double northing_m = 0;
};

struct Connection {
  uint32_t node = 0;
  uint32_t edge_a = 0;
  uint32_t edge_b = 0;
  bool diverging = false;
};

struct Landmark {
  uint32_t id = 0;
  LandmarkKind kind = LandmarkKind::unknown;
  uint32_t edge = 0;
  double offset_m = 0;
  double lateral_m = 0;  // left of the track's middle, looking along growing offset; 0 = in it, or not known
  double sigma_m = 0;
  std::string name;
};

struct BaliseGroup {
  static constexpr uint32_t kLastNidC = 1023;    // that ETCS can carry
  static constexpr uint32_t kLastNidBg = 16382;  // 16383 means unknown
  uint32_t nid_c = 0;
  uint32_t nid_bg = 0;
  uint32_t edge = 0;
  double offset_m = 0;
  bool nominal_is_forward = true;
  bool is_virtual = false;
  double q_locacc_m = 0;
  std::vector<uint32_t> balises;  // landmark ids, 0 = not among the landmarks
  [[nodiscard]] uint32_t nid_lrbg() const { return nid_c << 14U | nid_bg; }
};

/// A place on the map: EDGE:OFFSET[:+|-].
struct EdgePosition {
  uint32_t edge = 0;
  double offset_m = 0;
  Direction direction = Direction::forward;
};

class Map {
 public:
  /// Reads what `railfix map build` wrote (Protobuf, railfix.map.Map of idl/map.proto).
  static core::Result<Map> load(const std::filesystem::path& file);
  [[nodiscard]] core::Status save(const std::filesystem::path& file) const;

  std::string name;
  std::string source;
  std::string crs;          // for PROJ, empty = local metres
  std::vector<Edge> edges;  // edges[i].id == i + 1
  std::vector<Node> nodes;  // nodes[i].id == i + 1
  std::vector<Connection> connections;
  std::vector<Landmark> landmarks;  // landmarks[i].id == i + 1
  std::vector<BaliseGroup> balise_groups;
  std::vector<std::string> problems;
  double q_locacc_m = 0;                 // of virtual groups: how far off its places may be, 0 = not known
  std::vector<std::string> learnt_runs;  // whose sightings are in its landmarks (`railfix map learn`), by their content

  /// Nullptr when there is no such edge or landmark.
  [[nodiscard]] const Edge* edge(uint32_t id) const;
  [[nodiscard]] const Landmark* landmark(uint32_t id) const;
  /// "EDGE:OFFSET[:+|-]", EDGE a name, a number N or edge/N, which is never a name. What several edges are meant by is
  /// an error. Behind a name the offset may run on over the line's next pieces,
  /// which are called NAME#2, NAME#3, ... where switches cut it, as far as each begins where the last one ends.
  [[nodiscard]] core::Result<EdgePosition> parse_position(const std::string& text) const;
  /// The edge's number as parse_position() takes it: edge/N where another edge is called N.
  [[nodiscard]] std::string edge_text(uint32_t id) const;
  /// Landmarks of one edge, by offset. Looked up in a map as it was loaded, not in a copy or after landmarks came or
  /// went: there all are gone through. REQUIRES: no landmark of a loaded map was put onto another edge.
  [[nodiscard]] std::vector<const Landmark*> landmarks_on(uint32_t edge) const;
  /// WGS 84 of a map coordinate; nothing without a crs.
  [[nodiscard]] std::optional<GeoPoint> to_geo(double easting_m, double northing_m) const;
  [[nodiscard]] std::optional<Eigen::Vector2d> from_geo(const GeoPoint& point) const;

 private:
  /// Which landmarks lie on which edge, as they were loaded.
  struct LandmarksByEdge {
    const Landmark* all = nullptr;  // another list than this one is not known
    size_t count = 0;
    std::vector<uint32_t> first;  // of every edge, in `order`; one more at the end
    std::vector<uint32_t> order;  // places in `landmarks`
  };
  void index_landmarks();
  LandmarksByEdge by_edge_;
};

}  // namespace railfix::track
