// When recorded pictures are due. Knows no clock: the caller says what time it is.
#pragma once

#include <cstdint>
#include <map>
#include <optional>
#include <string>
#include <vector>

namespace railfix::frame_grabber {

/// Recorded rate on the wall clock: the first picture is due when it comes, each other as much later as it was recorded
/// later.
class RealPace {
 public:
  struct Verdict {
    int64_t due_ns = 0;  // wall clock; in the past = now
    bool skip = false;   // more than one period late
  };
  /// REQUIRES: in the order of playing. A picture that is stamped before one already played is due at once.
  Verdict ask(int64_t stamp_ns, int64_t wall_ns);
  /// Due time minus stamp of every picture. REQUIRES: asked once.
  [[nodiscard]] int64_t wall_minus_data_ns() const { return wall_minus_data_ns_; }

 private:
  int64_t wall_minus_data_ns_ = 0;
  std::optional<int64_t> newest_ns_;
};

/// Lock step: which services have not used the present step yet.
class LockStep {
 public:
  explicit LockStep(std::vector<std::string> services);
  /// A new step: everything up to data_ns has to be used.
  void begin(int64_t data_ns) { data_ns_ = data_ns; }
  /// A service has used everything up to data_ns. Services that nobody waits for are left out.
  void answered(const std::string& service, int64_t data_ns);
  [[nodiscard]] bool done() const;
  /// "odometry, fusion"
  [[nodiscard]] std::string missing() const;

 private:
  int64_t data_ns_ = INT64_MIN;
  std::map<std::string, int64_t> used_;
};

}  // namespace railfix::frame_grabber
