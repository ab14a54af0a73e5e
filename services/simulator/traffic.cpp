#include "simulator/traffic.hpp"

#include <algorithm>

#include "core/random.hpp"
#include "simulator/texture.hpp"

namespace railfix::simulator {
namespace {

constexpr double kShortestM = 60.0;
constexpr double kCarM = 25.5;

struct Beside {
  uint32_t edge;
  double begin_m, end_m;  // where the run goes beside it
  double middle_m;        // of the whole track
  bool loop;
};

std::vector<Beside> tracks_beside(const Trajectory& trajectory) {
  std::vector<Beside> beside;
  const auto& map = trajectory.line().path().map();
  for (const auto& branch : trajectory.line().branches()) {
    const double length_m = static_cast<double>(branch.samples.size()) * kCentreStepM;
    const double begin_m = std::max(0.0, branch.begin_m);
    const double end_m = std::min(trajectory.length_m(), branch.begin_m + length_m);
    if (end_m - begin_m < kShortestM) continue;
    const auto* edge = map.edge(branch.edge);
    const auto is_switch = [&](uint32_t node) { return map.nodes[node - 1].kind == track::NodeKind::railway_switch; };
    beside.push_back({branch.edge, begin_m, end_m, branch.begin_m + 0.5 * length_m,
                      is_switch(edge->from_node) && is_switch(edge->to_node)});
  }
  return beside;
}

double time_at(const Trajectory& trajectory, double distance_m) {
  double early = 0.0;
  double late = trajectory.duration_s();
  for (int i = 0; i < 40; ++i) {
    const double middle = 0.5 * (early + late);
    (trajectory.motion(middle).distance_m < distance_m ? early : late) = middle;
  }
  return 0.5 * (early + late);
}

}  // namespace

std::vector<OtherTrain> plan_traffic(const Trajectory& trajectory, int count, uint64_t seed) {
  std::vector<OtherTrain> trains;
  const auto beside = tracks_beside(trajectory);
  if (beside.empty()) return trains;
  core::Random random(mix_bits(seed, 51));
  for (int k = 0; k < count; ++k) {
    const auto& track = beside[static_cast<size_t>(k) % beside.size()];
    const double meet_m = track.begin_m + random.uniform(0.3, 0.7) * (track.end_m - track.begin_m);
    const double length_m = kCarM * std::floor(random.uniform(3.0, 8.0));
    if (track.loop) {
      trains.push_back({track.edge, track.middle_m + 0.5 * length_m, 0.0, length_m});
      continue;
    }
    const double speed_mps = (k % 3 == 2 ? 1.0 : -1.0) * random.uniform(18.0, 34.0);
    trains.push_back({track.edge, meet_m - speed_mps * time_at(trajectory, meet_m), speed_mps, length_m});
  }
  return trains;
}

}  // namespace railfix::simulator
