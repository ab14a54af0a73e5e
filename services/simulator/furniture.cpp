#include <algorithm>
#include <cmath>

#include "simulator/scenery.hpp"

namespace railfix::simulator {
namespace {

constexpr double kMastWidthM = 0.26;
constexpr double kMastTopM = 7.8;
constexpr double kFoundationM = 0.8;
constexpr double kFoundationTopM = 0.15;  // over the rail heads
constexpr double kContactWireM = 5.5;
constexpr double kCatenaryM = 6.9;
constexpr double kStaggerM = 0.2;
constexpr double kPlatesWithinM = 70.0;

void add_cantilever(Stage& stage, const Mast& mast, double stagger_m) {
  const double s = mast.distance_m;
  const double inner = mast.lateral_m + (mast.track_m < mast.lateral_m ? -0.13 : 0.13);
  const double wire = mast.track_m + stagger_m;
  const double insulator = inner + 0.25 * (wire - inner);
  stage.bar(stage.at(s, inner, 6.95), stage.at(s, wire, kCatenaryM), 0.06, 0.24F, s);
  stage.bar(stage.at(s, inner, 5.7), stage.at(s, wire, kCatenaryM), 0.06, 0.24F, s);
  stage.bar(stage.at(s, insulator, 6.1), stage.at(s, wire, kContactWireM), 0.04, 0.28F, s);
  for (const double up : {6.93, 5.8})
    stage.bar(stage.at(s, inner, up), stage.at(s, inner + 0.12 * (wire - inner), up + (up < 6.0 ? 0.14 : 0.0)), 0.14,
              0.16F, s);
}

void add_mast(Stage& stage, const Mast& mast, int64_t number) {
  const double s = mast.distance_m;
  const double d = mast.lateral_m;
  const float shade = (0.9F + 0.2F * unit_float(mix_bits(61, number)));
  const double half = 0.5 * kMastWidthM;
  const double inner = d > 0.0 ? d - half : d + half;
  stage.box(s, d, kFoundationM, kFoundationM, kFoundationTopM, 0.47F);
  stage.face({stage.at(s - half, inner, kFoundationTopM), stage.at(s + half, inner, kFoundationTopM),
              stage.at(s + half, inner, kMastTopM), stage.at(s - half, inner, kMastTopM)},
             0.20F * shade, s);
  stage.face({stage.at(s - half, d - half, kFoundationTopM), stage.at(s - half, d + half, kFoundationTopM),
              stage.at(s - half, d + half, kMastTopM), stage.at(s - half, d - half, kMastTopM)},
             0.34F * shade, s - half);
  if (s - stage.foot_m() < kPlatesWithinM) stage.board(s - half - 0.01, d, 0.24, 2.1, 2.5, 0.80F);
  add_cantilever(stage, mast, number % 2 == 0 ? kStaggerM : -kStaggerM);
  stage.cast(s, d - half, s, d + half, 0.0, kMastTopM);
  stage.cast(s, inner, s, mast.track_m, 6.6, 6.9);
}

// Contact wire and its catenary between masts of the same track.
void add_wires(Stage& stage, const Mast& from, const Mast& to, int64_t number) {
  const double span = to.distance_m - from.distance_m;
  const double a = number % 2 == 0 ? kStaggerM : -kStaggerM;
  constexpr int kPieces = 4;
  for (int i = 0; i < kPieces; ++i) {
    const auto place = [&](int k, bool carrier) {
      const double w = static_cast<double>(k) / kPieces;
      const double lateral = from.track_m + w * (to.track_m - from.track_m) + a * (1.0 - 2.0 * w);
      const double sag = 4.0 * w * (1.0 - w) * 0.9;
      return stage.at(from.distance_m + w * span, lateral, carrier ? kCatenaryM - sag : kContactWireM);
    };
    const double s = from.distance_m + span * i / kPieces;
    if (!stage.seen(s + span / kPieces)) continue;
    stage.bar(place(i, false), place(i + 1, false), 0.015, 0.2F, s);
    stage.bar(place(i, true), place(i + 1, true), 0.015, 0.2F, s);
  }
}

void add_masts(Stage& stage) {
  const auto& masts = stage.line().masts();
  const auto begin = std::lower_bound(masts.begin(), masts.end(), stage.foot_m() - 70.0,
                                      [](const Mast& mast, double s) { return mast.distance_m < s; });
  for (auto mast = begin; mast != masts.end() && mast->distance_m < stage.foot_m() + Stage::kFarM; ++mast) {
    const auto number = mast - masts.begin();
    if (stage.seen(mast->distance_m)) {
      add_mast(stage, *mast, number);
    } else if (stage.foot_m() - mast->distance_m < 8.0) {
      stage.cast(mast->distance_m, mast->lateral_m - 0.13, mast->distance_m, mast->lateral_m + 0.13, 0.0, kMastTopM);
    }
    const auto next = std::find_if(mast + 1, masts.end(), [&](const Mast& other) {
      return std::abs(other.track_m - mast->track_m) < 1.0 && other.distance_m > mast->distance_m + 1.0;
    });
    if (next != masts.end() && next->distance_m - mast->distance_m < 75.0) add_wires(stage, *mast, *next, number);
  }
}

void add_signal(Stage& stage, double s, double d) {
  stage.post(s, d, 0.12, 4.6, 0.30F);
  stage.board(s - 0.05, d, 0.55, 3.6, 4.7, 0.07F);
  stage.glow({stage.at(s - 0.06, d + 0.07, 4.3), stage.at(s - 0.06, d - 0.07, 4.3), stage.at(s - 0.06, d - 0.07, 4.44),
              stage.at(s - 0.06, d + 0.07, 4.44)},
             0.95F, s - 0.06);
  stage.board(s - 0.05, d, 0.35, 2.2, 2.7, 0.75F);
  stage.cast(s, d - 0.2, s, d + 0.2, 0.0, 4.7);
}

void add_distractors(Stage& stage) {
  for (const auto& thing : stage.line().distractors()) {
    if (!stage.seen(thing.distance_m)) continue;
    const double s = thing.distance_m;
    const double d = thing.lateral_m;
    switch (thing.kind) {
      case Distractor::Kind::signal:
        add_signal(stage, s, d);
        break;
      case Distractor::Kind::distance_board:
        stage.post(s, d, 0.07, 0.9, 0.35F);
        stage.board(s - 0.02, d, 0.42, 0.5, 1.1, 0.82F);
        stage.board(s - 0.03, d, 0.16, 0.65, 0.95, 0.15F);
        break;
      case Distractor::Kind::speed_board:
        stage.post(s, d, 0.08, 2.6, 0.35F);
        stage.board(s - 0.02, d, 0.6, 1.9, 2.5, 0.15F);
        stage.board(s - 0.03, d, 0.5, 1.95, 2.45, 0.72F);
        break;
      case Distractor::Kind::cabinet:
        stage.box(s, d, 0.5, 0.9, 1.0, 0.42F);
        stage.cast(s, d - 0.45, s, d + 0.45, 0.0, 1.0);
        break;
    }
  }
}

}  // namespace

void add_furniture(Stage& stage) {
  add_masts(stage);
  add_distractors(stage);
}

}  // namespace railfix::simulator
