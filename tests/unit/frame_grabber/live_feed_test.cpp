#include "frame_grabber/live_feed.hpp"

#include <gmock/gmock.h>

#include <deque>
#include <future>
#include <utility>

namespace railfix::frame_grabber {
namespace {

using ::testing::ElementsAre;

/// Does what its script says: '+' picture, 'x' one that is not whole, '!' gone, '-' cannot be connected (ends a
/// connection attempt); at its end the promise is kept and nothing more comes.
class Scripted : public LiveCamera {
 public:
  Scripted(std::string script, std::promise<void>& end) : script_(std::move(script)), end_(end) {}
  core::Result<std::string> connect() override {
    if (position_ < script_.size() && script_[position_] == '-') {
      ++position_;
      return core::Error{"not there"};
    }
    return std::string("there");
  }
  core::Result<std::optional<RawPicture>> next(std::chrono::milliseconds) override {
    if (position_ == script_.size()) {
      if (!ended_) end_.set_value();
      ended_ = true;
      return std::optional<RawPicture>();
    }
    const char now = script_[position_++];
    if (now == '!') return core::Error{"unplugged"};
    if (now == '+') return std::optional(RawPicture{});
    ++lost_;
    return std::optional<RawPicture>();
  }
  uint64_t take_lost() override { return std::exchange(lost_, 0); }
  void disconnect() override {}
  [[nodiscard]] std::string name() const override { return "camera scripted"; }

 private:
  std::string script_;
  std::promise<void>& end_;
  size_t position_ = 0;
  uint64_t lost_ = 0;
  bool ended_ = false;
};

std::vector<std::string> run(const std::string& script, bool finish_pictures) {
  LiveConfig config;
  config.reconnect_s = 0.001;
  config.silent_s = 3600;
  std::vector<std::string> told;
  std::promise<void> end;
  std::promise<LiveFeed*> made;
  auto feed_made = made.get_future().share();
  LiveEvents events;
  events.connected = [&told](const std::string& what) { told.push_back(what); };
  events.gone = [&told](const std::string& why) { told.push_back(why); };
  events.picture = [&, feed_made](const RawPicture& picture) {
    told.push_back("picture, lost " + std::to_string(picture.lost));
    if (finish_pictures) feed_made.get()->finished();
  };
  events.lost = [&told](uint64_t pictures) { told.push_back("lost " + std::to_string(pictures)); };
  LiveFeed feed(std::make_unique<Scripted>(script, end), config, events);
  made.set_value(&feed);
  end.get_future().wait();
  return told;
}

TEST(LiveFeed, ConnectsAgainAndTellsEachReasonOnce) {
  EXPECT_THAT(run("--+!-+", true), ElementsAre("not there", "there", "picture, lost 0", "unplugged", "not there",
                                               "there", "picture, lost 0"));
}

TEST(LiveFeed, TellsOfLostPicturesAlsoWhenNoneComes) {
  EXPECT_THAT(run("+xx!", true), ElementsAre("there", "picture, lost 0", "lost 1", "lost 1", "unplugged", "there"));
}

/// Waits for its device for ever, until it is cancelled.
class Blocked : public LiveCamera {
 public:
  explicit Blocked(bool connects) : connects_(connects) {}
  core::Result<std::string> connect() override {
    if (!connects_) wait();
    return std::string("there");
  }
  core::Result<std::optional<RawPicture>> next(std::chrono::milliseconds) override {
    wait();
    return std::optional<RawPicture>();
  }
  void disconnect() override {}
  void cancel() override { cancelled_.set_value(); }
  [[nodiscard]] std::string name() const override { return "camera blocked"; }

 private:
  void wait() { future_.wait(); }
  bool connects_;
  std::promise<void> cancelled_;
  std::shared_future<void> future_ = cancelled_.get_future().share();
};

TEST(LiveFeed, EndsWhileItsCameraBlocks) {
  for (const bool connects : {false, true}) {
    LiveEvents events;
    events.connected = [](const std::string&) {};
    events.gone = [](const std::string&) {};
    const LiveFeed feed(std::make_unique<Blocked>(connects), {}, events);
  }
}

TEST(LiveFeed, PicturesThatNobodyTakesAreLostAndNotKept) {
  EXPECT_THAT(run("++++++", false),
              ElementsAre("there", "picture, lost 0", "picture, lost 0", "picture, lost 0", "picture, lost 0"));
}

}  // namespace
}  // namespace railfix::frame_grabber
