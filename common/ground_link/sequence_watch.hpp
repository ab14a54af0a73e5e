// The ground's side of "none lost, none twice": which reports of a train are new.
#pragma once

#include <cstdint>
#include <map>
#include <set>
#include <string>
#include <utility>

namespace railfix::ground_link {

enum class Arrival : uint8_t {
  fresh,   // the next one, or the first one seen of this stream
  gap,     // fresh, but numbers before it are missing
  filled,  // one that was missing
  twice,   // seen before: MQTT may deliver a message again (QoS 1)
};

class SequenceWatch {
 public:
  Arrival arrived(const std::string& train, uint64_t stream, uint64_t sequence);
  /// Reports that are known to be missing, of all trains.
  [[nodiscard]] size_t missing() const;

 private:
  struct Stream {
    uint64_t last = 0;
    std::set<uint64_t> missing;  // below `last`; the newest 100,000
  };
  std::map<std::pair<std::string, uint64_t>, Stream> streams_;
};

}  // namespace railfix::ground_link
