#include "track/import/osm/osm_points.hpp"

#include <algorithm>
#include <array>
#include <map>
#include <unordered_set>

#include "track/import/osm/osm_chains.hpp"
#include "track/import/told.hpp"

namespace railfix::track {
namespace {

/// Knee-high, as for shunting, and no other signal ("railway:signal:main=...") at the node.
bool is_dwarf(const OsmTags& tags) {
  constexpr std::string_view kSignal = "railway:signal:";
  bool has_dwarf = false;
  for (const auto& [key, value] : tags) {
    if (!key.starts_with(kSignal) || key == "railway:signal:position" || key == "railway:signal:direction") continue;
    const bool is_height = key.ends_with(":height");
    const bool is_kind = key.find(':', kSignal.size()) == std::string::npos;
    const std::string height = is_kind ? value_of(tags, (key + ":height").c_str()) : value;
    if ((is_height || is_kind) && height != "dwarf") return false;
    has_dwarf = has_dwarf || is_height;
  }
  return has_dwarf;
}

/// Over the track (a gantry, the wire), between the rails, or on the ground: no post beside the track, which a camera
/// would tell as a mast. The posts of a gantry may stand several tracks away.
bool is_no_mast(const std::string& position) {
  constexpr std::array kNoMasts{"bridge", "overhead", "in_track", "ground"};
  return std::ranges::find(kNoMasts, position) != kNoMasts.end();
}

/// By its nature: a balise, signal, switch, or where something crosses.
bool is_of_track(const OsmTags& tags) {
  constexpr std::array kKinds{"balise", "signal", "switch", "level_crossing", "crossing", "railway_crossing"};
  return std::ranges::find(kKinds, value_of(tags, "railway")) != kKinds.end() || is_set(tags, "railway:balise");
}

}  // namespace

std::optional<TrackMark> OsmPoints::mark(int64_t node, int64_t way, double offset_m, std::optional<bool> along_way) {
  const OsmTags& tags = data_.nodes.at(node).tags;
  const std::string kind = value_of(tags, "railway");
  if (kind == "balise" || is_set(tags, "railway:balise"))
    return TrackMark{LandmarkKind::balise, offset_m, 0, kMappingSigmaM, value_of(tags, "ref")};
  if (kind == "signal") return signal(node, way, offset_m, along_way);
  if (kind == "level_crossing" || kind == "crossing")  // of a road, of a footpath
    return TrackMark{LandmarkKind::level_crossing, offset_m, 0, kMappingSigmaM, value_of(tags, "name")};
  return std::nullopt;
}

/// Left and right are those of the way as it is drawn, whichever direction the signal is for
/// (wiki.openstreetmap.org, Key:railway:signal:position and OpenRailwayMap/Tagging/Signal): with
/// railway:signal:direction=backward "left" is on the driver's right. Where it is not said countries differ.
std::optional<TrackMark> OsmPoints::signal(int64_t node, int64_t way, double offset_m, std::optional<bool> along_way) {
  const OsmNode& at = data_.nodes.at(node);
  const std::string position = value_of(at.tags, "railway:signal:position");
  if (is_no_mast(position) || is_dwarf(at.tags)) {
    no_masts_.add(called(node, at.place, way));
    return std::nullopt;
  }
  TrackMark mast{LandmarkKind::mast, offset_m, 0, kMappingSigmaM, value_of(at.tags, "ref")};
  const bool is_left = position == "left";
  if (!is_left && position != "right") {
    if (!position.empty()) no_sides_.add("\"" + position + "\" of " + called(node, at.place, way));
  } else if (along_way) {
    mast.lateral_m = is_left == *along_way ? kMastBesideM : -kMastBesideM;
  } else {
    turned_.add(called(node, at.place, way));
  }
  return mast;
}

/// Of GeoJSON, where a point belongs to a line by its place alone. OpenStreetMap's own nodes are those of a way, and
/// may be those of a tram or of a track that is gone.
void OsmPoints::tell_strays(std::vector<std::string>& problems) const {
  std::unordered_set<int64_t> on_track;
  for (const OsmWay& way : data_.ways) on_track.insert(way.nodes.begin(), way.nodes.end());
  std::map<int64_t, GeoPoint> strays;  // the same file always tells the same first one
  for (const auto& [id, node] : data_.nodes) {
    if (is_of_track(node.tags) && !on_track.contains(id) && id == id_of_place(node.place))
      strays.emplace(id, node.place);
  }
  if (strays.empty()) return;
  problems.push_back(
      std::to_string(strays.size()) +
      " signals, switches, balises and crossings are no points of a track that is read, the first one at " +
      told_place(strays.begin()->second) + "; left out: they count where the line has a point at the very same place");
}

void OsmPoints::tell(std::vector<std::string>& problems) const {
  tell_strays(problems);
  const auto tell = [&](const Told& told, const std::string& are, const std::string& what_then) {
    if (told.count > 0)
      problems.push_back(std::to_string(told.count) + " signals " + are + ", the first one is " + told.first + "; " +
                         what_then);
  };
  tell(no_masts_, "hang over the track, stand in it or are dwarfs", "no masts, left out");
  tell(no_sides_, "have a position that is neither left nor right", "their side is not known");
  tell(turned_, "stand where ways meet that are drawn against each other",
       "their side is not known: draw both in one direction");
}

}  // namespace railfix::track
