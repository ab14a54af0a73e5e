#include "topic_listener.hpp"

#include <algorithm>
#include <csignal>
#include <limits>

#include "core/time.hpp"
#include "train/plan.hpp"

namespace railfix::tool {

namespace {

constexpr int64_t kListenTurnNs = 50'000'000;
constexpr size_t kWaiting = 1000;

volatile std::sig_atomic_t interrupted = 0;

void take(const std::filesystem::path& config, TrainNetwork& network) {
  const auto common = service::read_config<service::CommonConfig>("common", config, {}, service::service_names());
  if (!common.ok()) throw CLI::ValidationError(common.error().message);
  network.host = common.value();
  network.train = network.host.train_id;
  network.domain = network.host.domain;
}

/// Of the train that is up on this computer; empty when there is none, or one of another name than that which is asked
/// for.
std::filesystem::path running_config(const std::filesystem::path& root, const std::optional<std::string>& train) {
  try {
    const HostFolder folder(root);
    const auto plan = folder.plan();
    if (!plan || plan->down || (train && *train != plan->train_id)) return {};
    const auto file = folder.generation(plan->generation) / "config.yaml";
    return std::filesystem::exists(file) ? file : std::filesystem::path();
  } catch (const core::BadInput& damaged) {
    throw CLI::ValidationError(damaged.what());
  }
}

}  // namespace

messaging::ParticipantOptions participant_options(const TrainNetwork& network, const std::string& command) {
  messaging::ParticipantOptions options;
  options.train_id = network.train;
  options.domain = network.domain;
  options.service = command;
  options.interfaces = network.host.interfaces;
  options.peers = network.host.peers;
  options.security_folder = network.host.security;
  return options;
}

void add_network(CLI::App& command, TrainNetwork& network) {
  command.add_option("--train", network.train, "Name of the train")->capture_default_str();
  add_domain(command, network);
}

void add_domain(CLI::App& command, TrainNetwork& network) {
  command.add_option("--domain", network.domain, "DDS domain")->capture_default_str()->check(CLI::Range(0, 232));
  command.add_option_function<std::string>(
      "--config", [&network](const std::string& file) { take(file, network); },
      "Configuration of the services on this computer: their train, domain, interfaces and keys");
}

void find_running_train(CLI::App& command, TrainNetwork& network) {
  command.add_option("--root", network.root, "Where var/lib/railfix-train of the train that runs here is")
      ->capture_default_str();
  command.parse_complete_callback([&command, &network] {
    const auto is_given = [&](const char* name) {
      const auto* option = command.get_option_no_throw(name);
      return option != nullptr && option->count() > 0;
    };
    if (is_given("--domain") || is_given("--config")) return;
    const auto train = is_given("--train") ? std::optional(network.train) : std::nullopt;
    if (const auto file = running_config(network.root, train); !file.empty()) take(file, network);
  });
}

std::string where(const TrainNetwork& network) {
  return "train " + network.train + ", domain " + std::to_string(network.domain);
}

std::string nobody_writes(const TrainNetwork& network) {
  return "nobody writes a topic on " + where(network) +
         (network.host.security.empty() ? ", without certificates" : ", with those in " + network.host.security) +
         "; is a train running there? Another domain: --domain; a train with certificates: --config";
}

TopicListener::TopicListener(const TrainNetwork& network, const std::string& command)
    : participant_(participant_options(network, command)) {
  for (const int signal : {SIGINT, SIGTERM}) std::signal(signal, [](int) { interrupted = 1; });
}

void TopicListener::stop() {
  interrupted = 1;
}

bool TopicListener::stopped() {
  return interrupted != 0;
}

void TopicListener::listen(const std::string& name, OnSample on_sample) {
  if (readers_.contains(name)) return;
  const auto* topic = messaging::find_topic(name);
  if (topic == nullptr) return;
  const size_t slash = name.find('/');
  messaging::TopicInfo info = *topic;
  info.reader_queue = std::max(info.reader_queue, topic->qos.data_sharing ? size_t{8} : kWaiting);
  readers_[name] = std::make_unique<messaging::AnyReader>(
      participant_, info, slash == std::string::npos ? "" : name.substr(slash + 1), queue_,
      [name, topic, on_sample = std::move(on_sample)](const auto& sample, const auto& sample_info) {
        on_sample(name, *topic, sample, sample_info);
      });
}

void TopicListener::run(double for_s, const std::function<bool()>& done) {
  const int64_t end_ns = for_s > 0 ? core::monotonic_ns() + core::to_ns(for_s) : std::numeric_limits<int64_t>::max();
  while (interrupted == 0 && core::monotonic_ns() < end_ns && !done()) {
    const int64_t turn_ns = std::min(core::monotonic_ns() + kListenTurnNs, end_ns);
    while (queue_.run_one(turn_ns) && core::monotonic_ns() < turn_ns) {
    }
  }
}

int TopicListener::writers(const std::string& name) const {
  const auto reader = readers_.find(name);
  return reader == readers_.end() ? 0 : reader->second->matched_writers();
}

}  // namespace railfix::tool
