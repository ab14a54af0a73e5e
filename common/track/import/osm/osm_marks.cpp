#include "track/import/osm/osm_marks.hpp"

#include <algorithm>
#include <charconv>
#include <cmath>

#include "core/units.hpp"
#include "track/import/osm/osm_heights.hpp"

namespace railfix::track {
namespace {

/// All values of these keys that `is_read` refuses, in one sentence; empty where there are none.
template <class IsRead>
std::string unread(const OsmData& data, std::initializer_list<const char*> keys, const IsRead& is_read,
                   const std::string& are) {
  size_t count = 0;
  std::string first;
  for (const OsmWay& way : data.ways) {
    for (const char* key : keys) {
      const std::string value = value_of(way.tags, key);
      if (value.empty() || is_read(value)) continue;
      if (count++ == 0) first = "the first one is \"" + value + "\" of way " + std::to_string(way.id);
    }
  }
  return count == 0 ? "" : std::to_string(count) + are + ", " + first + "; left out";
}

/// A limit that is not read is none: trains would seem to be allowed more than they are.
bool is_read_speed(const std::string& value) {
  return value == "none" || value == "signals" || speed_mps_of(value);
}

}  // namespace

std::vector<std::string> unread_tags(const OsmData& data) {
  const auto says_which_way = [](const std::string& value) { return value == "up" || value == "down"; };
  std::vector<std::string> told{
      unread(data, {"maxspeed", "maxspeed:forward", "maxspeed:backward"}, is_read_speed,
             " speed limits are no number of km/h or mph"),
      unread(
          data, {"incline"}, [&](const std::string& value) { return says_which_way(value) || grade_of(value); },
          " inclines are no number of %, per mille or degrees that a track can have"),
      unread(
          data, {"incline"}, [&](const std::string& value) { return !says_which_way(value); },
          " inclines say only which way the track climbs, not how much")};
  std::erase(told, "");
  return told;
}

std::optional<double> speed_mps_of(const std::string& text) {
  double value = 0;
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), value);
  if (error != std::errc()) return std::nullopt;
  const std::string_view unit(end, static_cast<size_t>(text.data() + text.size() - end));
  if (unit == " mph" || unit == "mph") {
    value *= 1.609344;
  } else if (!unit.empty() && unit != " km/h") {
    return std::nullopt;
  }
  return value > 0 && is_speed(value) ? std::optional(core::mps_from_kmh(value)) : std::nullopt;
}

void OsmMarks::add(ImportedTrack& track) const {
  add_structures(track);
  add_points(track);
  add_speeds(track);
}

void OsmMarks::add_structures(ImportedTrack& track) const {
  const auto at = [&](size_t i) { return offset_of(i, track); };
  const auto has = [&](size_t segment, const char* key) { return is_set(tags_of(segment), key); };
  const size_t count = chain_.ways.size();
  size_t bridge_begin = 0;
  for (size_t i = 0; i < count; ++i) {
    const std::string name = value_of(tags_of(i), "tunnel:name");
    if (i > 0 && has(i, "tunnel") && !has(i - 1, "tunnel")) {
      track.marks.push_back({LandmarkKind::portal_in, at(i), 0, kMappingSigmaM, name});
    }
    if (i + 1 < count && has(i, "tunnel") && !has(i + 1, "tunnel")) {
      track.marks.push_back({LandmarkKind::portal_out, at(i + 1), 0, kMappingSigmaM, name});
    }
    if (!has(i, "bridge")) continue;
    if (i == 0 || !has(i - 1, "bridge")) bridge_begin = i;
    if (i + 1 == count || !has(i + 1, "bridge")) add_underbridge(at(bridge_begin), at(i + 1), chain_.ways[i], track);
  }
}

void OsmMarks::add_points(ImportedTrack& track) const {
  for (size_t i = 1; i < chain_.ways.size(); ++i) {
    const bool along = chain_.along_way[i];
    const std::optional<bool> along_way = along == chain_.along_way[i - 1] ? std::optional(along) : std::nullopt;
    auto mark = points_.mark(chain_.nodes[i], data_.ways[chain_.ways[i - 1]].id, offset_of(i, track), along_way);
    if (mark) track.marks.push_back(std::move(*mark));
  }
}

/// maxspeed, and maxspeed:forward and :backward as the way is drawn; equal neighbours are one limit.
void OsmMarks::add_speeds(ImportedTrack& track) const {
  const auto speed_at = [&](size_t segment, bool forward) {
    const OsmTags& tags = tags_of(segment);
    const bool as_drawn = forward == chain_.along_way[segment];
    const auto own = speed_mps_of(value_of(tags, as_drawn ? "maxspeed:forward" : "maxspeed:backward"));
    return own ? own : speed_mps_of(value_of(tags, "maxspeed"));
  };
  for (const bool forward : {true, false}) {
    std::optional<double> speed;
    double begin_m = 0;
    for (size_t i = 0; i <= chain_.ways.size(); ++i) {
      const bool is_end = i == chain_.ways.size();
      const auto next = is_end ? std::nullopt : speed_at(i, forward);
      if (i > 0 && !is_end && next == speed) continue;
      const double at_m = i == 0 ? 0.0 : is_end ? track.alignment.length_m() : offset_of(i, track);
      if (speed && at_m > begin_m)
        track.speed_limits.push_back({begin_m, at_m, *speed, forward ? Direction::forward : Direction::reverse});
      speed = next;
      begin_m = at_m;
    }
  }
}

double OsmMarks::offset_of(size_t point, const ImportedTrack& track) const {
  return track.alignment.nearest(chain_.points[point].x(), chain_.points[point].y()).offset_m;
}

/// A bridge that carries the track, as one landmark in the middle; the uncertainty covers the bridge.
void OsmMarks::add_underbridge(double from_m, double to_m, size_t way, ImportedTrack& track) const {
  const double length = to_m - from_m;
  track.marks.push_back({LandmarkKind::underbridge, from_m + 0.5 * length, 0,
                         std::hypot(kMappingSigmaM, length / std::sqrt(12.0)),
                         value_of(data_.ways[way].tags, "bridge:name")});
}

}  // namespace railfix::track
