// Track choice: many passages of switches, each with a layout, radius, speed, sensor and manoeuvre of its own.
#include <algorithm>
#include <chrono>
#include <cstdio>
#include <iostream>
#include <map>
#include <string>

#include "matching.hpp"
#include "support/switch_passage.hpp"

namespace railfix::measure {
namespace {

constexpr double kFrogLimitM = 30;
constexpr double kBestTestSigmas = 6.2;  // P(error) = Q(sigmas / 2)

/// Passages with one kind of sensor.
struct Class {
  explicit Class(const char* what) : name(what) {}
  const char* name;
  int passages = 0;
  int wrong = 0;
  int open = 0;
  int facing = 0;
  int late = 0;         // or never
  int scarce = 0;       // the turning is all there is, and too little for anyone
  int scarce_late = 0;  // ... of those that are late
  std::vector<double> behind_frog_m;

  void add(const testing::PassagePlan& plan, const testing::PassageResult& result) {
    ++passages;
    wrong += result.wrong ? 1 : 0;
    open += result.known_at_end ? 0 : 1;
    if (!plan.facing) return;
    ++facing;
    if (result.known_at_end) behind_frog_m.push_back(result.behind_frog_m);
    const bool is_scarce = !plan.camera && result.apart_sigmas < kBestTestSigmas;
    late += is_late(result) ? 1 : 0;
    scarce += is_scarce ? 1 : 0;
    scarce_late += is_scarce && is_late(result) ? 1 : 0;
  }
  static bool is_late(const testing::PassageResult& result) {
    return !result.known_at_end || result.behind_frog_m > kFrogLimitM;
  }
  void print() {
    std::sort(behind_frog_m.begin(), behind_frog_m.end());
    const auto at = [&](double share) {
      return behind_frog_m.empty()
                 ? 0.0
                 : behind_frog_m[static_cast<size_t>(share * static_cast<double>(behind_frog_m.size() - 1))];
    };
    std::printf(
        "%s: %d passages, wrong once declared %d, not known at the end %d; of %d facing ones declared later than "
        "30 m behind the frog or never %d\n",
        name, passages, wrong, open, facing, late);
    std::printf("  declared behind the frog: median %.1f m, p95 %.1f m, p99 %.1f m, max %.1f m\n", at(0.5), at(0.95),
                at(0.99), at(1));
    if (scarce == 0) return;
    std::printf("  legs less than %.1f sigmas apart (even the best test would be wrong 1 time in 1000): %d, late %d\n",
                kBestTestSigmas, scarce, scarce_late);
  }
};

void tell(int number, const testing::PassagePlan& plan, const testing::PassageResult& result) {
  const std::string what = result.wrong          ? "wrong at " + std::to_string(result.wrong_at_m) + " m"
                           : result.known_at_end ? "late"
                                                 : "open";
  std::cout << what << " (" << number << "): " << plan.text() << (result.astray ? " astray" : "") << ", legs apart by "
            << result.apart_sigmas << " sigmas, declared " << result.behind_frog_m << " m behind the frog\n";
}

testing::PassagePlan passage_of(core::Random& random, const MatchingOptions& options) {
  testing::PassagePlan plan = testing::random_passage(random);
  static const std::map<std::string, testing::GyroFault> faults{{"", testing::GyroFault::none},
                                                                {"stuck", testing::GyroFault::stuck},
                                                                {"bias", testing::GyroFault::bias},
                                                                {"noise", testing::GyroFault::noise}};
  plan.gyro_fault = faults.at(options.gyro_fault);
  if (plan.gyro_fault != testing::GyroFault::none) {
    plan.camera = plan.frog_seen = false;
    plan.gyro_fault_rps = (random.uniform() < 0.5 ? -1 : 1) * options.fault_rps;
  }
  if (!options.just_clear) return plan;
  plan.facing = true;
  plan.manoeuvre = testing::Manoeuvre::just_clear;
  plan.speed_mps = std::min(plan.speed_mps, core::mps_from_kmh(40));
  return plan;
}

}  // namespace

int measure_switches(const MatchingOptions& options) {
  const int count = options.count > 0 ? options.count : 1000;
  core::Random random(options.seed * 1000003);
  Class camera("camera");
  Class gyro("gyro only");
  const auto begin = std::chrono::steady_clock::now();
  for (int i = 0; i < count; ++i) {
    const testing::PassagePlan plan = passage_of(random, options);
    const auto result = testing::SwitchPassage(plan, options.seed * 100000 + static_cast<uint64_t>(i)).run();
    (plan.camera ? camera : gyro).add(plan, result);
    const bool late = plan.facing && Class::is_late(result);
    if (options.each && (result.wrong || !result.known_at_end || late)) tell(i, plan, result);
  }
  camera.print();
  gyro.print();
  std::printf("%.1f s\n", std::chrono::duration<double>(std::chrono::steady_clock::now() - begin).count());
  return 0;
}

}  // namespace railfix::measure
