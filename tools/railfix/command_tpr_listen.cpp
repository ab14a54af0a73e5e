#include <unistd.h>

#include <atomic>
#include <csignal>
#include <cstdio>
#include <iostream>
#include <memory>
#include <mutex>
#include <nlohmann/json.hpp>
#include <sstream>
#include <string>

#include "command_tpr.hpp"
#include "core/json_text.hpp"
#include "core/time.hpp"
#include "etcs/train_position_report.hpp"
#include "ground_link/ground_report.hpp"
#include "ground_link/mqtt_client.hpp"
#include "ground_link/sequence_watch.hpp"
#include "ground_link/silence_watch.hpp"
#include "number_between.hpp"

namespace railfix::tool {

namespace {

using ground_link::Arrival;
using ground_link::GroundReport;
using ground_link::MqttNext;

struct ListenOptions {
  std::string broker = "localhost:1883";
  ground_link::MqttOptions mqtt;
  std::string password_file;
  uint64_t count = 0;
  double silent_after_s = 60;
  bool json = false;
  bool forget = false;
};

const char* text_of(Arrival arrival) {
  switch (arrival) {
    case Arrival::fresh:
      return "new";
    case Arrival::gap:
      return "gap";
    case Arrival::filled:
      return "filled";
    default:
      return "twice";
  }
}

std::string metres(uint32_t raw, uint32_t q_scale) {
  const auto known = etcs::metres_if_known(raw, q_scale);
  if (!known) return "?";
  char text[32];
  std::snprintf(text, sizeof text, "%.1f", *known);
  return text;
}

std::string sentence(const GroundReport& report) {
  const auto decoded = etcs::decode(report.message, static_cast<etcs::Baseline>(report.baseline));
  if (!decoded.ok()) return decoded.error().message;
  const auto& f = decoded.value();
  if (!etcs::names_group(f.nid_lrbg)) return "LRBG unknown";
  const std::string speed = f.v_train == etcs::kStandstillSpeed ? "0" : std::to_string(f.v_train * etcs::kSpeedStepKmh);
  const char* side = f.q_dlrbg == etcs::kNominal   ? "the nominal"
                     : f.q_dlrbg == etcs::kReverse ? "the reverse"
                                                   : "an unknown";
  return metres(f.d_lrbg, f.q_scale) + " m on " + side + " side of LRBG " + std::to_string(etcs::nid_c_of(f.nid_lrbg)) +
         "/" + std::to_string(etcs::nid_bg_of(f.nid_lrbg)) + "  -" + metres(f.l_doubtover, f.q_scale) + "/+" +
         metres(f.l_doubtunder, f.q_scale) + " m  " + speed + " km/h";
}

void print(const GroundReport& report, Arrival arrival, bool as_json) {
  if (!as_json) {
    std::printf("%s  %llu  %.3f s  %s  %s\n", report.train.c_str(), static_cast<unsigned long long>(report.sequence),
                core::seconds(report.stamp_ns), text_of(arrival), sentence(report).c_str());
  } else {
    const nlohmann::ordered_json json{{"train", report.train},
                                      {"host", report.host},
                                      {"stream", report.stream},
                                      {"sequence", report.sequence},
                                      {"arrival", text_of(arrival)},
                                      {"stamp_ns", report.stamp_ns},
                                      {"sent_ns", report.sent_ns},
                                      {"received_ns", core::wall_ns()},
                                      {"baseline", report.baseline},
                                      {"reason", report.reason},
                                      {"hex", etcs::to_hex(report.message)}};
    std::printf("%s\n", core::json_text(json).c_str());
  }
  std::fflush(stdout);
}

/// Before there are threads. SIGUSR1: the client has ended by itself. Whose reader has gone is told by the write.
sigset_t hold_end_signals() {
  sigset_t ends;
  sigemptyset(&ends);
  for (const int signal : {SIGINT, SIGTERM, SIGUSR1}) sigaddset(&ends, signal);
  sigset_t held = ends;
  sigaddset(&held, SIGPIPE);
  pthread_sigmask(SIG_BLOCK, &held, nullptr);
  return ends;
}

/// Whole lines at once: two threads write, and whoever reads the other end reads no half of one.
void tell(const std::string& sentence) {
  std::cerr << sentence + "\n";
}

std::string not_connected(const ground_link::MqttOptions& mqtt, const std::string& why) {
  return "not connected to " + ground_link::broker_of(mqtt) + " (" + why + ")";
}

class Listener {
 public:
  explicit Listener(const ListenOptions& options)
      : options_(options), silence_(core::to_ns(options.silent_after_s)), ends_(hold_end_signals()) {}

  int run() {
    const ground_link::MqttClient client(options_.mqtt, events());
    const timespec turn{1, 0};
    while (sigtimedwait(&ends_, nullptr, &turn) < 0) tell_silent();
    return 0;
  }
  void tell_missing() const {
    if (watch_.missing() > 0) tell(std::to_string(watch_.missing()) + " reports are missing");
  }

 private:
  ground_link::MqttEvents events() {
    ground_link::MqttEvents events;
    events.connected = [this](auto) {
      tell("connected");
      const std::lock_guard lock(mutex_);
      connected_ = true;
      silence_.restart(core::monotonic_ns());
    };
    events.disconnected = [this](const std::string& why) { disconnected(why); };
    events.received = [this](std::span<const uint8_t> payload) { received(payload); };
    events.next = [this] { return next(); };
    return events;
  }
  void disconnected(const std::string& why) {
    if (next() != MqttNext::go_on) {
      kill(getpid(), SIGUSR1);
      return;
    }
    tell(not_connected(options_.mqtt, why));
    const std::lock_guard lock(mutex_);
    connected_ = false;
  }
  void received(std::span<const uint8_t> payload) {
    const auto report = ground_link::ground_report_from(payload);
    if (!report.ok()) {
      tell(report.error().message);
      return;
    }
    const auto& r = report.value();
    {
      const std::lock_guard lock(mutex_);
      silence_.heard(r.train, core::monotonic_ns());
    }
    const auto arrival = watch_.arrived(r.train, r.stream, r.sequence);
    if (arrival == Arrival::twice) return;
    print(r, arrival, options_.json);
    ++count_;
  }
  /// What was not written is not confirmed, and nothing behind the last one that is wanted: both stay at the broker.
  [[nodiscard]] MqttNext next() const {
    if (std::ferror(stdout) != 0) return MqttNext::not_taken;
    return options_.count != 0 && count_ >= options_.count ? MqttNext::enough : MqttNext::go_on;
  }
  void tell_silent() {
    const std::lock_guard lock(mutex_);
    if (!connected_ || !(options_.silent_after_s > 0)) return;
    for (const auto& train : silence_.fell_silent(core::monotonic_ns())) {
      std::ostringstream text;
      text << train << " has been silent for " << options_.silent_after_s << " s";
      tell(text.str());
    }
  }

  const ListenOptions& options_;
  // The client's thread alone, while it runs.
  ground_link::SequenceWatch watch_;
  uint64_t count_ = 0;
  std::mutex mutex_;
  ground_link::SilenceWatch silence_;
  bool connected_ = false;
  sigset_t ends_;
};

int listen(const ListenOptions& options) {
  Listener listener(options);
  const int code = listener.run();
  listener.tell_missing();
  return code;
}

/// Whoever comes with a clean session ends the one that the broker has kept under this name.
int forget(const ListenOptions& options) {
  const sigset_t ends = hold_end_signals();
  std::atomic<bool> forgotten = false;
  ground_link::MqttEvents events;
  events.connected = [&](auto) {
    forgotten = true;
    kill(getpid(), SIGUSR1);
  };
  events.disconnected = [&](const std::string& why) { tell(not_connected(options.mqtt, why)); };
  const ground_link::MqttClient client(options.mqtt, events);
  int signal = 0;
  sigwait(&ends, &signal);
  if (forgotten) {
    std::cout << "the broker keeps nothing for " << options.mqtt.client_id
              << " any more; a listener that runs under this name begins it anew\n";
  }
  return forgotten ? 0 : 1;
}

}  // namespace

void add_tpr_listen(CLI::App& tpr, Action& chosen) {
  auto options = std::make_shared<ListenOptions>();
  options->mqtt.subscribe_to = "railfix/+/position_report";
  auto* command = tpr.add_subcommand("listen", "The ground side: print the reports that come over MQTT, each once");
  command->footer("Example: railfix tpr listen --broker ground.example:8883 --ca ca.pem --client-id rbc1");
  command
      ->add_option("--broker", options->broker,
                   "MQTT broker, HOST or HOST:PORT, or [ADDRESS]:PORT with an IPv6 address")
      ->capture_default_str();
  command->add_option("--topic", options->mqtt.subscribe_to, "MQTT topic filter")->capture_default_str();
  auto* named = command->add_option(
      "--client-id", options->mqtt.client_id,
      "With a name of its own the broker keeps reports while nobody listens, for ever: it takes them "
      "from the trains, and drops those that it has no room for (Mosquitto: max_queued_messages); end "
      "it with --forget");
  command
      ->add_flag("--forget", options->forget,
                 "Listen to nothing: let the broker forget --client-id and what it keeps for it; end the listener of "
                 "that name first, it would begin it anew")
      ->needs(named);
  command->add_option("--ca", options->mqtt.ca_file, "Certificate authority of the broker, PEM; without it no TLS");
  command->add_option("--certificate", options->mqtt.certificate_file, "Own certificate, PEM");
  command->add_option("--key", options->mqtt.key_file, "Key of it, PEM");
  command->add_option("--user", options->mqtt.user, "User name at the broker");
  command->add_option("--password-file", options->password_file, "File whose first line is the password");
  command->add_option("--count", options->count, "End after so many reports, 0 = run until interrupted");
  command
      ->add_option("--silent-after-s", options->silent_after_s,
                   "Name a train on standard error that has sent nothing for so long, 0 = never; longer than T_CYCLOC")
      ->check(number_between(0, 1e9))
      ->capture_default_str();
  command->add_flag("--json", options->json, "One JSON object a line, as `railfix tpr compare` reads them (.jsonl)");
  command->callback([options, &chosen] {
    chosen = [options] {
      core::ok_or_throw(ground_link::parse_broker(options->broker, options->mqtt));
      if (!options->password_file.empty())
        options->mqtt.password = core::value_or_throw(ground_link::read_password(options->password_file));
      if (const auto plain = ground_link::plain_password(options->mqtt); !plain.empty()) tell(plain);
      if (options->forget) {
        options->mqtt.subscribe_to.clear();
        return forget(*options);
      }
      options->mqtt.keep_session = !options->mqtt.client_id.empty();
      return listen(*options);
    };
  });
}

}  // namespace railfix::tool
