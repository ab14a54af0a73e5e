#include <benchmark/benchmark.h>

#include "track_detector/track_detector.hpp"
#include "unit/track_detector/synthetic_picture.hpp"

namespace {

using namespace railfix::track_detector;

cv::Mat picture() {
  test::Scene scene;
  scene.shape.camera = test::kMount;
  scene.shape.camera.pitch_rad += 0.004;
  scene.shape.curvature_per_m = 1.0 / 800;
  return test::render(scene);
}

/// 1280x1024, one thread: the limit is 4 ms a picture.
void BM_Track(benchmark::State& state) {
  cv::setNumThreads(1);
  const cv::Mat grey = picture();
  TrackDetector detector(test::kCab, test::kMount, {});
  for (auto _ : state) benchmark::DoNotOptimize(detector.detect(grey).confidence);
}
BENCHMARK(BM_Track)->Unit(benchmark::kMillisecond);

void BM_ColdStart(benchmark::State& state) {
  cv::setNumThreads(1);
  const cv::Mat grey = picture();
  TrackDetector detector(test::kCab, test::kMount, {});
  for (auto _ : state) {
    detector.reset();
    benchmark::DoNotOptimize(detector.detect(grey).confidence);
  }
}
BENCHMARK(BM_ColdStart)->Unit(benchmark::kMillisecond);

void BM_NothingToSee(benchmark::State& state) {
  cv::setNumThreads(1);
  test::Scene scene;
  scene.shape.camera = test::kMount;
  scene.left_rail = scene.right_rail = false;
  const cv::Mat grey = test::render(scene);
  TrackDetector detector(test::kCab, test::kMount, {});
  for (auto _ : state) benchmark::DoNotOptimize(detector.detect(grey).confidence);
}
BENCHMARK(BM_NothingToSee)->Unit(benchmark::kMillisecond);

}  // namespace
