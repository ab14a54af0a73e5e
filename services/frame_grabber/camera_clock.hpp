// The camera's own clock in the host's time. A picture takes a least time to arrive and sometimes longer, so the lower
// edge of arrival less camera time shows how the clocks differ and drift; late arrivals do not move the stamps.
#pragma once

#include <cstdint>
#include <deque>
#include <optional>

namespace railfix::frame_grabber {

class CameraClock {
 public:
  /// Host time at which a picture of this camera time arrives when nothing delays it. Strictly growing, but for a
  /// camera clock that was set back, which begins anew. REQUIRES: in the order of arrival.
  int64_t host_ns(int64_t camera_ns, int64_t arrival_ns);
  [[nodiscard]] double drift_ppm() const { return drift_ * 1e6; }

 private:
  struct Lowest {  // of one window
    int64_t camera_ns;
    int64_t offset_ns;
  };
  void add(int64_t camera_ns, int64_t offset_ns);
  void fit_drift();
  [[nodiscard]] int64_t offset_ns(int64_t camera_ns) const;
  std::deque<Lowest> lowest_;
  int64_t window_begin_ns_ = 0;
  double drift_ = 0;
  std::optional<int64_t> last_camera_ns_;
  int64_t last_host_ns_ = INT64_MIN;
};

}  // namespace railfix::frame_grabber
