#include <algorithm>
#include <cmath>
#include <cstdio>
#include <limits>
#include <memory>
#include <optional>
#include <string>

#include "command_tpr.hpp"
#include "compare/columns.hpp"
#include "compare/doubts.hpp"
#include "compare/one_train.hpp"
#include "compare/other_fields.hpp"
#include "compare/pairing.hpp"
#include "compare/time_shift.hpp"
#include "compare/verdict_text.hpp"
#include "core/time.hpp"
#include "evaluation/statistics.hpp"
#include "evaluation/truth.hpp"
#include "number_between.hpp"
#include "report_source.hpp"

namespace railfix::tool {

namespace {

struct CompareOptions {
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
  TrainNetwork network;
  double for_s = 0;
};

constexpr int kWorse = 3;  // exit code
constexpr double kPathM = 1e6;
constexpr double kTurnS = 0.1;
constexpr size_t kMostTold = 5;
constexpr const char* kSeconds = "a number of seconds";
constexpr double kLongestGapS = 86400;
constexpr double kLargestOffsetS = 4e9;  // from a clock that begins at 0 to UTC, twice; sums fit nanoseconds

/// Where reports are compared: on the line through `start`, or through the first group of the map that the certified
/// system reports. The map is read once.
class Line {
 public:
  explicit Line(const CompareOptions& options) : options_(options) {
    if (options.map.empty()) {
      axes_.emplace();
      return;
    }
    map_ = std::make_shared<const track::Map>(core::value_or_throw(track::Map::load(options.map)));
    if (!options.start.empty()) follow(core::value_or_throw(map_->parse_position(options.start)));
  }
  /// Nothing before a group is known.
  const compare::Axes* axes(const std::vector<compare::TimedReport>& certified) {
    for (const auto& report : certified) {
      if (axes_) break;
      for (const auto& group : map_->balise_groups) {
        if (group.nid_lrbg() != report.fields.nid_lrbg) continue;
        follow({group.edge, group.offset_m, track::Direction::forward});
        break;
      }
    }
    return axes_ ? &*axes_ : nullptr;
  }

 private:
  void follow(const track::EdgePosition& start) {
    axes_.emplace(core::value_or_throw(track::Path::follow(map_, start, kPathM, kPathM, options_.via)));
  }
  const CompareOptions& options_;
  std::shared_ptr<const track::Map> map_;
  std::optional<compare::Axes> axes_;
};

void print_row(const char* what, const std::vector<compare::Sample>& samples) {
  const auto ours = evaluation::summarise(compare::sizes_of(samples, &compare::Sample::ours));
  const auto other = evaluation::summarise(compare::sizes_of(samples, &compare::Sample::certified));
  const auto columns = [](const evaluation::Summary& side) {
    char text[64];
    std::snprintf(text, sizeof text, "%9s %9s %9s", compare::figure("%.2f", side.mean).c_str(),
                  compare::figure("%.2f", side.p95).c_str(), compare::figure("%.2f", side.max).c_str());
    return std::string(text);
  };
  std::printf("%-24s %s   %s\n", what, columns(ours).c_str(), columns(other).c_str());
}

void print_shift(const compare::Pairing& pairing, const std::optional<compare::Judge>& judge) {
  const auto pairs = compare::without_repeats(pairing.pairs);
  const auto shift = compare::time_shift(pairs);
  if (!std::isfinite(shift.shift_s)) {
    std::printf(
        "difference over speed    not known: the speed hardly changes, stamps that are off would not be seen\n");
    return;
  }
  const bool late = shift.shift_s >= 0;
  std::printf(
      "difference over speed    %+.3f s +- %.3f s: stamps of the certified system are %s by that much, or ours %s\n",
      shift.shift_s, shift.sigma_s, late ? "late" : "early", late ? "early" : "late");
  if (!judge) return;
  const auto to_truth = compare::shift_to_truth(pairs, *judge);
  if (!std::isfinite(to_truth.shift_s)) return;
  std::printf("... from the truth       %+.3f s +- %.3f s: the certified system's are %s by that much\n",
              to_truth.shift_s, to_truth.sigma_s, to_truth.shift_s >= 0 ? "late" : "early");
}

void print_speeds(const std::vector<compare::Pair>& pairs) {
  std::vector<double> sizes;
  double mean_kmh = 0;
  size_t apart = 0;
  for (const auto& pair : pairs) {
    sizes.push_back(std::abs(pair.faster_kmh));
    mean_kmh += pair.faster_kmh / static_cast<double>(pairs.size());
    if (pair.speeds_apart() && ++apart <= kMostTold) {
      std::printf("  at %.3f s the speeds differ by %.0f km/h (V_TRAIN), more than both may be off\n",
                  core::seconds(pair.stamp_ns), pair.speed_apart_kmh);
    }
  }
  const auto size = evaluation::summarise(sizes);
  std::printf("speed, ours - certified  mean %+.1f km/h, |.| p50 %.1f, p95 %.1f, max %.1f km/h\n", mean_kmh, size.p50,
              size.p95, size.max);
  if (apart > 0) std::printf("speeds apart             in %zu of %zu\n", apart, pairs.size());
}

void print_other_fields(const std::vector<compare::Pair>& pairs) {
  const auto other = compare::other_fields_of(pairs);
  std::printf("not the same             M_MODE %zu, M_LEVEL %zu, Q_LENGTH %zu of %zu; not judged\n", other.modes,
              other.levels, other.integrity, pairs.size());
  if (other.both_lengths == 0) return;
  std::printf("L_TRAININT               ours %+.1f m on average, in %zu of %zu; not judged\n", other.longer_m,
              other.both_lengths, pairs.size());
}

void print_pairs(const compare::Pairing& pairing, const std::optional<compare::Judge>& judge) {
  std::vector<double> differences;
  double carried_m = 0;
  size_t disjoint = 0;
  size_t turned = 0;
  size_t runs_apart = 0;
  for (const auto& pair : pairing.pairs) {
    differences.push_back(pair.difference_m());
    carried_m = std::max(carried_m, pair.carried_m);
    if (pair.turned() && ++turned <= kMostTold) {
      std::printf("  at %.3f s the train looks the other way in ours (Q_DIRLRBG) than in the certified report\n",
                  core::seconds(pair.stamp_ns));
    }
    if (pair.runs_apart() && ++runs_apart <= kMostTold) {
      std::printf("  at %.3f s the train runs the other way in ours (Q_DIRTRAIN) than in the certified report\n",
                  core::seconds(pair.stamp_ns));
    }
    if (pair.overlap()) continue;
    if (++disjoint <= kMostTold) {
      std::printf("  at %.3f s the intervals have nothing in common: ours %+.2f m from the certified position\n",
                  core::seconds(pair.stamp_ns), pair.difference_m());
    }
  }
  double mean_m = 0;
  for (const double d : differences) mean_m += d / static_cast<double>(differences.size());
  std::vector<double> sizes;
  sizes.reserve(differences.size());
  for (const double d : differences) sizes.push_back(std::abs(d));
  const auto size = evaluation::summarise(sizes);
  std::printf(
      "ours - certified         mean %+.2f m, |.| p50 %.2f, p95 %.2f, max %.2f m (carried in time: up to %.2f m)\n",
      mean_m, size.p50, size.p95, size.max, carried_m);
  print_shift(pairing, judge);
  std::printf("intervals overlap        %zu of %zu\n", pairing.pairs.size() - disjoint, pairing.pairs.size());
  if (turned > 0) std::printf("train turned round       in %zu of %zu\n", turned, pairing.pairs.size());
  if (runs_apart > 0) std::printf("train runs the other way in %zu of %zu\n", runs_apart, pairing.pairs.size());
  print_speeds(pairing.pairs);
  print_other_fields(pairing.pairs);
}

/// Reports that come now, until the other side's file is over, time is up, or Ctrl-C; each pair is told as it comes.
/// When listening to ours ended, by its stamps; nothing where it is a file or nothing came.
std::optional<int64_t> listen(ReportSource& ours, ReportSource& certified, Line& line, const CompareOptions& options) {
  const int64_t end_ns =
      options.for_s > 0 ? core::monotonic_ns() + core::to_ns(options.for_s) : std::numeric_limits<int64_t>::max();
  const auto over = [](const ReportSource& live, const ReportSource& other) {
    return !other.live() && !live.reports().empty() && !other.reports().empty() &&
           live.reports().back().stamp_ns > other.reports().back().stamp_ns;
  };
  size_t told = 0;
  size_t heard = 0;
  int64_t heard_ns = 0;  // when the last one of ours came
  for (bool goes_on = true; goes_on && core::monotonic_ns() < end_ns;) {
    for (auto* source : {&ours, &certified}) {
      if (source->live()) goes_on &= source->listen(kTurnS);
    }
    if (ours.reports().size() != heard) {
      heard = ours.reports().size();
      heard_ns = core::monotonic_ns();
    }
    const auto one_train = compare::of_one_train(ours.reports(), certified.reports());
    const auto* axes = one_train.ok() ? line.axes(one_train.value().certified) : nullptr;
    if (axes == nullptr) continue;
    const auto pairs =
        compare::pair_up(ours.reports(), one_train.value().certified, *axes, core::to_ns(options.longest_gap_s)).pairs;
    for (; told < pairs.size(); ++told) {
      std::printf("at %.3f s ours - certified %+.2f m, intervals %s%s%s\n", core::seconds(pairs[told].stamp_ns),
                  pairs[told].difference_m(), pairs[told].overlap() ? "overlap" : "have nothing in common",
                  pairs[told].turned() ? ", the train looks the other way (Q_DIRLRBG)" : "",
                  pairs[told].runs_apart() ? ", the train runs the other way (Q_DIRTRAIN)" : "");
      std::fflush(stdout);
    }
    goes_on &= !over(ours, certified) && !over(certified, ours);
  }
  if (!ours.live() || heard == 0) return std::nullopt;
  return ours.reports().back().stamp_ns + core::monotonic_ns() - heard_ns;
}

int print_comparison(const CompareOptions& options, const compare::Pairing& pairing,
                     const std::optional<compare::Judge>& judge) {
  print_pairs(pairing, judge);
  const auto columns = compare::columns_of(pairing, judge);
  std::printf("\n%-24s %9s %9s %9s   %9s %9s %9s\n%-24s %9s %9s %9s   %9s %9s %9s\n", "", "ours", "", "", "certified",
              "", "", "m", "mean", "p95", "max", "mean", "p95", "max");
  print_row("interval length", columns.lengths);
  if (judge) print_row("error, size", columns.errors);
  if (columns.lengths.size() < pairing.pairs.size()) {
    std::printf("repeats at standstill    %zu of %zu pairs: left out, but for the first and the last of each\n",
                pairing.pairs.size() - columns.lengths.size(), pairing.pairs.size());
  }
  const auto unknown = [&](double compare::Sample::*side) {
    return std::ranges::count_if(columns.lengths, [&](const auto& sample) { return !std::isfinite(sample.*side); });
  };
  std::printf("interval not known       ours %td, certified %td of %zu: left out\n", unknown(&compare::Sample::ours),
              unknown(&compare::Sample::certified), columns.lengths.size());
  const auto verdict =
      compare::print_verdict(columns, compare::doubts_of(pairing, judge, options.offset_s), options.demand);
  return verdict == compare::Verdict::worse ? kWorse : 0;
}

void check(const CompareOptions& options) {
  if (options.map.empty() && !options.start.empty()) throw core::BadInput("--start needs --map: it is a place on it.");
  if (options.map.empty() && !options.via.empty()) throw core::BadInput("--via needs --map: it names edges of it.");
  if (!options.truth.empty() && (options.map.empty() || options.start.empty()))
    throw core::BadInput("--truth needs --map and --start, the place on the map where the truth begins.");
}

void check_reports(const char* side, const std::string& where, const ReportSource& source) {
  if (!source.reports().empty()) return;
  throw core::BadInput(std::string(side) + " " + where +
                       (source.live() ? ": no position report has come; is the train's tpr_publisher running?"
                                      : ": it holds no position report; is it the right file?"));
}

void check_places(const char* side, const std::string& where, const std::vector<compare::TimedReport>& reports) {
  if (std::ranges::any_of(reports, [](const auto& report) { return compare::position_known(report.fields); })) return;
  throw core::BadInput(
      std::string(side) + " " + where + ": none of its " + std::to_string(reports.size()) +
      " reports has a place, for the LRBG, D_LRBG or Q_DLRBG of each is unknown; record a run on which "
      "the train has passed a balise group.");
}

std::string span_text(int64_t from_ns, int64_t to_ns) {
  char text[64];
  std::snprintf(text, sizeof text, "from %.3f to %.3f s", core::seconds(from_ns), core::seconds(to_ns));
  return text;
}

void check_times(const compare::Judge& judge, const std::vector<compare::Pair>& pairs, const std::string& folder) {
  if (std::ranges::any_of(pairs, [&](const auto& pair) { return judge.covers(pair); })) return;
  const auto& rows = judge.truth->rows();
  throw core::BadInput(folder + ": the truth is " + span_text(rows.front().stamp_ns, rows.back().stamp_ns) +
                       " and does not overlap with the paired reports, " +
                       span_text(pairs.front().stamp_ns, pairs.back().stamp_ns) + ".");
}

int compare_reports(const CompareOptions& options) {
  check(options);
  std::optional<evaluation::Truth> truth;
  if (!options.truth.empty()) truth = core::value_or_throw(evaluation::Truth::read(options.truth));
  ReportSource ours(options.ours, static_cast<etcs::Baseline>(options.baseline), options.network);
  ReportSource certified(options.certified, static_cast<etcs::Baseline>(options.certified_baseline), options.network);
  certified.shift(core::to_ns(options.offset_s));
  Line line(options);
  if (!ours.live()) check_reports("--ours", options.ours, ours);
  if (!certified.live()) check_reports("--certified", options.certified, certified);
  std::optional<int64_t> ours_until_ns;
  if (ours.live() || certified.live()) ours_until_ns = listen(ours, certified, line, options);
  check_reports("--ours", options.ours, ours);
  check_reports("--certified", options.certified, certified);
  check_places("--ours", options.ours, ours.reports());
  const auto one_train = core::value_or_throw(compare::of_one_train(ours.reports(), certified.reports()));
  const auto& theirs = one_train.certified;
  check_places("--certified", options.certified, theirs);
  const auto* axes = line.axes(theirs);
  if (axes == nullptr) throw core::BadInput(options.map + ": has none of the reported balise groups.");
  const auto pairing =
      compare::pair_up(ours.reports(), theirs, *axes, core::to_ns(options.longest_gap_s), ours_until_ns);
  std::optional<compare::Judge> judge;
  if (truth) judge = compare::Judge{&*truth, options.foot_to_front_m};
  std::printf("reports                  ours %zu, %zu with a place; certified %zu, %zu with a place\n",
              ours.reports().size(), pairing.ours.placed.size(), theirs.size(), pairing.certified.placed.size());
  if (!one_train.remark.empty()) std::printf("trains                   %s\n", one_train.remark.c_str());
  if (ours.repeated() + certified.repeated() > 0) {
    std::printf("delivered once more      ours %zu, certified %zu reports: alike with the same stamp, counted once\n",
                ours.repeated(), certified.repeated());
  }
  if (ours.left_out() + certified.left_out() > 0) {
    std::printf(
        "no report can be read    from %zu lines of ours, %zu of the certified: the first are named above, and they "
        "are in none of the "
        "figures\n",
        ours.left_out(), certified.left_out());
  }
  if (pairing.ours.off_line.size() + pairing.certified.off_line.size() > 0) {
    std::printf("group not on the line    ours %zu, certified %zu reports: not paired, but \"known\" as they say\n",
                pairing.ours.off_line.size(), pairing.certified.off_line.size());
  }
  if (pairing.outside_ours > 0) {
    std::printf("beyond our log           %zu certified reports, from before it begins or after it ends: left out\n",
                pairing.outside_ours);
  }
  std::printf("reports every            ours %s s, certified %s s\n",
              compare::figure("%.3g", pairing.ours.every_s).c_str(),
              compare::figure("%.3g", pairing.certified.every_s).c_str());
  std::printf("paired in time           %zu in %zu legs; %zu certified reports have none of ours beside them\n",
              pairing.pairs.size(), pairing.legs, pairing.alone);
  if (pairing.pairs.empty())
    throw core::BadInput("No reports can be compared: do the times and balise groups of both sides belong together?");
  if (judge) check_times(*judge, pairing.pairs, options.truth);
  return print_comparison(options, pairing, judge);
}

}  // namespace

void add_tpr_compare(CLI::App& tpr, Action& chosen) {
  auto options = std::make_shared<CompareOptions>();
  auto* command = tpr.add_subcommand("compare", "Our reports beside those of the certified system, paired in time");
  command->footer(
      "Examples:\n"
      "  railfix tpr compare --ours OUT --certified rbc.csv --map line.map\n"
      "  railfix tpr compare --ours topic:demo --certified rbc.csv   what train demo sends now, until the file is "
      "over\n"
      "  railfix tpr compare --ours topic:demo --certified topic:demo-evc --for-s 3600\n"
      "Both sides must run on the same packet 58 (T_CYCLOC, D_CYCLOC, M_LOC): one that reports more seldom, and just\n"
      "behind each group, would look better.\n"
      "Ends with 3 where the verdict is WORSE.");
  command
      ->add_option("--ours", options->ours,
                   "Folder of a run, a .csv or .jsonl file with stamp_ns and hex, a recording (.mcap), or topic:TRAIN: "
                   "what is sent now")
      ->required();
  command->add_option("--certified", options->certified, "The certified system's, as --ours")->required();
  add_domain(*command, options->network);
  find_running_train(*command, options->network);
  command->add_option("--for-s", options->for_s, "Listen for so many seconds, 0 = until a file is over, or Ctrl-C")
      ->check(number_between(0, kLargestOffsetS, kSeconds));
  command->add_option("--map", options->map, "Compiled map: also reports with different LRBGs can be compared");
  command->add_option("--start", options->start, "Place on the map where the line begins, EDGE:OFFSET[:+|-]");
  command->add_option("--via", options->via, "Edges taken at switches");
  command->add_option("--truth", options->truth, "Folder with track.csv (SEQ/truth): errors of both systems");
  command->add_option("--foot-to-front-m", options->foot_to_front_m, "From the truth's place to the train's front end")
      ->check(number_between(-1000, 1000));
  const auto baselines = CLI::IsMember({3, 4});
  command->add_option("--baseline", options->baseline, "Layout of ours: 3 or 4")->check(baselines);
  command->add_option("--certified-baseline", options->certified_baseline, "Layout of the certified: 3 or 4")
      ->check(baselines);
  command->add_option("--longest-gap-s", options->longest_gap_s, "Ours are carried between reports not farther apart")
      ->check(number_between(0, kLongestGapS, kSeconds))
      ->capture_default_str();
  command->add_option("--offset-s", options->offset_s, "Added to the certified system's stamps")
      ->check(number_between(-kLargestOffsetS, kLargestOffsetS, kSeconds));
  command->add_option("--confidence", options->demand.confidence, "One-sided")->check(number_between(0.5, 0.9999));
  command->add_option("--margin", options->demand.margin, "At least as good: a ratio of at most 1 + margin")
      ->check(number_between(0, 1));
  command
      ->add_option("--broken-at-most", options->demand.broken_at_most,
                   "At least as good: shown that at most this share of our legs has a true place outside our interval; "
                   "0.05 takes 59 legs without one, and where fewer were run the verdict is \"not shown\"")
      ->check(number_between(0, 1))
      ->capture_default_str();
  command->callback([options, &chosen] { chosen = [options] { return compare_reports(*options); }; });
}

}  // namespace railfix::tool
