// What stands beside the tracks of an OpenStreetMap extract and is drawn there: platforms, with the tracks that they
// lie along, on which side, from where to where, and catenary masts.
#pragma once

#include <array>
#include <unordered_map>

#include "track/import/osm/osm_marks.hpp"

namespace railfix::track {

class OsmTrackside {
 public:
  /// REQUIRES: the draft's edges were made from the chains, in their order. All outlive this.
  OsmTrackside(const OsmData& data, const Projection& projection, const std::vector<OsmChain>& chains, Draft& draft);

  /// Marks the beginning and the end of the edge beside every track that a platform lies next to. Where it goes on
  /// beside the next track, or beyond the last one, it does not end. Returns how many platforms lie beside no track.
  size_t add_platforms();
  /// Marks every catenary mast beside the nearest track, and the one on its other side. Returns how many stand beside
  /// no track.
  size_t add_masts();

 private:
  enum class Drawn { edge, area, line };  // the most exact first

  /// One side of one track, as drawn.
  struct Side {
    size_t chain = 0;
    bool left = false;
    auto operator<=>(const Side&) const = default;
  };
  /// Of one platform beside one track; metres along the drawn track.
  struct Stretch {
    Side side;
    double from_m = 0;
    double to_m = 0;
    Drawn drawn = Drawn::line;
    std::string name;
    bool goes_on_before = false;
    bool goes_on_behind = false;
  };
  struct Segment {
    size_t chain = 0;
    size_t index = 0;
  };
  /// Of the perpendicular from a place to a drawn track.
  struct Foot {
    Side side;
    double along_m = 0;
    double away_m = 0;
    Eigen::Vector2d at;
    Eigen::Vector2d direction;       // of the track
    const OsmTags* track = nullptr;  // what is said of it there
  };

  void index_tracks();
  void look_beside(const OsmWay& platform);
  [[nodiscard]] std::vector<Foot> tracks_beside(const Eigen::Vector2d& at, const Eigen::Vector2d& direction,
                                                const OsmTags& platform, Drawn drawn) const;
  /// The nearest on the right and on the left of a line through the place that runs in this direction.
  template <class Accept>
  [[nodiscard]] std::array<std::optional<Foot>, 2> on_either_side(const Eigen::Vector2d& at,
                                                                  const Eigen::Vector2d& direction, double reach_m,
                                                                  const Accept& accept) const;
  /// Calls `use` with the foot on every track within reach.
  template <class Use>
  void for_feet(const Eigen::Vector2d& at, double reach_m, const Use& use) const;
  [[nodiscard]] std::optional<Foot> foot_on(const Segment& segment, const Eigen::Vector2d& at) const;
  [[nodiscard]] std::optional<Eigen::Vector2d> place_of(int64_t node) const;
  /// false: beside no track.
  bool add_mast(int64_t node);
  void merge();
  void find_where_they_go_on();
  [[nodiscard]] bool goes_on(const Stretch& stretch, bool at_end) const;
  [[nodiscard]] bool reaches(const Stretch& stretch, bool at_end) const;
  void add_end(const Stretch& stretch, double along_m);
  [[nodiscard]] double offset_of(size_t chain, double along_m) const;

  [[nodiscard]] static Drawn drawn_as(const OsmWay& way);
  [[nodiscard]] int64_t node_of(size_t chain, bool at_end) const {
    return at_end ? chains_[chain].nodes.back() : chains_[chain].nodes.front();
  }

  const OsmData& data_;
  const Projection& projection_;
  const std::vector<OsmChain>& chains_;
  Draft& draft_;
  std::vector<std::vector<double>> along_m_;  // of every point of every chain
  std::vector<Segment> segments_;
  std::unordered_map<int64_t, std::vector<size_t>> in_cell_;
  std::unordered_map<int64_t, std::vector<std::pair<size_t, bool>>> ends_at_;  // node -> chain, its end
  std::vector<Stretch> stretches_;
};

}  // namespace railfix::track
