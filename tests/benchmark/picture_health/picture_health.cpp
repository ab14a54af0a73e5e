// Picture health on datasets and folders of pictures: false alarms, what spoilt pictures are called, time.
//   railfix-bench-picture-health [--fps N] [--most N] SEQ...
#include <algorithm>
#include <cmath>
#include <cstdio>
#include <ctime>
#include <functional>
#include <opencv2/imgproc.hpp>
#include <string>
#include <vector>

#include "core/joined.hpp"
#include "dataset/dataset.hpp"
#include "frame_grabber/picture_health.hpp"
#include "measuring_tool.hpp"
#include "messaging/message_words.hpp"
#include "number_between.hpp"
#include "whole_number.hpp"

namespace {

using namespace railfix;
using namespace railfix::frame_grabber;

/// What a picture may suffer; from the tenth on, so that there is something to compare with.
struct Spoiling {
  const char* name;
  uint32_t expected;
  std::function<void(cv::Mat&)> spoil;
};

const Spoiling kSpoilings[] = {
    {"as it is", 0, [](cv::Mat&) {}},
    {"defocus 4 px", kBlurred, [](cv::Mat& m) { cv::GaussianBlur(m, m, {}, 4.0 * m.cols / 1280); }},
    {"condensation", kBlurred,
     [](cv::Mat& m) {
       cv::GaussianBlur(m, m, {}, 8.0 * m.cols / 1280);
       m.convertTo(m, -1, 0.7, 50);
     }},
    {"lower half covered", kCovered,
     [](cv::Mat& m) {
       cv::Mat hand = m.rowRange(m.rows / 2, m.rows);
       cv::GaussianBlur(hand, hand, {}, m.cols / 8.0);
       cv::Mat noise(hand.size(), CV_8UC1);
       cv::randn(noise, 6, 2);
       hand += noise;
     }},
};

constexpr int kGoodPictures = 10;

double quantile(std::vector<double> values, double q) {
  if (values.empty()) return std::nan("");
  const auto at = values.begin() + static_cast<std::ptrdiff_t>(q * static_cast<double>(values.size() - 1));
  std::nth_element(values.begin(), at, values.end());
  return *at;
}

double cpu_ms() {
  timespec now{};
  clock_gettime(CLOCK_PROCESS_CPUTIME_ID, &now);
  return static_cast<double>(now.tv_sec) * 1e3 + static_cast<double>(now.tv_nsec) * 1e-6;
}

std::string words_of(uint32_t health) {
  return core::joined(messaging::names_of_picture_health(health));
}

void judge(const std::string& path, const Spoiling& spoiling, double fps, int most) {
  auto source = core::value_or_throw(dataset::open_pictures(path, {fps}));
  const auto calibration = core::value_or_throw(dataset::find_calibration(path));
  PictureHealth health{PictureHealthConfig()};
  std::vector<double> sharpness, covered, times;
  int pictures = 0, flagged = 0, expected = 0;
  uint32_t all = 0;
  for (auto next = source->next(); pictures < most && next.ok() && next.value(); next = source->next()) {
    cv::Mat grey = next.value()->grey;
    if (pictures == 0 && calibration && calibration->mount) {
      health.watch_track(calibration->intrinsics, *calibration->mount);
    }
    if (pictures >= kGoodPictures) spoiling.spoil(grey);
    const double begin_ms = cpu_ms();
    const uint32_t bits = health.judge(next.value()->stamp_ns, grey);
    times.push_back(cpu_ms() - begin_ms);
    ++pictures;
    flagged += bits != 0;
    expected += (bits & spoiling.expected) != 0;
    all |= bits;
    if (bits != 0 && spoiling.expected == 0)
      std::printf("  %s %s\n", next.value()->name.c_str(), words_of(bits).c_str());
    if (health.sharpness()) sharpness.push_back(*health.sharpness());
    covered.push_back(health.covered_share());
  }
  std::printf(
      "%-22s %5d pictures, %5d flagged, %5d as expected (%s); sharpness p5 %.2f p50 %.2f p95 %.2f (%zu); covered p50 "
      "%.2f max %.2f; %.3f ms\n",
      spoiling.name, pictures, flagged, expected, words_of(all).c_str(), quantile(sharpness, 0.05),
      quantile(sharpness, 0.5), quantile(sharpness, 0.95), sharpness.size(), quantile(covered, 0.5),
      quantile(covered, 1), quantile(times, 0.5));
}

}  // namespace

int main(int argc, char** argv) {
  double fps = 0;
  int most = 1 << 30;
  std::vector<std::string> paths;
  CLI::App app("Picture health: false alarms, what spoilt pictures are called, time", "railfix-bench-picture-health");
  app.add_option("SEQ", paths, "Datasets and folders of pictures")->required();
  app.add_option("--fps", fps, "Pictures a second, where they have no times")->check(tool::number_between(0.01, 1000));
  app.add_option("--most", most, "No more than so many of each")->check(tool::whole_number(1, 1U << 30U));
  return measure::run_tool(app, argc, argv, [&] {
    for (const auto& path : paths) {
      std::printf("%s\n", path.c_str());
      for (const Spoiling& spoiling : kSpoilings) judge(path, spoiling, fps, most);
    }
    return 0;
  });
}
