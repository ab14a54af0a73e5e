// Track choice: many passages of switches, each with a layout, radius, speed, sensor and manoeuvre of its own.
#include <algorithm>
#include <chrono>
#include <cstdio>
#include <iostream>

#include "matching.hpp"
#include "support/switch_passage.hpp"

namespace railfix::measure {

int measure_switches(const MatchingOptions& options) {
  using testing::PassagePlan;
  using testing::SwitchPassage;
  const int count = options.count > 0 ? options.count : 1000;
  core::Random random(options.seed * 1000003);
  int wrong = 0;
  int open_at_end = 0;
  int facing = 0;
  int late = 0;
  std::vector<double> behind_frog_m;
  const auto begin = std::chrono::steady_clock::now();
  for (int i = 0; i < count; ++i) {
    const PassagePlan plan = testing::random_passage(random);
    const auto result = SwitchPassage(plan, options.seed * 100000 + static_cast<uint64_t>(i)).run();
    wrong += result.wrong ? 1 : 0;
    open_at_end += result.known_at_end ? 0 : 1;
    const bool chosen = plan.facing && result.known_at_end;
    if (chosen) {
      ++facing;
      behind_frog_m.push_back(result.behind_frog_m);
      late += result.behind_frog_m > 30 ? 1 : 0;
    }
    if (options.each && (result.wrong || !result.known_at_end || (chosen && result.behind_frog_m > 30))) {
      std::cout << (result.wrong ? "wrong at " + std::to_string(result.wrong_at_m)
                                 : (result.known_at_end ? "late" : "open"))
                << " (" << i << "): " << plan.text() << ", declared " << result.behind_frog_m << " m behind the frog\n";
    }
  }
  const double seconds = std::chrono::duration<double>(std::chrono::steady_clock::now() - begin).count();
  std::sort(behind_frog_m.begin(), behind_frog_m.end());
  const auto at = [&](double share) {
    return behind_frog_m.empty()
               ? 0.0
               : behind_frog_m[static_cast<size_t>(share * static_cast<double>(behind_frog_m.size() - 1))];
  };
  std::printf("passages %d (facing, declared: %d), wrong once declared %d, not known at the end %d\n", count, facing,
              wrong, open_at_end);
  std::printf("declared behind the frog: median %.1f m, p95 %.1f m, p99 %.1f m, max %.1f m; later than 30 m: %d\n",
              at(0.5), at(0.95), at(0.99), at(1), late);
  std::printf("%.1f s\n", seconds);
  return 0;
}

}  // namespace railfix::measure
