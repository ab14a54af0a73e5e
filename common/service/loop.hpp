// Private to this folder: the one run loop.
#pragma once

#include <map>

#include "service/clock_watch.hpp"
#include "service/health.hpp"
#include "service/notes.hpp"
#include "service/restarts.hpp"
#include "service/service.hpp"
#include "service/standby.hpp"
#include "service/turns.hpp"

namespace railfix::service {

class Loop final : public Context {
 public:
  /// `beside`: another one of this service runs on this host, which this one is to replace.
  Loop(std::string service, const CommonConfig& common, bool beside);
  ~Loop() override;

  void every(std::chrono::nanoseconds period, std::function<void()> handler) override;
  void every_while(std::function<bool()> wanted, std::chrono::nanoseconds period,
                   std::function<void()> handler) override;
  void post(std::function<void()> handler) override { queue_.push(nullptr, std::move(handler)); }
  void at_stop(std::function<void()> handler) override { at_stop_.push_back(std::move(handler)); }
  void on_command(const std::string& command,
                  std::function<core::Result<std::string>(const std::string&)> handler) override;
  Health& health() override { return *health_; }
  spdlog::logger& log() override { return *log_; }
  [[nodiscard]] const CommonConfig& common() const override { return common_; }
  [[nodiscard]] const std::string& service_name() const override { return service_; }
  messaging::Participant& participant() override { return participant_; }
  void share_charge(ChargeHandlers handlers) override;
  [[nodiscard]] bool in_charge() const override { return !standby_ || standby_->in_charge(); }
  [[nodiscard]] bool clock_is_doubted() const override { return clocks_.own_is_doubted(); }
  void watch_certificate(const std::string& what, const std::filesystem::path& file) override;
  void keep(const std::string& notes) override { notes_.keep(notes); }
  [[nodiscard]] const std::string& kept() const override { return notes_.kept(); }
  void finish(const std::string& why) override;
  void at_restart(std::function<void(int64_t)> handler) override;
  void turn_ends_when(std::function<bool(int64_t)> done) override { turn_ended_ = std::move(done); }

  /// Until finish().
  void turn();

 protected:
  void listen(const messaging::TopicInfo& topic, const std::string& instance, Handler handler,
              StampOf stamp_of) override;

 private:
  struct Timer {
    int64_t period_ns;
    int64_t due_ns;
    std::function<void()> handler;
    std::function<bool()> wanted;  // empty = always
    [[nodiscard]] bool is_wanted() const { return !wanted || wanted(); }
  };
  [[nodiscard]] int64_t next_due_ns(int64_t period_ns) const;
  void run_due_timers();
  void watch_cable();
  void watch_own_certificate();
  void watch_clocks();
  void look_at_clock();
  void watch_writers();
  void answer(const msg::ControlRequest& request);
  void keep_in_turn(const messaging::TopicInfo& topic, const std::string& instance, Handler handler, StampOf stamp_of);
  void read_clock();
  void clock(const msg::DataClock& clock, uint64_t writer);
  void take_turn();
  void end_turn();

  std::string service_;
  CommonConfig common_;
  bool beside_;
  messaging::Participant participant_;
  messaging::Queue queue_;
  std::shared_ptr<spdlog::logger> log_;
  std::unique_ptr<PublishedHealth> health_;
  std::unique_ptr<messaging::Writer<msg::DataProgress>> progress_;
  std::unique_ptr<messaging::Writer<msg::ControlReply>> reply_;
  Notes notes_;
  ClockWatch clocks_;
  std::vector<std::string> unheard_;                           // writers that do not fit, as told last
  std::map<std::string, std::filesystem::path> certificates_;  // not of DDS, by what they are
  std::unique_ptr<Standby> standby_;                           // nullptr = the only one of its kind
  std::map<std::string, std::function<core::Result<std::string>(const std::string&)>> commands_;
  int64_t born_ns_;
  std::vector<Timer> timers_;
  std::vector<std::function<void()>> at_stop_;
  Turns turns_;
  std::optional<msg::DataClock> turn_;  // given to us, until we have answered
  bool turn_taken_ = false;             // all its samples are used
  std::function<bool(int64_t)> turn_ended_;
  Restarts restarts_;
  std::vector<std::function<void(int64_t)>> at_restart_;
  std::vector<Handler> on_clock_;
  bool clock_is_read_ = false;
  std::vector<std::unique_ptr<messaging::AnyReader>> readers_;
  bool finished_ = false;
};

}  // namespace railfix::service
