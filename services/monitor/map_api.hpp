// /api/map: which part of the line is asked for, and the answer, made once for all who ask for the same. Knows no DDS.
#pragma once

#include "monitor/http_types.hpp"
#include "monitor/map_view.hpp"

namespace railfix::monitor {

class MapApi {
 public:
  /// Both must outlive it.
  MapApi(const track::Map& map, const MapView& view) : map_(map), view_(view) {}

  /// All of a short map; of a long one what lies around a place, the train's when none is named.
  Response get(const Request& request, const std::optional<track::EdgePosition>& train);

 private:
  struct Part {
    uint32_t edge = 0;  // 0 = all
    double offset_m = 0;
    double radius_m = 0;
    friend bool operator==(const Part&, const Part&) = default;
  };
  [[nodiscard]] Part part_of(const Request& request, const std::optional<track::EdgePosition>& train) const;

  const track::Map& map_;
  const MapView& view_;
  Part last_;
  std::shared_ptr<const std::string> last_text_;  // null = none was asked for yet
};

}  // namespace railfix::monitor
