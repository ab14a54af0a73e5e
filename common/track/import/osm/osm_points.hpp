// What stands at the nodes of OpenStreetMap tracks: signals, balises, level crossings.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "track/import/osm/osm_data.hpp"
#include "track/import/tracks.hpp"

namespace railfix::track {

constexpr double kMappingSigmaM = 3.0;

class OsmPoints {
 public:
  explicit OsmPoints(const OsmData& data) : data_(data) {}

  /// What stands at this node of a way (an id, for problems), if anything. `along_way`: the track runs as the way is
  /// drawn; nothing where ways meet there that are drawn against each other.
  std::optional<TrackMark> mark(int64_t node, int64_t way, double offset_m, std::optional<bool> along_way);
  /// Points on no track, signals that give no mast, or no side, one sentence each.
  void tell(std::vector<std::string>& problems) const;

 private:
  /// Things that have the same problem.
  struct Told {
    size_t count = 0;
    std::string first;
    void add(const std::string& one) {
      if (count++ == 0) first = one;
    }
  };
  void tell_strays(std::vector<std::string>& problems) const;
  std::optional<TrackMark> signal(int64_t node, int64_t way, double offset_m, std::optional<bool> along_way);

  const OsmData& data_;
  Told no_masts_;
  Told no_sides_;
  Told turned_;  // between ways that are drawn against each other
};

}  // namespace railfix::track
