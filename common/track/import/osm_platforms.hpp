// Platforms of an OpenStreetMap extract: which tracks they lie beside, on which side, from where to where.
#pragma once

#include <unordered_map>

#include "track/import/osm_marks.hpp"

namespace railfix::track {

class OsmPlatforms {
 public:
  /// REQUIRES: the draft's edges were made from the chains, in their order. All outlive this.
  OsmPlatforms(const OsmData& data, const Projection& projection, const std::vector<OsmChain>& chains, Draft& draft);

  /// Marks the beginning and the end of the edge beside every track that a platform lies next to. Where it goes on
  /// beside the next track, or beyond the last one, it does not end. Returns how many platforms lie beside no track.
  size_t add();

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
  struct Foot {
    Side side;
    double along_m = 0;
    double away_m = 0;
  };

  void index_tracks();
  void look_beside(const OsmWay& platform);
  [[nodiscard]] std::vector<Foot> tracks_beside(const Eigen::Vector2d& at, const Eigen::Vector2d& direction,
                                                const OsmTags& platform, Drawn drawn) const;
  [[nodiscard]] std::optional<Foot> foot_on(const Segment& segment, const Eigen::Vector2d& at,
                                            const Eigen::Vector2d& direction) const;
  void merge();
  void find_where_they_go_on();
  [[nodiscard]] bool goes_on(const Stretch& stretch, bool at_end) const;
  [[nodiscard]] bool reaches(const Stretch& stretch, bool at_end) const;
  void add_mark(const Stretch& stretch, double along_m);

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
