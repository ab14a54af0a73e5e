// The train mouse by stages, 1280x1024 (8 mm and 5.3 um, 10 degrees), 40 m/s at 60 Hz, one thread. The limit is 2 ms a
// picture.
#include <benchmark/benchmark.h>

#include <numbers>
#include <vector>

#include "core/time.hpp"
#include "odometry/train_mouse.hpp"
#include "unit/odometry/synthetic_ground.hpp"

namespace {

using namespace railfix;
using namespace railfix::odometry;

constexpr double kStepM = 40.0 / 60.0;
constexpr int kPictures = 12;
constexpr int kWarm = 4;  // the first pictures search the full band

geometry::Intrinsics camera() {
  geometry::Intrinsics camera;
  camera.fu_px = camera.fv_px = 1509;
  camera.cu_px = 639.5;
  camera.cv_px = 511.5;
  camera.k1 = -0.05;
  camera.width_px = 1280;
  camera.height_px = 1024;
  return camera;
}

geometry::CameraPose mount() {
  geometry::CameraPose pose;
  pose.pitch_rad = 10 * std::numbers::pi / 180;
  pose.height_m = 2.5;
  return pose;
}

const std::vector<MousePicture>& pictures() {
  static const std::vector<MousePicture> all = [] {
    cv::setNumThreads(1);
    test::SyntheticGround::Options options;
    options.sleeper_contrast = 40;
    test::SyntheticGround ground(1, options);
    std::vector<MousePicture> made(kPictures);
    for (int i = 0; i < kPictures; ++i) {
      MousePicture& picture = made[static_cast<size_t>(i)];
      picture.grey = ground.picture(camera(), mount(), kStepM * i, {});
      picture.stamp_ns = core::to_ns(i / 60.0);
      picture.pose = mount();
      picture.pose_measured = true;
    }
    return made;
  }();
  return all;
}

void BM_Picture(benchmark::State& state) {
  const auto& all = pictures();
  std::optional<TrainMouse> mouse;
  size_t next = all.size();
  for (auto _ : state) {
    if (next == all.size()) {
      state.PauseTiming();
      mouse.emplace(camera(), TrainMouseOptions{});
      for (next = 0; next < kWarm; ++next) mouse->process(all[next]);
      state.ResumeTiming();
    }
    const MouseStep step = mouse->process(all[next++]);
    if (!step.valid) state.SkipWithError("the ground is not found");
  }
}
BENCHMARK(BM_Picture)->Unit(benchmark::kMillisecond);

// The stages.

/// Two pictures one step apart, and what is made of them.
struct Stage {
  Stage()
      : pose{mount(), options.texture_depth_m, 0, 0},
        maker(camera(), vision::fit_sheet(camera(), pose, options.near_m, options.far_m,
                                          0.5 * options.gauge_m - options.rail_margin_m, options.cell_m, 0.02)),
        reference(TextureReference::Options{}) {
    maker.make(pictures()[0].grey, pose, before);
    maker.make(pictures()[1].grey, pose, now);
    coarse_maker.make(before, coarse_before);
    coarse_maker.make(now, coarse_now);
    reference.set(before, maker.sheet());
    reference.measure(now, field, votes);
  }
  [[nodiscard]] RowRange shifts(double from_m, double to_m) const {
    const double cell_m = 2 * maker.sheet().cell_m;
    return {static_cast<int>(from_m / cell_m), static_cast<int>(to_m / cell_m)};
  }
  TrainMouseOptions options;
  vision::SheetPose pose;
  vision::TopViewMaker maker;
  vision::TopView before, now;
  CoarseViewMaker coarse_maker;
  CoarseView coarse_before, coarse_now;
  ShiftSearch search;
  TextureReference reference;
  DisplacementField field = [](const Eigen::Vector2d&, bool) { return Eigen::Vector2d(-kStepM, 0); };
  std::vector<PatchMotion> votes;
};

void BM_StageTopView(benchmark::State& state) {
  Stage stage;
  for (auto _ : state) {
    stage.maker.make(pictures()[1].grey, stage.pose, stage.now);
    benchmark::DoNotOptimize(stage.now.grey.data);
  }
}
BENCHMARK(BM_StageTopView)->Unit(benchmark::kMicrosecond);

void BM_StageHalfSizeView(benchmark::State& state) {
  Stage stage;
  for (auto _ : state) {
    stage.coarse_maker.make(stage.now, stage.coarse_now);
    benchmark::DoNotOptimize(stage.coarse_now.contrast_grey);
  }
}
BENCHMARK(BM_StageHalfSizeView)->Unit(benchmark::kMicrosecond);

void search(benchmark::State& state, double from_m, double to_m) {
  Stage stage;
  const RowRange all{0, stage.coarse_now.rows - 1};
  for (auto _ : state) {
    const ShiftPeak peak =
        stage.search.find(stage.coarse_before, stage.coarse_now, all, stage.shifts(from_m, to_m), 2, 4);
    benchmark::DoNotOptimize(peak.score);
  }
}
void BM_StageSearchNearPrediction(benchmark::State& state) {
  search(state, kStepM - 0.16, kStepM + 0.16);
}
BENCHMARK(BM_StageSearchNearPrediction)->Unit(benchmark::kMicrosecond);

void BM_StageSearchFullBand(benchmark::State& state) {
  search(state, -70.0 / 60, 70.0 / 60);
}
BENCHMARK(BM_StageSearchFullBand)->Unit(benchmark::kMicrosecond);

void BM_StageNewReference(benchmark::State& state) {
  Stage stage;
  for (auto _ : state) stage.reference.set(stage.before, stage.maker.sheet());
}
BENCHMARK(BM_StageNewReference)->Unit(benchmark::kMicrosecond);

/// One of four rounds.
void BM_StagePatches(benchmark::State& state) {
  Stage stage;
  for (auto _ : state) benchmark::DoNotOptimize(stage.reference.measure(stage.now, stage.field, stage.votes));
}
BENCHMARK(BM_StagePatches)->Unit(benchmark::kMicrosecond);

/// One of four rounds.
void BM_StageLeastSquares(benchmark::State& state) {
  Stage stage;
  MotionFilter filter(stage.options.filter);
  const PosePrior prior;
  const PoseErrors first = filter.first(prior);
  Motion motion;
  for (auto _ : state) {
    filter.solve(first, prior, {}, stage.pose.height_m(), stage.votes, motion);
    benchmark::DoNotOptimize(motion.along_m);
  }
}
BENCHMARK(BM_StageLeastSquares)->Unit(benchmark::kMicrosecond);

}  // namespace
