// The monitor as a service: samples from DDS, pages and frames to whoever looks.
#pragma once

#include <deque>

#include "monitor/http_server.hpp"
#include "monitor/live_api.hpp"
#include "monitor/live_messages.hpp"
#include "monitor/monitor_config.hpp"
#include "monitor/problems.hpp"
#include "monitor/static_files.hpp"
#include "monitor/train_watch.hpp"
#include "service/service.hpp"

namespace railfix::monitor {

class MonitorService {
 public:
  using Config = MonitorConfig;
  MonitorService(const Config& config, service::Context& context);
  ~MonitorService();

 private:
  struct ControlWaiting {
    uint64_t client = 0;
    nlohmann::json id;
    std::string service;
    int64_t asked_ns = 0;
  };
  /// A sample's place in the page: the newest one of its topic, and when it came.
  template <class T>
  struct Newest {
    std::optional<T> sample;
    int64_t received_ns = 0;
    void take(const Arrived& arrived) {
      sample = arrived.as<T>();
      received_ns = arrived.info.received_ns;
    }
  };

  [[nodiscard]] Handlers handlers();
  [[nodiscard]] LiveApi::Actions live_actions();
  [[nodiscard]] Handlers::Upgrade upgrade(const Request& request) const;
  void start_timers();
  void set_up_topics();

  void arrived(const Arrived& arrived);
  void on_log(const Arrived& arrived);
  void on_report(const Arrived& arrived);
  void choose_topics();
  void publish_state();
  void publish_topics();
  void publish_log();
  void look_for_problems();
  [[nodiscard]] TrainSeen train_seen();

  [[nodiscard]] Response answer(const Request& request);
  [[nodiscard]] nlohmann::json about(const Request& request) const;
  [[nodiscard]] std::string control_of(const Request& request) const;
  [[nodiscard]] std::vector<nlohmann::json> first(const std::string& kind);
  [[nodiscard]] nlohmann::json status_message(const std::string& kind, const std::string& topic,
                                              const messaging::TopicInfo& info, const void* sample) const;
  void control(const ClientPtr& client, const ControlAsk& ask);
  void reply(const msg::ControlReply& reply);
  void give_up_waiting();

  Config config_;
  service::Context& context_;
  std::optional<track::Map> map_;
  StaticFiles files_;
  messaging::Writer<msg::ControlRequest> control_;
  std::map<std::string, std::function<void(const Arrived&)>> on_topic_;

  ServiceBoard services_;
  Newest<msg::TrainState> state_;
  int64_t state_sent_ns_ = 0;  // receipt of the one last published
  Newest<msg::TrainPose> pose_;
  Newest<msg::PositionFix> choice_;
  Newest<msg::GnssFix> gnss_;
  Newest<msg::RecorderStatus> recorder_;
  Newest<msg::PlayerStatus> player_;
  Newest<msg::DataClock> clock_;
  std::deque<nlohmann::json> log_;
  nlohmann::json log_fresh_ = nlohmann::json::array();
  std::deque<nlohmann::json> reports_;
  std::vector<std::string> written_;
  ProblemList problems_;
  int64_t begun_ns_ = 0;
  int64_t scraped_ns_ = 0;

  uint64_t next_request_ = 0;
  std::map<uint64_t, ControlWaiting> waiting_;
  TrainWatch watch_;
  std::string address_;
  uint16_t port_ = 0;
  HttpServer server_;
  LiveApi live_;  // before the server: it holds clients
};

}  // namespace railfix::monitor
