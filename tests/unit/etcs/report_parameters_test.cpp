#include "etcs/report_parameters.hpp"

#include <gmock/gmock.h>

#include "unit/etcs/random_report.hpp"

namespace railfix::etcs {
namespace {

using ::testing::HasSubstr;
using testing::random_parameters;
using testing::set_bits;

TEST(ReportParameters, HandMadePacket) {
  // 58 | both | 72 bits | 1 m | 6 s | 1000 m | at groups | 1 element: 500 m, max safe front end
  // 00111010 10 0000001001000 01 00000110 000001111101000 001 00001 000000111110100 1
  ReportParameters parameters;
  parameters.t_cycloc = 6;
  parameters.d_cycloc = 1000;
  parameters.locations = {{500, 1}};
  const auto packet = encode(parameters).value();
  EXPECT_EQ(to_hex(packet), "3A80908303E82103E9");
  EXPECT_EQ(decode_report_parameters(packet).value(), parameters);
}

TEST(ReportParameters, RandomPacketsComeBackAndFlipsAreConsistent) {
  core::Random random(58);
  for (int i = 0; i < 500; ++i) {
    const auto parameters = random_parameters(random);
    const auto packet = encode(parameters).value();
    ASSERT_EQ(decode_report_parameters(packet).value(), parameters);
    for (size_t bit = 0; bit < packet.size() * 8; ++bit) {
      auto flipped = packet;
      flipped[bit / 8] = static_cast<uint8_t>(flipped[bit / 8] ^ 0x80U >> bit % 8);
      const auto decoded = decode_report_parameters(flipped);
      if (!decoded.ok()) continue;
      ASSERT_NE(decoded.value(), parameters);
      ASSERT_EQ(encode(decoded.value()).value(), flipped);
    }
    for (size_t size = 0; size < packet.size(); ++size) {
      ASSERT_FALSE(decode_report_parameters({packet.data(), size}).ok());
    }
  }
}

TEST(ReportParameters, ErrorsSayWhatIsWrong) {
  auto parameters = ReportParameters{};
  const auto packet = encode(parameters).value();
  ASSERT_EQ(packet.size(), 7U);
  const auto with = [&](size_t begin, unsigned count, uint32_t value) {
    auto changed = packet;
    set_bits(changed, begin, count, value);
    return decode_report_parameters(changed).error().message;
  };
  EXPECT_THAT(with(0, 8, 57), HasSubstr("NID_PACKET = 57"));
  EXPECT_THAT(with(8, 2, 3), HasSubstr("Q_DIR = 3 is a spare value"));
  EXPECT_THAT(with(10, 13, 57), HasSubstr("L_PACKET of packet 58 is 57 bits, but with 0 locations it must be 56"));
  EXPECT_THAT(with(23, 2, 3), HasSubstr("Q_SCALE = 3"));
  EXPECT_THAT(with(48, 3, 3), HasSubstr("M_LOC = 3"));
  EXPECT_THAT(with(51, 5, 1), HasSubstr("ends inside D_LOC"));
  auto longer = packet;
  longer.push_back(0);
  EXPECT_THAT(decode_report_parameters(longer).error().message, HasSubstr("goes on after packet 58"));
  parameters.locations.resize(32);
  EXPECT_THAT(encode(parameters).error().message, HasSubstr("at most 31"));
}

}  // namespace
}  // namespace railfix::etcs
