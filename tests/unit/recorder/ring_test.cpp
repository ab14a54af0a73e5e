#include "recorder/ring.hpp"

#include <gmock/gmock.h>
#include <unistd.h>

#include <fstream>

#include "core/time.hpp"
#include "mcap/reader.hpp"
#include "recorder/event_file.hpp"
#include "recorder/recordings_folder.hpp"

namespace railfix::recorder {

namespace {

namespace fs = std::filesystem;
using ::testing::ElementsAre;

constexpr int64_t kSecondNs = core::kNsPerSecond;

SamplePtr sample(uint32_t sequence, size_t bytes = 100, const std::string& standing = "") {
  static const auto channel = std::make_shared<const ChannelOf>(
      ChannelOf{"topic", "m::T", "module m { struct T { octet x; }; };", {{"keyed", "false"}}});
  return std::make_shared<const StoredSample>(StoredSample{
      channel, sequence, sequence * kSecondNs, sequence * kSecondNs, std::vector<uint8_t>(bytes, 7), standing});
}

std::vector<uint32_t> sequences(const std::vector<SamplePtr>& samples) {
  std::vector<uint32_t> all;
  for (const auto& one : samples) all.push_back(one->sequence);
  return all;
}

TEST(Ring, KeepsTheLastSeconds) {
  Ring ring(3, 1'000'000);
  EXPECT_EQ(ring.seconds(), 0);
  for (uint32_t i = 1; i <= 10; ++i) ring.add(sample(i), i * kSecondNs);
  EXPECT_THAT(sequences(ring.snapshot().samples), ElementsAre(7, 8, 9, 10));
  EXPECT_EQ(ring.seconds(), 3);
  EXPECT_EQ(ring.bytes(), 400U);
}

TEST(Ring, KeepsNoMoreThanItsMemory) {
  Ring ring(1000, 250);
  for (uint32_t i = 1; i <= 5; ++i) ring.add(sample(i), i * kSecondNs);
  EXPECT_THAT(sequences(ring.snapshot().samples), ElementsAre(4, 5));
  ring.add(sample(6, 1000), 6 * kSecondNs);
  EXPECT_EQ(ring.bytes(), 0U) << "one that is too large leaves nothing, and is no reason to fall";
  ring.add(sample(7), 7 * kSecondNs);
  EXPECT_THAT(sequences(ring.snapshot().samples), ElementsAre(7));
}

TEST(Ring, RemembersStandingValuesThatFellOut) {
  Ring ring(2, 1'000'000);
  ring.add(sample(1, 10, "a"), 1 * kSecondNs);
  ring.add(sample(2, 10, "a"), 2 * kSecondNs);
  ring.add(sample(3, 10, "b"), 3 * kSecondNs);
  for (uint32_t i = 4; i <= 5; ++i) ring.add(sample(i), i * kSecondNs);
  EXPECT_THAT(sequences(ring.snapshot().standing), ElementsAre(2)) << "the value of a at the ring's begin";
  EXPECT_THAT(sequences(ring.snapshot().samples), ElementsAre(3, 4, 5));
}

class EventFileTest : public ::testing::Test {
 protected:
  EventFileTest() : folder_(fs::temp_directory_path() / ("railfix-event-" + std::to_string(::getpid()))) {
    fs::remove_all(folder_);
  }
  ~EventFileTest() override { fs::remove_all(folder_); }
  fs::path folder_;
};

TEST_F(EventFileTest, HoldsWhatWasBeforeAndWhatCameAfter) {
  Ring ring(3, 1'000'000);
  ring.add(sample(1, 10, "a"), 1 * kSecondNs);
  for (uint32_t i = 2; i <= 10; ++i) ring.add(sample(i), i * kSecondNs);
  auto file = EventFile::create(folder_ / "x-event.mcap", {}, {{"train_id", "demo"}}, {5, "a jolt", "by hand"},
                                ring.snapshot(), 1'000'000)
                  .value();
  EXPECT_TRUE(is_protected(folder_ / "x-event.mcap")) << "from the beginning";
  file->add(sample(11));
  file->note({6, "another", "rule"});
  file->add(sample(12));
  const auto result = file->wait();
  ASSERT_TRUE(result.ok()) << result.error().message;
  EXPECT_TRUE(file->done());
  auto reader = mcap::Reader::open(folder_ / "x-event.mcap").value();
  std::vector<uint32_t> found;
  std::vector<int64_t> times_s;
  reader->for_each({}, [&](const mcap::Channel&, const mcap::Message& message) {
    found.push_back(message.sequence);
    times_s.push_back(message.log_time_ns / kSecondNs);
    return true;
  });
  EXPECT_THAT(found, ElementsAre(1, 7, 8, 9, 10, 11, 12));
  EXPECT_THAT(times_s, ElementsAre(7, 7, 8, 9, 10, 11, 12)) << "the standing value counts from where the ring begins";
  ASSERT_EQ(reader->metadata().size(), 3U);
  EXPECT_EQ(reader->metadata()[1].name, "railfix_event");
  EXPECT_EQ(reader->metadata()[1].entries.at("text"), "a jolt");
  EXPECT_EQ(reader->metadata()[2].entries.at("trigger"), "rule");
}

TEST_F(EventFileTest, ADiskThatIsTooSlowCostsSamplesThatAreCounted) {
  auto file = EventFile::create(folder_ / "y-event.mcap", {}, {}, {5, "e", "by hand"}, {}, 150).value();
  // Whatever is written meanwhile, a sample of this size never fits.
  for (uint32_t i = 0; i < 3; ++i) file->add(sample(i, 200));
  const auto result = file->wait();
  ASSERT_TRUE(result.ok());
  EXPECT_THAT(result.value(), ::testing::HasSubstr("lost topic: 3 queue"));
}

TEST_F(EventFileTest, AFolderThatCannotBeWrittenIsSaid) {
  std::filesystem::create_directories(folder_);
  std::ofstream(folder_ / "file").put('x');
  EXPECT_FALSE(EventFile::create(folder_ / "file" / "z.mcap", {}, {}, {}, {}, 1).ok());
}

}  // namespace

}  // namespace railfix::recorder
