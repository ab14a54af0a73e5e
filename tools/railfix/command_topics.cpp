#include <spdlog/fmt/fmt.h>

#include <algorithm>
#include <cstdio>
#include <iostream>
#include <map>
#include <memory>
#include <nlohmann/json.hpp>
#include <optional>

#include "cdr/decode.hpp"
#include "commands.hpp"
#include "core/joined.hpp"
#include "core/json_text.hpp"
#include "core/similar_names.hpp"
#include "core/time.hpp"
#include "messaging/topics.hpp"
#include "not_negative.hpp"
#include "topic_listener.hpp"
#include "topic_watch.hpp"

namespace railfix::tool {
namespace {

using nlohmann::ordered_json;

constexpr double kListS = 3;
constexpr int64_t kHintNs = 2 * core::kNsPerSecond;

struct TopicsOptions {
  std::string topic;
  TrainNetwork network;
  bool json = false;
  uint64_t count = 0;
  double for_s = 0;
};

/// The topic, with its camera when there is only one; BadInput with the names that may have been meant.
std::string resolve(TopicListener& listener, const TopicsOptions& options) {
  std::vector<std::string> written;
  listener.run(kListS, [&] {
    written = listener.participant().written_topics();
    return messaging::find_topic(options.topic) != nullptr && options.topic.find("camera_") != 0;
  });
  const bool needs_camera = options.topic == "camera_frame" || options.topic == "camera_preview";
  if (needs_camera) {
    std::erase_if(written, [&](const std::string& name) { return !name.starts_with(options.topic + "/"); });
    if (written.size() == 1) return written.front();
    const auto names = core::joined(written);
    throw core::BadInput(
        "topic " + options.topic + " is one for each camera; " +
        (names.empty() ? "none is written on " + where(options.network) + ", name one as " + options.topic + "/cam0"
                       : "there are: " + names));
  }
  if (messaging::find_topic(options.topic) != nullptr) return options.topic;
  for (const auto& topic : messaging::all_topics()) written.push_back(topic.name);
  std::ranges::sort(written);
  written.erase(std::ranges::unique(written).begin(), written.end());
  throw core::BadInput("there is no topic '" + options.topic + "'; " + core::did_you_mean(options.topic, written));
}

int list(const TopicsOptions& options) {
  TopicListener listener(options.network, "railfix-topics");
  std::map<std::string, TopicStatistics> all;
  const int64_t since_ns = core::wall_ns();
  const int64_t begun_ns = core::monotonic_ns();
  const auto watch = [&](const std::string& name) {
    listener.listen(name, [&all, since_ns](const std::string& topic, const messaging::TopicInfo& type, const auto&,
                                           const messaging::SampleInfo& info) {
      all.try_emplace(topic, since_ns).first->second.add(type, info);
    });
  };
  listener.run(options.for_s > 0 ? options.for_s : kListS, [&] {
    for (const auto& name : listener.participant().written_topics()) watch(name);
    return false;
  });
  const double listened_s = core::seconds(core::monotonic_ns() - begun_ns);
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
                      {"rate_hz", statistics.rate_hz(listened_s)},
                      {"samples", statistics.samples()},
                      {"lost", statistics.lost()}});
    } else {
      std::printf("%-26s %7d %9.2f %8llu %6llu  %s\n", name.c_str(), writers, statistics.rate_hz(listened_s),
                  static_cast<unsigned long long>(statistics.samples()),
                  static_cast<unsigned long long>(statistics.lost()), type.c_str());
    }
  }
  if (options.json) std::cout << core::json_text(json, 2) << '\n';
  if (names.empty()) std::cerr << nobody_writes(options.network) << '\n';
  return names.empty() ? 1 : 0;
}

/// Says once that nothing has come yet, and why that may be.
class Hint {
 public:
  void update(const TopicListener& listener, const std::string& topic, uint64_t samples, const TopicsOptions& options) {
    if (said_ || samples > 0 || core::monotonic_ns() - begun_ns_ < kHintNs) return;
    said_ = true;
    std::cerr << topic << ": "
              << (listener.writers(topic) > 0 ? "has a writer, but nothing was sent yet" : "has no writer") << " ("
              << where(options.network) << "); waiting, Ctrl-C ends\n";
  }

 private:
  int64_t begun_ns_ = core::monotonic_ns();
  bool said_ = false;
};

/// Watches one topic: `report` is asked for a line every second about that second, and at the end about all of it.
template <class Statistics>
int watch(const TopicsOptions& options) {
  TopicListener listener(options.network, "railfix-topics");
  const std::string topic = resolve(listener, options);
  const int64_t since_ns = core::wall_ns();
  Statistics whole(since_ns);
  Statistics second(since_ns);
  listener.listen(topic, [&](const auto&, const messaging::TopicInfo& info, const std::shared_ptr<const void>& sample,
                             const messaging::SampleInfo& sample_info) {
    whole.add(info, sample.get(), sample_info);
    second.add(info, sample.get(), sample_info);
  });
  int64_t shown_ns = core::monotonic_ns();
  Hint hint;
  listener.run(options.for_s, [&] {
    hint.update(listener, topic, whole.samples(), options);
    if (!options.json && whole.samples() > 0 && core::monotonic_ns() - shown_ns >= core::kNsPerSecond) {
      std::cout << topic << ": " << second.line() << std::endl;
      second = Statistics(since_ns);
      shown_ns = core::monotonic_ns();
    }
    return options.count > 0 && whole.samples() >= options.count;
  });
  if (options.json) {
    auto json = whole.json();
    json["topic"] = topic;
    std::cout << core::json_text(json) << '\n';
  } else if (whole.samples() > 0) {
    std::cout << "all: " << topic << ": " << whole.line() << '\n';
  } else {
    std::cerr << topic << ": nothing came, it " << (listener.writers(topic) > 0 ? "has a writer" : "has no writer")
              << " (" << where(options.network) << ")\n";
  }
  return whole.samples() > 0 ? 0 : 1;
}

/// Of a latched topic the first ones may be hours old: the text says so, and so does JSON with a member of its own.
void print_sample(ordered_json sample, double before_s, bool as_json) {
  if (as_json) {
    if (before_s > 0) sample["sent_before_listening_s"] = before_s;
    std::cout << core::json_text(sample) << std::endl;
    return;
  }
  if (before_s > 0) std::cout << fmt::format("sent {:.1f} s before listening:\n", before_s);
  for (const auto& [key, value] : sample.items()) {
    std::cout << key << ": " << (value.is_string() ? value.get<std::string>() : value.dump()) << '\n';
  }
  std::cout << "---" << std::endl;
}

int echo(const TopicsOptions& options) {
  TopicListener listener(options.network, "railfix-topics");
  const std::string topic = resolve(listener, options);
  uint64_t shown = 0;
  cdr::DecodeOptions decode_options;
  decode_options.name_constants = !options.json;
  const int64_t since_ns = core::wall_ns();
  listener.listen(topic, [&](const auto&, const messaging::TopicInfo& info, const std::shared_ptr<const void>& sample,
                             const messaging::SampleInfo& sample_info) {
    if (options.count > 0 && shown >= options.count) return;
    const auto decoded =
        cdr::decode(cdr::own_types(), info.type->name(), info.type->serialize(sample.get()), decode_options);
    if (!decoded.ok()) throw std::runtime_error(decoded.error().message);
    ++shown;
    const int64_t before_ns = info.qos.transient_local ? since_ns - sample_info.source_ns : 0;
    print_sample(decoded.value(), core::seconds(before_ns), options.json);
  });
  Hint hint;
  listener.run(options.for_s, [&] {
    hint.update(listener, topic, shown, options);
    return options.count > 0 && shown >= options.count;
  });
  return shown > 0 ? 0 : 1;
}

void add_common(CLI::App& command, TopicsOptions& options) {
  add_network(command, options.network);
  find_running_train(command, options.network);
  command.add_flag("--json", options.json, "JSON on standard output");
  command.add_option("--for", options.for_s, "End after this many seconds")->check(not_negative());
}

}  // namespace

void add_topics(CLI::App& app, Action& chosen) {
  auto options = std::make_shared<TopicsOptions>();
  auto* topics = app.add_subcommand("topics", "Live topics of a train: which there are, how fast, what they say");
  topics->footer("Example: railfix topics hz train_state --train demo");
  topics->require_subcommand(1);
  const auto add = [&](const char* name, const char* what, int (*run)(const TopicsOptions&), bool one_topic) {
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
  add("hz", "Rate, gaps and losses of one topic, every second.  Example: railfix topics hz odometry_step --for 10",
      watch<RateStatistics>, true);
  add("bw", "How many bytes of one topic come, every second.  Example: railfix topics bw camera_preview/cam0 --for 10",
      watch<BandwidthStatistics>, true);
  add("delay",
      "How long samples of one topic are on their way, and how old the data in them is, every second.  Example: "
      "railfix "
      "topics delay train_state --for 10",
      watch<DelayStatistics>, true);
  add("echo",
      "Samples of one topic as they come; what a latched topic said before comes first, marked so.  Example: railfix "
      "topics echo train_state --count 1 --json",
      echo, true);
  topics->add_subcommand("qos", "Quality of service of every topic as Fast DDS XML, to edit for common.qos_profiles")
      ->callback([&chosen] {
        chosen = [] {
          std::cout << messaging::qos_xml();
          return 0;
        };
      });
}

}  // namespace railfix::tool
