#include <benchmark/benchmark.h>

#include "core/time.hpp"
#include "simulator/builtin_line.hpp"
#include "simulator/renderer.hpp"
#include "track_detector/landmark_finder.hpp"
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
  EdgeFinder finder;
  int tried[2];
  for (auto _ : state)
    benchmark::DoNotOptimize(finder.find(stage.grey, test::kCab, stage.scene.shape, stage.edges, tried).size());
}
BENCHMARK(BM_StageEdges)->Unit(benchmark::kMicrosecond);

void BM_StageFit(benchmark::State& state) {
  const Stage stage;
  EdgeFinder finder;
  int tried[2];
  std::vector<EdgePoint> points;
  for (const auto& edge : finder.find(stage.grey, test::kCab, stage.scene.shape, stage.edges, tried))
    points.push_back(edge.point);
  RailFitOptions options;
  options.prior.camera = test::kMount;
  options.prior_sigma = DetectorOptions{}.limits;
  options.least_sigma_factor = 0.15;
  options.step_tolerance = 0.05;
  RailFitter fitter;
  for (auto _ : state) benchmark::DoNotOptimize(fitter.fit(test::kCab, points, options.prior, options).residual_px);
}
BENCHMARK(BM_StageFit)->Unit(benchmark::kMicrosecond);

// The sightings: pictures of the simulator over balises, a switch and masts, at 90 km/h and 30 pictures a second.

struct Ride {
  static constexpr double kStepM = 25.0 / 30;
  Ride() {
    cv::setNumThreads(1);
    auto map = std::make_shared<railfix::track::Map>(railfix::simulator::builtin_line());
    auto line = railfix::simulator::Line::make(map, {1, 1305, railfix::track::Direction::forward}, 140);
    railfix::simulator::RenderOptions options;
    options.camera = camera = test::kCab;
    const railfix::simulator::Renderer renderer(std::make_shared<railfix::simulator::Line>(std::move(line).value()),
                                                options);
    for (int i = 0; i < 50; ++i) {
      railfix::simulator::Shot shot;
      shot.pose = test::kMount;
      shot.distance_m = kStepM * i;
      shot.speed_mps = kStepM * 30;
      LandmarkPicture picture;
      picture.grey = renderer.render(shot);
      picture.pose = test::kMount;
      pictures.push_back(picture);
    }
    const railfix::vision::SheetPose pose{test::kMount, 0.12, 0, 0};
    sheet = railfix::vision::fit_sheet(camera, pose, 3.5, 14.0, 0.58, 0.02, 0.02);
    railfix::vision::TopViewMaker maker(camera, sheet);
    views.resize(pictures.size());
    for (size_t i = 0; i < pictures.size(); ++i) maker.make(pictures[i].grey, pose, views[i]);
  }
  railfix::geometry::Intrinsics camera;
  railfix::vision::Sheet sheet;
  std::vector<LandmarkPicture> pictures;
  std::vector<railfix::vision::TopView> views;
};

Ride& ride() {
  static Ride ride;
  return ride;
}

/// Every picture in turn; `Work` takes its index and a stamp that grows.
template <class Work>
void each_picture(benchmark::State& state, Work&& work) {
  size_t i = 0;
  int64_t stamp_ns = 0;
  for (auto _ : state) {
    work(i, stamp_ns);
    i = (i + 1) % ride().pictures.size();
    stamp_ns += railfix::core::to_ns(1.0 / 30);
  }
}

void BM_Sightings(benchmark::State& state) {
  LandmarkFinder finder(ride().camera, {});
  each_picture(state, [&](size_t i, int64_t stamp_ns) {
    LandmarkPicture picture = ride().pictures[i];
    picture.stamp_ns = stamp_ns;
    benchmark::DoNotOptimize(finder.process(picture).size());
  });
}
BENCHMARK(BM_Sightings)->Unit(benchmark::kMicrosecond);

void BM_SightingsGroundView(benchmark::State& state) {
  railfix::vision::TopViewMaker maker(ride().camera, ride().sheet);
  railfix::vision::TopView view;
  each_picture(state, [&](size_t i, int64_t) {
    maker.make(ride().pictures[i].grey, {test::kMount, 0.12, 0, 0}, view);
    benchmark::DoNotOptimize(view.grey.data);
  });
}
BENCHMARK(BM_SightingsGroundView)->Unit(benchmark::kMicrosecond);

void BM_SightingsGroundMotion(benchmark::State& state) {
  GroundMotion motion(70);
  each_picture(state, [&](size_t i, int64_t stamp_ns) {
    benchmark::DoNotOptimize(motion.step(ride().views[i], ride().sheet, stamp_ns));
  });
}
BENCHMARK(BM_SightingsGroundMotion)->Unit(benchmark::kMicrosecond);

void BM_SightingsPlates(benchmark::State& state) {
  PlateSearch search(ride().sheet, {});
  each_picture(state, [&](size_t i, int64_t) {
    benchmark::DoNotOptimize(search.find(ride().views[i], {test::kCab.fv_px, 2.6, 0.05}).size());
  });
}
BENCHMARK(BM_SightingsPlates)->Unit(benchmark::kMicrosecond);

template <class Search>
void one_search(benchmark::State& state, Search&& search) {
  each_picture(state, [&](size_t i, int64_t) { benchmark::DoNotOptimize(search.find(ride().pictures[i]).size()); });
}
void BM_SightingsFrogs(benchmark::State& state) {
  one_search(state, FrogSearch(ride().camera, {}));
}
BENCHMARK(BM_SightingsFrogs)->Unit(benchmark::kMicrosecond);
void BM_SightingsPlatforms(benchmark::State& state) {
  one_search(state, PlatformSearch(ride().camera));
}
BENCHMARK(BM_SightingsPlatforms)->Unit(benchmark::kMicrosecond);
void BM_SightingsUprights(benchmark::State& state) {
  one_search(state, UprightSearch(ride().camera));
}
BENCHMARK(BM_SightingsUprights)->Unit(benchmark::kMicrosecond);

}  // namespace
