// The shape of every service: one configuration, one run loop, one thread that runs all handlers, status and log over
// DDS.
//
//   int main(int argc, char** argv) { return railfix::service::run<railfix::odometry::OdometryService>("odometry",
//   argc, argv); }
//
//   class OdometryService {
//    public:
//     using Config = OdometryConfig;   // has describe(service::Fields&), and check() where keys must fit together: a
//                                      // core::Status, which --check and so `railfix train check` tell, too
//     OdometryService(const Config& config, service::Context& context);   // creates writers, registers handlers; may
//     throw BadInput
//   };
//
// Command line of every service: --config FILE, --set section.key=value, --check, --document, --version (see
// docs/configuration).
#pragma once

#include <spdlog/logger.h>

#include <chrono>
#include <filesystem>
#include <functional>
#include <memory>
#include <string>

#include "messaging/topics.hpp"
#include "service/config.hpp"

namespace railfix::service {

/// So long a program that has come to its end waits for its last samples to arrive.
inline constexpr int64_t kLastWordsNs = 300'000'000;

/// What all services of a train share: section `common` of the configuration file.
struct CommonConfig {
  std::string train_id = "demo";
  std::string host = "local";
  int64_t domain = 0;
  std::string log_level = "info";
  std::string qos_profiles;
  int64_t ownership_strength = 0;
  double take_over_s = 0.25;
  std::vector<std::string> interfaces;
  std::vector<std::string> peers;
  std::string security;
  bool lock_step = false;
  void describe(Fields& fields);
  [[nodiscard]] core::Status check() const;
};

/// A name that can stand in a DDS partition, a file name and a systemd unit.
bool is_name(const std::string& text);

/// What a service that works sends, so that who asks how it is can tell whether data flows through it.
enum class Flow {
  sporadic,  // now and then
  steady,    // all the time, while data comes
  answers,   // something for every input
};

/// State, counters and latency of this service; published as service_status four times a second and at every change of
/// state. Call from handlers only. Of one that is not in charge, active and degraded are told as "stands by".
class Health {
 public:
  virtual ~Health() = default;
  virtual void ready() = 0;  // set up, waits for input
  virtual void active() = 0;
  virtual void degraded(const std::string& reason) = 0;  // goes on with less
  virtual void failed(const std::string& reason) = 0;
  virtual void input() = 0;                     // one input sample used
  virtual void output(int64_t grabbed_ns) = 0;  // one output sent; grabbed_ns of the input behind it, 0 = none
  virtual void dropped(uint64_t count) = 0;
  virtual void flows(Flow flow) = 0;                    // sporadic until said
  virtual void serves(const std::string& address) = 0;  // a page, for who asks on this host
};

/// What a service that may have a standby says and hears of it.
struct ChargeHandlers {
  // How good its output is: more is better, 0 to 255; 0 = anybody else's is better.
  std::function<int()> fitness = [] { return 1; };
  std::function<void(bool taken)> changed = {};  // it has taken charge, or has given it away
};

/// What a service gets from the run loop. All handlers run one after the other in the service's own thread, samples in
/// the order of their arrival.
class Context {
 public:
  virtual ~Context() = default;

  /// A writer of this topic; `instance` is the part behind the slash ("cam0" in camera_frame/cam0).
  template <class T>
  messaging::Writer<T> writer(const messaging::Topic<T>& topic, const std::string& instance = "") {
    return messaging::Writer<T>(participant(), topic, instance);
  }
  /// Calls the handler for every sample. When handlers are slower than the data the oldest waiting samples are dropped
  /// and counted (queue length: topic.reader_queue). In lock step the samples of a step are handled when this service's
  /// turn has come, by stamp, equal stamps in the order of these calls.
  template <class T>
  void on(const messaging::Topic<T>& topic, std::function<void(const T&)> handler, const std::string& instance = "") {
    listen(
        messaging::info_of(topic), instance,
        [handler = std::move(handler)](const void* sample) { handler(*static_cast<const T*>(sample)); },
        [](const void* sample) -> int64_t {
          if constexpr (requires(const T& t) { t.stamp_ns(); }) return static_cast<const T*>(sample)->stamp_ns();
          return 0;
        });
  }
  /// Calls the handler in this period (host's monotonic clock).
  virtual void every(std::chrono::nanoseconds period, std::function<void()> handler) = 0;
  /// The same, only while `wanted` says so: otherwise the processor is not woken for it.
  virtual void every_while(std::function<bool()> wanted, std::chrono::nanoseconds period,
                           std::function<void()> handler) = 0;
  /// Calls the handler once, soon, in the service thread. May be called from any thread.
  virtual void post(std::function<void()> handler) = 0;
  /// Calls the handler when the service is told to stop, before writers go away.
  virtual void at_stop(std::function<void()> handler) = 0;
  /// Answers a request on service_control that is addressed to this service: gives the reply's text or an error.
  virtual void on_command(const std::string& command,
                          std::function<core::Result<std::string>(const std::string& argument)> handler) = 0;

  virtual Health& health() = 0;
  virtual spdlog::logger& log() = 0;
  [[nodiscard]] virtual const CommonConfig& common() const = 0;
  [[nodiscard]] virtual const std::string& service_name() const = 0;
  virtual messaging::Participant& participant() = 0;
  /// For a service of which there may be several (common.ownership_strength): one is in charge, the others work along
  /// and send nothing. See charge.hpp for the rule.
  virtual void share_charge(ChargeHandlers handlers = {}) = 0;  // NOLINT(google-default-arguments)
  /// To be asked right before sending. The only one of its kind is always in charge, and so is everybody in lock step.
  [[nodiscard]] virtual bool in_charge() const = 0;
  /// This host's clock was set while this service ran, and does not agree with the other hosts' since. Always false on
  /// a train with one host.
  [[nodiscard]] virtual bool clock_is_doubted() const = 0;
  /// One that is not of DDS (of a broker, of a page). Degraded from messaging::kCertificateWarningDays before it runs
  /// out; one that cannot be read is for whoever uses it to tell. `what` begins a sentence.
  virtual void watch_certificate(const std::string& what, const std::filesystem::path& file) = 0;
  /// What this service wants to know when it is started anew on this host: in memory, gone when the computer restarts.
  /// kept() gives the notes of the process before, empty = none.
  virtual void keep(const std::string& notes) = 0;
  [[nodiscard]] virtual const std::string& kept() const = 0;
  /// Ends the run loop; the program exits with 0.
  virtual void finish(const std::string& why) = 0;

  /// Played data begins anew: a replay was moved, looped or begun again, or another one is played. What the service has
  /// learnt from the data before is not true any more, what it was configured with is. `data_ns`: where it goes on.
  /// Samples from before that were under way are not handled any more. Never called on a live train, whose clock may be
  /// set: only played data has a data_clock.
  virtual void at_restart(std::function<void(int64_t data_ns)> handler) = 0;
  /// Lock step: a turn that this service finishes in a thread of its own ends when `done` says so, which is asked after
  /// every handler.
  virtual void turn_ends_when(std::function<bool(int64_t data_ns)> done) = 0;

 protected:
  using Handler = std::function<void(const void* sample)>;
  using StampOf = int64_t (*)(const void* sample);
  virtual void listen(const messaging::TopicInfo& topic, const std::string& instance, Handler handler,
                      StampOf stamp_of) = 0;
};

/// Everything around a service. `make` is called once the participant is up.
struct Program {
  std::string name;
  std::function<core::Status(const std::filesystem::path& file, const std::vector<Override>& overrides)> read;
  std::function<std::string()> document;
  std::function<std::shared_ptr<void>(Context&)> make;
};
int run_program(const Program& program, int argc, char** argv);

/// Environment variable that a supervisor sets for the process that follows one that has ended by itself: how that one
/// ended. The new one says it to the train, in log_record.
inline constexpr const char* kEndedBefore = "RAILFIX_ENDED_BEFORE";

/// All services of a train, in the order of the data's way; each has a configuration section of its name.
const std::vector<std::string>& service_names();

template <class Service>
int run(const std::string& name, int argc, char** argv) {
  auto config = std::make_shared<typename Service::Config>();
  Program program;
  program.name = name;
  program.read = [config, name](const std::filesystem::path& file,
                                const std::vector<Override>& overrides) -> core::Status {
    auto read = read_config<typename Service::Config>(name, file, overrides, service_names());
    if (!read.ok()) return read.error();
    *config = read.value();
    if constexpr (requires { config->check(); }) return config->check();
    return {};
  };
  program.document = [name] { return document_config<typename Service::Config>(name); };
  program.make = [config](Context& context) -> std::shared_ptr<void> {
    return std::make_shared<Service>(*config, context);
  };
  return run_program(program, argc, argv);
}

}  // namespace railfix::service
