// Has everyone on the train found everyone, so that no sample is lost?
#pragma once

#include "messaging/messaging.hpp"

namespace railfix::messaging {

/// `here`: this participant's view; `endpoints` and `matches`: what all others say of themselves in service_status,
/// summed up. Every pair of reader and writer counts twice, once at each end.
inline bool all_connected(const Connections& here, uint32_t endpoints, uint32_t matches) {
  return here.remote_endpoints == endpoints && here.matches + matches == 2 * here.pairs;
}

/// The same from the statuses themselves: a map by whatever tells the services apart.
template <class Statuses>
bool all_connected(const Connections& here, const Statuses& statuses) {
  uint32_t endpoints = 0;
  uint32_t matches = 0;
  for (const auto& [service, status] : statuses) {
    endpoints += status.endpoints();
    matches += status.matches();
  }
  return all_connected(here, endpoints, matches);
}

}  // namespace railfix::messaging
