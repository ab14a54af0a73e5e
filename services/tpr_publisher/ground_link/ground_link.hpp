// Position reports to the ground: stored first, then sent over MQTT (QoS 1) in the order in which they were made,
// removed from the store when the broker has them; what it refuses stays there, and is offered again. What cannot be
// stored (a full disk) goes from memory, in a stream of its own. Two threads of its own: a slow disk or network never
// holds the service up.
#pragma once

#include <chrono>
#include <condition_variable>
#include <deque>
#include <mutex>
#include <optional>
#include <string>
#include <thread>
#include <variant>

#include "ground_link/ground_report.hpp"
#include "ground_link/mqtt_client.hpp"
#include "tpr_publisher/ground_link/outbox.hpp"
#include "tpr_publisher/ground_link/report_store.hpp"

namespace railfix::tpr_publisher {

struct GroundLinkSettings {
  ground_link::MqttOptions mqtt;
  std::string topic;
  std::filesystem::path store;
  size_t store_limit = 100'000;
  std::chrono::seconds read_patience{60};  // those behind a stored report that cannot be read wait so long
};

class GroundLink {
 public:
  /// Throws BadInput when the store or the certificates cannot be opened.
  explicit GroundLink(const GroundLinkSettings& settings);
  ~GroundLink();
  GroundLink(const GroundLink&) = delete;
  GroundLink& operator=(const GroundLink&) = delete;

  /// Any thread; returns at once. Stream and sequence are filled in here.
  void send(ground_link::GroundReport report);
  /// Empty when all is well, otherwise one sentence for service_status.
  [[nodiscard]] std::string trouble() const;
  /// What is to be known of a link that works; usually empty.
  [[nodiscard]] std::string remark() const;
  /// Reports go to the broker.
  [[nodiscard]] bool connected() const;
  /// What is sent survives a power cut.
  [[nodiscard]] bool stores() const;

 private:
  struct Connected {
    ground_link::MqttVersion version;
  };
  struct Disconnected {
    std::string why;
  };
  struct Delivered {
    int id;
  };
  struct Refused {
    int id;
    std::string why;  // empty: nobody there waits for it
  };
  struct Unstored {
    ground_link::GroundReport report;  // has its number from when it was first under way
    uint64_t behind = UINT64_MAX;      // the newest in the store at that time
    [[nodiscard]] bool has_number() const { return report.sequence != 0; }
  };
  using Event = std::variant<ground_link::GroundReport, Connected, Disconnected, Delivered, Refused>;
  void push(Event event);
  [[nodiscard]] std::deque<Event> wait();
  void run();
  void take(Event& event);
  void take(ground_link::GroundReport& report) { unstored_.push_back({std::move(report)}); }
  void take(const Connected& now);
  void take(const Disconnected& lost);
  void take(const Delivered& report);
  void take(const Refused& report);
  [[nodiscard]] std::string nobody_listens() const;
  [[nodiscard]] std::string refused_because(const std::string& why) const;
  void wait_again(int id);
  void try_again();
  void remove_delivered();
  void store_new(bool all);
  void publish();
  void publish_stored();
  [[nodiscard]] bool waits_to_read(const core::Error& error);
  void publish_unstored();
  /// The client's id of it; nothing when the client does not take it now.
  std::optional<int> give(ground_link::GroundReport report, uint64_t stream, uint64_t sequence);
  void say();
  [[nodiscard]] std::string broker() const;
  /// Before what was refused is tried again.
  [[nodiscard]] std::chrono::nanoseconds pause() const;

  GroundLinkSettings settings_;
  ReportStore store_;  // from here on the worker's own, until mutex_
  Outbox outbox_;
  std::deque<Unstored> unstored_;
  std::map<int, Unstored> unstored_under_way_;
  std::vector<uint64_t> delivered_;  // or beyond the limit: to be removed from the store
  uint64_t memory_stream_;           // of what was never stored
  uint64_t memory_sequence_ = 0;
  std::string link_trouble_;     // why there is no connection
  std::string publish_trouble_;  // why the client did not take a report over one that there is; tried again
  std::string refusal_;          // empty = the broker takes what it gets
  std::chrono::steady_clock::time_point try_again_at_;
  std::string store_trouble_;
  std::string read_trouble_;  // why the next stored report cannot be read now; tried again
  std::optional<std::chrono::steady_clock::time_point> unreadable_since_;
  size_t dropped_ = 0;
  mutable std::mutex mutex_;
  std::condition_variable wake_;
  std::deque<Event> events_;
  std::string trouble_;
  std::string remark_;
  bool connected_ = false;
  bool stores_ = true;
  bool stop_ = false;
  std::unique_ptr<ground_link::MqttClient> client_;
  std::thread thread_;
};

}  // namespace railfix::tpr_publisher
