#include "compare/columns.hpp"

#include <cmath>

#include "evaluation/statistics.hpp"

namespace railfix::compare {

namespace {

bool alike(const Pair& a, const Pair& b) {
  return a.stay == b.stay;
}

bool alike(const Availability& a, const Availability& b) {
  return a.stay == b.stay && a.ours == b.ours && a.certified == b.certified;
}

template <typename Item>
std::vector<Item> first_and_last(const std::vector<Item>& items) {
  std::vector<Item> kept;
  for (size_t i = 0; i < items.size(); ++i) {
    const bool between =
        i > 0 && i + 1 < items.size() && alike(items[i - 1], items[i]) && alike(items[i], items[i + 1]);
    if (!between) kept.push_back(items[i]);
  }
  return kept;
}

}  // namespace

bool Judge::covers(const Pair& pair) const {
  return truth->at(pair.stamp_ns) && truth->at(pair.ours_sent.stamp_ns);
}

double Judge::error_m(const PlacedReport& report) const {
  const auto real = truth->at(report.stamp_ns);
  const double begin_m = truth->rows().front().distance_m;
  return real ? report.front_m - (real->distance_m - begin_m) - foot_to_front_m : evaluation::kUnknown;
}

double Judge::outside(const PlacedReport& report) const {
  const double real_m = report.front_m - error_m(report);
  if (!std::isfinite(real_m)) return evaluation::kUnknown;
  if (real_m < report.low_m || real_m > report.high_m) return 1;
  return std::isfinite(report.high_m - report.low_m) ? 0 : evaluation::kUnknown;
}

bool Judge::on_other_track(const OffLine& report) const {
  return report.contradicted_by && outside(*report.contradicted_by) == 0;
}

std::vector<Pair> without_repeats(const std::vector<Pair>& pairs) {
  return first_and_last(pairs);
}

Columns columns_of(const Pairing& pairing, const std::optional<Judge>& judge) {
  Columns columns;
  for (const auto& at : first_and_last(pairing.availability))
    columns.available.push_back({at.leg, at.ours ? 1.0 : 0.0, at.certified ? 1.0 : 0.0});
  for (const auto& pair : without_repeats(pairing.pairs)) {
    const auto& ours = pair.ours_sent;  // as sent: what carrying adds is not its own
    const auto& other = pair.certified;
    columns.lengths.push_back({pair.leg, ours.high_m - ours.low_m, other.high_m - other.low_m});
    if (judge) columns.errors.push_back({pair.leg, judge->error_m(ours), judge->error_m(other)});
  }
  if (!judge) return columns;
  for (const auto& [leg, report] : pairing.ours.placed)
    columns.outside.push_back({leg, judge->outside(report), evaluation::kUnknown});
  for (const auto& [leg, report] : pairing.certified.placed)
    columns.outside.push_back({leg, evaluation::kUnknown, judge->outside(report)});
  for (const auto& report : pairing.ours.off_line) {
    if (!judge->on_other_track(report)) continue;
    columns.outside.push_back({report.leg, 1, evaluation::kUnknown});
    ++columns.ours_other_track;
  }
  for (const auto& report : pairing.certified.off_line) {
    if (!judge->on_other_track(report)) continue;
    columns.outside.push_back({report.leg, evaluation::kUnknown, 1});
    ++columns.certified_other_track;
  }
  return columns;
}

}  // namespace railfix::compare
