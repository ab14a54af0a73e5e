#include "recording/export_track.hpp"

#include <cmath>
#include <limits>
#include <map>
#include <nlohmann/json.hpp>
#include <sstream>

#include "cdr/decode.hpp"
#include "core/time.hpp"
#include "core/units.hpp"
#include "core/whole_file.hpp"
#include "messaging/message_words.hpp"
#include "messaging/topics.hpp"
#include "recording/sample_types.hpp"
#include "recording/utc_text.hpp"

namespace railfix::tool {

namespace {

namespace topics = messaging::topics;
using nlohmann::ordered_json;

constexpr double kUnknown = std::numeric_limits<double>::quiet_NaN();
constexpr int64_t kBreakNs = core::kNsPerSecond;
constexpr int64_t kGnssBreakNs = 10 * core::kNsPerSecond;
constexpr int64_t kIntervalEveryNs = core::kNsPerSecond;
constexpr double kMetresPerDegree = 111'195;   // of latitude, on a sphere of 6371 km
constexpr double kLongestIntervalM = 100'000;  // what is longer says nothing on a map

using Lines = std::vector<std::vector<TrackPoint>>;

void add(Lines& lines, const TrackPoint& point, int64_t break_ns) {
  const bool begins = lines.empty() || std::abs(point.stamp_ns - lines.back().back().stamp_ns) > break_ns ||
                      point.integrity != lines.back().back().integrity;
  if (begins) lines.emplace_back();
  if (!begins && point.stamp_ns == lines.back().back().stamp_ns) {
    lines.back().back() = point;
  } else {
    lines.back().push_back(point);
  }
}

// By the recording's own types: recordings of other versions have other members beside these.
void take_state(const ordered_json& state, RecordedTrack& track) {
  const auto value = [&](const char* name) { return state.at(name).get<double>(); };
  if (state.at("track_known") == 0 || !std::isfinite(value("lat_deg")) || !std::isfinite(value("lon_deg"))) return;
  add(track.train,
      {state.at("stamp_ns"), value("lat_deg"), value("lon_deg"), kUnknown, value("heading_rad"), value("speed_mps"),
       value("over_m"), value("under_m"), state.at("edge"), value("offset_m"), state.at("integrity")},
      kBreakNs);
}

void take_fix(const ordered_json& fix, RecordedTrack& track) {
  const auto value = [&](const char* name) { return fix.at(name).get<double>(); };
  if (fix.at("fix") == msg::GNSS_NONE || !std::isfinite(value("lat_deg")) || !std::isfinite(value("lon_deg"))) return;
  add(track.gnss,
      {fix.at("stamp_ns"), value("lat_deg"), value("lon_deg"), value("alt_m"), kUnknown, kUnknown, kUnknown, kUnknown,
       0, 0, msg::INTEGRITY_OK},
      kGnssBreakNs);
}

Lines lines_of(const Lines& all, bool usable) {
  Lines lines;
  for (const auto& line : all) {
    if ((line.front().integrity < msg::INTEGRITY_UNUSABLE) == usable) lines.push_back(line);
  }
  return lines;
}

void write_gpx_track(std::ostringstream& gpx, const char* name, const Lines& lines) {
  if (lines.empty()) return;
  gpx << "  <trk>\n    <name>" << name << "</name>\n";
  for (const auto& line : lines) {
    gpx << "    <trkseg>\n";
    for (const auto& point : line) {
      char place[80];
      std::snprintf(place, sizeof place, "lat=\"%.8f\" lon=\"%.8f\"", point.lat_deg, point.lon_deg);
      gpx << "      <trkpt " << place << '>';
      if (std::isfinite(point.alt_m)) gpx << "<ele>" << point.alt_m << "</ele>";
      gpx << "<time>" << utc_text(point.stamp_ns) << "</time></trkpt>\n";
    }
    gpx << "    </trkseg>\n";
  }
  gpx << "  </trk>\n";
}

// RFC 7946 11.2: more digits than 7 or 8 are not of this Earth.
double rounded(double degrees) {
  return std::round(degrees * 1e8) / 1e8;
}

ordered_json place(const TrackPoint& point, double ahead_m = 0) {
  const double north_deg = ahead_m * std::cos(point.heading_rad) / kMetresPerDegree;
  const double east_deg =
      ahead_m * std::sin(point.heading_rad) / (kMetresPerDegree * std::cos(core::rad_from_deg(point.lat_deg)));
  if (ahead_m == 0) return {rounded(point.lon_deg), rounded(point.lat_deg)};
  return {rounded(point.lon_deg + east_deg), rounded(point.lat_deg + north_deg)};
}

TrackPoint with_integrity(TrackPoint point, uint8_t integrity) {
  point.integrity = integrity;
  return point;
}

/// As geojson.io and others draw it.
const char* integrity_colour(uint8_t integrity) {
  return integrity == msg::INTEGRITY_OK ? "#2e7d32" : integrity == msg::INTEGRITY_DEGRADED ? "#f9a825" : "#c62828";
}

/// A change of integrity is no gap on a map: from the one place to the next the worse holds.
std::map<uint8_t, Lines> by_integrity(Lines lines) {
  for (size_t i = 1; i < lines.size(); ++i) {
    auto& before = lines[i - 1];
    auto& after = lines[i];
    if (std::abs(after.front().stamp_ns - before.back().stamp_ns) > kBreakNs) continue;
    const uint8_t was = before.front().integrity;
    const uint8_t is = after.front().integrity;
    if (was > is) {
      before.push_back(with_integrity(after.front(), was));
    } else {
      after.insert(after.begin(), with_integrity(before.back(), is));
    }
  }
  std::map<uint8_t, Lines> sorted;
  for (auto& line : lines) sorted[line.front().integrity].push_back(std::move(line));
  return sorted;
}

ordered_json lines_feature(const char* name, const Lines& lines) {
  ordered_json coordinates = ordered_json::array();
  for (const auto& line : lines) {
    if (line.size() < 2) continue;  // a line has two points at least
    ordered_json one = ordered_json::array();
    for (const auto& point : line) one.push_back(place(point));
    coordinates.push_back(one);
  }
  return {{"type", "Feature"},
          {"geometry", {{"type", "MultiLineString"}, {"coordinates", coordinates}}},
          {"properties",
           {{"name", name},
            {"from", utc_text(lines.front().front().stamp_ns)},
            {"to", utc_text(lines.back().back().stamp_ns)}}}};
}

ordered_json train_feature(uint8_t integrity, const Lines& lines) {
  auto feature = lines_feature("train", lines);
  feature["properties"]["integrity"] = messaging::name_of_integrity(integrity);
  feature["properties"]["stroke"] = integrity_colour(integrity);
  return feature;
}

ordered_json number(double value) {
  return std::isfinite(value) ? ordered_json(value) : ordered_json(nullptr);
}

ordered_json interval_feature(const TrackPoint& point) {
  return {{"type", "Feature"},
          {"geometry",
           {{"type", "LineString"}, {"coordinates", {place(point, -point.over_m), place(point, point.under_m)}}}},
          {"properties",
           {{"name", "confidence interval"},
            {"time", utc_text(point.stamp_ns)},
            {"edge", point.edge},
            {"offset_m", point.offset_m},
            {"over_m", point.over_m},
            {"under_m", point.under_m},
            {"speed_kmh", number(core::kmh_from_mps(point.speed_mps))},
            {"integrity", messaging::name_of_integrity(point.integrity)},
            {"degraded", point.integrity != msg::INTEGRITY_OK}}}};
}

bool drawable(const TrackPoint& point) {
  return std::isfinite(point.heading_rad) && point.over_m + point.under_m > 0 &&
         point.over_m + point.under_m < kLongestIntervalM;
}

}  // namespace

core::Result<RecordedTrack> read_track(mcap::Reader& reader, const mcap::Selection& part) {
  RecordedTrack track;
  mcap::Selection selection = part;
  selection.topics = {topics::train_state.name, topics::gnss_fix.name};
  SampleTypes types(reader);
  core::Status status;
  reader.for_each(selection, [&](const mcap::Channel& channel, const mcap::Message& message) {
    const auto* type = types.structure(channel);
    if (type == nullptr) return true;
    const auto sample = cdr::decode(*types.types(channel), type->name, message.data);
    try {
      if (sample.ok() && channel.topic == topics::train_state.name) take_state(sample.value(), track);
      if (sample.ok() && channel.topic == topics::gnss_fix.name) take_fix(sample.value(), track);
    } catch (const nlohmann::json::exception& error) {
      status = core::Error{reader.file().string() + ": " + type->name + " of that version lacks a member (" +
                           error.what() + ")"};
    }
    return status.ok();
  });
  if (!status.ok()) return status.error();
  if (!track.train.empty() || !track.gnss.empty()) return track;
  const bool whole = part.from_ns.value_or(0) <= reader.statistics().start_ns && !part.to_ns;
  return core::Error{reader.file().string() + (whole ? " says nowhere" : " does not say in this part") +
                     " where on the Earth the train was: no train_state with latitude and longitude (has the "
                     "map a coordinate system?) and no GNSS fix"};
}

core::Status write_gpx(const RecordedTrack& track, const std::filesystem::path& file) {
  std::ostringstream gpx;
  gpx << R"(<?xml version="1.0" encoding="UTF-8"?>)" << '\n'
      << R"(<gpx version="1.1" creator="Railfix" xmlns="http://www.topografix.com/GPX/1/1">)" << '\n';
  write_gpx_track(gpx, "train", lines_of(track.train, true));
  write_gpx_track(gpx, "train, unusable", lines_of(track.train, false));
  write_gpx_track(gpx, "GNSS", track.gnss);
  gpx << "</gpx>\n";
  return core::write_whole(file, gpx.str());
}

core::Status write_geojson(const RecordedTrack& track, const std::filesystem::path& file) {
  ordered_json features = ordered_json::array();
  for (const auto& [integrity, lines] : by_integrity(track.train)) {
    features.push_back(train_feature(integrity, lines));
  }
  if (!track.gnss.empty()) features.push_back(lines_feature("GNSS", track.gnss));
  int64_t due_ns = std::numeric_limits<int64_t>::min();
  for (const auto& line : track.train) {
    for (const auto& point : line) {
      if (point.stamp_ns < due_ns || !drawable(point)) continue;
      features.push_back(interval_feature(point));
      due_ns = point.stamp_ns + kIntervalEveryNs;
    }
  }
  std::ostringstream text;
  text << ordered_json{{"type", "FeatureCollection"}, {"features", features}}.dump(1) << '\n';
  return core::write_whole(file, text.str());
}

}  // namespace railfix::tool
