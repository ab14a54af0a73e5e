// The recorder program under the full load of a train: 60 pictures a second of 1280x1024 and every topic, over DDS.
// Prints its processor time, what reached the disk, and what was lost where; compares what was sent with what stands
// in the files. With --replay the recording is played again, and how late its samples went out is judged, too.
//
//   railfix-measure-recorder [--seconds 30] [--pictures full] [--compression lz4] [--ring-s 10] [--quota-mb 20000]
//                            [--replay]
#include <sched.h>
#include <unistd.h>

#include <CLI/CLI.hpp>
#include <atomic>
#include <cmath>
#include <cstdio>
#include <fstream>
#include <iostream>
#include <mutex>
#include <nlohmann/json.hpp>
#include <thread>

#include "core/time.hpp"
#include "mcap/reader.hpp"
#include "recorder/recordings_folder.hpp"
#include "support/program.hpp"
#include "support/run_until.hpp"
#include "train_load.hpp"

namespace railfix {
namespace {

namespace fs = std::filesystem;
namespace topics = messaging::topics;

constexpr int64_t kDomain = 89;
constexpr double kProgressS = 10;
constexpr double kWantedLateMs = 1;  // 99 % of the replayed samples
constexpr double kLateMs = 3;
constexpr int64_t kBarePeriodNs = 5 * core::kNsPerSecond / 1000;

struct Options {
  double seconds = 30;
  LoadOptions load;
  std::string pictures = "full";
  std::string compression = "lz4";
  double ring_s = 0;
  double quota_mb = 0;
  double split_mb = 4000;
  fs::path folder;
  bool keep = false;
  bool replay = false;
};

struct Usage {
  double cpu_s = 0;
  double written_mb = 0;  // to the disk
};

Usage usage_of(uint32_t pid) {
  Usage usage;
  std::string stat = test::slurp("/proc/" + std::to_string(pid) + "/stat");
  std::istringstream fields(stat.substr(stat.rfind(')') + 1));
  std::string skipped;
  for (int i = 0; i < 11; ++i) fields >> skipped;
  double user = 0;
  double system = 0;
  fields >> user >> system;
  usage.cpu_s = (user + system) / static_cast<double>(sysconf(_SC_CLK_TCK));
  std::ifstream io("/proc/" + std::to_string(pid) + "/io");
  for (std::string name; io >> name;) {
    double value = 0;
    io >> value;
    if (name == "write_bytes:") usage.written_mb = value / 1e6;
  }
  return usage;
}

// What the host of a virtual machine has taken from its processors (proc(5), /proc/stat).
int64_t stolen_ticks() {
  std::ifstream stat("/proc/stat");
  std::string skipped;
  for (int i = 0; i < 8; ++i) stat >> skipped;
  int64_t ticks = 0;
  stat >> ticks;
  return ticks;
}

/// How late the system wakes a thread of the player's priority that does nothing: the share of any lateness that no
/// program can mend.
class BareThread {
 public:
  BareThread() : thread_([this] { sleep(); }) {}
  ~BareThread() {
    ended_ = true;
    thread_.join();
  }
  BareThread(const BareThread&) = delete;
  BareThread& operator=(const BareThread&) = delete;
  [[nodiscard]] std::string lateness() const {
    const std::lock_guard lock(mutex_);
    std::vector<double> sorted = late_ms_;
    if (sorted.empty()) return "not measured";
    std::ranges::sort(sorted);
    char text[160];
    std::snprintf(
        text, sizeof text,
        "p50 %.3f, p99 %.3f, at most %.1f ms; later than %.0f ms %d times, %d of them because the machine's host "
        "took the processor",
        sorted[sorted.size() / 2], sorted[sorted.size() * 99 / 100], sorted.back(), kLateMs, late_, stolen_);
    return text;
  }

 private:
  void sleep() {
    const sched_param priority{1};
    (void)sched_setscheduler(0, SCHED_FIFO, &priority);
    while (!ended_) {
      const int64_t due_ns = core::monotonic_ns() + kBarePeriodNs;
      std::this_thread::sleep_for(std::chrono::nanoseconds(kBarePeriodNs));
      const std::lock_guard lock(mutex_);
      late_ms_.push_back(1e3 * core::seconds(core::monotonic_ns() - due_ns));
      const int64_t ticks = stolen_ticks();
      if (late_ms_.back() > kLateMs) {
        ++late_;
        stolen_ += ticks > ticks_ ? 1 : 0;
      }
      ticks_ = ticks;
    }
  }
  mutable std::mutex mutex_;
  std::vector<double> late_ms_;
  int late_ = 0;    // later than kLateMs
  int stolen_ = 0;  // ... while the machine's host had its processor
  int64_t ticks_ = stolen_ticks();
  std::atomic<bool> ended_ = false;
  std::thread thread_;  // last: it uses all of the above
};

class Measurement {
 public:
  explicit Measurement(const Options& options)
      : options_(options),
        participant_(network()),
        load_(participant_, options.load),
        control_(participant_, topics::service_control),
        recorder_(arguments(), {options.folder / "recorder.log", {}, {}}),
        health_(participant_, topics::service_status, "", queue_,
                [this](const msg::ServiceStatus& status) {
                  if (std::string(status.service().c_str()) == "recorder") pid_ = status.pid();
                }),
        status_reader_(participant_, topics::recorder_status, "", queue_, [this](const msg::RecorderStatus& status) {
          status_ = status;
          most_waiting_mb_ = std::max(most_waiting_mb_, status.queue_mb());
          if (status.file().size() == 0) return;
          auto& lost = lost_[status.file().c_str()];
          lost.assign(status.lost().begin(), status.lost().end());
        }) {}

  int run() {
    if (!test::run_until(queue_, [&] { return pid_ != 0 && load_.heard() && status_.file().size() > 0; })) {
      std::cerr << "the recorder did not start: " << test::slurp(options_.folder / "recorder.log") << '\n';
      return 2;
    }
    const Usage before = usage_of(pid_);
    const int64_t begin_ns = core::monotonic_ns();
    send();
    const double took_s = core::seconds(core::monotonic_ns() - begin_ns);
    const Usage after = usage_of(pid_);
    settle();
    print(before, after, took_s);
    if (recorder_.end(SIGTERM) != 0) std::cerr << "the recorder ended with an error\n";
    const uint64_t missing = options_.quota_mb > 0 ? 0 : compare();
    const bool whole = lost_samples() == 0 && missing == 0;
    std::printf("recorder: %s, %llu samples lost in %.0f s (wanted: 0)\n", whole ? "PASS" : "FAIL",
                static_cast<unsigned long long>(std::max(lost_samples(), missing)), took_s);
    const bool prompt = !options_.replay || replay();
    return whole && prompt ? 0 : 1;
  }

 private:
  [[nodiscard]] messaging::ParticipantOptions network() const {
    messaging::ParticipantOptions made;
    made.train_id = "load-" + std::to_string(getpid());
    made.domain = kDomain;
    return made;
  }
  [[nodiscard]] std::vector<std::string> arguments() const {
    const auto mb = [](double value) { return std::to_string(static_cast<int64_t>(value)); };
    return test::with_settings(
        "railfix-recorder",
        {"common.train_id=" + network().train_id, "common.domain=" + std::to_string(kDomain),
         "recorder.folder=" + options_.folder.string(), "recorder.pictures=" + options_.pictures,
         "recorder.compression=" + options_.compression, "recorder.quota_mb=" + mb(options_.quota_mb),
         "recorder.split_mb=" + mb(options_.split_mb), "recorder.ring_s=" + mb(options_.ring_s), "recorder.after_s=5",
         "recorder.chunk_mb=4", "recorder.keep_free_mb=2000"});
  }

  void handle() {
    while (queue_.run_one(0)) {
    }
  }

  void send() {
    for (double left_s = options_.seconds; left_s > 0; left_s -= 1) {
      load_.send(std::min(left_s, 1.0));
      handle();
      const double done_s = options_.seconds - left_s + 1;
      if (std::fmod(done_s, kProgressS) < 1 && left_s > 1) {
        std::printf("%.0f of %.0f s: %llu lost, %.1f MB wait for the disk\n", done_s, options_.seconds,
                    static_cast<unsigned long long>(lost_samples()), status_.queue_mb());
        std::fflush(stdout);
      }
      const bool half = left_s > options_.seconds / 2 && left_s - 1 <= options_.seconds / 2;
      if (half && options_.ring_s > 0) {
        msg::ControlRequest request;
        request.request_id(1);
        request.service("recorder");
        request.command("event");
        request.argument("half time");
        control_.write(request);
      }
    }
  }

  // What was sent reaches the file.
  void settle() {
    const int64_t until_ns = core::monotonic_ns() + 3 * core::kNsPerSecond;
    (void)test::run_until(queue_, [&] { return core::monotonic_ns() > until_ns; });
  }

  void print(const Usage& before, const Usage& after, double took_s) {
    uint64_t samples = 0;
    for (const auto& [topic, count] : load_.sent()) samples += count;
    std::printf("sent: %.0f s, %llu pictures of %ux%u and %llu other samples%s\n", took_s,
                static_cast<unsigned long long>(load_.sent().at("camera_frame/cam0")), options_.load.width_px,
                options_.load.height_px,
                static_cast<unsigned long long>(samples - load_.sent().at("camera_frame/cam0")),
                load_.late() > 0 ? (", " + std::to_string(load_.late()) + " pictures late").c_str() : "");
    std::printf("recorder (pictures %s, compression %s, ring %.0f s): %.0f %% of one core, %.1f MB/s to the disk\n",
                options_.pictures.c_str(), options_.compression.c_str(), options_.ring_s,
                100 * (after.cpu_s - before.cpu_s) / took_s, (after.written_mb - before.written_mb) / took_s);
    std::printf("waiting for the disk at most %.1f MB; %u recordings, %.0f MB in the folder\n", most_waiting_mb_,
                status_.files(), status_.kept_mb());
    for (const auto& [file, topics] : lost_) {
      for (const auto& lost : topics) {
        std::printf("lost of %s in %s: transport %llu, encoder %llu, queue %llu, disk %llu\n", lost.topic().c_str(),
                    fs::path(file).filename().c_str(), static_cast<unsigned long long>(lost.transport()),
                    static_cast<unsigned long long>(lost.encoder()), static_cast<unsigned long long>(lost.queue()),
                    static_cast<unsigned long long>(lost.disk()));
      }
    }
  }

  /// In all files: each counts its own.
  [[nodiscard]] uint64_t lost_samples() const {
    uint64_t sum = 0;
    for (const auto& [file, topics] : lost_) {
      for (const auto& lost : topics) sum += lost.transport() + lost.encoder() + lost.queue() + lost.disk();
    }
    return sum;
  }

  /// Plays the largest file to a reader of its pictures. True when the samples went out in time and all pictures came.
  bool replay() {
    fs::path largest;
    for (const auto& entry : fs::directory_iterator(options_.folder)) {
      const bool whole = entry.path().extension() == ".mcap";
      if (whole && (largest.empty() || fs::file_size(entry.path()) > fs::file_size(largest))) largest = entry.path();
    }
    messaging::ParticipantOptions other = network();
    other.train_id += "-replay";
    messaging::Queue queue;
    messaging::Participant participant(other);
    uint64_t pictures = 0;
    const messaging::Reader<msg::CameraFrame> reader(participant, topics::camera_frame, "cam0", queue,
                                                     [&](const msg::CameraFrame&) { ++pictures; });
    const fs::path said = options_.folder / "replay.json";
    test::Program player({"railfix", "replay", largest.string(), "--train", other.train_id, "--domain",
                          std::to_string(kDomain), "--without", "service_status", "--json"},
                         {said, options_.folder / "replay.log", {}});
    const BareThread bare;
    while (!player.exit_code()) queue.run_one(core::monotonic_ns() + core::kNsPerSecond / 100);
    while (queue.run_one(0)) {
    }
    const auto report = nlohmann::json::parse(test::slurp(said), nullptr, false);
    if (report.is_discarded()) {
      std::printf("replay: FAIL, %s", test::slurp(options_.folder / "replay.log").c_str());
      return false;
    }
    const double p99_ms = report["late_p99_ms"];
    const uint64_t recorded = pictures_in(largest);
    std::printf("replay of %s: %llu samples; later than due: p50 %.3f, p99 %.3f, at most %.1f ms\n",
                largest.filename().c_str(), static_cast<unsigned long long>(report["samples"].get<uint64_t>()),
                report["late_p50_ms"].get<double>(), p99_ms, report["late_max_ms"].get<double>());
    std::printf("a bare thread beside it, which only sleeps: %s\n", bare.lateness().c_str());
    const bool good = p99_ms < kWantedLateMs && pictures == recorded;
    std::printf("replay: %s, p99 %.3f ms (wanted: < %.0f ms), %llu of %llu pictures came to another process\n",
                good ? "PASS" : "FAIL", p99_ms, kWantedLateMs, static_cast<unsigned long long>(pictures),
                static_cast<unsigned long long>(recorded));
    return good;
  }

  static uint64_t pictures_in(const fs::path& recording) {
    const auto reader = core::value_or_throw(mcap::Reader::open(recording));
    uint64_t pictures = 0;
    for (const auto& [id, count] : reader->statistics().channel_messages) {
      if (reader->channels().at(id).topic == "camera_frame/cam0") pictures += count;
    }
    return pictures;
  }

  /// Samples that were sent and stand in no file.
  uint64_t compare() {
    std::map<std::string, uint64_t> found;
    for (const auto& entry : fs::directory_iterator(options_.folder)) {
      if (entry.path().extension() != ".mcap") continue;
      const auto reader = core::value_or_throw(mcap::Reader::open(entry.path()));
      const auto& statistics = reader->statistics();
      if (entry.path().stem().string().find(recorder::kEventKind) != std::string::npos) {
        std::printf("file of the event: %llu samples over %.1f s\n",
                    static_cast<unsigned long long>(statistics.messages),
                    core::seconds(statistics.end_ns - statistics.start_ns));
        continue;
      }
      for (const auto& [id, count] : statistics.channel_messages) found[reader->channels().at(id).topic] += count;
    }
    uint64_t missing = 0;
    for (const auto& [topic, count] : load_.sent()) {
      if (topic == "camera_frame/cam0" && options_.pictures == "none") continue;
      missing += count - std::min(count, found[topic]);
    }
    std::printf("sent and in no file: %llu\n", static_cast<unsigned long long>(missing));
    return missing;
  }

  Options options_;
  messaging::Queue queue_;
  messaging::Participant participant_;
  TrainLoad load_;
  messaging::Writer<msg::ControlRequest> control_;
  test::Program recorder_;
  uint32_t pid_ = 0;
  msg::RecorderStatus status_;
  double most_waiting_mb_ = 0;
  std::map<std::string, std::vector<msg::LostSamples>> lost_;  // by file
  messaging::Reader<msg::ServiceStatus> health_;
  messaging::Reader<msg::RecorderStatus> status_reader_;
};

}  // namespace
}  // namespace railfix

int main(int argc, char** argv) {
  railfix::Options options;
  CLI::App app{"The recorder under the full load of a train"};
  app.add_option("--seconds", options.seconds);
  app.add_option("--rate-hz", options.load.rate_hz, "Pictures a second");
  app.add_option("--pictures", options.pictures, "full, jpeg or none");
  app.add_option("--compression", options.compression, "zstd, lz4 or none");
  app.add_option("--ring-s", options.ring_s, "Keep a ring of full pictures, and make an event at half time");
  app.add_option("--quota-mb", options.quota_mb, "Remove the oldest while recording; then files are not counted");
  app.add_option("--split-mb", options.split_mb);
  app.add_option("--folder", options.folder, "Where to record; removed at the end unless --keep");
  app.add_flag("--keep", options.keep);
  app.add_flag("--replay", options.replay, "Play the largest file again and judge how late its samples go out");
  CLI11_PARSE(app, argc, argv);
  if (options.folder.empty()) {
    options.folder = std::filesystem::temp_directory_path() / ("railfix-load-" + std::to_string(getpid()));
  }
  std::filesystem::create_directories(options.folder);
  int result = 2;
  try {
    result = railfix::Measurement(options).run();
  } catch (const railfix::core::BadInput& error) {
    std::cerr << error.what() << '\n';
  }
  if (!options.keep) std::filesystem::remove_all(options.folder);
  return result;
}
