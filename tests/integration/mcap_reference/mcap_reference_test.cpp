// The reference implementation reads our recordings and we read its own.
#include <gtest/gtest.h>

#include <filesystem>
#include <fstream>
#include <nlohmann/json.hpp>

#include "core/random.hpp"
#include "mcap/reader.hpp"
#include "mcap/writer.hpp"
#include "support/mcap_records.hpp"
#include "support/mcap_reference.hpp"
#include "support/program.hpp"

namespace railfix::mcap {

namespace {

using nlohmann::json;
namespace fs = std::filesystem;

constexpr uint32_t kSamples = 200;

class McapReferenceTest : public ::testing::Test {
 protected:
  static const test::McapReference& reference() {
    static const test::McapReference installed(
        fs::path(RAILFIX_SOURCE_DIR) / "tests" / "integration" / "mcap_reference", kWork);
    return installed;
  }
  void SetUp() override {
    if (reference().problem() == "npm is not there") GTEST_SKIP() << "skipped: npm is not there";
    ASSERT_EQ(reference().problem(), "");
  }

  static json sample(uint32_t i) {
    return {{"topic", i % 3 == 0 ? "position_fix" : "track_view"},
            {"sequence", i},
            {"log_time_ns", 5000 + 10 * i},
            {"publish_time_ns", 4990 + 10 * i},
            {"data", std::string(30 + i % 90, static_cast<char>('A' + i % 26))}};
  }

  static fs::path record(Compression compression) {
    WriterOptions options;
    options.chunk_bytes = 1500;
    options.compression = compression;
    options.overwrite = true;
    auto writer = Writer::create(kWork / "ours.mcap", options).value();
    const uint16_t schema = writer->add_schema("railfix::msg::Any", "omgidl", "module railfix {};").value();
    EXPECT_TRUE(writer->write_metadata({"railfix", {{"train", "demo"}}}).ok());
    for (uint32_t i = 0; i < kSamples; ++i) {
      const json one = sample(i);
      const auto data = one["data"].get<std::string>();
      const Message message{writer->add_channel(schema, one["topic"], "cdr", {{"reliable", "1"}}).value(), i,
                            one["log_time_ns"], one["publish_time_ns"],
                            ByteView(reinterpret_cast<const uint8_t*>(data.data()), data.size())};
      EXPECT_TRUE(writer->write(message).ok());
    }
    const auto status = writer->close();
    EXPECT_TRUE(status.ok()) << status.error().message;
    return kWork / "ours.mcap";
  }

  inline static const fs::path kWork = MCAP_REFERENCE_WORK;
};

TEST_F(McapReferenceTest, ReadsOurRecordings) {
  for (const auto compression : {Compression::none, Compression::zstd, Compression::lz4}) {
    const fs::path file = record(compression);
    for (const std::string action : {"indexed", "stream"}) {
      ASSERT_TRUE(reference().run(action, file, kWork / "found.json")) << action << " " << name_of(compression);
      const json found = json::parse(std::ifstream(kWork / "found.json"));
      ASSERT_EQ(found["messages"].size(), kSamples) << action;
      for (uint32_t i = 0; i < kSamples; ++i) EXPECT_EQ(found["messages"][i], sample(i)) << action;
      EXPECT_EQ(found["metadata"], json::parse(R"([{"name": "railfix", "entries": {"train": "demo"}}])"));
      EXPECT_EQ(found["statistics"]["messages"], kSamples);
      EXPECT_EQ(found["statistics"]["channels"], 2);
      EXPECT_GT(found["statistics"]["chunks"].get<int>(), 5);
      EXPECT_EQ(found["dataEnd"].get<bool>(), action == "stream");
    }
  }
}

// tests/benchmark/recording_cuts does the same a thousand times.
TEST_F(McapReferenceTest, AcceptsEveryRepairedFile) {
  const fs::path folder = kWork / "cuts";
  fs::remove_all(folder);
  fs::create_directories(folder);
  core::Random random(5);
  std::map<std::string, size_t> expected;
  for (const auto compression : {Compression::none, Compression::zstd, Compression::lz4}) {
    const Bytes whole = test::bytes_of_file(record(compression));
    const auto ends = test::record_ends(whole);
    for (int i = 0; i < 20; ++i) {
      const size_t size = kMagic.size() + random.next() % (whole.size() - kMagic.size());
      std::ofstream(folder / "cut", std::ios::binary)
          .write(reinterpret_cast<const char*>(whole.data()), static_cast<std::streamsize>(size));
      const std::string name = name_of(compression) + std::to_string(size) + ".mcap";
      const auto lost = recover(folder / "cut", folder / name);
      ASSERT_TRUE(lost.ok()) << lost.error().message;
      expected[name] = test::messages_before(ends, size);
    }
  }
  ASSERT_TRUE(reference().run("count", folder, kWork / "counts.json"));
  const json counts = json::parse(std::ifstream(kWork / "counts.json"));
  ASSERT_EQ(counts.size(), expected.size());
  for (const auto& [name, messages] : expected) EXPECT_EQ(counts[name], messages) << name;
}

TEST_F(McapReferenceTest, ReadsWhatWeCutAndMerge) {
  const fs::path file = record(Compression::zstd);
  const auto railfix = [](std::vector<std::string> arguments) {
    arguments.insert(arguments.begin(), {"railfix", "recording"});
    const auto done = test::run_program(arguments, 60);
    EXPECT_EQ(done.exit_code, 0) << done.err;
  };
  const auto part = [&](const std::string& name) { return (kWork / name).string(); };
  for (const char* name : {"first.mcap", "second.mcap", "merged.mcap"}) fs::remove(kWork / name);
  // Sample i was recorded 10 ns times i after the first.
  railfix({"cut", file.string(), "--to", "0.0000012", "--out", part("first.mcap")});
  railfix({"cut", file.string(), "--from", "0.000001", "--out", part("second.mcap")});
  railfix({"merge", part("first.mcap"), part("second.mcap"), "--out", part("merged.mcap")});
  for (const std::string action : {"indexed", "stream"}) {
    ASSERT_TRUE(reference().run(action, kWork / "merged.mcap", kWork / "found.json")) << action;
    const json found = json::parse(std::ifstream(kWork / "found.json"));
    ASSERT_EQ(found["messages"].size(), kSamples) << action;
    for (uint32_t i = 0; i < kSamples; ++i) EXPECT_EQ(found["messages"][i], sample(i)) << action;
    EXPECT_EQ(found["statistics"]["messages"], kSamples);
  }
}

TEST_F(McapReferenceTest, NoticesWhatWeWouldNotWrite) {
  const fs::path file = record(Compression::zstd);
  std::fstream stream(file, std::ios::binary | std::ios::in | std::ios::out);
  stream.seekp(400);
  stream.write("XXXX", 4);
  stream.close();
  EXPECT_FALSE(reference().run("stream", file, kWork / "found.json")) << "the comparison above could not fail";
}

TEST_F(McapReferenceTest, OurReaderReadsTheirs) {
  const fs::path file = kWork / "theirs.mcap";
  ASSERT_TRUE(reference().run("write", file, kWork / "written.log"));
  auto reader = Reader::open(file).value();
  EXPECT_TRUE(reader->indexed());
  uint32_t i = 0;
  reader->for_each({}, [&](const Channel& channel, const Message& message) {
    EXPECT_EQ(channel.topic, i % 2 == 0 ? "first" : "second");
    EXPECT_EQ(message.sequence, i);
    EXPECT_EQ(message.log_time_ns, 1000 + i);
    EXPECT_EQ(message.publish_time_ns, 900 + i);
    EXPECT_EQ(std::string(message.data.begin(), message.data.end()), "message " + std::to_string(i));
    ++i;
    return true;
  });
  EXPECT_EQ(i, 50U);
  EXPECT_TRUE(reader->problems().empty());
  ASSERT_EQ(reader->metadata().size(), 1U);
  EXPECT_EQ(reader->metadata()[0], (Metadata{"origin", {{"key", "value"}}}));
}

}  // namespace

}  // namespace railfix::mcap
