#include <unistd.h>

#include <csignal>
#include <cstdio>
#include <iostream>
#include <memory>
#include <nlohmann/json.hpp>
#include <string>

#include "command_tpr.hpp"
#include "core/json_text.hpp"
#include "core/time.hpp"
#include "etcs/train_position_report.hpp"
#include "ground_link/ground_report.hpp"
#include "ground_link/mqtt_client.hpp"
#include "ground_link/sequence_watch.hpp"

namespace railfix::tool {

namespace {

using ground_link::Arrival;
using ground_link::GroundReport;

struct ListenOptions {
  std::string broker = "localhost:1883";
  ground_link::MqttOptions mqtt;
  std::string password_file;
  uint64_t count = 0;
  bool json = false;
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

int listen(const ListenOptions& options) {
  sigset_t ends;
  sigemptyset(&ends);
  for (const int signal : {SIGINT, SIGTERM, SIGUSR1}) sigaddset(&ends, signal);
  pthread_sigmask(SIG_BLOCK, &ends, nullptr);  // before there are threads; SIGUSR1: we have seen enough
  ground_link::SequenceWatch watch;
  uint64_t count = 0;
  ground_link::MqttEvents events;
  events.connected = [](auto) { std::cerr << "connected\n"; };
  events.disconnected = [&](const std::string& why) {
    std::cerr << "not connected to " << options.mqtt.host << ":" << options.mqtt.port << " (" << why << ")\n";
  };
  events.received = [&](std::span<const uint8_t> payload) {
    if (options.count != 0 && count >= options.count) return;
    const auto report = ground_link::ground_report_from(payload);
    if (!report.ok()) {
      std::cerr << report.error().message << '\n';
      return;
    }
    const auto& r = report.value();
    const auto arrival = watch.arrived(r.train, r.stream, r.sequence);
    if (arrival == Arrival::twice) return;
    print(r, arrival, options.json);
    if (++count == options.count) kill(getpid(), SIGUSR1);
  };
  {
    const ground_link::MqttClient client(options.mqtt, events);
    int signal = 0;
    sigwait(&ends, &signal);
  }
  if (watch.missing() > 0) std::cerr << watch.missing() << " reports are missing\n";
  return 0;
}

}  // namespace

void add_tpr_listen(CLI::App& tpr, Action& chosen) {
  auto options = std::make_shared<ListenOptions>();
  options->mqtt.subscribe_to = "railfix/+/position_report";
  auto* command = tpr.add_subcommand("listen", "The ground side: print the reports that come over MQTT, each once");
  command->footer("Example: railfix tpr listen --broker ground.example:8883 --ca ca.pem --client-id rbc1");
  command->add_option("--broker", options->broker, "MQTT broker, HOST or HOST:PORT")->capture_default_str();
  command->add_option("--topic", options->mqtt.subscribe_to, "MQTT topic filter")->capture_default_str();
  command->add_option("--client-id", options->mqtt.client_id,
                      "With a name of its own the broker keeps reports while nobody listens");
  command->add_option("--ca", options->mqtt.ca_file, "Certificate authority of the broker, PEM; without it no TLS");
  command->add_option("--certificate", options->mqtt.certificate_file, "Own certificate, PEM");
  command->add_option("--key", options->mqtt.key_file, "Key of it, PEM");
  command->add_option("--user", options->mqtt.user, "User name at the broker");
  command->add_option("--password-file", options->password_file, "File whose first line is the password");
  command->add_option("--count", options->count, "End after so many reports, 0 = run until interrupted");
  command->add_flag("--json", options->json, "One JSON object a line, as `railfix tpr compare` reads them (.jsonl)");
  command->callback([options, &chosen] {
    chosen = [options] {
      core::ok_or_throw(ground_link::parse_broker(options->broker, options->mqtt));
      if (!options->password_file.empty())
        options->mqtt.password = core::value_or_throw(ground_link::read_password(options->password_file));
      if (const auto plain = ground_link::plain_password(options->mqtt); !plain.empty()) std::cerr << plain << '\n';
      options->mqtt.keep_session = !options->mqtt.client_id.empty();
      return listen(*options);
    };
  });
}

}  // namespace railfix::tool
