#include <gmock/gmock.h>
#include <sys/mount.h>

#include "core/random.hpp"
#include "recordings.hpp"
#include "support/mcap_records.hpp"

namespace railfix::mcap {

namespace {

using ::testing::Contains;
using ::testing::HasSubstr;
using ::testing::IsEmpty;

WriterOptions small_chunks() {
  WriterOptions options;
  options.chunk_bytes = 300;
  options.overwrite = true;
  return options;
}

/// Ends of the chunks of a proper file and how many messages stand before each.
std::vector<std::pair<size_t, size_t>> chunk_ends(const Bytes& file) {
  std::vector<std::pair<size_t, size_t>> ends;
  for (const auto& end : test::record_ends(file)) {
    if (end.opcode == static_cast<uint8_t>(Opcode::chunk)) ends.emplace_back(end.offset, end.messages);
  }
  return ends;
}

using DamageTest = RecordingTest;

TEST_F(DamageTest, CutAtEveryByteKeepsEveryWholeChunk) {
  const auto all = samples(24);
  const Bytes whole = content(record(all, small_chunks()));
  const auto ends = chunk_ends(whole);
  ASSERT_GE(ends.size(), 4U);
  for (size_t size = 0; size < whole.size(); ++size) {
    const auto opened = Reader::open(store({whole.begin(), whole.begin() + static_cast<std::ptrdiff_t>(size)}));
    if (size < kMagic.size()) {
      EXPECT_FALSE(opened.ok());
      continue;
    }
    ASSERT_TRUE(opened.ok()) << opened.error().message;
    size_t expected = 0;
    for (const auto& [end, messages] : ends) expected = size >= end ? messages : expected;
    Reader& reader = *opened.value();
    ASSERT_EQ(read(reader).size(), expected) << "cut at byte " << size;
    ASSERT_EQ(reader.statistics().messages, expected);
    ASSERT_FALSE(reader.problems().empty());
  }
}

TEST_F(DamageTest, EveryFlippedByteIsNoticedOrHarmless) {
  const auto all = samples(16);
  const Bytes whole = content(record(all, small_chunks()));
  const auto expected = read(*Reader::open(folder_ / "test.mcap").value());
  for (size_t i = 0; i < whole.size(); ++i) {
    Bytes changed = whole;
    changed[i] ^= 0x41;
    const auto opened = Reader::open(store(changed));
    if (!opened.ok()) continue;
    Reader& reader = *opened.value();
    const auto got = read(reader);
    ASSERT_TRUE(got == expected || !reader.problems().empty()) << "byte " << i << " changed the messages silently";
  }
}

TEST_F(DamageTest, CorruptChunkIsNamedAndTheOthersAreRead) {
  const auto all = samples(40);
  Bytes bytes = content(record(all, small_chunks()));
  const auto ends = chunk_ends(bytes);
  bytes[ends[2].first - 3] ^= 0xFF;
  auto reader = Reader::open(store(bytes)).value();
  ASSERT_TRUE(reader->indexed());
  EXPECT_EQ(read(*reader).size(), all.size() - (ends[2].second - ends[1].second));
  EXPECT_THAT(reader->problems(), Contains(HasSubstr("its messages are missing")));
  const size_t said = reader->problems().size();
  (void)read(*reader);
  EXPECT_EQ(reader->problems().size(), said) << "said once";
}

// Of a file that was cut off, so that no index tells where the next one begins.
TEST_F(DamageTest, ABrokenLengthOrBlockCostsTheChunksItIsInAndNoOthers) {
  const auto all = samples(60);
  const Bytes whole = content(record(all, small_chunks()));
  const auto records = test::record_ends(whole);
  std::vector<size_t> chunks;  // numbers of their records
  for (size_t i = 0; i < records.size(); ++i) {
    if (records[i].opcode == static_cast<uint8_t>(Opcode::chunk)) chunks.push_back(i);
  }
  ASSERT_GE(chunks.size(), 5U);
  const size_t begin = records[chunks[2] - 1].offset;
  const size_t lost = records[chunks[2]].messages - records[chunks[1]].messages;
  const Bytes cut(whole.begin(), whole.begin() + static_cast<std::ptrdiff_t>(records[chunks.back()].offset));
  for (const size_t of_length : {1, 2, 4, 8}) {
    Bytes bytes = cut;
    bytes[begin + of_length] ^= 0x41;
    auto reader = Reader::open(store(bytes)).value();
    EXPECT_GE(read(*reader).size(), all.size() - lost) << of_length;  // all, where it was too long only
    EXPECT_FALSE(reader->problems().empty());
  }
  Bytes bytes = cut;
  std::fill(bytes.begin() + static_cast<std::ptrdiff_t>(begin),
            bytes.begin() + static_cast<std::ptrdiff_t>(records[chunks[2]].offset), uint8_t{0});
  auto reader = Reader::open(store(bytes)).value();
  EXPECT_EQ(read(*reader).size(), all.size() - lost);
  EXPECT_THAT(reader->problems(), Contains(HasSubstr("goes on with the chunk at byte ")));
}

TEST_F(DamageTest, DamagedIndexFallsBackToTheScan) {
  const auto all = samples(40);
  Bytes bytes = content(record(all, small_chunks()));
  bytes[bytes.size() - 60] ^= 0xFF;
  auto reader = Reader::open(store(bytes)).value();
  EXPECT_FALSE(reader->indexed());
  EXPECT_EQ(read(*reader).size(), all.size());
  EXPECT_THAT(reader->problems(), Contains(HasSubstr("checksum of its index")));
}

TEST_F(DamageTest, GarbageNeverCrashes) {
  core::Random random(7);
  const Bytes whole = content(record(samples(30), small_chunks()));
  for (int round = 0; round < 600; ++round) {
    Bytes bytes = whole;
    const size_t begin = random.next() % bytes.size();
    const size_t count = 1 + random.next() % 40;
    for (size_t i = begin; i < std::min(bytes.size(), begin + count); ++i)
      bytes[i] = static_cast<uint8_t>(random.next());
    if (round % 3 == 0) std::copy(kMagic.begin(), kMagic.end(), bytes.begin());
    const auto opened = Reader::open(store(bytes));
    EXPECT_LE(opened.ok() ? read(*opened.value()).size() : 0U, 60U);
  }
}

TEST_F(DamageTest, OtherFilesAreRefusedWithASentence) {
  const auto missing = Reader::open(folder_ / "missing.mcap");
  ASSERT_FALSE(missing.ok());
  EXPECT_THAT(missing.error().message, HasSubstr("cannot be read"));
  const auto empty = Reader::open(store({}));
  ASSERT_FALSE(empty.ok());
  EXPECT_THAT(empty.error().message, HasSubstr("is empty"));
  const auto other = Reader::open(store(Bytes(1000, 'x')));
  ASSERT_FALSE(other.ok());
  EXPECT_THAT(other.error().message, HasSubstr("not an MCAP recording"));
  EXPECT_FALSE(Reader::open(folder_).ok());
}

TEST_F(DamageTest, MessagesOutsideChunksAreFound) {
  Bytes bytes(kMagic.begin(), kMagic.end());
  append(bytes, Channel{3, 0, "topic", "json", {}});
  append(bytes, Message{3, 1, 20, 20, bytes_of("later")});
  append(bytes, Message{3, 2, 10, 10, bytes_of("earlier")});
  auto reader = Reader::open(store(bytes)).value();
  const auto all = read(*reader);
  ASSERT_EQ(all.size(), 2U);
  EXPECT_EQ(all[0].data, "earlier");
}

TEST_F(DamageTest, TwoDifferentChannelsOfOneIdAreToldApart) {
  Bytes bytes(kMagic.begin(), kMagic.end());
  append(bytes, Channel{3, 0, "topic", "json", {}});
  append(bytes, Channel{3, 0, "other", "json", {}});
  EXPECT_THAT(Reader::open(store(bytes)).value()->problems(), Contains(HasSubstr("defined twice")));
}

TEST_F(DamageTest, RecoverMakesAProperFile) {
  const auto all = samples(40);
  Bytes bytes = content(record(all, small_chunks()));
  const auto ends = chunk_ends(bytes);
  bytes.resize(ends[3].first + 5);
  const auto lost = recover(store(bytes), folder_ / "recovered.mcap");
  ASSERT_TRUE(lost.ok()) << lost.error().message;
  EXPECT_FALSE(lost.value().empty());
  auto reader = Reader::open(folder_ / "recovered.mcap").value();
  EXPECT_TRUE(reader->indexed());
  EXPECT_THAT(reader->problems(), IsEmpty());
  EXPECT_EQ(read(*reader).size(), ends[3].second);
  EXPECT_EQ(reader->channels().size(), 2U);
  const auto trace = std::ranges::find(reader->metadata(), std::string("railfix_repair"), &Metadata::name);
  ASSERT_NE(trace, reader->metadata().end()) << "nobody sees later that something is missing";
  const std::map<std::string, std::string> missing{
      {"file", "changed.mcap"}, {"lost_chunks", "0"}, {"skipped_bytes", "5"}};
  EXPECT_EQ(trace->entries, missing);
}

TEST_F(DamageTest, ARecoveryThatIsStoppedLeavesNothingOfItself) {
  Bytes bytes = content(record(samples(40), small_chunks()));
  bytes.resize(chunk_ends(bytes)[3].first + 5);
  const auto damaged = store(bytes);
  const auto out = folder_ / "recovered.mcap";
  int asked = 0;
  ASSERT_TRUE(recover(damaged, out, [&] { return ++asked > 0; }).ok());
  std::filesystem::remove(out);
  for (int most = 0; most < asked; ++most) {
    int left = most;
    const auto stopped = recover(damaged, out, [&] { return left-- > 0; });
    ASSERT_FALSE(stopped.ok());
    EXPECT_THAT(stopped.error().message, HasSubstr("was stopped"));
    EXPECT_FALSE(std::filesystem::exists(out));
    EXPECT_FALSE(std::filesystem::exists(out.string() + ".active"));
  }
}

TEST_F(DamageTest, ARecoveryOnAFullDiskLeavesNothingOfItself) {
  Bytes bytes = content(record(samples(2000), small_chunks()));
  bytes.resize(bytes.size() - 20);
  const auto damaged = store(bytes);
  const auto disk = folder_ / "disk";
  std::filesystem::create_directories(disk);
  if (mount("tmpfs", disk.c_str(), "tmpfs", 0, "size=20k") != 0) GTEST_SKIP() << "a disk can be made by root only";
  const auto lost = recover(damaged, disk / "recovered.mcap");
  EXPECT_FALSE(lost.ok());
  EXPECT_TRUE(std::filesystem::is_empty(disk));
  umount2(disk.c_str(), MNT_DETACH);
}

/// Heads of chunks that each claim what follows, and behind them room for it.
Bytes heads_of_chunks(size_t count, uint32_t crc) {
  constexpr uint64_t kClaimed = 5000;
  Bytes bytes(kMagic.begin(), kMagic.end());
  Encoder encoder(bytes);
  encoder.u8(0);
  for (size_t i = 0; i < count; ++i) {
    encoder.u8(static_cast<uint8_t>(Opcode::chunk));
    encoder.u64(kClaimed + 40);
    encoder.time(1);
    encoder.time(2);
    encoder.u64(kClaimed);
    encoder.u32(crc);
    encoder.text("");
    encoder.u64(kClaimed);
  }
  bytes.resize(bytes.size() + 2 * kClaimed, 0);
  return bytes;
}

TEST_F(DamageTest, WhatOnlyLooksLikeChunksHoldsUpNobody) {
  constexpr int kAnswered = 10;
  int asked = 0;
  const auto a_while = [&] { return ++asked < kAnswered; };
  const auto stopped = Reader::open(store(heads_of_chunks(100, 1)), a_while);
  ASSERT_FALSE(stopped.ok()) << "asked " << asked << " times";
  EXPECT_THAT(stopped.error().message, HasSubstr("was stopped"));
  EXPECT_EQ(asked, kAnswered);
  asked = 0;
  EXPECT_TRUE(Reader::open(store(heads_of_chunks(100, 0)), a_while).ok()) << "their heads alone say what they are not";
}

TEST_F(DamageTest, ChunksOfOneTimeAreHeldUpToALimitAndTheOthersToldAsLost) {
  constexpr uint64_t kChunks = 20;
  const auto file_of = [](int64_t length_ns) {
    Bytes bytes(kMagic.begin(), kMagic.end());
    append(bytes, Channel{3, 0, "topic", "json", {}});
    for (uint64_t i = 0; i < kChunks; ++i) {
      const auto begin_ns = static_cast<int64_t>(i);
      const int64_t end_ns = begin_ns + length_ns;
      Bytes records;
      append(records, Message{3, 1, begin_ns, begin_ns, bytes_of(std::string(100'000, '\0'))});
      append(records, Message{3, 2, end_ns, end_ns, bytes_of("{}")});
      append(bytes, ChunkHead{begin_ns, end_ns, records.size(), 0, "zstd"}, compress(records, Compression::zstd));
    }
    return bytes;
  };
  Selection selection;
  selection.most_held_bytes = 550'000;
  auto overlapping = Reader::open(store(file_of(1000))).value();
  EXPECT_EQ(read(*overlapping, selection).size(), 10U);
  EXPECT_EQ(overlapping->lost_chunks().size(), kChunks - 5);
  EXPECT_THAT(overlapping->problems(), Contains(HasSubstr("too much memory beside others of the same time")));
  auto in_turn = Reader::open(store(file_of(1))).value();
  EXPECT_EQ(read(*in_turn, selection).size(), 2 * kChunks);
  EXPECT_THAT(in_turn->lost_chunks(), IsEmpty());
}

}  // namespace

}  // namespace railfix::mcap
