#include <algorithm>
#include <cmath>
#include <cstdio>
#include <memory>
#include <string>

#include "command_tpr.hpp"
#include "compare/gamab.hpp"
#include "compare/pairing.hpp"
#include "core/time.hpp"
#include "evaluation/statistics.hpp"
#include "evaluation/truth.hpp"

namespace railfix::tool {

namespace {

using compare::Verdict;

struct Options {
  std::string ours;
  std::string certified;
  std::string map;
  std::string start;
  std::vector<uint32_t> via;
  std::string truth;
  double foot_to_front_m = 0;
  int baseline = 3;
  int certified_baseline = 3;
  double longest_gap_s = 15;
  double offset_s = 0;
  compare::Demand demand;
};

constexpr double kPathM = 1e6;

/// The line through `start`, or through the first group that the certified system reports.
track::Path path_of(const Options& options, const std::vector<compare::TimedReport>& certified) {
  auto map = std::make_shared<const track::Map>(core::value_or_throw(track::Map::load(options.map)));
  track::EdgePosition start;
  if (!options.start.empty()) {
    start = core::value_or_throw(map->parse_position(options.start));
  } else {
    const track::BaliseGroup* first = nullptr;
    for (const auto& report : certified) {
      for (const auto& group : map->balise_groups) {
        if (first == nullptr && group.nid_lrbg() == report.fields.nid_lrbg) first = &group;
      }
      if (first != nullptr) break;
    }
    if (first == nullptr) throw core::BadInput(options.map + ": has none of the reported balise groups.");
    start = {first->edge, first->offset_m, track::Direction::forward};
  }
  return core::value_or_throw(track::Path::follow(map, start, kPathM, kPathM, options.via));
}

/// Error of a report against the truth; both on the path that begins where the truth does.
struct Judge {
  const evaluation::Truth* truth;
  double foot_to_front_m;
  [[nodiscard]] double error_m(const compare::PlacedReport& report) const {
    const auto real = truth->at(report.stamp_ns);
    return real ? report.front_m - real->distance_m - foot_to_front_m : evaluation::kUnknown;
  }
  /// 1 where the true front end lies outside the promised interval, else 0.
  [[nodiscard]] double outside(const compare::PlacedReport& report) const {
    const double real_m = report.front_m - error_m(report);
    return std::isfinite(real_m) && (real_m < report.low_m || real_m > report.high_m) ? 1 : 0;
  }
};

struct Columns {
  std::vector<compare::Sample> lengths;
  std::vector<compare::Sample> errors;
  std::vector<compare::Sample> outside;
};

Columns columns_of(const compare::Pairing& pairing, const std::optional<Judge>& judge) {
  Columns columns;
  for (const auto& pair : pairing.pairs) {
    const auto& ours = pair.ours_sent;  // as sent: what carrying adds is not its own
    const auto& other = pair.certified;
    columns.lengths.push_back({pair.leg, ours.high_m - ours.low_m, other.high_m - other.low_m});
    if (!judge) continue;
    columns.errors.push_back({pair.leg, judge->error_m(ours), judge->error_m(other)});
    if (!std::isfinite(columns.errors.back().ours) || !std::isfinite(columns.errors.back().certified)) continue;
    columns.outside.push_back({pair.leg, judge->outside(ours), judge->outside(other)});
  }
  return columns;
}

std::vector<double> values(const std::vector<compare::Sample>& samples, double compare::Sample::*side) {
  std::vector<double> list;
  for (const auto& sample : samples) list.push_back(std::abs(sample.*side));
  return list;
}

void print_row(const char* what, const std::vector<compare::Sample>& samples) {
  const auto ours = evaluation::summarise(values(samples, &compare::Sample::ours));
  const auto other = evaluation::summarise(values(samples, &compare::Sample::certified));
  std::printf("%-24s %9.2f %9.2f %9.2f   %9.2f %9.2f %9.2f\n", what, ours.mean, ours.p95, ours.max, other.mean,
              other.p95, other.max);
}

const char* text_of(Verdict verdict) {
  return verdict == Verdict::at_least_as_good ? "at least as good" : verdict == Verdict::worse ? "WORSE" : "not shown";
}

Verdict print_ratio(const char* what, const compare::RatioResult& result) {
  std::printf("%-24s ratio %.3f (%.3f to %.3f), %zu pairs in %zu legs: %s", what, result.ratio, result.low, result.high,
              result.samples, result.legs, text_of(result.verdict));
  if (result.verdict == Verdict::open && std::isfinite(result.legs_needed)) {
    std::printf("; needs about %.0f legs", result.legs_needed);
  } else if (result.verdict == Verdict::open && result.samples > 0) {
    std::printf("; more legs would not show it at this ratio");
  }
  std::printf("\n");
  return result.verdict;
}

void print_pairs(const compare::Pairing& pairing) {
  std::vector<double> differences;
  double carried_m = 0;
  size_t disjoint = 0;
  for (const auto& pair : pairing.pairs) {
    differences.push_back(pair.difference_m());
    carried_m = std::max(carried_m, pair.carried_m);
    if (pair.overlap()) continue;
    if (++disjoint <= 5) {
      std::printf("  at %.3f s the intervals have nothing in common: ours %+.2f m from the certified position\n",
                  core::seconds(pair.stamp_ns), pair.difference_m());
    }
  }
  double mean_m = 0;
  for (const double d : differences) mean_m += d / static_cast<double>(differences.size());
  std::vector<double> sizes;
  for (const double d : differences) sizes.push_back(std::abs(d));
  const auto size = evaluation::summarise(sizes);
  std::printf(
      "ours - certified         mean %+.2f m, |.| p50 %.2f, p95 %.2f, max %.2f m (carried in time: up to %.2f m)\n",
      mean_m, size.p50, size.p95, size.max, carried_m);
  const auto shift = compare::time_shift(pairing.pairs);
  if (std::isfinite(shift.shift_s)) {
    std::printf("difference over speed    %+.3f s +- %.3f s: stamps of the certified system %s by that much, or ours\n",
                shift.shift_s, shift.sigma_s, shift.shift_s >= 0 ? "are late" : "are early");
  }
  std::printf("intervals overlap        %zu of %zu\n", pairing.pairs.size() - disjoint, pairing.pairs.size());
}

int verdict(const Columns& columns, const Options& options) {
  std::printf("\nGAMAB, %.0f %% confidence, margin %.0f %%, bootstrap over legs (ours / certified)\n",
              100 * options.demand.confidence, 100 * options.demand.margin);
  std::vector<Verdict> verdicts;
  verdicts.push_back(
      print_ratio("interval length, mean", compare_ratio(columns.lengths, compare::Figure::mean, options.demand)));
  if (columns.errors.empty()) {
    std::printf("error                    not known without --truth\n");
  } else {
    verdicts.push_back(
        print_ratio("error, RMS", compare_ratio(columns.errors, compare::Figure::root_mean_square, options.demand)));
    const auto broken = compare_broken(columns.outside, options.demand);
    std::printf("outside the interval     ours on %zu, certified on %zu of %zu legs; ours at most %.2g of legs: %s\n",
                broken.ours, broken.certified, broken.legs, broken.ours_at_most, text_of(broken.verdict));
    verdicts.push_back(broken.verdict);
  }
  const bool worse = std::count(verdicts.begin(), verdicts.end(), Verdict::worse) > 0;
  const bool open = std::count(verdicts.begin(), verdicts.end(), Verdict::open) > 0;
  std::printf("verdict                  %s\n", worse                    ? "WORSE"
                                               : open                   ? "not shown"
                                               : columns.errors.empty() ? "intervals at least as good; errors not known"
                                                                        : "at least as good");
  return 0;
}

int compare_reports(const Options& options) {
  if (!options.truth.empty() && (options.map.empty() || options.start.empty()))
    throw core::BadInput("--truth needs --map and --start, the place on the map where the truth begins.");
  const auto ours =
      core::value_or_throw(compare::read_reports(options.ours, static_cast<etcs::Baseline>(options.baseline)));
  auto certified = core::value_or_throw(
      compare::read_reports(options.certified, static_cast<etcs::Baseline>(options.certified_baseline)));
  for (auto& report : certified) report.stamp_ns += core::to_ns(options.offset_s);
  const auto axes = options.map.empty() ? compare::Axes() : compare::Axes(path_of(options, certified));
  const auto pairing = compare::pair_up(ours, certified, axes, core::to_ns(options.longest_gap_s));
  std::optional<evaluation::Truth> truth;
  std::optional<Judge> judge;
  if (!options.truth.empty()) {
    truth = core::value_or_throw(evaluation::Truth::read(options.truth));
    judge = Judge{&*truth, options.foot_to_front_m};
  }
  std::printf("reports                  ours %zu, %zu with a place; certified %zu, %zu with a place\n", ours.size(),
              pairing.ours_placed, certified.size(), pairing.certified_placed);
  std::printf("paired in time           %zu in %zu legs; %zu certified reports have none of ours beside them\n",
              pairing.pairs.size(), pairing.legs, pairing.alone);
  if (pairing.pairs.empty())
    throw core::BadInput("No reports can be compared: do the times and balise groups of both files belong together?");
  print_pairs(pairing);
  const auto columns = columns_of(pairing, judge);
  std::printf("\n%-24s %9s %9s %9s   %9s %9s %9s\n%-24s %9s %9s %9s   %9s %9s %9s\n", "", "ours", "", "", "certified",
              "", "", "m", "mean", "p95", "max", "mean", "p95", "max");
  print_row("interval length", columns.lengths);
  if (judge) print_row("error, size", columns.errors);
  return verdict(columns, options);
}

}  // namespace

void add_tpr_compare(CLI::App& tpr, Action& chosen) {
  auto options = std::make_shared<Options>();
  auto* command = tpr.add_subcommand("compare", "Our reports beside those of the certified system, paired in time");
  command->footer("Example: railfix tpr compare --ours OUT --certified rbc.csv --map line.map");
  command->add_option("--ours", options->ours, "Folder of a run, or a .csv or .jsonl file with stamp_ns and hex")
      ->required();
  command->add_option("--certified", options->certified, "The certified system's: .csv or .jsonl, stamp_ns and hex")
      ->required();
  command->add_option("--map", options->map, "Compiled map: also reports with different LRBGs can be compared");
  command->add_option("--start", options->start, "Place on the map where the line begins, EDGE:OFFSET[:+|-]");
  command->add_option("--via", options->via, "Edges taken at switches");
  command->add_option("--truth", options->truth, "Folder with track.csv (SEQ/truth): errors of both systems");
  command->add_option("--foot-to-front-m", options->foot_to_front_m, "From the truth's place to the train's front end");
  const auto baselines = CLI::IsMember({3, 4});
  command->add_option("--baseline", options->baseline, "Layout of ours: 3 or 4")->check(baselines);
  command->add_option("--certified-baseline", options->certified_baseline, "Layout of the certified: 3 or 4")
      ->check(baselines);
  command->add_option("--longest-gap-s", options->longest_gap_s, "Ours are carried between reports not farther apart")
      ->capture_default_str();
  command->add_option("--offset-s", options->offset_s, "Added to the certified system's stamps");
  command->add_option("--confidence", options->demand.confidence, "One-sided")->check(CLI::Range(0.5, 0.9999));
  command->add_option("--margin", options->demand.margin, "At least as good: a ratio of at most 1 + margin")
      ->check(CLI::Range(0.0, 1.0));
  command->callback([options, &chosen] { chosen = [options] { return compare_reports(*options); }; });
}

}  // namespace railfix::tool
