// Quality of service of a topic: one profile of which its writers offer at least what its readers request, so that both
// always match.
// deploy/qos/railfix_qos.xml holds the same profiles for people and tools; a test keeps the two equal.
#pragma once

#include <cstdint>
#include <string>

namespace railfix::messaging {

struct QosProfile {
  bool reliable = true;  // what readers request; writers always offer reliable unless the whole topic is best effort
  bool writer_reliable = true;
  bool transient_local = false;  // late joiners get the last samples
  int32_t depth = 32;            // keep last, of an instance
  int32_t max_instances = 1;     // keyed topics: how many keys there may be
  bool exclusive = false;        // a reader hears one writer at a time, and stays with it (standby services)
  int64_t deadline_ns = 0;       // 0 = none
  bool data_sharing = false;     // zero copy on one host; for plain, unkeyed types
  bool asynchronous = false;     // sending never blocks the service thread
};

}  // namespace railfix::messaging
