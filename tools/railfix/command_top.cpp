// `railfix top`: services and topics of a train, live.
#include <spdlog/fmt/fmt.h>
#include <sys/ioctl.h>
#include <unistd.h>

#include <cstdlib>
#include <iostream>
#include <memory>
#include <nlohmann/json.hpp>

#include "commands.hpp"
#include "core/json_text.hpp"
#include "core/time.hpp"
#include "key_reader.hpp"
#include "messaging/message_words.hpp"
#include "not_negative.hpp"
#include "recording/utc_text.hpp"
#include "service_table.hpp"
#include "topic_listener.hpp"
#include "topic_watch.hpp"

namespace railfix::tool {
namespace {

using nlohmann::ordered_json;

constexpr double kOnceS = 3;
constexpr int64_t kDrawNs = core::kNsPerSecond;
constexpr double kOldS = 3600;

struct TopOptions {
  TrainNetwork network;
  bool once = false;
  bool json = false;
  bool plain = false;
  bool pictures = false;
  double for_s = 0;
};

/// One topic, over the last second and since the beginning.
struct WatchedTopic {
  explicit WatchedTopic(int64_t since_ns) : whole(since_ns) {}
  BandwidthStatistics second;
  TopicStatistics whole;
  double rate_hz = 0;
  double bytes_per_s = 0;
  int64_t last_ns = 0;
};

class Watch {
 public:
  explicit Watch(const TopOptions& options) : options_(options), listener_(options.network, "railfix-top") {
    listener_.listen(messaging::topics::service_status.name, [this](const auto& name, const auto& topic,
                                                                    const auto& sample, const auto& info) {
      services_.note(*static_cast<const msg::ServiceStatus*>(sample.get()), core::wall_ns(), info.writer);
      count(name, topic, sample.get(), info);
    });
    listener_.listen(messaging::topics::player_status.name,
                     [this](const auto& name, const auto& topic, const auto& sample, const auto& info) {
                       services_.note_player(core::wall_ns());
                       count(name, topic, sample.get(), info);
                     });
  }

  /// `draw` is called once a second.
  void run(double for_s, const std::function<void()>& draw) {
    int64_t due_ns = core::monotonic_ns() + kDrawNs;
    listener_.run(for_s, [&] {
      find_topics();
      services_.note_silence_now_and_then(core::wall_ns());
      if (core::monotonic_ns() < due_ns) return false;
      due_ns += kDrawNs;
      end_second();
      draw();
      return false;
    });
  }
  [[nodiscard]] std::string table(bool colours) {
    std::string text = fmt::format("{}  {}  {} services, {} topics\n\n", where(options_.network),
                                   utc_text(core::wall_ns()), services_.services().size(), written_.size());
    text += service_table(services_, colours);
    text += fmt::format("\n{:<26} {:>7} {:>9} {:>10} {:>8} {:>8} {:>7}\n", "topic", "writers", "Hz", "kB/s", "age s",
                        "ms", "lost");
    for (const auto& name : written_) text += line(name);
    return text;
  }
  [[nodiscard]] ordered_json json() {
    ordered_json json{
        {"train", options_.network.train}, {"services", ordered_json::array()}, {"topics", ordered_json::array()}};
    for (const auto& [key, seen] : services_.services()) {
      const auto& s = seen.status;
      json["services"].push_back(
          {{"service", seen.name()},
           {"host", key.first},
           {"state", seen.alive || seen.stopped() ? messaging::name_of_state(s.state()) : "silent"},
           {"dropped", s.dropped()},
           {"cpu_percent", s.cpu_percent()},
           {"rss_mb", s.rss_mb()},
           {"reason", s.reason().c_str()}});
    }
    for (const auto& name : written_) {
      ordered_json topic{{"topic", name}, {"writers", listener_.writers(name)}};
      if (listened_to(name)) {
        const auto& watched = topics_.try_emplace(name, begun_ns_).first->second;
        topic["rate_hz"] = watched.rate_hz;
        topic["bytes_per_s"] = watched.bytes_per_s;
        topic["lost"] = watched.whole.lost();
      }
      json["topics"].push_back(topic);
    }
    return json;
  }
  [[nodiscard]] bool nobody() const { return written_.empty() && services_.services().empty(); }

 private:
  // Whole pictures are copied for every listener: only when asked for.
  [[nodiscard]] bool listened_to(const std::string& name) const {
    const auto* topic = messaging::find_topic(name);
    return topic != nullptr && (options_.pictures || !topic->qos.data_sharing);
  }
  void find_topics() {
    written_ = listener_.participant().written_topics();
    for (const auto& name : written_) {
      if (!listened_to(name)) continue;
      listener_.listen(name, [this](const auto& topic, const auto& type, const auto& sample, const auto& info) {
        count(topic, type, sample.get(), info);
      });
    }
  }
  void count(const std::string& name, const messaging::TopicInfo& type, const void* sample,
             const messaging::SampleInfo& info) {
    auto& topic = topics_.try_emplace(name, begun_ns_).first->second;
    topic.second.add(type, sample, info);
    topic.whole.add(type, info);
    topic.last_ns = core::monotonic_ns();
  }
  // By the clock, not by the gaps: one sample in ten seconds is no rate.
  void end_second() {
    const int64_t now_ns = core::monotonic_ns();
    const double length_s = core::seconds(now_ns - second_begun_ns_);
    second_begun_ns_ = now_ns;
    for (auto& [name, topic] : topics_) {
      topic.rate_hz = static_cast<double>(topic.second.samples()) / length_s;
      topic.bytes_per_s = static_cast<double>(topic.second.bytes()) / length_s;
      topic.second = BandwidthStatistics();
    }
  }
  std::string line(const std::string& name) {
    const std::string begin = fmt::format("{:<26} ", name);
    if (messaging::find_topic(name) == nullptr) return begin + "      - between services only\n";
    if (!listened_to(name)) return begin + "      - not listened to (--pictures)\n";
    const auto& topic = topics_.try_emplace(name, begun_ns_).first->second;
    const double age_s = core::seconds(core::monotonic_ns() - topic.last_ns);
    const std::string age = topic.last_ns == 0 ? "never" : age_s > kOldS ? "> 1 h" : fmt::format("{:.1f}", age_s);
    return begin + fmt::format("{:>7} {:>9.1f} {:>10.1f} {:>8} {:>8.2f} {:>7}\n", listener_.writers(name),
                               topic.rate_hz, topic.bytes_per_s / 1e3, age, topic.whole.latency_ms(),
                               topic.whole.lost());
  }

  TopOptions options_;
  int64_t begun_ns_ = core::wall_ns();
  TopicListener listener_;
  messaging::ServiceBoard services_;
  std::map<std::string, WatchedTopic> topics_;
  std::vector<std::string> written_;
  int64_t second_begun_ns_ = core::monotonic_ns();
};

/// The whole terminal while it lives, and then as it was.
class Screen {
 public:
  Screen() { std::cout << "\x1b[?1049h\x1b[?25l" << std::flush; }
  ~Screen() { std::cout << "\x1b[?25h\x1b[?1049l" << std::flush; }
  Screen(const Screen&) = delete;
  Screen& operator=(const Screen&) = delete;
  static void draw(const std::string& text) {
    winsize size{};
    size_t rows = ioctl(STDOUT_FILENO, TIOCGWINSZ, &size) == 0 && size.ws_row > 0 ? size.ws_row : 50;
    std::string out = "\x1b[H";
    size_t begin = 0;
    for (; rows > 1 && begin < text.size(); --rows) {
      const size_t end = text.find('\n', begin);
      out += text.substr(begin, end - begin) + "\x1b[K\n";
      begin = end + 1;
    }
    std::cout << out << "\x1b[J" << std::flush;
  }
};

int top(const TopOptions& options) {
  const bool terminal = isatty(STDOUT_FILENO) == 1;
  const bool colours = terminal && !options.plain && std::getenv("NO_COLOR") == nullptr;
  Watch watch(options);
  if (options.once || options.json || !terminal) {
    watch.run(options.for_s > 0 ? options.for_s : kOnceS, [] {});
    if (options.json) {
      std::cout << core::json_text(watch.json(), 2) << '\n';
    } else {
      std::cout << watch.table(colours);
    }
    if (watch.nobody()) std::cerr << nobody_writes(options.network) << '\n';
    return watch.nobody() ? 1 : 0;
  }
  const Screen screen;
  const KeyReader keys([](const std::string& key) {
    if (key == "q") TopicListener::stop();
  });
  Screen::draw("listens to " + where(options.network) + "\n");
  watch.run(options.for_s, [&] { Screen::draw(watch.table(colours) + "\nq quits\n"); });
  return 0;
}

}  // namespace

void add_top(CLI::App& app, Action& chosen) {
  auto options = std::make_shared<TopOptions>();
  auto* command = app.add_subcommand(
      "top",
      "Services and topics of a train, live; q quits.  Example: railfix top --train demo; railfix top --once --json");
  add_network(*command, options->network);
  find_running_train(*command, options->network);
  command->add_flag("--once", options->once, "Listen for three seconds (or --for), print one table, and end");
  command->add_flag("--json", options->json, "One table as JSON, and end");
  command->add_flag("--no-colour", options->plain, "Without colours; as with NO_COLOR set");
  command->add_flag("--pictures", options->pictures, "Listen to whole pictures too, which costs processor time");
  command->add_option("--for", options->for_s, "End after this many seconds")->check(not_negative());
  command->callback([options, &chosen] { chosen = [options] { return top(*options); }; });
}

}  // namespace railfix::tool
