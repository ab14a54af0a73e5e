// Private to this folder: tells when played data begins anew - a replay was moved, looped or begun again, or another
// one is played - and which samples are still of the data before. Only whoever plays data says what time it is there
// (data_clock), so the clock of a live train that is set is none. Knows no DDS and no clock.
#pragma once

#include <cstdint>
#include <optional>

#include "idl/operation.h"

namespace railfix::service {

class Restarts {
 public:
  /// True when the data begins anew with this clock. `writer` tells one player from another.
  bool heard(const msg::DataClock& clock, uint64_t writer, int64_t now_ns);
  /// A sample of this stamp (0 = none) was under way when the data began anew: of the two times it is nearer to the one
  /// before. REQUIRES: asked when the sample comes; now_ns as above (monotonic).
  [[nodiscard]] bool outdated(int64_t stamp_ns, int64_t now_ns) const;

 private:
  [[nodiscard]] bool begins_anew(const msg::DataClock& clock, uint64_t writer) const;
  struct Restart {
    int64_t before_ns = 0;  // where the data was
    int64_t at_ns = 0;      // monotonic
  };
  std::optional<msg::DataClock> last_;
  uint64_t writer_ = 0;
  std::optional<Restart> restart_;
};

}  // namespace railfix::service
