// How long one camera frame is on its way over DDS from one process to another, and whether any is lost. Frames lie in
// memory that both share: the way begins when the picture is complete there and ends in the reader's handler.
#include <spawn.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <numeric>
#include <thread>
#include <vector>

#include "core/time.hpp"
#include "measuring_tool.hpp"
#include "messaging/topics.hpp"

extern char** environ;

namespace {

using namespace railfix;

constexpr int64_t kPatienceNs = 3'000'000'000;
constexpr double kTargetUs = 200;  // of the median
constexpr uint32_t kWidthPx = 1280;
constexpr uint32_t kHeightPx = 1024;

struct Options {
  std::string train = "frame-hop-" + std::to_string(getpid());
  int frames = 3000;
  double rate_hz = 60;
  bool write = false;
};

messaging::ParticipantOptions participant_options(const Options& options, const std::string& service) {
  messaging::ParticipantOptions dds;
  dds.train_id = options.train;
  dds.domain = 97;
  dds.service = service;
  return dds;
}

/// The other process.
int write_frames(const Options& options) {
  messaging::Participant participant(participant_options(options, "frame_grabber"));
  messaging::Writer<msg::CameraFrame> writer(participant, messaging::topics::camera_frame, "cam0");
  const auto patient_until_ns = core::monotonic_ns() + kPatienceNs;
  while (writer.matched_readers() == 0) {
    if (core::monotonic_ns() > patient_until_ns) throw std::runtime_error("no reader came within 3 s");
    std::this_thread::sleep_for(std::chrono::milliseconds(10));
  }
  std::vector<uint8_t> picture(kWidthPx * kHeightPx);
  std::iota(picture.begin(), picture.end(), uint8_t{0});
  auto next = std::chrono::steady_clock::now();
  for (int i = 0; i < options.frames; ++i) {
    std::this_thread::sleep_until(next += std::chrono::nanoseconds(core::to_ns(1 / options.rate_hz)));
    writer.write_in_place([&](msg::CameraFrame& frame) {
      frame.stamp_ns(core::wall_ns());
      frame.seq(static_cast<uint64_t>(i));
      frame.width_px(kWidthPx);
      frame.height_px(kHeightPx);
      frame.exposure_s(0);
      frame.health(0);
      std::ranges::copy(picture, frame.data().begin());
      frame.grabbed_ns(core::monotonic_ns());
    });
  }
  // Until the last one was read: the reader ends first.
  while (writer.matched_readers() > 0) std::this_thread::sleep_for(std::chrono::milliseconds(10));
  return 0;
}

pid_t start_writer(const Options& options) {
  std::vector<std::string> words{"/proc/self/exe", "--write",
                                 "--train",        options.train,
                                 "--frames",       std::to_string(options.frames),
                                 "--rate-hz",      std::to_string(options.rate_hz)};
  std::vector<char*> argv;
  for (auto& word : words) argv.push_back(word.data());
  argv.push_back(nullptr);
  pid_t pid = 0;
  if (posix_spawn(&pid, words[0].c_str(), nullptr, nullptr, argv.data(), environ) != 0)
    throw std::runtime_error("cannot start the process that sends");
  return pid;
}

std::vector<double> read_frames(const Options& options) {
  messaging::Participant participant(participant_options(options, "track_detector"));
  messaging::Queue queue;
  std::vector<double> way_us;
  int64_t last_ns = core::monotonic_ns();
  const messaging::Reader<msg::CameraFrame> reader(
      participant, messaging::topics::camera_frame, "cam0", queue, [&](const msg::CameraFrame& frame) {
        last_ns = core::monotonic_ns();
        way_us.push_back(1e-3 * static_cast<double>(last_ns - frame.grabbed_ns()));
      });
  const auto wanted = static_cast<size_t>(options.frames);
  while (way_us.size() < wanted && core::monotonic_ns() < last_ns + kPatienceNs) queue.run_one(last_ns + kPatienceNs);
  return way_us;
}

int measure_hop(const Options& options) {
  const pid_t writer = start_writer(options);
  auto way_us = read_frames(options);
  int status = 0;
  waitpid(writer, &status, 0);
  if (status != 0 || way_us.empty()) throw std::runtime_error("no frame came over");
  std::sort(way_us.begin(), way_us.end());
  const auto lost = static_cast<size_t>(options.frames) - way_us.size();
  std::printf("%ux%u at %g Hz, %d frames: %zu lost; on the way p50 %.0f us, p99 %.0f us, max %.0f us\n", kWidthPx,
              kHeightPx, options.rate_hz, options.frames, lost, way_us[way_us.size() / 2],
              way_us[way_us.size() * 99 / 100], way_us.back());
  return lost == 0 && way_us[way_us.size() / 2] <= kTargetUs ? 0 : 1;
}

}  // namespace

int main(int argc, char** argv) {
  CLI::App app{"Frames over DDS: how long one is on its way from process to process, and how many are lost",
               "railfix-measure-frame-hop"};
  Options options;
  app.add_option("--frames", options.frames, "How many")->check(CLI::Range(1, 1000000))->capture_default_str();
  app.add_option("--rate-hz", options.rate_hz, "How many a second")
      ->check(CLI::Range(0.1, 1000.0))
      ->capture_default_str();
  app.add_option("--train", options.train)->group("");
  app.add_flag("--write", options.write)->group("");
  return railfix::measure::run_tool(app, argc, argv,
                                    [&] { return options.write ? write_frames(options) : measure_hop(options); });
}
