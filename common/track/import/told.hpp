// How problems name an edge and write a number.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <string>
#include <vector>

#include "core/units.hpp"
#include "track/map.hpp"

namespace railfix::track {

/// "12.34"; a number beyond any railway's is written short ("1e+308"), so that the sentence stays one.
inline std::string told_number(double value, int places) {
  std::array<char, 32> text{};
  std::snprintf(text.data(), text.size(), std::abs(value) < 1e9 ? "%.*f" : "%.*g", places, value);
  return text.data();
}

inline std::string told_m(double value, int places = 2) {
  return told_number(value, places) + " m";
}

inline std::string told_place(const GeoPoint& at) {
  return "latitude " + told_number(at.lat_deg, 6) + ", longitude " + told_number(at.lon_deg, 6);
}

inline std::string told_deg(double rad) {
  return told_number(core::deg_from_rad(rad), 1) + " degrees";
}

/// What a fit has left out of a drawing.
inline std::string told_left_out(size_t points, double most_m) {
  return std::to_string(points) + " point" + (points > 1 ? "s" : "") + " up to " + told_m(most_m) +
         " beside the track that the others make; left out";
}

/// Behind the first of so many that a sentence is about.
inline std::string told_as_more(size_t count) {
  return count > 1 ? ", as " + std::to_string(count - 1) + " more," : "";
}

/// "a, b, c and 14 more"
inline std::string told_list(const std::vector<std::string>& names, size_t most = 3) {
  std::string list;
  const size_t named = std::min(most, names.size());
  for (size_t i = 0; i < named; ++i) list += (i == 0 ? "" : ", ") + names[i];
  return list + (names.size() > named ? " and " + std::to_string(names.size() - named) + " more" : "");
}

inline std::string called(const Edge& edge) {
  return "edge " + std::to_string(edge.id) + " (" + edge.name + ")";
}

}  // namespace railfix::track
