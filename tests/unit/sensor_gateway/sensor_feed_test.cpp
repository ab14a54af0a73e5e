#include "sensor_gateway/sensor_feed.hpp"

#include <gmock/gmock.h>

#include <future>

namespace railfix::sensor_gateway {
namespace {

using ::testing::ElementsAre;

/// Does what its script says: '+' sample, 'x' a broken message, '!' gone, '-' cannot be connected; at its end the
/// promise is kept and nothing more comes until it is cancelled.
class Scripted : public LiveSensor {
 public:
  Scripted(std::string script, std::promise<void>& end) : script_(std::move(script)), end_(end) {}
  core::Result<std::string> connect() override {
    if (position_ < script_.size() && script_[position_] == '-') {
      ++position_;
      return core::Error{"not there"};
    }
    return std::string("there");
  }
  core::Result<Delivery> next(std::chrono::milliseconds) override {
    if (position_ == script_.size()) {
      if (!ended_) end_.set_value();
      ended_ = true;
      cancelled_.get_future().wait();
      return Delivery();
    }
    if (script_[position_++] == '!') return core::Error{"unplugged"};
    return script_[position_ - 1] == 'x' ? Delivery{{}, {0, 1}, ""} : Delivery{{dataset::WheelRow()}, {1, 0}, ""};
  }
  void disconnect() override {}
  void cancel() override { cancelled_.set_value(); }
  [[nodiscard]] const std::string& source() const override { return script_; }
  [[nodiscard]] std::string name() const override { return "sensor scripted"; }
  [[nodiscard]] std::string why_silent() const override { return "is silent"; }

 private:
  std::string script_;
  std::promise<void>& end_;
  std::promise<void> cancelled_;
  size_t position_ = 0;
  bool ended_ = false;
};

std::vector<std::string> run(const std::string& script) {
  LiveConfig config;
  config.reconnect_s = 0.001;
  std::vector<std::string> told;
  std::promise<void> end;
  FeedEvents events;
  events.connected = [&told](const std::string& what) { told.push_back(what); };
  events.gone = [&told](const std::string& why) { told.push_back(why); };
  events.delivered = [&told](const Delivery& delivery) {
    told.emplace_back(delivery.frames.broken > 0 ? "broken" : "sample");
  };
  {
    const SensorFeed feed(std::make_unique<Scripted>(script, end), config, events);
    end.get_future().wait();
  }
  return told;
}

TEST(SensorFeed, ConnectsAgainAndTellsEachReasonOnce) {
  EXPECT_THAT(run("--+!-+"), ElementsAre("not there", "there", "sample", "unplugged", "not there", "there", "sample"));
  EXPECT_THAT(run("+!!!+"), ElementsAre("there", "sample", "unplugged", "there", "sample"));
}

TEST(SensorFeed, TellsOfWhatCameBroken) {
  EXPECT_THAT(run("+xx!+"), ElementsAre("there", "sample", "broken", "broken", "unplugged", "there", "sample"));
}

/// Connected, and nothing ever comes.
class Silent : public LiveSensor {
 public:
  explicit Silent(std::promise<void>& anew) : anew_(anew) {}
  core::Result<std::string> connect() override {
    if (++connections_ == 3) anew_.set_value();
    return std::string("there");
  }
  core::Result<Delivery> next(std::chrono::milliseconds) override { return Delivery(); }
  void disconnect() override {}
  void cancel() override {}
  [[nodiscard]] const std::string& source() const override { return source_; }
  [[nodiscard]] std::string name() const override { return "sensor"; }
  [[nodiscard]] std::string why_silent() const override { return "is silent"; }

 private:
  std::promise<void>& anew_;
  const std::string source_ = "silent";
  int connections_ = 0;
};

TEST(SensorFeed, OneThatIsSilentIsConnectedAnewAndToldOnce) {
  LiveConfig config;
  config.reconnect_s = 0.001;
  config.silent_s = 0.2;
  std::vector<std::string> told;
  std::promise<void> anew;
  FeedEvents events;
  events.connected = [](const std::string&) {};
  events.gone = [&told](const std::string& why) { told.push_back(why); };
  {
    const SensorFeed feed(std::make_unique<Silent>(anew), config, events);
    anew.get_future().wait();
  }
  EXPECT_THAT(told, ElementsAre("sensor is silent (nothing for 0.2 s); it is tried again"));
}

}  // namespace
}  // namespace railfix::sensor_gateway
