// The service, or its ground link alone, with a real Mosquitto and somebody who listens on the ground.
#pragma once

#include <atomic>
#include <mutex>

#include "ground_link/ground_report.hpp"
#include "ground_link/mqtt_client.hpp"
#include "ground_link/sequence_watch.hpp"
#include "integration/tpr/broker.hpp"
#include "integration/tpr/tpr_service.hpp"
#include "tpr_publisher/ground_link/ground_link.hpp"

namespace railfix {

/// The ground's end: a session at the broker that outlives connections, and what came over it.
class Ground {
 public:
  /// options: how it shows the broker who it is.
  Ground(const std::string& broker, const std::string& name, ground_link::MqttOptions options = {})
      : probe_topic_("railfix/" + name + "/position_report") {
    core::ok_or_throw(ground_link::parse_broker(broker, options));
    options.client_id = "ground-" + name;
    options.keep_session = true;
    options.subscribe_to = probe_topic_;
    options.longest_retry_s = 0.2;
    client_ = std::make_unique<ground_link::MqttClient>(
        options,
        ground_link::MqttEvents{{}, {}, {}, {}, [this](std::span<const uint8_t> payload) { receive(payload); }});
  }
  /// Waits until the broker has the subscription: a message to ourselves comes back.
  bool subscribed() {
    const std::vector<uint8_t> probe{0};
    for (int i = 0; i < 600; ++i) {
      if (i % 20 == 0) (void)client_->publish(probe_topic_, probe);
      if (probed_) return true;
      poll(nullptr, 0, 50);
    }
    return false;
  }
  /// Without those that came twice.
  [[nodiscard]] std::vector<ground_link::GroundReport> reports() const {
    const std::lock_guard lock(mutex_);
    return reports_;
  }
  [[nodiscard]] size_t count() const {
    const std::lock_guard lock(mutex_);
    return reports_.size();
  }
  [[nodiscard]] size_t twice() const {
    const std::lock_guard lock(mutex_);
    return twice_;
  }
  [[nodiscard]] size_t missing() const {
    const std::lock_guard lock(mutex_);
    return watch_.missing();
  }

 private:
  void receive(std::span<const uint8_t> payload) {
    if (payload.size() == 1) {
      probed_ = true;
      return;
    }
    auto report = ground_link::ground_report_from(payload).value();
    const std::lock_guard lock(mutex_);
    if (watch_.arrived(report.train, report.stream, report.sequence) == ground_link::Arrival::twice) {
      ++twice_;
    } else {
      reports_.push_back(std::move(report));
    }
  }
  std::string probe_topic_;
  std::atomic<bool> probed_ = false;
  mutable std::mutex mutex_;
  ground_link::SequenceWatch watch_;
  std::vector<ground_link::GroundReport> reports_;
  size_t twice_ = 0;
  std::unique_ptr<ground_link::MqttClient> client_;
};

class GroundLinkTest : public TprService {
 protected:
  GroundLinkTest() { std::filesystem::create_directories(folder_); }
  ~GroundLinkTest() override { std::filesystem::remove_all(folder_); }
  void SetUp() override {
    if (!std::filesystem::exists(test::kMosquitto)) GTEST_SKIP() << "mosquitto is not installed (./dev setup)";
  }

  [[nodiscard]] std::vector<std::string> linked_service(const std::string& broker,
                                                        std::vector<std::string> more = {}) const {
    const std::string link = "tpr_publisher.ground_link.";
    more.insert(more.end(), {"tpr_publisher.d_cycloc_m=1", link + "broker=" + broker, link + "longest_retry_s=0.2",
                             link + "store=" + (folder_ / "reports.db").string()});
    return service(more);
  }
  /// Runs on, a report a metre, until so many have come over DDS.
  bool run_for(size_t reports) {
    return run_until([&] { return reports_.size() >= reports; },
                     [&] {
                       if (reports_.size() >= last_.reports) {
                         last_.offset_m += 1.5;
                         last_.reports = reports_.size() + 1;
                       }
                       write_state(last_.offset_m);
                     });
  }
  bool status_says(const std::string& text) {
    return run_until([&] { return reason().find(text) != std::string::npos; }, [&] { write_state(last_.offset_m); });
  }
  [[nodiscard]] std::filesystem::path file(const std::string& name) const { return folder_ / name; }

  /// Of a link alone, without the service.
  [[nodiscard]] tpr_publisher::GroundLinkSettings link_settings(const std::string& broker) const {
    tpr_publisher::GroundLinkSettings settings;
    core::ok_or_throw(ground_link::parse_broker(broker, settings.mqtt));
    settings.mqtt.client_id = "railfix-" + train_;
    settings.mqtt.longest_retry_s = 0.2;
    settings.topic = "railfix/" + train_ + "/position_report";
    settings.store = file("link.db");
    return settings;
  }
  [[nodiscard]] ground_link::GroundReport report(uint64_t number) const {
    return {train_, 0, 0, static_cast<int64_t>(number), 0, 3, 1, {0x88}, ""};
  }
  static bool says(const tpr_publisher::GroundLink& link, const std::string& text) {
    return link.trouble().find(text) != std::string::npos;
  }
  template <class Condition>
  static bool wait_for(Condition condition) {
    for (int i = 0; i < 6000 && !condition(); ++i) poll(nullptr, 0, 10);
    return condition();
  }

  struct {
    double offset_m = 110;
    size_t reports = 0;
  } last_;
  std::filesystem::path folder_ = std::filesystem::temp_directory_path() / ("ground-" + std::to_string(getpid()));
};

}  // namespace railfix
