// Small recordings for the tests, in a folder of their own that goes away with the test.
#pragma once

#include <gtest/gtest.h>
#include <unistd.h>

#include <filesystem>
#include <fstream>
#include <string>
#include <vector>

#include "mcap/reader.hpp"
#include "mcap/writer.hpp"

namespace railfix::mcap {

struct Sample {
  std::string topic;
  uint32_t sequence = 0;
  int64_t log_time_ns = 0;
  int64_t publish_time_ns = 0;
  std::string data;
  bool operator==(const Sample&) const = default;
};

inline ByteView bytes_of(const std::string& text) {
  return {reinterpret_cast<const uint8_t*>(text.data()), text.size()};
}

class RecordingTest : public ::testing::Test {
 protected:
  void SetUp() override {
    folder_ =
        std::filesystem::temp_directory_path() / ("railfix-mcap-" + std::to_string(::getpid()) + "-" +
                                                  ::testing::UnitTest::GetInstance()->current_test_info()->name());
    std::filesystem::remove_all(folder_);
    std::filesystem::create_directories(folder_);
  }
  void TearDown() override { std::filesystem::remove_all(folder_); }

  /// Two topics in turn; every seventh message of the second one is stamped before its predecessor.
  static std::vector<Sample> samples(uint32_t count) {
    std::vector<Sample> all;
    for (uint32_t i = 0; i < count; ++i) {
      const bool odd = i % 2 == 1;
      const int64_t log_ns = 1'000'000 + 1000 * static_cast<int64_t>(i) - (i % 7 == 0 ? 1500 : 0);
      all.push_back({odd ? "wheel_sample" : "track_view", i, log_ns, log_ns - 300,
                     std::string(20 + i % 50, static_cast<char>('a' + i % 26))});
    }
    return all;
  }

  std::filesystem::path record(const std::vector<Sample>& all, const WriterOptions& options = {}) const {
    const auto file = folder_ / "test.mcap";
    auto created = Writer::create(file, options);
    EXPECT_TRUE(created.ok()) << (created.ok() ? "" : created.error().message);
    Writer& writer = *created.value();
    const uint16_t schema = writer.add_schema("railfix::msg::Any", "omgidl", "module railfix {};").value();
    for (const Sample& sample : all) {
      const uint16_t channel = writer.add_channel(schema, sample.topic, "cdr", {{"train", "demo"}}).value();
      const auto status =
          writer.write({channel, sample.sequence, sample.log_time_ns, sample.publish_time_ns, bytes_of(sample.data)});
      EXPECT_TRUE(status.ok()) << status.error().message;
    }
    EXPECT_TRUE(writer.write_metadata({"railfix", {{"train", "demo"}, {"map", "loop"}}}).ok());
    const auto status = writer.close();
    EXPECT_TRUE(status.ok()) << status.error().message;
    return file;
  }

  static std::vector<Sample> read(Reader& reader, const Selection& selection = {}) {
    std::vector<Sample> all;
    reader.for_each(selection, [&](const Channel& channel, const Message& message) {
      all.push_back({channel.topic, message.sequence, message.log_time_ns, message.publish_time_ns,
                     std::string(message.data.begin(), message.data.end())});
      return true;
    });
    return all;
  }

  static Bytes content(const std::filesystem::path& file) {
    std::ifstream stream(file, std::ios::binary);
    return {std::istreambuf_iterator<char>(stream), std::istreambuf_iterator<char>()};
  }
  [[nodiscard]] std::filesystem::path store(const Bytes& bytes) const {
    const auto file = folder_ / "changed.mcap";
    std::ofstream(file, std::ios::binary)
        .write(reinterpret_cast<const char*>(bytes.data()), static_cast<std::streamsize>(bytes.size()));
    return file;
  }

  std::filesystem::path folder_;
};

}  // namespace railfix::mcap
