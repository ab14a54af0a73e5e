// The first step of the search on the whole network: every place of every edge in both directions is a hypothesis that
// follows the train from block to block of 100 m, through every leg of every switch, and estimates with an extended
// Kalman filter of four states where along the track it is and the errors of odometer and gyro. What falls far below
// the best one is dropped, and a way of more than 12 edges within a block; nothing else is, so what is left are all
// places that may be the one.
#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include "map_matcher/locate/locator_types.hpp"
#include "map_matcher/locate/network_index.hpp"

namespace railfix::map_matcher {

class PlaceFilter {
 public:
  static constexpr size_t kBlockBins = 5;
  /// `first_bin` is the number of the bin where it begins, counted since the first ever. The index must outlive it.
  PlaceFilter(const LocatorParameters& parameters, const NetworkIndex& index, size_t first_bin)
      : parameters_(parameters), index_(&index), first_bin_(first_bin), taken_bins_(first_bin) {}

  /// Takes the whole blocks that are new. `gone_bins` were measured before the way, and forgotten. REQUIRES: no more
  /// than taken_bins().
  void advance(const MeasuredWay& way, size_t gone_bins);
  /// Those that may be the place, the likely ones first; their bins count from the way's first one.
  [[nodiscard]] std::vector<Candidate> candidates(size_t gone_bins) const;
  [[nodiscard]] size_t first_bin() const { return first_bin_; }
  /// The number of the first bin that it has not taken yet.
  [[nodiscard]] size_t taken_bins() const { return taken_bins_; }
  /// How much likelier (log) the best place is than that the train is on a track that is not on the map, which many
  /// places had the chance to fit.
  [[nodiscard]] double evidence() const;
  /// Nothing on the map fits.
  [[nodiscard]] bool lost() const { return begun_ && places_.empty(); }
  /// More may fit than could be followed.
  [[nodiscard]] bool overflowed() const { return overflowed_; }

 private:
  struct Block {
    double turn_rad = 0;
    double turned_rad = 0;     // measured since the filter's beginning, at the end of the block
    double turn_variance = 0;  // that is new in the block
    std::vector<Mark> marks;   // from the end of the block, negative
  };
  /// A hypothesis. States: turning on the map less the measured one, constant error of the turning a metre, place and
  /// scale of the odometer less one.
  struct Place {
    uint32_t run = 0;
    uint32_t before = 0;  // the run before that
    float into_m = 0;     // the place
    float base_rad = 0;   // turned on the map since the filter's beginning, at the beginning of the run
    float offset_rad = 0;
    float bias_per_m = 0;
    float scale_error = 0;
    float log = 0;                       // log likelihood
    std::array<float, 10> covariance{};  // upper triangle, row by row
  };
  /// The runs since the beginning of the block, and where they begin before the present one.
  struct Trail {
    struct Leg {
      uint32_t run = 0;
      float begin_m = 0;
    };
    std::array<Leg, 12> legs;
    size_t size = 0;
  };
  [[nodiscard]] std::vector<Block> blocks_of(const MeasuredWay& way, size_t gone_bins);
  void begin(const std::vector<Block>& blocks);
  void follow(Place origin, const std::vector<Block>& blocks);
  [[nodiscard]] Place origin_at(uint32_t run, float into_m) const;
  static void foretell(Place& place, const Block& block);
  [[nodiscard]] static float block_end_m(const Place& place);
  /// False, and nothing changed, where it comes to the end of its run.
  [[nodiscard]] bool runs_on(Place& place, const Block& block) const;
  void go(const Place& place, const Block& block, double least_log, std::vector<Place>& to) const;
  void go_on(const Place& place, float end_m, const Trail& trail, const Block& block, double least_log,
             std::vector<Place>& to) const;
  void weigh(Place& place, const Block& block) const;
  void weigh_marks(Place& place, const Trail& trail, const Block& block) const;
  [[nodiscard]] float heading(const Place& place, float into_m) const;
  void drop_unlikely();
  void join_same();
  void weigh_unmapped(const Block& block);

  LocatorParameters parameters_;
  const NetworkIndex* index_;
  std::vector<Place> places_;
  float best_log_ = -INFINITY;
  std::vector<double> best_logs_;  // of each block while the filter begins
  std::vector<Place> now_;         // of one origin
  std::vector<Place> next_;        // on another run
  size_t first_bin_;
  size_t taken_bins_;
  double turned_rad_ = 0;
  double unmapped_log_ = 0;  // log likelihood of a track that is not on the map
  double last_turn_rad_ = 0;
  size_t origins_ = 0;
  bool begun_ = false;
  bool overflowed_ = false;
};

}  // namespace railfix::map_matcher
