// Has everyone on the train found everyone, so that no sample is lost?
#pragma once

#include <cstdint>

namespace railfix::messaging {

/// `here`: this participant's view, as Connections has it; `endpoints` and `matches`: what all others say of themselves
/// in service_status, summed up. Every pair of reader and writer counts twice, once at each end.
template <class Here>
bool all_connected(const Here& here, uint32_t endpoints, uint32_t matches) {
  return here.remote_endpoints == endpoints && here.matches + matches == 2 * here.pairs;
}

/// The same from the statuses themselves: a map by whatever tells the services apart.
template <class Here, class Statuses>
bool all_connected(const Here& here, const Statuses& statuses) {
  uint32_t endpoints = 0;
  uint32_t matches = 0;
  for (const auto& [service, status] : statuses) {
    endpoints += status.endpoints();
    matches += status.matches();
  }
  return all_connected(here, endpoints, matches);
}

}  // namespace railfix::messaging
