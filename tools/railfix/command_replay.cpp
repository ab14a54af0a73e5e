#include <algorithm>
#include <cmath>
#include <csignal>
#include <iostream>
#include <map>
#include <memory>
#include <opencv2/imgcodecs.hpp>
#include <thread>

#include "commands.hpp"
#include "core/time.hpp"
#include "mcap/reader.hpp"
#include "messaging/topics.hpp"
#include "progress.hpp"

namespace railfix::tool {
namespace {

// Long enough to find readers before the first sample, and to get the last ones out.
constexpr std::chrono::milliseconds kDiscovery{1500};
constexpr std::chrono::milliseconds kLinger{300};
constexpr int64_t kAssertNs = 50'000'000;

// A recorded command must not start or stop a service of today, nor an old clock lead one.
const std::set<std::string> kOnlyWhenNamed{"service_control", "service_reply", "data_clock", "data_progress"};

struct Options {
  std::filesystem::path file;
  double rate = 1;
  std::vector<std::string> topics;
  std::string train = "demo";
  int64_t domain = 0;
  double from_s = 0;
  double to_s = std::numeric_limits<double>::infinity();
};

volatile std::sig_atomic_t interrupted = 0;

/// Publishes the samples of one recorded channel.
class Channel {
 public:
  Channel(messaging::Participant& participant, const messaging::TopicInfo& topic, const std::string& name, bool as_jpeg)
      : type_(*topic.type),
        as_jpeg_(as_jpeg),
        sample_(topic.type->make()),
        writer_(participant, topic, instance(name)) {}

  /// False: the bytes are not such a sample.
  bool publish(const std::vector<uint8_t>& cdr) {
    if (as_jpeg_) return publish_picture(cdr);
    return type_.deserialize(cdr, sample_.get()) && writer_.write(sample_.get());
  }

 private:
  static std::string instance(const std::string& name) {
    const size_t slash = name.find('/');
    return slash == std::string::npos ? "" : name.substr(slash + 1);
  }

  bool publish_picture(const std::vector<uint8_t>& cdr) {
    msg::CameraPreview picture;
    if (!messaging::deserialize(cdr, picture)) return false;
    const cv::Mat pixels = picture.jpeg().empty() ? cv::Mat() : cv::imdecode(picture.jpeg(), cv::IMREAD_GRAYSCALE);
    if (pixels.empty() || pixels.total() > msg::CAMERA_MAX_PIXELS) return false;
    return writer_.write_in_place([&](void* sample) {
      auto& frame = *static_cast<msg::CameraFrame*>(sample);
      frame.stamp_ns(picture.stamp_ns());
      frame.grabbed_ns(picture.grabbed_ns());
      frame.seq(picture.seq());
      frame.width_px(static_cast<uint32_t>(pixels.cols));
      frame.height_px(static_cast<uint32_t>(pixels.rows));
      frame.exposure_s(picture.exposure_s());
      frame.health(picture.health());
      std::copy(pixels.datastart, pixels.dataend, frame.data().begin());
    });
  }

  const messaging::Type& type_;
  bool as_jpeg_;
  std::shared_ptr<void> sample_;
  messaging::AnyWriter writer_;
};

class Replay {
 public:
  explicit Replay(const Options& options)
      : options_(options),
        reader_(core::value_or_throw(mcap::Reader::open(options.file))),
        participant_(participant_options(options)) {}

  int run() {
    make_channels();
    refuse_running_train();
    const auto& statistics = reader_->statistics();
    mcap::Selection selection;
    for (const auto& [name, channel] : channels_) selection.topics.insert(name);
    selection.from_ns = statistics.start_ns + core::to_ns(options_.from_s);
    const double length_s = core::seconds(statistics.end_ns - statistics.start_ns);
    if (options_.from_s > length_s) {
      throw core::BadInput("--from " + std::to_string(options_.from_s) + " is behind the end of " +
                           options_.file.string() + ", which is " + std::to_string(length_s) + " s long");
    }
    if (options_.to_s < length_s) selection.to_ns = statistics.start_ns + core::to_ns(options_.to_s);
    const double played_s = std::min(options_.to_s, length_s) - options_.from_s;
    Progress progress("replay (seconds)", static_cast<uint64_t>(std::max(1.0, std::ceil(played_s))));
    play(selection, progress);
    progress.finish();
    std::this_thread::sleep_for(kLinger);
    for (const auto& problem : reader_->problems()) std::cerr << problem << '\n';
    for (const auto& [name, count] : broken_) {
      std::cerr << name << ": " << count << " samples are not of this version's type and were left out\n";
    }
    std::cout << published_ << " samples of " << channels_.size() << " topics published for train " << options_.train
              << ", domain " << options_.domain << '\n';
    return published_ > 0 ? 0 : 1;
  }

 private:
  static messaging::ParticipantOptions participant_options(const Options& options) {
    messaging::ParticipantOptions made;
    made.train_id = options.train;
    made.domain = options.domain;
    made.service = "railfix-replay";
    return made;
  }

  [[nodiscard]] bool wanted(const std::string& topic) const {
    if (options_.topics.empty()) return !kOnlyWhenNamed.contains(topic);
    const std::string base = topic.substr(0, topic.find('/'));
    return std::ranges::any_of(options_.topics, [&](const std::string& name) { return name == topic || name == base; });
  }

  void make_channels() {
    std::string recorded;
    for (const auto& [id, channel] : reader_->channels()) {
      recorded += (recorded.empty() ? "" : ", ") + channel.topic;
      const auto* topic = messaging::find_topic(channel.topic);
      if (!wanted(channel.topic) || channels_.contains(channel.topic)) continue;
      const auto schema = reader_->schemas().find(channel.schema_id);
      const std::string type = schema == reader_->schemas().end() ? "" : schema->second.name;
      const bool as_jpeg = topic != nullptr && topic->name == std::string("camera_frame") &&
                           type == messaging::type_of<msg::CameraPreview>().name();
      if (topic == nullptr || channel.message_encoding != "cdr" || (!as_jpeg && type != topic->type->name())) {
        std::cerr << channel.topic << " is not a topic of this version (" << type << ") and is left out\n";
        continue;
      }
      channels_.emplace(channel.topic, std::make_unique<Channel>(participant_, *topic, channel.topic, as_jpeg));
    }
    if (!channels_.empty()) return;
    throw core::BadInput(options_.file.string() + " has none of the wanted topics; it has " +
                         (recorded.empty() ? "none" : recorded));
  }

  /// Two writers of one topic would give the train two positions.
  void refuse_running_train() {
    std::this_thread::sleep_for(kDiscovery);
    for (const auto& name : participant_.written_topics()) {
      if (!channels_.contains(name)) continue;
      throw core::BadInput("train " + options_.train + " on domain " + std::to_string(options_.domain) +
                           " is running: " + name +
                           " has a writer already; replay as another train (--train) or other topics (--topics)");
    }
  }

  void wait_until(int64_t due_ns) {
    while (interrupted == 0) {
      participant_.assert_liveliness();
      const int64_t left_ns = due_ns - core::monotonic_ns();
      if (left_ns <= 0) return;
      std::this_thread::sleep_for(std::chrono::nanoseconds(std::min(left_ns, kAssertNs)));
    }
  }

  void play(const mcap::Selection& selection, Progress& progress) {
    std::signal(SIGINT, [](int) { interrupted = 1; });
    const int64_t begun_ns = core::monotonic_ns();
    reader_->for_each(selection, [&](const mcap::Channel& channel, const mcap::Message& message) {
      const int64_t into_ns = message.log_time_ns - *selection.from_ns;
      wait_until(begun_ns + static_cast<int64_t>(static_cast<double>(into_ns) / options_.rate));
      if (interrupted != 0) return false;
      if (channels_.at(channel.topic)->publish({message.data.begin(), message.data.end()})) {
        ++published_;
      } else {
        ++broken_[channel.topic];
      }
      progress.update(static_cast<uint64_t>(std::max(0.0, core::seconds(into_ns))));
      return true;
    });
  }

  Options options_;
  std::unique_ptr<mcap::Reader> reader_;
  messaging::Participant participant_;
  std::map<std::string, std::unique_ptr<Channel>> channels_;
  std::map<std::string, uint64_t> broken_;
  uint64_t published_ = 0;
};

}  // namespace

void add_replay(CLI::App& app, Action& chosen) {
  auto options = std::make_shared<Options>();
  auto* command = app.add_subcommand("replay",
                                     "Publish a recording again with its own timing.  Example: railfix replay run.mcap "
                                     "--topics track_view --train test");
  command->add_option("FILE", options->file, "Recording (.mcap, also one that was cut off)")->required();
  command->add_option("--rate", options->rate, "Times faster than recorded")
      ->capture_default_str()
      ->check(CLI::Range(0.01, 1000.0));
  command
      ->add_option("--topics", options->topics,
                   "Only these, separated by commas; without it all but commands and the data clock")
      ->delimiter(',');
  command->add_option("--train", options->train, "Train to publish as")->capture_default_str();
  command->add_option("--domain", options->domain, "DDS domain")->capture_default_str()->check(CLI::Range(0, 232));
  command->add_option("--from", options->from_s, "Begin this many seconds into the recording")
      ->check(CLI::NonNegativeNumber);
  command->add_option("--to", options->to_s, "End this many seconds into the recording")->check(CLI::NonNegativeNumber);
  command->callback([&chosen, options] { chosen = [options] { return Replay(*options).run(); }; });
}

}  // namespace railfix::tool
