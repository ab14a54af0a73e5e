// Which balise groups one ride can lead over.
#pragma once

#include <cstdint>
#include <unordered_map>
#include <vector>

#include "track/map.hpp"

namespace railfix::compare {

class Network {
 public:
  Network() = default;
  explicit Network(const track::Map& map);

  [[nodiscard]] bool has(uint32_t nid_lrbg) const { return groups_.contains(nid_lrbg); }
  /// The tracks of the two are joined somewhere, and yet no train that does not turn back comes from the one to the
  /// other within `longest_m`. Where nothing joins them the map lacks something, and that proves nothing.
  [[nodiscard]] bool no_way(uint32_t nid_lrbg, uint32_t other_nid_lrbg, double longest_m) const;

 private:
  struct Place {
    size_t edge = 0;
    double offset_m = 0;
  };
  [[nodiscard]] bool leads_to(const Place& from, const Place& to, double longest_m) const;
  /// A run is 2 x edge, one more against growing offsets.
  [[nodiscard]] double into_m(size_t run, double offset_m) const {
    return run % 2 == 0 ? offset_m : length_m_[run / 2] - offset_m;
  }
  std::vector<double> length_m_;            // of each edge
  std::vector<size_t> part_;                // of the network, that each edge belongs to
  std::vector<std::vector<size_t>> after_;  // runs that may follow each run
  std::unordered_map<uint32_t, std::vector<Place>> groups_;
};

}  // namespace railfix::compare
