#include "service/log.hpp"

#include <spdlog/sinks/base_sink.h>
#include <spdlog/sinks/stdout_color_sinks.h>
#include <unistd.h>

#include "core/cut_text.hpp"
#include "core/time.hpp"

namespace railfix::service {
namespace {

constexpr size_t kTextBytes = 1023;

class TopicSink final : public spdlog::sinks::base_sink<std::mutex> {
 public:
  TopicSink(messaging::Participant& participant, const std::string& service, const std::string& host)
      : writer_(participant, messaging::topics::log_record) {
    record_.service(service);
    record_.host(host);
  }

 private:
  void sink_it_(const spdlog::details::log_msg& message) override {
    record_.stamp_ns(core::wall_ns());
    record_.level(static_cast<uint8_t>(message.level));
    record_.text(core::cut_text({message.payload.data(), message.payload.size()}, kTextBytes));
    writer_.write(record_);
  }
  void flush_() override {}

  messaging::Writer<msg::LogRecord> writer_;
  msg::LogRecord record_;
};

}  // namespace

std::shared_ptr<spdlog::logger> make_logger(messaging::Participant& participant, const std::string& service,
                                            const CommonConfig& common) {
  auto terminal = std::make_shared<spdlog::sinks::stderr_color_sink_mt>();
  // A file is read days later.
  terminal->set_pattern(isatty(STDERR_FILENO) == 1 ? "%H:%M:%S.%e %n %^%l%$ %v"
                                                   : "%Y-%m-%d %H:%M:%S.%e%z %n %^%l%$ %v");
  auto topic = std::make_shared<TopicSink>(participant, service, common.host);
  topic->set_level(spdlog::level::info);
  auto logger = std::make_shared<spdlog::logger>(service, spdlog::sinks_init_list{terminal, topic});
  logger->set_level(spdlog::level::from_str(common.log_level));
  return logger;
}

}  // namespace railfix::service
