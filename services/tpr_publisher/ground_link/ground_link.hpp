// Position reports to the ground: stored first, then sent over MQTT (QoS 1) in the order in which they were made,
// removed from the store when the broker has them; what it refuses stays there, and is offered again. What cannot be
// stored (a full disk, a store that cannot be opened) goes from memory. Two threads of its own: a slow disk or network
// never holds the service up.
#pragma once

#include <chrono>
#include <condition_variable>
#include <deque>
#include <functional>
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
  std::chrono::seconds read_patience{60};  // those behind stored reports that cannot be read wait so long
  std::function<void(const std::string& sentence)> warn;  // of reports that are lost by the end; in a thread of its own
};

class GroundLink {
 public:
  /// Throws BadInput when the certificates cannot be opened. A store that cannot be is tried again.
  explicit GroundLink(const GroundLinkSettings& settings);
  /// What cannot be stored goes to the broker, for 2 s at most.
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
  using Clock = std::chrono::steady_clock;
  using Connected = ground_link::MqttConnection;
  struct Disconnected {
    std::string why;
  };
  struct Delivered {
    int id;
  };
  struct Refused {
    int id;
    ground_link::MqttRefusal refusal;
  };
  struct Unheard {
    int id;
  };
  struct Lasts {};
  struct Unstored {
    ground_link::GroundReport report;
    bool given = false;            // to the client, some time: the broker may have it
    uint64_t behind = UINT64_MAX;  // the newest in the store when it was first
  };
  using Event = std::variant<ground_link::GroundReport, Connected, Disconnected, Delivered, Refused, Unheard, Lasts>;
  void push(Event event);
  [[nodiscard]] std::deque<Event> wait();
  void run();
  void work(bool store_all);
  void say_farewell();
  void take(Event& event);
  void take(ground_link::GroundReport& report);
  void take(const Connected& now);
  void take(const Disconnected& lost);
  void take(const Delivered& report);
  void take(const Refused& report);
  void take(const Unheard& report);
  void take(const Lasts& lasts);
  void not_taken(int id, std::string why);
  [[nodiscard]] std::string only_311() const;
  [[nodiscard]] std::string nobody_listens() const;
  [[nodiscard]] std::string refused_because(const ground_link::MqttRefusal& refusal) const;
  void notice_silence();
  void open_store();
  void wait_again(int id);
  void try_again();
  void remove_delivered();
  void store_under_way();
  void store_new(bool all);
  void publish();
  void publish_stored();
  [[nodiscard]] bool waits_to_read(const core::Error& error);
  void publish_unstored();
  /// The client's id of it; nothing when the client does not take it now.
  std::optional<int> give(const ground_link::GroundReport& report);
  void say();
  [[nodiscard]] std::string own_trouble() const;
  [[nodiscard]] std::string trouble_with_reports() const;
  [[nodiscard]] std::string storing_trouble() const;
  [[nodiscard]] std::string broker() const { return ground_link::broker_of(settings_.mqtt); }
  /// Before what was refused is tried again.
  [[nodiscard]] std::chrono::nanoseconds pause() const;

  GroundLinkSettings settings_;
  std::optional<ReportStore> store_;  // from here on the worker's own, until mutex_; nothing = cannot be opened
  Clock::time_point open_again_at_;
  Clock::time_point memory_goes_at_;  // what lies in the store that cannot be opened goes first, until then
  Outbox outbox_;
  std::deque<Unstored> unstored_;
  std::map<int, Unstored> unstored_under_way_;
  std::vector<uint64_t> delivered_;  // or beyond the limit: to be removed from the store
  uint64_t stream_;                  // of what is sent from now on, stored or not
  uint64_t sequence_ = 0;
  int connection_ = 0;                             // the client's number of it, as far as the outbox knows
  std::map<int, Clock::time_point> given_;         // when, of what is under way
  std::optional<Clock::time_point> silent_since_;  // the broker confirms and refuses nothing; nothing = it does
  std::string link_trouble_;                       // why there is no connection
  std::string doubt_;                              // why the one that there is may not last
  std::string publish_trouble_;  // why the client did not take a report over one that there is; tried again
  std::string refusal_;          // empty = the broker takes what it gets
  Clock::time_point try_again_at_;
  std::string store_trouble_;
  std::string read_trouble_;  // why the next stored report cannot be read now; tried again
  std::optional<Clock::time_point> unreadable_since_;
  size_t dropped_ = 0;
  std::string version_remark_;
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
