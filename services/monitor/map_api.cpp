#include "monitor/map_api.hpp"

#include <spdlog/fmt/fmt.h>

#include <cmath>

#include "monitor/live_api.hpp"

namespace railfix::monitor {
namespace {

constexpr double kRadiusM = 20'000;
constexpr double kLargestRadiusM = 50'000;

std::optional<double> number_of(const Request& request, const char* key) {
  const auto found = request.query.find(key);
  if (found == request.query.end()) return std::nullopt;
  char* end = nullptr;
  const double value = std::strtod(found->second.c_str(), &end);
  return end != found->second.c_str() && *end == '\0' && std::isfinite(value) ? std::optional(value) : std::nullopt;
}

}  // namespace

Response MapApi::get(const Request& request, const std::optional<track::EdgePosition>& train) {
  const Part part = part_of(request, train);
  if (part.radius_m > kLargestRadiusM) {
    return {400, "text/plain; charset=utf-8",
            fmt::format("radius must be {:.0f} m or less; without it {:.0f} m are given\n", kLargestRadiusM, kRadiusM),
            "", "no-store"};
  }
  if (!last_text_ || !(part == last_)) {
    const auto around = part.edge == 0 ? std::nullopt : std::optional(track::EdgePosition{part.edge, part.offset_m});
    last_text_ = std::make_shared<const std::string>(text_of(view_.message(around, part.radius_m)) + "\n");
    last_ = part;
  }
  return {200, "application/json", "", "", "no-store", last_text_};
}

MapApi::Part MapApi::part_of(const Request& request, const std::optional<track::EdgePosition>& train) const {
  const double radius_m = number_of(request, "radius").value_or(kRadiusM);
  const auto edge = number_of(request, "edge");
  if (edge && *edge >= 1 && *edge <= static_cast<double>(map_.edges.size())) {
    return {static_cast<uint32_t>(*edge), number_of(request, "offset").value_or(0), radius_m};
  }
  if (view_.length_m() <= MapView::kWholeMapM) return {};
  const bool is_here = train && map_.edge(train->edge) != nullptr;
  const auto around = is_here ? *train : track::EdgePosition{1, 0};
  return {around.edge, around.offset_m, radius_m};
}

}  // namespace railfix::monitor
