// The monitor as a service: samples from DDS, pages and frames to whoever looks.
#pragma once

#include <deque>

#include "core/time.hpp"
#include "monitor/cab_watch.hpp"
#include "monitor/foxglove_api.hpp"
#include "monitor/http_server.hpp"
#include "monitor/live_api.hpp"
#include "monitor/live_messages.hpp"
#include "monitor/map_api.hpp"
#include "monitor/map_view.hpp"
#include "monitor/monitor_config.hpp"
#include "monitor/newest.hpp"
#include "monitor/problems.hpp"
#include "monitor/report_list.hpp"
#include "monitor/static_files.hpp"
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
  /// Whose samples come at least once a second is gone when none came for this long.
  static constexpr double kAbsentS = 5;
  template <class T>
  static bool recent(const Newest<T>& newest) {
    return newest.sample && newest.age_s(core::monotonic_ns()) < kAbsentS;
  }

  // monitor_service.cpp: samples, and what is wrong
  [[nodiscard]] bool played_data_has_ended() const;
  [[nodiscard]] bool is_live() const;
  void start_timers();
  void beat();
  void restart();
  void set_up_topics();
  void arrived(const Arrived& arrived);
  void hand_to_foxglove(const Arrived& arrived);
  void on_track(const msg::TrackView& view);
  void on_log(const Arrived& arrived);
  void on_report(const Arrived& arrived);
  [[nodiscard]] std::set<std::string> cameras() const;
  [[nodiscard]] std::set<std::string> wanted_topics() const;
  [[nodiscard]] bool scraped() const;
  [[nodiscard]] bool nobody_looks() const;
  void choose_topics();
  void show_channels();
  [[nodiscard]] TrainSeen train_seen();
  void look_for_silence();
  void publish_services();
  void await_data();
  void look_for_problems(const TrainSeen& train);
  void forget_stopped(const TrainSeen& train);

  // monitor_shows.cpp: what is said to those who look
  [[nodiscard]] std::optional<track::EdgePosition> place() const;
  void publish_log();
  void publish_curvature();
  void publish_pictures();
  void publish_state();
  void publish_topics();
  void publish_beat();
  [[nodiscard]] nlohmann::json curvature_message() const;
  [[nodiscard]] nlohmann::json status_message(const std::string& kind, const messaging::TopicInfo& info,
                                              const void* sample) const;
  [[nodiscard]] std::vector<TopicShown> topics_shown() const;
  [[nodiscard]] std::vector<nlohmann::json> first(const std::string& kind);

  // monitor_clients.cpp: HTTP, WebSockets, control
  [[nodiscard]] Handlers handlers();
  [[nodiscard]] LiveApi::Actions live_actions();
  [[nodiscard]] FoxgloveApi::Actions foxglove_actions();
  [[nodiscard]] Handlers::Upgrade upgrade(const Request& request) const;
  [[nodiscard]] Response answer(const Request& request);
  [[nodiscard]] Response map_answer(const Request& request);
  [[nodiscard]] Response metrics_answer();
  [[nodiscard]] Response health_answer();
  [[nodiscard]] nlohmann::json about(const Request& request) const;
  [[nodiscard]] std::string exposure() const;
  [[nodiscard]] std::string control_of(const Request& request) const;
  void control(const ClientPtr& client, const ControlAsk& ask);
  void reply(const msg::ControlReply& reply);
  void give_up_waiting();

  Config config_;
  service::Context& context_;
  std::optional<track::Map> map_;
  std::unique_ptr<MapView> map_view_;  // null without a map, as the next
  std::unique_ptr<MapApi> map_api_;
  StaticFiles files_;
  messaging::Writer<msg::ControlRequest> control_;
  std::map<std::string, std::function<void(const Arrived&)>> on_topic_;

  messaging::ServiceBoard services_;  // by the monotonic clock, as all times here
  Newest<msg::TrainState> state_;
  int64_t state_sent_ns_ = 0;               // arrival of the one last published
  std::optional<int64_t> awaits_since_ns_;  // the first state: since fusion was heard, or the data began
  Newest<msg::TrainPose> pose_;
  Newest<msg::PositionFix> choice_;
  Newest<msg::GnssFix> gnss_;
  Newest<msg::RecorderStatus> recorder_;
  Newest<msg::PlayerStatus> player_;
  Newest<msg::DataClock> clock_;
  std::deque<nlohmann::json> log_;
  nlohmann::json log_fresh_ = nlohmann::json::array();
  ReportList reports_;
  bool report_is_newest_ = true;  // the last one that came
  uint64_t reports_sent_ = 0;
  CurvatureTrail trail_;
  std::map<std::string, FoxgloveMessage> standing_;  // by topic
  std::vector<std::string> written_;
  std::map<std::string, int64_t> wanted_ns_;  // topics, and when they were last wanted
  std::optional<std::set<std::string>> shown_cameras_;
  ProblemList problems_;
  bool looked_ = false;
  int64_t begun_ns_ = 0;
  int64_t scraped_ns_ = 0;
  uint64_t slow_viewers_ = 0;
  uint64_t beats_ = 0;

  uint64_t next_request_ = 0;
  std::map<uint64_t, ControlWaiting> waiting_;
  TrainWatch watch_;
  std::string address_;
  uint16_t port_ = 0;
  uint16_t foxglove_port_ = 0;
  HttpServer server_;
  CabWatch cab_;
  LiveApi live_;  // these two hold clients, and go before the server
  FoxgloveApi foxglove_;
};

}  // namespace railfix::monitor
