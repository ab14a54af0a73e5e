#include <fcntl.h>
#include <gmock/gmock.h>
#include <sys/resource.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <csignal>
#include <fstream>
#include <thread>

#include "mcap/check.hpp"
#include "recordings.hpp"
#include "support/other_writers_file.hpp"

namespace railfix::mcap {

namespace {

using ::testing::HasSubstr;
using ::testing::IsEmpty;

std::vector<Sample> in_time_order(std::vector<Sample> all) {
  std::ranges::stable_sort(all, {}, &Sample::log_time_ns);
  return all;
}

TEST_F(RecordingTest, GivesBackWhatWasWrittenInTimeOrder) {
  for (const auto compression : {Compression::none, Compression::zstd, Compression::lz4}) {
    WriterOptions options;
    options.chunk_bytes = 700;
    options.compression = compression;
    options.overwrite = true;
    const auto all = samples(300);
    auto reader = Reader::open(record(all, options)).value();
    EXPECT_TRUE(reader->indexed());
    EXPECT_EQ(read(*reader), in_time_order(all)) << name_of(compression);
    EXPECT_THAT(reader->problems(), IsEmpty());
    EXPECT_GT(reader->statistics().chunks, 20U);
  }
}

TEST_F(RecordingTest, StatisticsAndMetadataMatch) {
  const auto all = samples(101);
  auto reader = Reader::open(record(all)).value();
  const Statistics& statistics = reader->statistics();
  EXPECT_EQ(statistics.messages, 101U);
  EXPECT_EQ(statistics.schemas, 1U);
  EXPECT_EQ(statistics.channels, 2U);
  EXPECT_EQ(statistics.metadata, 1U);
  EXPECT_EQ(statistics.start_ns, std::ranges::min(all, {}, &Sample::log_time_ns).log_time_ns);
  EXPECT_EQ(statistics.end_ns, std::ranges::max(all, {}, &Sample::log_time_ns).log_time_ns);
  EXPECT_EQ(statistics.channel_messages, (std::map<uint16_t, uint64_t>{{1, 51}, {2, 50}}));
  ASSERT_EQ(reader->metadata().size(), 1U);
  EXPECT_EQ(reader->metadata()[0], (Metadata{"railfix", {{"train", "demo"}, {"map", "loop"}}}));
  EXPECT_EQ(reader->channels().at(1).metadata.at("train"), "demo");
  EXPECT_EQ(reader->schemas().at(1).name, "railfix::msg::Any");
}

TEST_F(RecordingTest, SelectsByTopicAndTime) {
  WriterOptions options;
  options.chunk_bytes = 500;
  const auto all = samples(200);
  auto reader = Reader::open(record(all, options)).value();
  auto expected = in_time_order(all);
  std::erase_if(expected, [](const Sample& sample) {
    return sample.topic != "wheel_sample" || sample.log_time_ns < 1'050'000 || sample.log_time_ns >= 1'100'000;
  });
  ASSERT_FALSE(expected.empty());
  EXPECT_EQ(read(*reader, {{"wheel_sample"}, 1'050'000, 1'100'000}), expected);
  EXPECT_THAT(read(*reader, {{"no_such_topic"}, {}, {}}), IsEmpty());
}

TEST_F(RecordingTest, KeepsFileOrderOfEqualTimes) {
  std::vector<Sample> all;
  for (uint32_t i = 0; i < 50; ++i) all.push_back({"log_record", i, 5000, 5000, "same time"});
  WriterOptions options;
  options.chunk_bytes = 200;
  auto reader = Reader::open(record(all, options)).value();
  EXPECT_EQ(read(*reader), all);
}

TEST_F(RecordingTest, GoesBackwardsToo) {
  WriterOptions options;
  options.chunk_bytes = 700;
  auto all = samples(300);
  all.push_back({"track_view", 300, all.back().log_time_ns, 5, "same time"});
  auto reader = Reader::open(record(all, options)).value();
  auto expected = in_time_order(all);
  std::erase_if(expected, [](const Sample& sample) { return sample.log_time_ns >= 1'200'000; });
  std::ranges::reverse(expected);
  EXPECT_EQ(read(*reader, {{}, {}, 1'200'000, true}), expected);
}

TEST_F(RecordingTest, ChunksOfWhatIsLeftOutAreNotRead) {
  WriterOptions options;
  options.chunk_bytes = 700;
  options.compression = Compression::none;
  const auto file = record(samples(300), options);
  auto bytes = content(file);
  bytes[bytes.size() / 4] ^= 1;  // in a chunk: who reads it meets a wrong checksum
  auto reader = Reader::open(store(bytes)).value();
  auto messages = reader->messages({{}, {}, {}, true});
  ASSERT_TRUE(messages.next());
  messages.leave_out(1);
  const auto other = messages.next();
  ASSERT_TRUE(other);
  EXPECT_EQ(other->channel_id, 2);
  messages.leave_out(2);
  EXPECT_FALSE(messages.next());
  EXPECT_THAT(reader->problems(), IsEmpty());
  EXPECT_LT(read(*reader).size(), 300U);
  EXPECT_FALSE(reader->problems().empty());
}

TEST_F(RecordingTest, EmptyRecordingIsProper) {
  auto reader = Reader::open(record({})).value();
  EXPECT_TRUE(reader->indexed());
  EXPECT_THAT(read(*reader), IsEmpty());
  EXPECT_THAT(reader->problems(), IsEmpty());
  EXPECT_EQ(reader->statistics().messages, 0U);
}

TEST_F(RecordingTest, LargeMessageGetsItsOwnChunk) {
  WriterOptions options;
  options.chunk_bytes = 1000;
  auto all = samples(3);
  all[1].data = std::string(5000, 'x');
  auto reader = Reader::open(record(all, options)).value();
  EXPECT_EQ(read(*reader).size(), 3U);
  EXPECT_EQ(reader->statistics().chunks, 3U);
}

TEST_F(RecordingTest, APlaceThatCannotBeLookedAtIsRefusedWithASentence) {
  std::filesystem::create_symlink("loop", folder_ / "loop");
  for (const auto& file : {folder_ / "loop", folder_ / std::string(300, 'x')}) {
    const auto created = Writer::create(file, {});
    ASSERT_FALSE(created.ok());
    EXPECT_THAT(created.error().message, HasSubstr("cannot be created ("));
  }
}

TEST_F(RecordingTest, MetadataInFrontIsFoundWithoutReadingTheRest) {
  const auto file = folder_ / "front.mcap";
  auto writer = Writer::create(file, {}).value();
  const uint16_t channel = writer->add_channel(0, "log_record", "json", {}).value();
  ASSERT_TRUE(writer->write_metadata({"railfix", {{"number", "7"}}}).ok());
  EXPECT_EQ(metadata_in_front(file.string() + ".active", "railfix").value().entries.at("number"), "7");
  ASSERT_TRUE(writer->write({channel, 1, 1, 1, bytes_of("{}")}).ok());
  ASSERT_TRUE(writer->close().ok());
  EXPECT_EQ(metadata_in_front(file, "railfix").value().entries.at("number"), "7");
  EXPECT_FALSE(metadata_in_front(file, "other").has_value());
  WriterOptions small_chunks;
  small_chunks.chunk_bytes = 300;
  const auto behind = metadata_in_front(record(samples(40), small_chunks), "railfix");
  EXPECT_FALSE(behind.has_value()) << "stands behind the messages";
  EXPECT_FALSE(metadata_in_front(store(Bytes(1000, 'x')), "railfix").has_value());
  EXPECT_FALSE(metadata_in_front(folder_ / "none", "railfix").has_value());
}

TEST_F(RecordingTest, OpenFileIsCalledActiveAndReadable) {
  const auto file = folder_ / "live.mcap";
  WriterOptions options;
  options.chunk_bytes = 100;
  auto writer = Writer::create(file, options).value();
  const uint16_t channel = writer->add_channel(0, "log_record", "json", {}).value();
  for (uint32_t i = 0; i < 4; ++i) {
    ASSERT_TRUE(writer->write({channel, i, i, i, bytes_of(std::string(60, '{'))}).ok());
  }
  EXPECT_FALSE(std::filesystem::exists(file));
  EXPECT_TRUE(being_written(file.string() + ".active"));
  WriterOptions greedy;
  greedy.overwrite = true;
  EXPECT_FALSE(Writer::create(file, greedy).ok()) << "another recorder must not take it over";
  auto reader = Reader::open(file.string() + ".active").value();
  EXPECT_FALSE(reader->indexed());
  EXPECT_EQ(read(*reader).size(), 3U) << "all but the chunk that is being collected";
  ASSERT_TRUE(writer->close().ok());
  EXPECT_FALSE(std::filesystem::exists(file.string() + ".active"));
  EXPECT_FALSE(being_written(file));
  EXPECT_EQ(read(*Reader::open(file).value()).size(), 4U);
}

TEST_F(RecordingTest, OldChunkIsStoredWithoutNewMessages) {
  WriterOptions options;
  options.chunk_age_s = 1e-9;
  auto writer = Writer::create(folder_ / "slow.mcap", options).value();
  const uint16_t channel = writer->add_channel(0, "log_record", "json", {}).value();
  const uint64_t before = writer->bytes_written();
  ASSERT_TRUE(writer->write({channel, 1, 1, 1, bytes_of("{}")}).ok());
  ASSERT_TRUE(writer->tick().ok());
  EXPECT_GT(writer->bytes_written(), before);
}

TEST_F(RecordingTest, RefusesToOverwriteAndSaysWhy) {
  const auto file = record(samples(2));
  const auto again = Writer::create(file, {});
  ASSERT_FALSE(again.ok());
  EXPECT_THAT(again.error().message, HasSubstr("exists already"));
  const auto nowhere = Writer::create(folder_ / "no" / "such" / "folder.mcap", {});
  ASSERT_FALSE(nowhere.ok());
  EXPECT_THAT(nowhere.error().message, HasSubstr("No such file"));
}

TEST_F(RecordingTest, RefusesUnknownIds) {
  auto writer = Writer::create(folder_ / "ids.mcap", {}).value();
  EXPECT_FALSE(writer->add_channel(7, "track_view", "cdr", {}).ok());
  EXPECT_FALSE(writer->write({3, 0, 0, 0, bytes_of("x")}).ok());
}

TEST_F(RecordingTest, FullDiskIsAnErrorNotACrash) {
  if (!std::filesystem::exists("/dev/full")) GTEST_SKIP() << "skipped: no /dev/full";
  std::filesystem::create_symlink("/dev/full", folder_ / "full.mcap.active");
  WriterOptions options;
  options.overwrite = true;
  const auto created = Writer::create(folder_ / "full.mcap", options);
  ASSERT_FALSE(created.ok());
  EXPECT_THAT(created.error().message, HasSubstr("disk full"));
}

/// A disk that is full where this file has so many bytes.
class FullAt {
 public:
  explicit FullAt(uint64_t bytes) {
    getrlimit(RLIMIT_FSIZE, &before_);
    const rlimit now{bytes, before_.rlim_max};
    handler_ = std::signal(SIGXFSZ, SIG_IGN);
    setrlimit(RLIMIT_FSIZE, &now);
  }
  ~FullAt() {
    setrlimit(RLIMIT_FSIZE, &before_);
    static_cast<void>(std::signal(SIGXFSZ, handler_));
  }
  FullAt(const FullAt&) = delete;
  FullAt& operator=(const FullAt&) = delete;

 private:
  rlimit before_{};
  void (*handler_)(int) = nullptr;
};

TEST_F(RecordingTest, AMessageThatWaitsForAFullDiskIsNotCalledLost) {
  WriterOptions options;
  options.chunk_age_s = 1e-9;
  auto writer = Writer::create(folder_ / "full.mcap", options).value();
  const uint16_t channel = writer->add_channel(0, "log_record", "json", {}).value();
  {
    const FullAt here(writer->bytes_written());
    for (uint32_t i = 0; i < 5; ++i) EXPECT_TRUE(writer->write({channel, i, i, i, bytes_of("{}")}).ok());
    const auto ticked = writer->tick();
    ASSERT_FALSE(ticked.ok());
    EXPECT_THAT(ticked.error().message, HasSubstr("is the disk full?"));
  }
  EXPECT_TRUE(writer->tick().ok());
  ASSERT_TRUE(writer->close().ok());
  EXPECT_EQ(read(*Reader::open(folder_ / "full.mcap").value()).size(), 5U);
}

TEST_F(RecordingTest, AMessageThatFindsNoRoomIsAnError) {
  WriterOptions options;
  options.chunk_bytes = 100;
  auto writer = Writer::create(folder_ / "full.mcap", options).value();
  const uint16_t channel = writer->add_channel(0, "log_record", "json", {}).value();
  const FullAt here(writer->bytes_written());
  EXPECT_TRUE(writer->write({channel, 0, 0, 0, bytes_of(std::string(60, '{'))}).ok());
  EXPECT_FALSE(writer->write({channel, 1, 1, 1, bytes_of(std::string(60, '{'))}).ok()) << "memory has an end, too";
}

// A pipe cannot be forced to a disk.
TEST_F(RecordingTest, AMessageIsNotCalledLostWhenTheFileCannotBeForcedToTheDisk) {
  const auto file = folder_ / "pipe.mcap";
  const auto pipe = file.string() + ".active";
  ASSERT_EQ(::mkfifo(pipe.c_str(), 0600), 0);
  const int other_end = ::open(pipe.c_str(), O_RDONLY | O_NONBLOCK | O_CLOEXEC);
  WriterOptions options;
  options.overwrite = true;
  options.sync_period_s = 1e-9;
  auto writer = Writer::create(file, options).value();
  const uint16_t channel = writer->add_channel(0, "log_record", "json", {}).value();
  for (uint32_t i = 0; i < 20; ++i) {
    EXPECT_TRUE(writer->write({channel, i, i, i, bytes_of("{}")}).ok()) << i;
    std::this_thread::sleep_for(std::chrono::milliseconds(2));
  }
  for (const auto& told : {writer->tick(), writer->tick(), writer->close()}) {
    ASSERT_FALSE(told.ok());
    EXPECT_THAT(told.error().message, HasSubstr("cannot be forced to the disk"));
  }
  ::close(other_end);
}

TEST_F(RecordingTest, KnowsWhenItsFileWasRemoved) {
  auto writer = Writer::create(folder_ / "gone.mcap", {}).value();
  std::filesystem::rename(folder_ / "gone.mcap.active", folder_ / "moved");
  EXPECT_FALSE(writer->is_removed()) << "it is only moved";
  std::filesystem::remove(folder_ / "moved");
  EXPECT_TRUE(writer->is_removed());
}

TEST_F(RecordingTest, WhatOtherWritersLeaveOutOfTheSummaryIsFoundInTheFile) {
  for (unsigned bits = 0; bits < test::OtherSummary::kCombinations; ++bits) {
    const auto file = store(test::other_writers_file(test::OtherSummary(bits)));
    auto reader = Reader::open(file).value();
    EXPECT_EQ(read(*reader).size(), test::kOtherSamples) << bits;
    EXPECT_EQ(reader->statistics().messages, test::kOtherSamples) << bits;
    EXPECT_EQ(reader->schemas().size(), 1U) << bits;
    EXPECT_THAT(reader->problems(), IsEmpty()) << bits;
    EXPECT_THAT(check(file).value().problems, IsEmpty()) << bits;
    EXPECT_TRUE(reader->closed());
  }
  EXPECT_TRUE(Reader::open(store(test::other_writers_file(test::OtherSummary(63)))).value()->indexed());
}

}  // namespace

}  // namespace railfix::mcap
