#include <algorithm>
#include <cmath>

#include "simulator/scenery.hpp"

namespace railfix::simulator {
namespace {

constexpr double kCarM = 24.8;
constexpr double kCarPitchM = 25.5;
constexpr double kHalfWidthM = 1.45;
constexpr double kFloorM = 0.9;
constexpr double kRoofM = 3.9;
constexpr double kBehindM = 4.0;  // so far behind the foot cars still show or throw shadows
constexpr int kPanels = 6;

/// One car on its track, from its end that is nearer to the path's beginning.
struct Car {
  const CentreLine& track;
  double begin_m, end_m;
  double side;  // of the wall that faces the path, left = +1
  float paint;
};

Quad wall(const Stage& stage, const Car& car, double from, double to, double bottom, double top) {
  const double d = car.side * kHalfWidthM;
  return {stage.beside(car.track, from, d, bottom), stage.beside(car.track, to, d, bottom),
          stage.beside(car.track, to, d, top), stage.beside(car.track, from, d, top)};
}

void add_side(Stage& stage, const Car& car) {
  const double panel = (car.end_m - car.begin_m) / kPanels;
  for (int i = 0; i < kPanels; ++i) {
    const double a = car.begin_m + i * panel;
    const double b = a + panel;
    if (b < stage.foot_m()) continue;
    stage.panel(wall(stage, car, a, b, -0.1, kFloorM), 0.10F, a);
    stage.panel(wall(stage, car, a, b, kFloorM, kRoofM), car.paint, a);
    const bool door = i == 0 || i == kPanels - 1;
    const double inset = door ? 1.3 : 0.45;
    stage.face(wall(stage, car, a + inset, b - inset, door ? kFloorM + 0.1 : 1.9, 2.9), door ? 0.30F : 0.07F, a - 0.01);
  }
}

void add_end(Stage& stage, const Car& car, bool leading, bool coming) {
  const double s = car.begin_m;
  if (s < stage.foot_m()) return;
  const auto across = [&](double left, double right, double bottom, double top) {
    return Quad{stage.beside(car.track, s, left, bottom), stage.beside(car.track, s, right, bottom),
                stage.beside(car.track, s, right, top), stage.beside(car.track, s, left, top)};
  };
  stage.face(across(kHalfWidthM, -kHalfWidthM, -0.1, kFloorM), 0.08F, s - 0.02);
  stage.face(across(kHalfWidthM, -kHalfWidthM, kFloorM, kRoofM), leading ? 0.75F * car.paint : 0.12F, s - 0.02);
  if (!leading) return;
  stage.face(across(1.15, -1.15, 2.1, 3.2), 0.06F, s - 0.03);
  for (const double d : {-0.95, 0.95})
    stage.glow(across(d + 0.12, d - 0.12, 1.25, 1.45), coming ? 1.4F : 0.25F, s - 0.03);
}

void add_shadow(Stage& stage, const Car& car) {
  const auto lateral = [&](double s, double d) { return stage.lateral_m(stage.beside(car.track, s, d, 0.0)); };
  const double near = std::max(car.begin_m, stage.foot_m() - 2.0);
  if (car.end_m <= near) return;
  for (const double d : {-kHalfWidthM, kHalfWidthM})
    stage.cast(near, lateral(near, d), car.end_m, lateral(car.end_m, d), 0.0, kRoofM);
  stage.shade({stage.stones(near, lateral(near, -1.3)), stage.stones(near, lateral(near, 1.3)),
               stage.stones(car.end_m, lateral(car.end_m, 1.3)), stage.stones(car.end_m, lateral(car.end_m, -1.3))},
              0.55);
}

void add_train(Stage& stage, const OtherTrain& train, const CentreLine& track, double time_s) {
  const double front_m = train.front_m + train.speed_mps * time_s;
  const double ahead = train.speed_mps < 0.0 ? -1.0 : 1.0;
  const int cars = std::max(1, static_cast<int>(std::lround(train.length_m / kCarPitchM)));
  const double track_end_m = track.begin_m + static_cast<double>(track.samples.size() - 1) * kCentreStepM;
  for (int i = 0; i < cars; ++i) {
    const double tip = front_m - ahead * i * kCarPitchM;
    const double begin_m = ahead > 0.0 ? tip - kCarM : tip;
    const double end_m = begin_m + kCarM;
    if (end_m < stage.foot_m() - kBehindM || begin_m > stage.foot_m() + Stage::kFarM) continue;
    if (begin_m < track.begin_m || end_m > track_end_m) continue;
    const double side =
        stage.lateral_m(stage.beside(track, std::max(begin_m, stage.foot_m()), 0.0, 0.0)) > 0.0 ? -1.0 : 1.0;
    const Car car{track, begin_m, end_m, side, 0.35F + 0.3F * unit_float(mix_bits(41, train.edge, i / 3))};
    const bool outermost = ahead > 0.0 ? i == cars - 1 : i == 0;
    add_shadow(stage, car);
    add_side(stage, car);
    add_end(stage, car, outermost, ahead < 0.0);
  }
}

}  // namespace

void add_trains(Stage& stage, const std::vector<OtherTrain>& trains, double time_s) {
  for (const auto& train : trains) {
    for (const auto& track : stage.line().branches()) {
      if (track.edge == train.edge) add_train(stage, train, track, time_s);
    }
  }
}

}  // namespace railfix::simulator
