// How well does `railfix map learn` find again what a map was made without? Chainage of the learned landmarks against
// the true ones, and whether their sigmas hold.
//
//   railfix map build TRUE.map --landmarks frog --out POOR.map
//   railfix simulate --map TRUE.map ... --out S1     railfix run --dataset S1 --map POOR.map --out R1     (and so on)
//   railfix map learn POOR.map R1 R2 R3 --out LEARNED.map
//   railfix-measure-survey TRUE.map POOR.map LEARNED.map
#include <algorithm>
#include <cmath>
#include <cstdio>
#include <map>
#include <set>

#include "measuring_tool.hpp"
#include "track/map.hpp"

namespace {

using namespace railfix;  // NOLINT(google-build-using-namespace)
using track::Landmark;
using track::Map;

constexpr double kSameThingM = 4;
constexpr double kTooFarSigmas = 3;

struct Errors {
  size_t learned = 0;
  size_t real = 0;
  size_t false_ones = 0;
  double squares = 0;
  double normalised_squares = 0;
  double largest_m = 0;
  size_t beyond = 0;  // 3 sigmas
};

bool one_side(const Landmark& a, const Landmark& b) {
  const bool has_side = a.kind == track::LandmarkKind::mast || a.kind == track::LandmarkKind::platform;
  return !has_side || a.lateral_m * b.lateral_m >= 0;
}

const Landmark* nearest(const Map& map, const Landmark& to) {
  const Landmark* best = nullptr;
  for (const Landmark& mark : map.landmarks) {
    if (mark.kind != to.kind || mark.edge != to.edge || !one_side(mark, to)) continue;
    if (best == nullptr || std::abs(mark.offset_m - to.offset_m) < std::abs(best->offset_m - to.offset_m)) best = &mark;
  }
  const bool near = best != nullptr && std::abs(best->offset_m - to.offset_m) < kSameThingM;
  return near ? best : nullptr;
}

void print(const char* kind, const Errors& e) {
  const auto n = static_cast<double>(e.learned - e.false_ones);
  std::printf("%-12s %4zu of %4zu, %zu false; rms %.3f m, largest %.3f m, rms/sigma %.2f, beyond 3 sigma %zu\n", kind,
              e.learned - e.false_ones, e.real, e.false_ones, std::sqrt(e.squares / n), e.largest_m,
              std::sqrt(e.normalised_squares / n), e.beyond);
}

int judge(const std::string& truth_file, const std::string& poor_file, const std::string& learned_file) {
  const Map truth = core::value_or_throw(Map::load(truth_file));
  const Map poor = core::value_or_throw(Map::load(poor_file));
  const Map learned = core::value_or_throw(Map::load(learned_file));
  std::map<std::string, Errors> kinds;
  std::set<uint32_t> passed;  // edges on which something was learned: other tracks were not run on
  for (size_t i = poor.landmarks.size(); i < learned.landmarks.size(); ++i) passed.insert(learned.landmarks[i].edge);
  for (const Landmark& mark : truth.landmarks) {
    if (passed.contains(mark.edge) && nearest(poor, mark) == nullptr) ++kinds[track::to_string(mark.kind)].real;
  }
  Errors all;
  for (size_t i = poor.landmarks.size(); i < learned.landmarks.size(); ++i) {
    const Landmark& mark = learned.landmarks[i];
    Errors& kind = kinds[track::to_string(mark.kind)];
    const Landmark* real = nearest(truth, mark);
    for (Errors* e : {&kind, &all}) {
      ++e->learned;
      if (real == nullptr) {
        ++e->false_ones;
        continue;
      }
      const double error_m = mark.offset_m - real->offset_m;
      e->squares += error_m * error_m;
      e->normalised_squares += std::pow(error_m / mark.sigma_m, 2);
      e->largest_m = std::max(e->largest_m, std::abs(error_m));
      e->beyond += std::abs(error_m) > kTooFarSigmas * mark.sigma_m;
    }
    std::printf("  %-10s %3u:%8.3f  error %+.3f m, sigma %.3f m\n", track::to_string(mark.kind).c_str(), mark.edge,
                mark.offset_m, real == nullptr ? NAN : mark.offset_m - real->offset_m, mark.sigma_m);
  }
  for (const auto& [kind, errors] : kinds) {
    all.real += errors.real;
    print(kind.c_str(), errors);
  }
  print("all", all);
  return 0;
}

}  // namespace

int main(int argc, char** argv) {
  CLI::App app{"Accuracy of `railfix map learn`: learned landmarks against the true ones", "railfix-measure-survey"};
  std::string truth;
  std::string poor;
  std::string learned;
  app.add_option("TRUE", truth, "The map that the pictures were drawn from")->required();
  app.add_option("POOR", poor, "The map that the runs were made on")->required();
  app.add_option("LEARNED", learned, "What `railfix map learn` made of it")->required();
  return railfix::measure::run_tool(app, argc, argv, [&] { return judge(truth, poor, learned); });
}
