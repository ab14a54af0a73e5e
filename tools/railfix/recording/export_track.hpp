// Where the train was, for maps: GPX 1.1 and GeoJSON (RFC 7946).
#pragma once

#include <filesystem>
#include <vector>

#include "core/result.hpp"
#include "mcap/reader.hpp"

namespace railfix::tool {

/// One train_state that knows where it is on the Earth, or one GNSS fix.
struct TrackPoint {
  int64_t stamp_ns = 0;
  double lat_deg = 0;
  double lon_deg = 0;
  double alt_m = 0;        // NaN = not known
  double heading_rad = 0;  // clockwise from north; NaN = not known
  double speed_mps = 0;    // NaN = not known
  double over_m = 0;       // confidence interval: so far behind ...
  double under_m = 0;      // ... and so far in front; NaN = not known
  uint32_t edge = 0;
  double offset_m = 0;
  uint8_t integrity = 0;  // INTEGRITY_*
};

struct RecordedTrack {
  // Broken where the place was not known for a second, and where its integrity changes.
  std::vector<std::vector<TrackPoint>> train;
  std::vector<std::vector<TrackPoint>> gnss;
};

/// Error: neither a train_state with latitude and longitude nor a GNSS fix is in the part.
core::Result<RecordedTrack> read_track(mcap::Reader& reader, const mcap::Selection& part);

/// Places that must not be used are a track of their own, "train, unusable".
core::Status write_gpx(const RecordedTrack& track, const std::filesystem::path& file);
/// The lines of the train, one feature for each integrity, and once a second its confidence interval as a line of its
/// own, laid straight along the heading.
core::Status write_geojson(const RecordedTrack& track, const std::filesystem::path& file);

}  // namespace railfix::tool
