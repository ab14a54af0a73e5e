#include "monitor/cab_watch.hpp"

#include <algorithm>
#include <cmath>

#include "core/time.hpp"
#include "messaging/camera.hpp"

namespace railfix::monitor {
namespace {

constexpr size_t kTracks = 128;
constexpr int64_t kPatienceNs = 400'000'000;
constexpr double kPointEveryM = 2;

}  // namespace

CabWatch::CabWatch(double picture_hz) : period_ns_(core::to_ns(0.9 / picture_hz)) {}

void CabWatch::calibration(const msg::CameraCalibration& c) {
  intrinsics_[c.camera().c_str()] = messaging::intrinsics_of(c);
}

void CabWatch::track(const msg::TrackView& view) {
  if (!tracks_.empty() && view.stamp_ns() < tracks_.back().stamp_ns()) tracks_.clear();  // played anew
  tracks_.push_back(view);
  if (tracks_.size() > kTracks) tracks_.pop_front();
}

void CabWatch::picture(const std::string& camera, Preview preview, const messaging::SampleInfo& info) {
  const auto [taken, first] = taken_ns_.try_emplace(camera, info.arrived_ns);
  if (!first && info.arrived_ns - taken->second < period_ns_) return;
  taken->second = info.arrived_ns;
  waiting_[camera] = {std::move(preview), info.arrived_ns};
}

std::vector<CabWatch::Due> CabWatch::due(int64_t now_ns) {
  std::vector<Due> due;
  for (auto waiting = waiting_.begin(); waiting != waiting_.end();) {
    const int64_t stamp_ns = waiting->second.preview->stamp_ns();
    const auto track = std::ranges::find_if(tracks_, [&](const auto& view) { return view.stamp_ns() >= stamp_ns; });
    const bool same = track != tracks_.end() && track->stamp_ns() == stamp_ns;
    if (track == tracks_.end() && now_ns - waiting->second.since_ns < kPatienceNs) {
      ++waiting;
      continue;
    }
    due.push_back({waiting->first, waiting->second.preview, same ? std::optional(*track) : std::nullopt});
    waiting = waiting_.erase(waiting);
  }
  return due;
}

const geometry::Intrinsics* CabWatch::intrinsics(const std::string& camera) const {
  const auto found = intrinsics_.find(camera);
  return found == intrinsics_.end() ? nullptr : &found->second;
}

void CurvatureTrail::add(double distance_m, double per_m, double sigma_per_m) {
  if (!points_.empty()) {
    const double moved_m = std::abs(distance_m - points_.back().distance_m);
    if (moved_m < kPointEveryM) return;
    if (moved_m > kLengthM) points_.clear();  // another run
  }
  points_.push_back({distance_m, per_m, sigma_per_m});
  constexpr size_t kMost = 2 * static_cast<size_t>(kLengthM / kPointEveryM);  // of a train that is moved to and fro
  while (points_.size() > kMost || std::abs(distance_m - points_.front().distance_m) > kLengthM) points_.pop_front();
}

nlohmann::json CurvatureTrail::seen_from(double distance_m) const {
  auto seen = nlohmann::json::array();
  const auto rounded = [](double value, double parts) { return std::round(value * parts) / parts; };
  for (const Point& point : points_) {
    seen.push_back(
        {rounded(point.distance_m - distance_m, 10), rounded(point.per_m, 1e7), rounded(point.sigma_per_m, 1e7)});
  }
  return seen;
}

}  // namespace railfix::monitor
