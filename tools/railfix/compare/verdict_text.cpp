#include "compare/verdict_text.hpp"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <string>

#include "evaluation/statistics.hpp"

namespace railfix::compare {
namespace {

const char* text_of(Verdict verdict) {
  return verdict == Verdict::at_least_as_good ? "at least as good" : verdict == Verdict::worse ? "WORSE" : "not shown";
}

std::string text_of_need(const RatioResult& result) {
  if (result.legs < kFewestLegs)
    return "needs " + std::to_string(kFewestLegs) + " legs at least, how many is not known yet";
  if (std::isnan(result.legs_needed)) return "how many legs it needs is not known yet";
  if (std::isinf(result.legs_needed)) return "more legs would not show it at this ratio";
  char text[64];
  std::snprintf(text, sizeof text, "needs about %.0f legs if they go on like these", result.legs_needed);
  return text;
}

/// `doubt`, where there is one, forbids "at least as good".
Verdict print_ratio(const char* what, RatioResult result, const char* doubt = nullptr) {
  const bool doubted = doubt != nullptr && result.verdict == Verdict::at_least_as_good;
  if (doubted) result.verdict = Verdict::open;
  const std::string bounds = std::isnan(result.low) ? "too few legs for bounds"
                                                    : figure("%.3f", result.low) + " to " + figure("%.3f", result.high);
  std::printf("%-24s ratio %s (%s), %zu pairs in %zu legs: %s", what, figure("%.3f", result.ratio).c_str(),
              bounds.c_str(), result.samples, result.legs, text_of(result.verdict));
  if (doubted) {
    std::printf("; %s", doubt);
  } else if (result.verdict == Verdict::open && result.samples > 0) {
    std::printf("; %s", text_of_need(result).c_str());
  }
  std::printf("\n");
  return result.verdict;
}

Verdict print_share(const std::vector<Sample>& samples, const Demand& demand) {
  const auto result = compare_share(samples, demand);
  const auto share = [&](double Sample::*side) { return 100 * evaluation::summarise(sizes_of(samples, side)).mean; };
  std::printf("interval known           ours %.1f %%, certified %.1f %% of %zu certified reports; ",
              share(&Sample::ours), share(&Sample::certified), samples.size());
  return print_ratio("certified over ours:", result);
}

std::string text_of(const char* format, auto... values) {
  char text[256];
  std::snprintf(text, sizeof text, format, values...);
  return text;
}

std::string text_of_stamps(const StampsOff& stamps) {
  return text_of("the stamps of %s are off by %.3f s; say --offset-s %.3f",
                 stamps.by_truth ? "the certified system" : "one side", std::abs(stamps.shift_s), stamps.offset_s);
}

/// Empty without any.
std::string text_of(const Doubts& doubts) {
  if (doubts.turned > 0) {
    return text_of("on %zu legs the train looks the other way in ours (Q_DIRLRBG), so one side is wrong",
                   doubts.turned);
  }
  if (doubts.runs_apart > 0) {
    return text_of("on %zu legs the train runs the other way in ours (Q_DIRTRAIN), so one side is wrong",
                   doubts.runs_apart);
  }
  if (doubts.speeds_apart > 0) {
    return text_of("on %zu legs the speeds differ by more than both may be off (V_TRAIN), so one side is wrong",
                   doubts.speeds_apart);
  }
  if (doubts.stamps) return text_of_stamps(*doubts.stamps);
  if (doubts.apart > 0) {
    return text_of(
        "on %zu legs the intervals have nothing in common, so one side is wrong, and only --truth says which",
        doubts.apart);
  }
  if (doubts.off_line > 0) {
    return text_of(
        "on %zu legs ours refers to a group that is not on the line, where the certified system is on it; if the train "
        "ran there, lead the line along with --via",
        doubts.off_line);
  }
  if (doubts.other_groups > 0) {
    return text_of(
        "on %zu legs ours refers to a group that cannot be compared with that of the certified system; "
        "say --map, --start and --via with both on the line",
        doubts.other_groups);
  }
  if (doubts.ours_silent()) {
    return text_of(
        "at %zu of %zu certified reports ours is silent for longer than --longest-gap-s, or a side came to its group "
        "by another way (NID_PRVLRBG), and what it would have said is not known",
        doubts.silent, doubts.heard);
  }
  if (doubts.other_times()) {
    return text_of("%zu of %zu certified reports are from before ours begin or after they end; take logs of one time",
                   doubts.outside, doubts.in_all);
  }
  if (doubts.ours_seldom()) {
    return text_of("ours reports every %.3g s, the certified system every %.3g s; let both run on the same packet 58",
                   doubts.ours_every_s, doubts.certified_every_s);
  }
  return {};
}

/// Why a length or an error is that of a part only, nullptr where it is not.
const char* part_only(const Doubts& doubts) {
  if (doubts.off_line > 0) return "ours refers to groups that are not on the line";
  if (doubts.other_groups > 0) return "ours refers to groups that cannot be compared";
  if (doubts.ours_silent()) return "ours is silent where it could be worse";
  return doubts.ours_seldom() ? "ours reports too seldom" : nullptr;
}

/// What the verdicts come to.
Verdict print_sum(const std::vector<Verdict>& verdicts, const Doubts& doubts, const Columns& columns) {
  const auto any = [&](Verdict one) { return std::ranges::count(verdicts, one) > 0; };
  std::printf("verdict                  ");
  if (any(Verdict::worse)) {
    std::printf("WORSE%s\n", columns.ours_other_track > 0 ? "; ours refers to groups of another track" : "");
    return Verdict::worse;
  }
  if (const auto doubt = text_of(doubts); !doubt.empty()) {
    std::printf("not shown: %s\n", doubt.c_str());
    return Verdict::open;
  }
  if (any(Verdict::open)) {
    std::printf("not shown\n");
    return Verdict::open;
  }
  std::printf("%s\n", !columns.errors.empty() ? "at least as good"
                                              : "intervals at least as good, and as often known; errors not known");
  return Verdict::at_least_as_good;
}

}  // namespace

std::vector<double> sizes_of(const std::vector<Sample>& samples, double Sample::*side) {
  std::vector<double> list;
  list.reserve(samples.size());
  for (const auto& sample : samples) list.push_back(std::abs(sample.*side));
  return list;
}

std::string figure(const char* format, double value) {
  if (std::isnan(value)) return "-";
  char text[64];
  std::snprintf(text, sizeof text, format, value);
  return text;
}

Verdict print_verdict(const Columns& columns, const Doubts& doubts, const Demand& demand) {
  std::printf("\nGAMAB, %.0f %% confidence, margin %.0f %%, over legs (ours / certified)\n", 100 * demand.confidence,
              100 * demand.margin);
  std::vector<Verdict> verdicts{print_share(columns.available, demand)};
  const char* part = part_only(doubts);
  verdicts.push_back(print_ratio("interval length, mean", compare_ratio(columns.lengths, Figure::mean, demand), part));
  if (columns.errors.empty()) {
    std::printf("error                    not known without --truth\n");
  } else {
    const char* doubt = doubts.stamps ? "stamps are off" : part;
    verdicts.push_back(
        print_ratio("error, RMS", compare_ratio(columns.errors, Figure::root_mean_square, demand), doubt));
    auto broken = compare_broken(columns.outside, demand);
    const bool elsewhere = doubts.off_line > 0 && broken.verdict == Verdict::at_least_as_good;
    if (elsewhere) broken.verdict = Verdict::open;
    std::printf(
        "outside the interval     ours on %zu of %zu, certified on %zu of %zu legs; ours at most %.2g of legs, "
        "demanded %.2g: %s%s\n",
        broken.ours.broken, broken.ours.legs, broken.certified.broken, broken.certified.legs, broken.ours_at_most,
        demand.broken_at_most, text_of(broken.verdict),
        elsewhere ? "; ours refers to groups that are not on the line" : "");
    if (columns.ours_other_track + columns.certified_other_track > 0) {
      std::printf(
          "... by a wrong group      ours %zu, certified %zu reports: on another track than the other side, "
          "which is right\n",
          columns.ours_other_track, columns.certified_other_track);
    }
    verdicts.push_back(broken.verdict);
  }
  return print_sum(verdicts, doubts, columns);
}

}  // namespace railfix::compare
