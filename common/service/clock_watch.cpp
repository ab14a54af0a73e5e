#include "service/clock_watch.hpp"

#include <algorithm>
#include <cmath>
#include <cstdio>

#include "core/time.hpp"

namespace railfix::service {

void ClockWatch::hear(const std::string& host, int64_t stamp_ns, int64_t received_ns) {
  if (host == host_) return;
  auto& late_ns = late_ns_[host];
  late_ns.push_back(received_ns - stamp_ns);
  if (late_ns.size() > kMessages) late_ns.pop_front();
}

std::string ClockWatch::trouble() const {
  std::string text;
  for (const auto& [host, late_ns] : late_ns_) {
    if (late_ns.size() < kMessages) continue;
    const int64_t quickest_ns = *std::min_element(late_ns.begin(), late_ns.end());
    if (std::abs(quickest_ns) <= kToleratedNs) continue;
    char offset[32];
    std::snprintf(offset, sizeof(offset), "%.1f s", std::abs(core::seconds(quickest_ns)));
    text += (text.empty() ? "" : " ") + ("The clock of " + host + " is " + offset) +
            (quickest_ns > 0 ? " behind " : " ahead of ") + host_ +
            "'s: let chrony or PTP set both (railfix doctor says which is not).";
  }
  return text;
}

}  // namespace railfix::service
