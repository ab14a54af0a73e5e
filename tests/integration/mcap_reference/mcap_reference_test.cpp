// The reference implementation reads our recordings and we read its own.
#include <gtest/gtest.h>

#include <algorithm>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <nlohmann/json.hpp>

#include "mcap/reader.hpp"
#include "mcap/writer.hpp"

namespace railfix::mcap {

namespace {

using nlohmann::json;
namespace fs = std::filesystem;

constexpr uint32_t kSamples = 200;

class McapReferenceTest : public ::testing::Test {
 protected:
  static void SetUpTestSuite() {
    if (std::system("npm --version > /dev/null 2>&1") != 0) return;
    npm_ = true;
    fs::create_directories(kWork);
    for (const char* name : {"package.json", "reference.mjs"}) {
      fs::copy_file(kSource / name, kWork / name, fs::copy_options::overwrite_existing);
    }
    if (!fs::exists(kWork / "node_modules" / "@mcap" / "support")) {
      const std::string install = "cd '" + kWork.string() + "' && npm install --no-audit --no-fund > npm.log 2>&1";
      ASSERT_EQ(std::system(install.c_str()), 0) << "npm install failed, see " << kWork / "npm.log";
    }
  }
  void SetUp() override {
    if (!npm_) GTEST_SKIP() << "skipped: npm is not there";
  }

  static bool reference(const std::string& action, const fs::path& file, const fs::path& out) {
    const std::string command = "cd '" + kWork.string() + "' && node reference.mjs " + action + " '" + file.string() +
                                "' > '" + out.string() + "' 2> errors.log";
    return std::system(command.c_str()) == 0;
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

  inline static const fs::path kSource = fs::path(RAILFIX_SOURCE_DIR) / "tests" / "integration" / "mcap_reference";
  inline static const fs::path kWork = MCAP_REFERENCE_WORK;
  inline static bool npm_ = false;
};

TEST_F(McapReferenceTest, ReadsOurRecordings) {
  for (const auto compression : {Compression::none, Compression::zstd, Compression::lz4}) {
    const fs::path file = record(compression);
    for (const std::string action : {"indexed", "stream"}) {
      ASSERT_TRUE(reference(action, file, kWork / "found.json")) << action << " " << name_of(compression);
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

TEST_F(McapReferenceTest, NoticesWhatWeWouldNotWrite) {
  const fs::path file = record(Compression::zstd);
  std::fstream stream(file, std::ios::binary | std::ios::in | std::ios::out);
  stream.seekp(400);
  stream.write("XXXX", 4);
  stream.close();
  EXPECT_FALSE(reference("stream", file, kWork / "found.json")) << "the comparison above could not fail";
}

TEST_F(McapReferenceTest, OurReaderReadsTheirs) {
  const fs::path file = kWork / "theirs.mcap";
  ASSERT_TRUE(reference("write", file, kWork / "written.log"));
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
