#include "support/train/line.hpp"

#include <cmath>
#include <vector>

namespace railfix::train {
namespace {

constexpr double kBesideM = 4.5;

std::vector<track::Element> random_elements(core::Random& random, double length_m) {
  std::vector<track::Element> elements;
  double sum_m = 0;
  while (sum_m < length_m) {
    const double curvature = (random.uniform() < 0.5 ? -1 : 1) / random.uniform(400, 2500);
    for (const auto& e :
         {track::Element{random.uniform(150, 900), 0, 0}, track::Element{80, 0, curvature},
          track::Element{random.uniform(80, 500), curvature, curvature}, track::Element{80, curvature, 0}}) {
      elements.push_back(e);
      sum_m += e.length_m;
    }
  }
  return elements;
}

}  // namespace

std::shared_ptr<track::Map> random_line(core::Random& random, double length_m) {
  const auto elements = random_elements(random, length_m);
  double sum_m = 0;
  for (const auto& e : elements) sum_m += e.length_m;
  std::vector<track::GradePoint> profile;
  double elevation_m = 400;
  for (double offset_m = 0; offset_m < sum_m; offset_m += 800) {
    profile.push_back({offset_m, elevation_m, 100});
    elevation_m += 800 * random.uniform(-0.015, 0.015);
  }
  auto map = std::make_shared<track::Map>();
  const double heading_rad = random.uniform(0, 6);
  const track::PlanPose start{1000, 2000, heading_rad};
  const track::PlanPose beside{1000 + kBesideM * std::cos(heading_rad), 2000 - kBesideM * std::sin(heading_rad),
                               heading_rad};
  map->edges.push_back({1, "line", 1, 2, "", track::Alignment::chained(start, elements, profile)});
  map->edges.push_back({2, "beside", 3, 4, "", track::Alignment::chained(beside, elements, profile)});
  for (uint32_t id = 1; id <= 4; ++id) map->nodes.push_back({id, track::NodeKind::end, "", 0, 0});
  return map;
}

}  // namespace railfix::train
