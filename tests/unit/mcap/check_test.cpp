#include "mcap/check.hpp"

#include <gmock/gmock.h>
#include <unistd.h>

#include <fstream>

#include "mcap/writer.hpp"

namespace railfix::mcap {
namespace {

namespace fs = std::filesystem;
using ::testing::HasSubstr;

class CheckTest : public ::testing::Test {
 protected:
  void SetUp() override {
    file_ = fs::temp_directory_path() / ("railfix-check-" + std::to_string(::getpid()) + ".mcap");
    WriterOptions options;
    options.chunk_bytes = 150;
    options.overwrite = true;
    auto writer = Writer::create(file_, options).value();
    const uint16_t schema = writer->add_schema("a::B", "omgidl", "module a {};").value();
    const uint16_t fast = writer->add_channel(schema, "fast", "cdr", {}).value();
    const uint16_t slow = writer->add_channel(schema, "slow", "cdr", {}).value();
    for (uint32_t i = 0; i < 12; ++i) {
      const std::string data = "message " + std::to_string(i);
      const ByteView bytes(reinterpret_cast<const uint8_t*>(data.data()), data.size());
      EXPECT_TRUE(writer->write({i % 4 == 0 ? slow : fast, i, 1000 + 10 * i, 1000 + 10 * i, bytes}).ok());
    }
    EXPECT_TRUE(writer->write_metadata({"railfix", {{"train", "demo"}}}).ok());
    EXPECT_TRUE(writer->close().ok());
  }
  void TearDown() override { fs::remove(file_); }
  [[nodiscard]] std::string bytes() const {
    std::ifstream stream(file_, std::ios::binary);
    return {std::istreambuf_iterator<char>(stream), {}};
  }
  std::vector<std::string> problems_of(const std::string& bytes) {
    std::ofstream(file_, std::ios::binary | std::ios::trunc) << bytes;
    return check(file_).value().problems;
  }
  fs::path file_;
};

TEST_F(CheckTest, AWholeFileIsSound) {
  const auto found = check(file_).value();
  EXPECT_THAT(found.problems, ::testing::IsEmpty());
  EXPECT_GT(found.chunks, 2U);
  EXPECT_EQ(found.chunks_with_crc, found.chunks);
  EXPECT_TRUE(found.data_crc);
  EXPECT_TRUE(found.summary_crc);
  const auto& fast = found.channels.at(1);
  EXPECT_EQ(fast.messages, 9U);
  EXPECT_EQ(fast.first_ns, 1010);
  EXPECT_EQ(fast.last_ns, 1110);
  EXPECT_EQ(fast.longest_gap_ns, 20);
}

TEST_F(CheckTest, NoChangedByteIsOverlooked) {
  const std::string whole = bytes();
  for (size_t i = 0; i < whole.size(); ++i) {
    std::string changed = whole;
    changed[i] = static_cast<char>(changed[i] ^ 0x10);
    ASSERT_FALSE(problems_of(changed).empty()) << "byte " << i;
  }
}

TEST_F(CheckTest, NoCutIsOverlooked) {
  const std::string whole = bytes();
  for (size_t i = 0; i < whole.size(); ++i) ASSERT_FALSE(problems_of(whole.substr(0, i)).empty()) << "byte " << i;
  EXPECT_THAT(problems_of(whole.substr(0, whole.size() / 2)), ::testing::Contains(HasSubstr("not closed properly")));
}

}  // namespace
}  // namespace railfix::mcap
