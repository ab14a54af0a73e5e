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

// The stages.

/// A top view and what is in it, as the detector makes them.
struct Stage {
  Stage() : view(test::kCab, test::kMount, {28, 5, 32, 0.02}) {
    cv::setNumThreads(1);
    scene.shape.camera = test::kMount;
    scene.shape.curvature_per_m = 1.0 / 800;
    grey = test::render(scene);
    view.look(grey);
    edges.near_m = 5;
    edges.far_m = 60;
  }
  test::Scene scene;
  cv::Mat grey;
  TopView view;
  EdgeOptions edges;
};

void BM_StageTopView(benchmark::State& state) {
  Stage stage;
  for (auto _ : state) {
    stage.view.look(stage.grey);
    benchmark::DoNotOptimize(stage.view.ridges(false).data);
  }
}
BENCHMARK(BM_StageTopView)->Unit(benchmark::kMicrosecond);

void BM_StageSearch(benchmark::State& state) {
  Stage stage;
  RailSearch search(stage.view, {0.024, 0.06, 0.36, 0.046, 0.006}, 1.435, 0.07);
  const cv::Mat& ridges = stage.view.ridges(false);
  for (auto _ : state) benchmark::DoNotOptimize(search.find(ridges, 4).size());
}
BENCHMARK(BM_StageSearch)->Unit(benchmark::kMicrosecond);

void BM_StageBranch(benchmark::State& state) {
  Stage stage;
  BranchSearch search;
  const cv::Mat& ridges = stage.view.ridges(false);
  for (auto _ : state)
    benchmark::DoNotOptimize(search.find(stage.view, ridges, test::kCab, stage.scene.shape, 1.435, 0.07));
}
BENCHMARK(BM_StageBranch)->Unit(benchmark::kMicrosecond);

void BM_StageEdges(benchmark::State& state) {
  const Stage stage;
  int tried[2];
  for (auto _ : state)
    benchmark::DoNotOptimize(find_edges(stage.grey, test::kCab, stage.scene.shape, stage.edges, tried).size());
}
BENCHMARK(BM_StageEdges)->Unit(benchmark::kMicrosecond);

void BM_StageFit(benchmark::State& state) {
  const Stage stage;
  int tried[2];
  std::vector<EdgePoint> points;
  for (const auto& edge : find_edges(stage.grey, test::kCab, stage.scene.shape, stage.edges, tried))
    points.push_back(edge.point);
  RailFitOptions options;
  options.prior.camera = test::kMount;
  options.prior_sigma = DetectorOptions{}.limits;
  options.least_sigma_factor = 0.15;
  options.step_tolerance = 0.05;
  for (auto _ : state) benchmark::DoNotOptimize(fit_rails(test::kCab, points, options.prior, options).residual_px);
}
BENCHMARK(BM_StageFit)->Unit(benchmark::kMicrosecond);

}  // namespace
