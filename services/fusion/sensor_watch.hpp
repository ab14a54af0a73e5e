// Is one sensor to be believed? What became of its measurements lately.
#pragma once

#include <algorithm>
#include <cstdint>

#include "core/time.hpp"

namespace railfix::fusion {

/// A plain value.
struct SensorWatch {
  int64_t seen_ns = 0;  // 0 = never
  int64_t used_ns = 0;
  int refused = 0;  // in a row
  int agreed = 0;   // in a row, while it is isolated and only watched
  bool isolated = false;
  bool convicted = false;  // isolated because it is known to be the wrong one
  int64_t changed_ns = 0;  // when it was isolated, or taken back

  [[nodiscard]] bool isolated_without_proof() const { return isolated && !convicted; }
  [[nodiscard]] bool used_within(double time_s, int64_t now_ns) const {
    return used_ns != 0 && !isolated && core::seconds(now_ns - used_ns) < time_s;
  }
  void accept(int64_t stamp_ns) {
    used_ns = stamp_ns;
    refused = 0;
    if (isolated) changed_ns = stamp_ns;
    isolated = convicted = false;
  }
  void isolate(int64_t stamp_ns) {
    if (!isolated) changed_ns = stamp_ns;
    isolated = true;
    agreed = 0;
  }
  /// Isolated from now on, whatever it was before, because it is known to be the wrong one.
  void convict(int64_t stamp_ns) {
    isolated = false;
    isolate(stamp_ns);
    convicted = true;
  }
  /// Its samples do not come any more: that it is isolated is no contradiction.
  void leave_out() { isolated = convicted = false; }
  /// What an isolated sensor says next; one agreement may be chance, so many in a row bring it back.
  void hear(bool agrees, int enough, int64_t stamp_ns) {
    agreed = agrees ? agreed + 1 : 0;
    if (agreed >= enough) accept(stamp_ns);
  }
  void set_clock(int64_t stamp_ns) {
    seen_ns = std::min(seen_ns, stamp_ns);
    used_ns = std::min(used_ns, stamp_ns);
    changed_ns = std::min(changed_ns, stamp_ns);
  }
};

inline constexpr int kRefusalsToIsolate = 3;  // in a row

}  // namespace railfix::fusion
