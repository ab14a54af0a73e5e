#include "campaign.hpp"

#include <algorithm>
#include <atomic>
#include <cmath>
#include <exception>
#include <thread>

namespace railfix::train {
namespace {

constexpr size_t kBlock = 8;
constexpr double kManyWider = 0.05;
constexpr double kSavedSigma = 1e-4;

struct Run {
  Fault fault;
  Verdict verdict;
  StanfordCounts stanford;
  fusion::SavedScalesAre saved;
};

Run run_one(const CampaignPlan& plan, uint64_t number) {
  const auto simulation = simulation_of(plan, number);
  auto fusion = fusion_of(plan, simulation, number);
  Run run{simulation.plan().fault, {}, {}, {}};
  run.verdict = judge(simulation, fusion, 0, [&run](const fusion::TrainEstimate& state, double error_m) {
    run.stanford.add(std::abs(error_m), error_m > 0 ? state.over_m : state.under_m);
  });
  run.saved = fusion.saved_scales();
  return run;
}

std::vector<Run> run_block(const CampaignPlan& plan, uint64_t first) {
  std::vector<Run> runs(kBlock);
  std::vector<std::exception_ptr> failures(kBlock);  // one that leaves a thread would end the program
  std::atomic<size_t> next{0};
  std::vector<std::thread> threads;
  for (int t = 0; t < plan.threads; ++t) {
    threads.emplace_back([&] {
      for (size_t i = next++; i < kBlock; i = next++) {
        try {
          runs[i] = run_one(plan, first + i);
        } catch (...) {
          failures[i] = std::current_exception();
        }
      }
    });
  }
  for (auto& thread : threads) thread.join();
  for (const auto& failure : failures) {
    if (failure) std::rethrow_exception(failure);
  }
  return runs;
}

}  // namespace

TrainSimulation simulation_of(const CampaignPlan& plan, uint64_t number) {
  const uint64_t seed = seed_of_run(plan.seed, number);
  core::Random random = draws_of_run(seed);
  SimulationPlan one = plan.simulation;
  one.duration_s = plan.duration_s;
  const bool none = plan.faults.empty() || random.uniform() < plan.no_fault_share;
  if (!none) {
    const auto& [sensor, kind] = plan.faults[number % plan.faults.size()];
    draw_fault(one, random, sensor, kind, plan.slip_always);
  }
  if (random.uniform() < plan.unknown_start_share) one.start_told = false;
  if (!plan.map) return TrainSimulation(one, seed);
  return TrainSimulation(one, seed, plan.map, plan.starts[number % plan.starts.size()]);
}

fusion::Fusion fusion_of(const CampaignPlan& plan, const TrainSimulation& simulation, uint64_t number) {
  std::optional<fusion::SavedScales> saved;
  if (plan.saved_wrong) {
    const double wrong = (number / 3 % 2 == 0 ? 1 : -1) * *plan.saved_wrong;
    saved.emplace();
    saved->scales = {simulation.camera_scale_error + (number % 3 != 1 ? wrong : 0),
                     simulation.wheel_scale_error + (number % 3 != 0 ? wrong : 0), kSavedSigma, kSavedSigma, 0};
    saved->stamp_ns = simulation.stamp_ns(0);
  }
  return core::value_or_throw(fusion::Fusion::create(plan.parameters, simulation.map, simulation.start(), saved));
}

CampaignResult run_campaign(const CampaignPlan& plan, const std::function<void(const Verdict&)>& progress) {
  CampaignResult result;
  for (uint64_t first = 0; result.sum.way_m < 1000 * plan.km; first += kBlock) {
    const auto runs = run_block(plan, first);
    if (progress) progress(result.sum);
    for (size_t i = 0; i < runs.size() && result.sum.way_m < 1000 * plan.km; ++i) {
      const auto& run = runs[i];
      const FaultName name{run.fault.sensor, run.fault.kind};
      result.by_fault[name].add(run.verdict);
      ++result.runs[name];
      if (run.verdict.other_leg_sure_s > result.sum.other_leg_sure_s) result.longest_other_leg = first + i;
      result.sum.add(run.verdict);
      ++result.run_count;
      result.stanford.add(run.stanford);
      ++result.saved[run.saved];
      const auto& v = run.verdict;
      const double wider = static_cast<double>(v.wider) / static_cast<double>(std::max<size_t>(v.states, 1));
      const BadRun noted{first + i, run.fault, v.outside, v.wider_unsaid, v.worst_excess_m, wider};
      if (v.outside + v.wider_unsaid > 0) {
        result.bad.push_back(noted);
      } else if (wider > kManyWider) {
        result.wide.push_back(noted);
      }
    }
  }
  return result;
}

}  // namespace railfix::train
