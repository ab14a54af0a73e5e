// Listens to topics of one train for a command on the terminal.
#pragma once

#include <CLI/CLI.hpp>
#include <filesystem>
#include <functional>
#include <map>
#include <memory>
#include <string>

#include "messaging/topics.hpp"
#include "service/service.hpp"

namespace railfix::tool {

/// Which train, on which network.
struct TrainNetwork {
  std::string train = "demo";
  int64_t domain = 0;
  service::CommonConfig host;  // interfaces, peers and keys
  std::filesystem::path root = "/";
};
/// --train and --domain, or --config for everything at once.
void add_network(CLI::App& command, TrainNetwork& network);
/// The same without --train.
void add_domain(CLI::App& command, TrainNetwork& network);
/// When none of these is given, or its name alone: the train that runs on this computer (railfix train up), if there is
/// one. Not for who plays data.
void find_running_train(CLI::App& command, TrainNetwork& network);
/// As a tool of this name (it begins with "railfix-").
messaging::ParticipantOptions participant_options(const TrainNetwork& network, const std::string& command);
/// "train demo, domain 0"
std::string where(const TrainNetwork& network);
/// A sentence for who has heard of nobody there.
std::string nobody_writes(const TrainNetwork& network);

class TopicListener {
 public:
  using OnSample =
      std::function<void(const std::string& topic, const messaging::TopicInfo& info,
                         const std::shared_ptr<const void>& sample, const messaging::SampleInfo& sample_info)>;
  /// Ctrl-C and SIGTERM end run() from now on.
  TopicListener(const TrainNetwork& network, const std::string& command);

  /// A topic that is listened to already, or that is none of ours, is left alone.
  void listen(const std::string& name, OnSample on_sample);
  /// Until time is up, `done` says so (asked about twenty times a second), or Ctrl-C. for_s 0 = no limit.
  void run(double for_s, const std::function<bool()>& done);
  /// Ends run(). Any thread.
  static void stop();
  /// Ctrl-C, SIGTERM or stop().
  [[nodiscard]] static bool stopped();
  messaging::Participant& participant() { return participant_; }
  [[nodiscard]] int writers(const std::string& name) const;

 private:
  messaging::Participant participant_;
  messaging::Queue queue_;
  std::map<std::string, std::unique_ptr<messaging::AnyReader>> readers_;
};

}  // namespace railfix::tool
