// Many simulated runs with faults, on several threads; the same result for any number of threads.
#pragma once

#include <functional>
#include <map>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "stanford.hpp"
#include "support/train/verdict.hpp"

namespace railfix::train {

using FaultName = std::pair<Sensor, FaultKind>;

struct CampaignPlan {
  double km = 100;
  uint64_t seed = 1;
  int threads = 2;
  double duration_s = 240;            // of one run
  std::vector<FaultName> faults;      // in turn, one a run
  double no_fault_share = 0.25;       // of runs beside those
  double unknown_start_share = 0;     // of runs that are not told where they begin
  bool slip_always = false;           // beside faults of other motion sensors too
  std::optional<double> saved_wrong;  // scales are saved, wrong by so much: camera's, wheel's and both in turn
  SimulationPlan simulation;
  fusion::FusionParameters parameters;
  std::shared_ptr<const track::Map> map;    // nullptr: every run on a random line
  std::vector<track::EdgePosition> starts;  // on map, in turn
};

/// A run with states outside, wider than allowed without saying so, or with many states that are wider.
struct BadRun {
  uint64_t number = 0;
  Fault fault;
  size_t outside = 0;
  size_t unsaid = 0;
  double excess_m = 0;
  double wider_share = 0;
};

struct CampaignResult {
  std::map<FaultName, Verdict> by_fault;
  std::map<FaultName, size_t> runs;
  Verdict sum;
  size_t run_count = 0;
  uint64_t longest_other_leg = 0;  // the run with the longest state on a leg that the train did not take
  std::vector<BadRun> bad;
  std::vector<BadRun> wide;  // none of the bad ones
  StanfordCounts stanford;
  std::map<fusion::SavedScalesAre, size_t> saved;  // runs that ended so
};

/// Run `number` of the campaign alone, and the fusion for it.
TrainSimulation simulation_of(const CampaignPlan& plan, uint64_t number);
fusion::Fusion fusion_of(const CampaignPlan& plan, const TrainSimulation& simulation, uint64_t number);
/// progress hears of the sum so far now and then.
CampaignResult run_campaign(const CampaignPlan& plan, const std::function<void(const Verdict&)>& progress = {});

}  // namespace railfix::train
