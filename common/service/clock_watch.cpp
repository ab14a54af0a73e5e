#include "service/clock_watch.hpp"

#include <algorithm>
#include <cmath>
#include <cstdio>

#include "core/kernel_clock.hpp"
#include "core/time.hpp"

namespace railfix::service {

void ClockWatch::look(int64_t wall_ns, int64_t monotonic_ns) {
  const int64_t ahead_ns = wall_ns - monotonic_ns;
  const int64_t set_by_ns = ahead_ns - ahead_ns_.value_or(ahead_ns);
  ahead_ns_ = ahead_ns;
  looked_ns_ = wall_ns;
  std::erase_if(heard_, [&](const auto& entry) { return wall_ns - entry.second.last_ns > kGoneNs; });
  if (std::abs(set_by_ns) <= kToleratedNs) return;
  set_by_ns_ = set_by_ns;
  set_at_ns_ = wall_ns;
  heard_.clear();
}

void ClockWatch::hear(const std::string& host, int64_t stamp_ns, int64_t received_ns) {
  if (host == host_) return;
  // What came before the clock was set says nothing of the clock now.
  if (received_ns < set_at_ns_ || received_ns > looked_ns_) return;
  auto& [late_ns, last_ns] = heard_[host];
  last_ns = received_ns;
  late_ns.push_back(received_ns - stamp_ns);
  if (late_ns.size() > kMessages) late_ns.pop_front();
  if (const auto quickest = quickest_ns(late_ns); quickest && std::abs(*quickest) <= kToleratedNs) set_by_ns_ = 0;
}

void ClockWatch::kept(std::optional<int64_t> max_error_ns) {
  is_kept_ = core::is_kept(max_error_ns);
  was_kept_ = was_kept_ || is_kept_;
}

std::optional<int64_t> ClockWatch::quickest_ns(const std::deque<int64_t>& late_ns) {
  if (late_ns.size() < kMessages) return std::nullopt;
  return *std::min_element(late_ns.begin(), late_ns.end());
}

std::string ClockWatch::trouble() const {
  std::string text;
  char offset[32];
  for (const auto& [host, heard] : heard_) {
    const auto quickest = quickest_ns(heard.late_ns);
    if (!quickest || std::abs(*quickest) <= kToleratedNs) continue;
    std::snprintf(offset, sizeof(offset), "%.1f s", std::abs(core::seconds(*quickest)));
    text += (text.empty() ? "" : " ") + ("The clock of " + host + " is " + offset) +
            (*quickest > 0 ? " behind " : " ahead of ") + host_ +
            "'s: let chrony or PTP set both (railfix doctor says which is not).";
  }
  if (was_kept_ && !is_kept_) {
    text += (text.empty() ? "" : " ") + ("The clock of " + host_) +
            " is not kept by PTP or NTP any more: see to its chronyd, or ptp4l and phc2sys.";
  }
  if (set_by_ns_ == 0) return text;
  std::snprintf(offset, sizeof(offset), "%+.1f s", core::seconds(set_by_ns_));
  return "The clock of " + host_ + " was set by " + offset + "." + (text.empty() ? "" : " ") + text;
}

}  // namespace railfix::service
