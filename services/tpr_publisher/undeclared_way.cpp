#include "tpr_publisher/undeclared_way.hpp"

#include <algorithm>
#include <cmath>

namespace railfix::tpr_publisher {

namespace {

constexpr size_t kMostRoutes = 5000;      // looked at in a large station before giving up
constexpr double kLegsDifferM = 200.0;    // beside ...
constexpr double kLegsDifferPerM = 0.05;  // ... this share of the way

}  // namespace

void Turns::run(double step_m) {
  points_.push_back(points_.back() + step_m);
  while (points_.size() >= 3) {
    const auto last = points_.end() - 1;
    const double stretch_m = std::abs(last[0] - last[-1]);
    const double before_m = std::abs(last[-1] - last[-2]);
    if ((last[0] - last[-1]) * (last[-1] - last[-2]) >= 0) {  // goes on the same way
      points_.erase(last - 1);
    } else if (points_.size() >= 4 && stretch_m >= before_m && before_m <= std::abs(last[-2] - last[-3])) {
      points_.erase(last - 2, last);
    } else {
      return;
    }
  }
}

double legs_differ_m(double way_m) {
  return kLegsDifferM + kLegsDifferPerM * std::abs(way_m);
}

std::optional<std::vector<WayBetween>> ways_between(const track::Map& map, const track::Ways& ways,
                                                    const track::EdgePosition& from, const track::EdgePosition& to,
                                                    double way_m) {
  const bool along = way_m >= 0;
  const auto begin = track::run_of(map, from);
  const double differ_m = legs_differ_m(way_m);
  std::vector<WayBetween> found;
  std::vector<track::Route> open{track::Route(track::run_of(map, to), to.offset_m, 0)};
  for (size_t i = 0; i < open.size(); ++i) {
    if (open.size() > kMostRoutes) return std::nullopt;
    const auto& end = along ? open[i].legs().front() : open[i].legs().back();
    if (end.run == begin) {
      const double length_m = -(end.begin_m + begin.into_m(from.offset_m));
      if (std::abs(length_m - way_m) <= differ_m) found.push_back({open[i], length_m});
    }
    if (along ? -end.begin_m > way_m + differ_m : end.end_m() > -way_m + differ_m) continue;
    for (const auto& next : along ? ways.before(end.run) : ways.after(end.run)) {
      auto longer = open[i];
      along ? longer.push_behind(next) : longer.push_ahead(next);
      open.push_back(std::move(longer));
    }
  }
  std::sort(found.begin(), found.end(), [&](const WayBetween& a, const WayBetween& b) {
    return std::abs(a.length_m - way_m) < std::abs(b.length_m - way_m);
  });
  return found;
}

double most_apart_m(const std::vector<WayBetween>& ways, double length_m) {
  double apart_m = 0;
  for (const auto& way : ways) apart_m = std::max(apart_m, std::abs(way.length_m - length_m));
  return apart_m;
}

bool every_way_leads_to(const track::Map& map, const track::Ways& ways, const track::EdgePosition& from, bool along,
                        uint32_t edge, double most_m) {
  struct Open {
    track::Run run;
    double length_m;  // from the edge of `from` on
  };
  std::vector<Open> open{{track::run_of(map, from), 0}};
  for (size_t i = 0; i < open.size(); ++i) {
    const auto further = along ? ways.after(open[i].run) : ways.before(open[i].run);
    if (further.empty() || open[i].length_m > most_m || open.size() > kMostRoutes) return false;
    const double length_m = open[i].length_m;
    for (const auto& next : further) {
      if (next.edge->id != edge) open.push_back({next, length_m + next.length_m()});
    }
  }
  return true;
}

}  // namespace railfix::tpr_publisher
