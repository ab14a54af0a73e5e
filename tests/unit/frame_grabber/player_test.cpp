#include "frame_grabber/player.hpp"

#include <gmock/gmock.h>

#include <future>

#include "core/time.hpp"

namespace railfix::frame_grabber {
namespace {

using ::testing::ElementsAre;

/// Stamps as given; a negative one is a broken picture.
class Numbers : public dataset::PictureSource {
 public:
  explicit Numbers(std::vector<int64_t> stamps) : stamps_(std::move(stamps)) {}
  core::Result<std::optional<dataset::Picture>> next() override {
    if (position_ == stamps_.size()) return std::optional<dataset::Picture>();
    const int64_t stamp = stamps_[position_++];
    if (stamp < 0) return core::Error{"broken " + std::to_string(stamp)};
    return std::optional(dataset::Picture{stamp, std::to_string(stamp), cv::Mat(2, 2, CV_8UC1, cv::Scalar(0))});
  }
  [[nodiscard]] std::optional<int64_t> next_stamp_ns() const override {
    if (position_ == stamps_.size()) return std::nullopt;
    return std::abs(stamps_[position_]);
  }
  bool skip() override { return position_++ < stamps_.size(); }
  [[nodiscard]] std::optional<size_t> count() const override { return stamps_.size(); }

 private:
  std::vector<int64_t> stamps_;
  size_t position_ = 0;
};

const ReadAhead::TooLate kNeverLate = [](int64_t, int64_t) { return false; };

TEST(ReadAhead, LeavesOutWhatWouldBeLateWithoutDecodingIt) {
  const auto late = [](int64_t stamp_ns, int64_t) { return stamp_ns == 2 || stamp_ns == 3 || stamp_ns > 5; };
  ReadAhead ahead(std::make_unique<Numbers>(std::vector<int64_t>{1, -2, -3, 4, 5, 6}), 4, late);
  EXPECT_EQ(ahead.next().picture.value()->stamp_ns, 1);
  const auto behind = ahead.next();
  EXPECT_EQ(behind.picture.value()->stamp_ns, 4);
  EXPECT_THAT(behind.left_out_ns, ElementsAre(2, 3));
  EXPECT_EQ(ahead.next().picture.value()->stamp_ns, 5);
  const auto end = ahead.next();
  EXPECT_FALSE(end.picture.value().has_value());
  EXPECT_THAT(end.left_out_ns, ElementsAre(6));
}

TEST(ReadAhead, PicturesThatAreNotNewerAreNeverLate) {
  const auto always_late = [](int64_t, int64_t) { return true; };
  ReadAhead ahead(std::make_unique<Numbers>(std::vector<int64_t>{5, 5, 4, 6}), 4, always_late);
  EXPECT_EQ(ahead.next().picture.value()->stamp_ns, 5);
  EXPECT_EQ(ahead.next().picture.value()->stamp_ns, 4);
  EXPECT_FALSE(ahead.next().picture.value().has_value());
}

TEST(ReadAhead, KeepsTheOrderWithTheShortestQueue) {
  ReadAhead ahead(std::make_unique<Numbers>(std::vector<int64_t>{1, 2, -3, 4}), 1, kNeverLate);
  EXPECT_EQ(ahead.next().picture.value()->stamp_ns, 1);
  EXPECT_EQ(ahead.next().picture.value()->stamp_ns, 2);
  EXPECT_EQ(ahead.next().picture.error().message, "broken -3");
  EXPECT_EQ(ahead.next().picture.value()->stamp_ns, 4);
  EXPECT_FALSE(ahead.next().picture.value().has_value());
  EXPECT_FALSE(ahead.next().picture.value().has_value());
}

TEST(ReadAhead, CanBeGivenUpWhileTheQueueIsFull) {
  ReadAhead ahead(std::make_unique<Numbers>(std::vector<int64_t>(1000, 1)), 2, kNeverLate);
  EXPECT_EQ(ahead.next().picture.value()->stamp_ns, 1);
}

struct Played {
  std::vector<std::string> events;
  std::promise<void> ended;
};

std::vector<std::string> play(std::vector<int64_t> stamps, bool real_pace, std::optional<int64_t> began_ns = {}) {
  Played played;
  std::promise<Player*> made;
  auto player = made.get_future().share();
  PlayerEvents events;
  events.picture = [&played, player](const dataset::Picture& picture) {
    played.events.push_back(picture.name);
    player.get()->complete();
  };
  events.late = [&played](int64_t stamp) { played.events.push_back("late " + std::to_string(stamp)); };
  events.broken = [&played](const std::string& why) { played.events.push_back(why); };
  events.ended = [&played] { played.ended.set_value(); };
  Player one(std::make_unique<Numbers>(std::move(stamps)), real_pace, 4, std::move(events), began_ns);
  made.set_value(&one);
  played.ended.get_future().wait();
  return played.events;
}

TEST(Player, LosslessGivesEveryPictureInOrder) {
  EXPECT_THAT(play({5, 1'000'000'000'000, -1, 7, 8}, false), ElementsAre("5", "1000000000000", "broken -1", "7", "8"));
}

TEST(Player, RealPaceGivesPicturesOfOneInstant) {
  EXPECT_THAT(play({5, 5, 5}, true), ElementsAre("5", "5", "5"));
}

TEST(Player, PassesOverWhatWouldHaveBeenPlayedBeforeItWasStarted) {
  const int64_t now_ns = core::wall_ns();
  EXPECT_THAT(play({5, 6, 7}, true, now_ns - 3600 * core::kNsPerSecond), ::testing::IsEmpty());
  EXPECT_THAT(play({5, 6, 7}, false, now_ns - 3600 * core::kNsPerSecond), ElementsAre("5", "6", "7"));
}

// Nanoseconds apart: how many are late is up to the machine, that each comes once and in its turn is not.
TEST(Player, RealPaceTellsOfLatePicturesInTheirTurn) {
  auto events = play({1, 2, 3, 4, 5, 6, 7, 8, 9}, true);
  for (std::string& event : events) event = event.substr(event.size() - 1);
  EXPECT_THAT(events, ElementsAre("1", "2", "3", "4", "5", "6", "7", "8", "9"));
}

TEST(Player, WaitsForCompletionAndCanBeGivenUpWhileItWaits) {
  std::promise<void> first;
  std::atomic<int> pictures = 0;
  PlayerEvents events;
  events.picture = [&](const dataset::Picture&) {
    if (++pictures == 1) first.set_value();
  };
  events.ended = [] { FAIL() << "must not end"; };
  {
    Player player(std::make_unique<Numbers>(std::vector<int64_t>{1, 2, 3}), false, 4, std::move(events));
    first.get_future().wait();
  }
  EXPECT_EQ(pictures, 1);
}

TEST(Player, CanBeGivenUpWhileAPictureIsNotDueForHours) {
  std::promise<void> first;
  PlayerEvents events;
  Player* playing = nullptr;
  std::promise<void> made;
  auto ready = made.get_future().share();
  events.picture = [&, ready](const dataset::Picture&) {
    ready.wait();
    playing->complete();
    first.set_value();
  };
  {
    Player player(std::make_unique<Numbers>(std::vector<int64_t>{0, 3'600'000'000'000}), true, 4, std::move(events));
    playing = &player;
    made.set_value();
    first.get_future().wait();
  }
}

}  // namespace
}  // namespace railfix::frame_grabber
