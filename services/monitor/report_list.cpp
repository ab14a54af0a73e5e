#include "monitor/report_list.hpp"

#include <algorithm>

#include "core/time.hpp"
#include "monitor/live_messages.hpp"

namespace railfix::monitor {
namespace {

constexpr size_t kReportsKept = 20;
constexpr int64_t kClocksAgreeNs = 5 * core::kNsPerSecond;

}  // namespace

bool ReportList::take(const msg::TrainPositionReport& report, int64_t received_ns) {
  if (report.sent_ns() <= received_ns)
    std::erase_if(reports_, [&](const Kept& kept) { return kept.sent_ns > received_ns + kClocksAgreeNs; });
  const auto later = std::ranges::upper_bound(reports_, report.sent_ns(), {}, &Kept::sent_ns);
  const bool newest = later == reports_.end();
  reports_.insert(later, Kept{report.sent_ns(), report_message(report)});
  if (reports_.size() > kReportsKept) reports_.pop_front();
  return newest;
}

std::vector<nlohmann::json> ReportList::messages() const {
  std::vector<nlohmann::json> messages;
  for (const auto& kept : reports_) messages.push_back(kept.message);
  return messages;
}

}  // namespace railfix::monitor
