#include "system/soak.hpp"

#include <cmath>
#include <cstdio>

#include "core/time.hpp"

namespace railfix::system_test {
namespace {

constexpr double kPeriodS = 10;
constexpr double kSettleShare = 0.2;  // of the time: caches and histories fill
constexpr double kGrowthMbPerHour = 5;
constexpr double kLatencyMsPerHour = 5;
constexpr double kStatePauseS = 0.35;  // as when something breaks
constexpr double kReportPauseS = 2;

/// Least squares.
struct Line {
  double slope_per_hour = 0;
  double sigma = 0;
  double first = 0;
  double last = 0;
};

struct Series {
  std::vector<double> at_s;
  std::vector<double> value;
  void add(double time_s, double one) {
    at_s.push_back(time_s);
    value.push_back(one);
  }
  // By ten blocks' medians, so that one noisy moment of the machine is one of ten points.
  [[nodiscard]] Line line() const {
    const size_t begin = static_cast<size_t>(kSettleShare * static_cast<double>(value.size()));
    constexpr size_t kBlocks = 10;
    std::vector<double> x;
    std::vector<double> y;
    for (size_t block = 0; block < kBlocks; ++block) {
      const size_t from = begin + block * (value.size() - begin) / kBlocks;
      const size_t to = begin + (block + 1) * (value.size() - begin) / kBlocks;
      if (from == to) continue;
      std::vector<double> part(value.begin() + static_cast<std::ptrdiff_t>(from),
                               value.begin() + static_cast<std::ptrdiff_t>(to));
      std::nth_element(part.begin(), part.begin() + static_cast<std::ptrdiff_t>(part.size() / 2), part.end());
      x.push_back((at_s[from] + at_s[to - 1]) / 2 / 3600);
      y.push_back(part[part.size() / 2]);
    }
    const auto n = static_cast<double>(x.size());
    if (n < 3) return {};
    double mean_x = 0;
    double mean_y = 0;
    for (size_t i = 0; i < x.size(); ++i) {
      mean_x += x[i] / n;
      mean_y += y[i] / n;
    }
    double xx = 0;
    double xy = 0;
    for (size_t i = 0; i < x.size(); ++i) {
      xx += (x[i] - mean_x) * (x[i] - mean_x);
      xy += (x[i] - mean_x) * (y[i] - mean_y);
    }
    Line line{xy / xx, 0, y.front(), y.back()};
    double rest = 0;
    for (size_t i = 0; i < x.size(); ++i) {
      const double residual = y[i] - mean_y - line.slope_per_hour * (x[i] - mean_x);
      rest += residual * residual;
    }
    line.sigma = std::sqrt(rest / (n - 2) / xx);
    return line;
  }
  /// From the settled part.
  [[nodiscard]] double median() const {
    if (value.empty()) return 0;
    std::vector<double> settled(
        value.begin() + static_cast<std::ptrdiff_t>(kSettleShare * static_cast<double>(value.size())), value.end());
    std::nth_element(settled.begin(), settled.begin() + static_cast<std::ptrdiff_t>(settled.size() / 2), settled.end());
    return settled[settled.size() / 2];
  }
};

struct Watched {
  Series memory_mb;
  Series latency_ms;  // from the picture's grab to this service's output, 99 of 100
  Series usual_latency_ms;
  Series cpu_percent;
  uint32_t pid = 0;
  int restarts = 0;
  uint64_t dropped = 0;
  bool silent = true;  // at the last look
};

bool print(const std::map<std::string, Watched>& all, const Heard& heard, double ridden_s) {
  std::printf(
      "\nsoak after %.1f minutes: %llu states, %llu outside, longest pause of train_state %.2f s, of reports "
      "%.2f s\n%-24s %26s %30s %8s %8s %8s %8s %8s\n",
      ridden_s / 60, static_cast<unsigned long long>(heard.states), static_cast<unsigned long long>(heard.outside),
      heard.state_gap_s, heard.report_gap_s, "service", "resident MB, slope an hour", "latency p99 ms, slope an hour",
      "p50 ms", "p99 ms", "CPU %", "dropped", "restarts");
  bool good = true;
  for (const auto& [name, one] : all) {
    const auto memory = one.memory_mb.line();
    const auto latency = one.latency_ms.line();
    const bool grows = memory.slope_per_hour - 2 * memory.sigma > kGrowthMbPerHour ||
                       latency.slope_per_hour - 2 * latency.sigma > kLatencyMsPerHour;
    good = good && !grows && !one.silent && one.restarts == 0;
    std::printf(
        "%-24s %6.1f to %6.1f, %+5.2f +- %4.2f  %6.1f to %6.1f, %+6.2f +- %4.2f  %8.2f %8.2f %8.2f %8llu %8d%s\n",
        name.c_str(), memory.first, memory.last, memory.slope_per_hour, memory.sigma, latency.first, latency.last,
        latency.slope_per_hour, latency.sigma, one.usual_latency_ms.median(), one.latency_ms.median(),
        one.cpu_percent.median(), static_cast<unsigned long long>(one.dropped), one.restarts,
        one.silent ? "  SILENT"
        : grows    ? "  GROWS"
                   : "");
  }
  std::printf("reports lost: %llu in the train, %llu at the ground\n",
              static_cast<unsigned long long>(heard.reports_lost), static_cast<unsigned long long>(heard.ground_lost));
  std::fflush(stdout);
  return good && heard.state_gap_s <= kStatePauseS && heard.report_gap_s <= kReportPauseS &&
         heard.outside + heard.reports_lost + heard.ground_lost == 0;
}

}  // namespace

int soak(Rig& rig, Observer& observer, double minutes) {
  std::map<std::string, Watched> all;
  observer.begin();
  double said_s = 0;
  for (double at_s = 0; at_s < 60 * minutes; at_s += kPeriodS) {
    observer.run(kPeriodS);
    for (const auto& name : rig.services()) {
      auto& one = all[name];
      const auto* seen = observer.service(name);
      one.silent = seen == nullptr || !seen->alive;
      if (one.silent) continue;
      const auto& status = seen->status;
      if (one.pid != 0 && one.pid != status.pid()) ++one.restarts;
      one.pid = status.pid();
      one.dropped = status.dropped();
      one.memory_mb.add(at_s, status.rss_mb());
      one.latency_ms.add(at_s, status.latency_p99_ms());
      one.usual_latency_ms.add(at_s, status.latency_p50_ms());
      one.cpu_percent.add(at_s, status.cpu_percent());
    }
    if (at_s - said_s < 600) continue;
    said_s = at_s;
    print(all, observer.end(), at_s);
  }
  return print(all, observer.end(), 60 * minutes) ? 0 : 1;
}

}  // namespace railfix::system_test
