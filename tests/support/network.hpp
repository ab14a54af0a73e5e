// The DDS network of a train under test.
#pragma once

#include <string>

#include "messaging/messaging.hpp"

namespace railfix::test {

/// What a participant of the test joins with. Each test has a domain of its own, so that tests may run side by side.
inline messaging::ParticipantOptions network(const std::string& train, int64_t domain) {
  messaging::ParticipantOptions options;
  options.train_id = train;
  options.domain = domain;
  return options;
}

}  // namespace railfix::test
