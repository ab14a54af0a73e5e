#include <algorithm>
#include <csignal>
#include <cstdio>
#include <iostream>
#include <map>
#include <memory>
#include <nlohmann/json.hpp>
#include <optional>

#include "cdr/decode.hpp"
#include "commands.hpp"
#include "core/time.hpp"
#include "messaging/topics.hpp"
#include "topic_watch.hpp"

namespace railfix::tool {
namespace {

using nlohmann::ordered_json;

constexpr double kListS = 3;
constexpr int64_t kTurnNs = 50'000'000;
constexpr int64_t kHintNs = 2 * core::kNsPerSecond;
constexpr size_t kWaiting = 1000;

struct Options {
  std::string topic;
  std::string train = "demo";
  int64_t domain = 0;
  bool json = false;
  uint64_t count = 0;
  double for_s = 0;
};

volatile std::sig_atomic_t interrupted = 0;

/// Listens to topics of one train until time or count is up, or Ctrl-C.
class Listener {
 public:
  using OnSample =
      std::function<void(const std::string& topic, const messaging::TopicInfo& info,
                         const std::shared_ptr<const void>& sample, const messaging::SampleInfo& sample_info)>;
  explicit Listener(const Options& options) : participant_(participant_options(options)) {
    std::signal(SIGINT, [](int) { interrupted = 1; });
  }

  void listen(const std::string& name, OnSample on_sample) {
    if (readers_.contains(name)) return;
    const auto* topic = messaging::find_topic(name);
    if (topic == nullptr) return;
    const size_t slash = name.find('/');
    messaging::TopicInfo info = *topic;
    info.reader_queue = std::max(info.reader_queue, topic->qos.data_sharing ? size_t{8} : kWaiting);
    readers_[name] = std::make_unique<messaging::AnyReader>(
        participant_, info, slash == std::string::npos ? "" : name.substr(slash + 1), queue_,
        [name, topic, on_sample = std::move(on_sample)](const auto& sample, const auto& sample_info) {
          if (sample_info.valid) on_sample(name, *topic, sample, sample_info);
        });
  }

  /// `done` is asked about twenty times a second.
  void run(double for_s, const std::function<bool()>& done) {
    const int64_t end_ns = for_s > 0 ? core::monotonic_ns() + core::to_ns(for_s) : std::numeric_limits<int64_t>::max();
    while (interrupted == 0 && core::monotonic_ns() < end_ns && !done()) {
      const int64_t turn_ns = std::min(core::monotonic_ns() + kTurnNs, end_ns);
      while (queue_.run_one(turn_ns) && core::monotonic_ns() < turn_ns) {
      }
    }
  }
  messaging::Participant& participant() { return participant_; }
  [[nodiscard]] int writers(const std::string& name) const {
    const auto reader = readers_.find(name);
    return reader == readers_.end() ? 0 : reader->second->matched_writers();
  }

 private:
  static messaging::ParticipantOptions participant_options(const Options& options) {
    messaging::ParticipantOptions made;
    made.train_id = options.train;
    made.domain = options.domain;
    made.service = "railfix-topics";
    return made;
  }
  messaging::Participant participant_;
  messaging::Queue queue_;
  std::map<std::string, std::unique_ptr<messaging::AnyReader>> readers_;
};

std::string where(const Options& options) {
  return "train " + options.train + ", domain " + std::to_string(options.domain);
}

/// The topic, with its camera when there is only one; BadInput with the names that may have been meant.
std::string resolve(Listener& listener, const Options& options) {
  std::vector<std::string> written;
  listener.run(kListS, [&] {
    written = listener.participant().written_topics();
    return messaging::find_topic(options.topic) != nullptr && options.topic.find("camera_") != 0;
  });
  const bool needs_camera = options.topic == "camera_frame" || options.topic == "camera_preview";
  if (needs_camera) {
    std::erase_if(written, [&](const std::string& name) { return !name.starts_with(options.topic + "/"); });
    if (written.size() == 1) return written.front();
    std::string names;
    for (const auto& name : written) names += (names.empty() ? "" : ", ") + name;
    throw core::BadInput("topic " + options.topic + " is one for each camera; " +
                         (names.empty()
                              ? "none is written on " + where(options) + ", name one as " + options.topic + "/cam0"
                              : "there are: " + names));
  }
  if (messaging::find_topic(options.topic) != nullptr) return options.topic;
  for (const auto& topic : messaging::all_topics()) written.push_back(topic.name);
  std::ranges::sort(written);
  written.erase(std::ranges::unique(written).begin(), written.end());
  std::string names;
  for (const auto& name : similar_names(options.topic, written)) names += (names.empty() ? "" : ", ") + name;
  throw core::BadInput("there is no topic '" + options.topic + "'" +
                       (names.empty() ? "; see `railfix topics list`" : "; did you mean " + names + "?"));
}

int list(const Options& options) {
  Listener listener(options);
  std::map<std::string, TopicStatistics> all;
  const auto watch = [&](const std::string& name) {
    listener.listen(name, [&all](const std::string& topic, const auto&, const auto&,
                                 const messaging::SampleInfo& info) { all[topic].add(info); });
  };
  listener.run(options.for_s > 0 ? options.for_s : kListS, [&] {
    for (const auto& name : listener.participant().written_topics()) watch(name);
    return false;
  });
  const auto names = listener.participant().written_topics();
  ordered_json json = ordered_json::array();
  if (!options.json)
    std::printf("%-26s %7s %9s %8s %6s  %s\n", "topic", "writers", "rate Hz", "samples", "lost", "type");
  for (const auto& name : names) {
    const TopicStatistics& statistics = all[name];
    const auto* topic = messaging::find_topic(name);
    const std::string type = topic == nullptr ? "unknown" : topic->type->name();
    const int writers = listener.writers(name);
    if (options.json) {
      json.push_back({{"topic", name},
                      {"type", type},
                      {"writers", writers},
                      {"rate_hz", statistics.rate_hz()},
                      {"samples", statistics.samples()},
                      {"lost", statistics.lost()}});
    } else {
      std::printf("%-26s %7d %9.2f %8llu %6llu  %s\n", name.c_str(), writers, statistics.rate_hz(),
                  static_cast<unsigned long long>(statistics.samples()),
                  static_cast<unsigned long long>(statistics.lost()), type.c_str());
    }
  }
  if (options.json) std::cout << json.dump(2) << '\n';
  if (names.empty()) std::cerr << "nobody writes a topic on " << where(options) << "; is a train running there?\n";
  return names.empty() ? 1 : 0;
}

/// Says once that nothing has come yet, and why that may be.
class Hint {
 public:
  void update(const Listener& listener, const std::string& topic, uint64_t samples, const Options& options) {
    if (said_ || samples > 0 || core::monotonic_ns() - begun_ns_ < kHintNs) return;
    said_ = true;
    std::cerr << topic << ": "
              << (listener.writers(topic) > 0 ? "has a writer, but nothing was sent yet" : "has no writer") << " ("
              << where(options) << "); waiting, Ctrl-C ends\n";
  }

 private:
  int64_t begun_ns_ = core::monotonic_ns();
  bool said_ = false;
};

ordered_json to_json(const std::string& topic, const TopicStatistics& statistics) {
  return {{"topic", topic},
          {"samples", statistics.samples()},
          {"rate_hz", statistics.rate_hz()},
          {"shortest_gap_ms", statistics.shortest_gap_ms()},
          {"longest_gap_ms", statistics.longest_gap_ms()},
          {"lost", statistics.lost()},
          {"latency_ms", statistics.latency_ms()}};
}

void print_rate(const std::string& topic, const TopicStatistics& statistics) {
  std::printf("%s: %.2f Hz, gaps %.1f to %.1f ms, %llu samples, %llu lost, latency %.2f ms\n", topic.c_str(),
              statistics.rate_hz(), statistics.shortest_gap_ms(), statistics.longest_gap_ms(),
              static_cast<unsigned long long>(statistics.samples()), static_cast<unsigned long long>(statistics.lost()),
              statistics.latency_ms());
  std::fflush(stdout);
}

int hz(const Options& options) {
  Listener listener(options);
  const std::string topic = resolve(listener, options);
  TopicStatistics whole;
  TopicStatistics second;
  listener.listen(topic, [&](const auto&, const auto&, const auto&, const messaging::SampleInfo& info) {
    whole.add(info);
    second.add(info);
  });
  int64_t shown_ns = core::monotonic_ns();
  Hint hint;
  listener.run(options.for_s, [&] {
    hint.update(listener, topic, whole.samples(), options);
    if (!options.json && whole.samples() > 0 && core::monotonic_ns() - shown_ns >= core::kNsPerSecond) {
      print_rate(topic, second);
      second = {};
      shown_ns = core::monotonic_ns();
    }
    return options.count > 0 && whole.samples() >= options.count;
  });
  if (options.json) {
    std::cout << to_json(topic, whole).dump() << '\n';
  } else {
    std::printf("all: ");
    print_rate(topic, whole);
  }
  return whole.samples() > 0 ? 0 : 1;
}

void print_sample(const ordered_json& sample) {
  for (const auto& [key, value] : sample.items()) {
    std::cout << key << ": " << (value.is_string() ? value.get<std::string>() : value.dump()) << '\n';
  }
  std::cout << "---" << std::endl;
}

int echo(const Options& options) {
  Listener listener(options);
  const std::string topic = resolve(listener, options);
  uint64_t shown = 0;
  cdr::DecodeOptions decode_options;
  decode_options.name_constants = !options.json;
  listener.listen(topic, [&](const auto&, const messaging::TopicInfo& info, const std::shared_ptr<const void>& sample,
                             const auto&) {
    if (options.count > 0 && shown >= options.count) return;
    const auto decoded =
        cdr::decode(cdr::own_types(), info.type->name(), info.type->serialize(sample.get()), decode_options);
    if (!decoded.ok()) throw std::runtime_error(decoded.error().message);
    ++shown;
    if (options.json) {
      std::cout << decoded.value().dump() << std::endl;
    } else {
      print_sample(decoded.value());
    }
  });
  Hint hint;
  listener.run(options.for_s, [&] {
    hint.update(listener, topic, shown, options);
    return options.count > 0 && shown >= options.count;
  });
  return shown > 0 ? 0 : 1;
}

void add_common(CLI::App& command, Options& options) {
  command.add_option("--train", options.train, "Train whose topics to look at")->capture_default_str();
  command.add_option("--domain", options.domain, "DDS domain")->capture_default_str()->check(CLI::Range(0, 232));
  command.add_flag("--json", options.json, "JSON on standard output");
  command.add_option("--for", options.for_s, "End after this many seconds")->check(CLI::NonNegativeNumber);
}

}  // namespace

void add_topics(CLI::App& app, Action& chosen) {
  auto options = std::make_shared<Options>();
  auto* topics = app.add_subcommand("topics", "Live topics of a train: which there are, how fast, what they say");
  topics->require_subcommand(1);
  const auto add = [&](const char* name, const char* what, int (*run)(const Options&), bool one_topic) {
    auto* command = topics->add_subcommand(name, what);
    add_common(*command, *options);
    if (one_topic) {
      command
          ->add_option("TOPIC", options->topic,
                       "Name as in `railfix topics list`, such as track_view or camera_frame/cam0")
          ->required();
      command->add_option("--count", options->count, "End after this many samples");
    }
    command->callback([&chosen, options, run] { chosen = [options, run] { return run(*options); }; });
  };
  add("list", "Topics that have a writer, with rate and type (listens three seconds)", list, false);
  add("hz", "Rate, gaps and losses of one topic, every second.  Example: railfix topics hz odometry_step --for 10", hz,
      true);
  add("echo", "Samples of one topic as they come.  Example: railfix topics echo train_state --count 1 --json", echo,
      true);
  topics->add_subcommand("qos", "Quality of service of every topic as Fast DDS XML, to edit for common.qos_profiles")
      ->callback([&chosen] {
        chosen = [] {
          std::cout << messaging::qos_xml();
          return 0;
        };
      });
}

}  // namespace railfix::tool
