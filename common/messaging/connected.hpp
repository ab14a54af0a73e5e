// Has everyone on the train found everyone, so that no sample is lost?
#pragma once

#include <cstdint>

namespace railfix::messaging {

/// Who has found whom. A train is connected when every service's matches add up to what the readers and writers there
/// are should have.
struct Connections {
  uint32_t endpoints = 0;         // readers and writers of this participant
  uint32_t matches = 0;           // their partners, summed up
  uint32_t remote_endpoints = 0;  // of all others on this train, as discovered
  uint32_t pairs = 0;             // reader-writer pairs of equal topics on this train, own and remote
};

/// `here`: this participant's view; `endpoints` and `matches`: what all others say of themselves
/// in service_status, summed up. Every pair of reader and writer counts twice, once at each end.
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
