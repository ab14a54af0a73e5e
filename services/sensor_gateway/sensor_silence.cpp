#include "sensor_gateway/sensor_silence.hpp"

#include <utility>

#include "core/time.hpp"

namespace railfix::sensor_gateway {

SensorSilence::SensorSilence(Sources sources, double silent_s, int64_t now_ns)
    : sources_(std::move(sources)), silent_s_(silent_s) {
  heard_ns_.fill(now_ns);
}

// Behind an outage of the whole source all of its sensors are awaited anew: the first that speaks accuses no other.
void SensorSilence::heard(size_t sensor, int64_t now_ns) {
  if (gone_.erase(sources_[sensor]) > 0) {
    for (size_t i = 0; i < sources_.size(); ++i) {
      if (sources_[i] == sources_[sensor]) heard_ns_[i] = now_ns;
    }
  }
  heard_ns_[sensor] = now_ns;
}

bool SensorSilence::lacks(size_t sensor, int64_t now_ns) const {
  const std::string& source = sources_[sensor];
  if (source.empty() || gone_.contains(source)) return false;
  if (core::seconds(now_ns - heard_ns_[sensor]) <= silent_s_) return false;
  for (size_t i = 0; i < sources_.size(); ++i) {
    if (sources_[i] == source && heard_ns_[i] > heard_ns_[sensor]) return true;
  }
  return false;
}

}  // namespace railfix::sensor_gateway
