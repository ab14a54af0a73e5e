#include "etcs/train_position_report.hpp"

#include <gmock/gmock.h>

#include "unit/etcs/random_report.hpp"

namespace railfix::etcs {
namespace {

using ::testing::HasSubstr;
using testing::random_report;
using testing::set_bits;

// Two independent encoders agree on this message.
constexpr const char* kCheckVector = "880601D6F345402AF34000E48F68EB84D250014010C38830";

TrainPositionReport check_report() {
  TrainPositionReport report;
  report.t_train = 123456789;
  report.nid_engine = 0x00ABCD;
  report.nid_lrbg = 123U << 14U | 4567U;
  report.d_lrbg = 1234;
  report.q_dirlrbg = kNominal;
  report.q_dlrbg = kNominal;
  report.l_doubtover = 10;
  report.l_doubtunder = 67;
  report.v_train = 28;
  report.q_dirtrain = kNominal;
  return report;
}

std::vector<uint8_t> bytes_of(const TrainPositionReport& report, Baseline baseline = Baseline::b3) {
  return encode(report, baseline).value();
}
std::string refusal(const std::vector<uint8_t>& message, Baseline baseline = Baseline::b3) {
  const auto decoded = decode(message, baseline);
  return decoded.ok() ? "accepted" : decoded.error().message;
}
std::string encode_refusal(const TrainPositionReport& report, Baseline baseline = Baseline::b3) {
  const auto encoded = encode(report, baseline);
  return encoded.ok() ? "accepted" : encoded.error().message;
}

TEST(TrainPositionReport, EncodesTheCheckVector) {
  EXPECT_EQ(to_hex(bytes_of(check_report())), kCheckVector);
}

TEST(TrainPositionReport, DecodesTheCheckVector) {
  EXPECT_EQ(decode(parse_hex(kCheckVector).value(), Baseline::b3).value(), check_report());
}

TEST(TrainPositionReport, PacketLengthsAreThoseOfTheStandard) {
  for (const auto& [baseline, base] : {std::pair{Baseline::b3, 114U}, {Baseline::b4, 115U}}) {
    auto report = check_report();
    EXPECT_EQ(position_packet_bits(report, baseline), base);
    report.m_level = kLevelNtc;
    report.nid_ntc = 7;
    EXPECT_EQ(position_packet_bits(report, baseline), base + 8);
    report.q_length = 2;
    report.l_trainint = 400;
    EXPECT_EQ(position_packet_bits(report, baseline), base + 23);
    report.nid_packet = 1;
    report.nid_prvlrbg = 99;
    EXPECT_EQ(position_packet_bits(report, baseline), base + 47);
  }
}

TEST(TrainPositionReport, BaselinesDifferInTheModeField) {
  auto report = check_report();
  report.m_mode = 17;
  report.v_train = kStandstillSpeed;
  EXPECT_EQ(decode(bytes_of(report, Baseline::b4), Baseline::b4).value(), report);
  EXPECT_THAT(encode_refusal(report), HasSubstr("V_TRAIN = 127 is a spare value"));
  report.v_train = 0;
  EXPECT_THAT(encode_refusal(report), HasSubstr("M_MODE = 17 does not fit"));
  EXPECT_NE(refusal(bytes_of(report, Baseline::b4)), "accepted");
}

TEST(TrainPositionReport, RandomReportsComeBack) {
  core::Random random(136);
  for (int i = 0; i < 4000; ++i) {
    const auto baseline = i % 2 == 0 ? Baseline::b3 : Baseline::b4;
    const auto report = random_report(random, baseline);
    const auto message = bytes_of(report, baseline);
    const auto decoded = decode(message, baseline);
    ASSERT_TRUE(decoded.ok()) << to_hex(message) << ": " << decoded.error().message;
    ASSERT_EQ(decoded.value(), report);
  }
}

TEST(TrainPositionReport, EveryTruncationIsRefused) {
  core::Random random(1);
  for (int i = 0; i < 200; ++i) {
    auto message = bytes_of(random_report(random, Baseline::b3));
    while (!message.empty()) {
      message.pop_back();
      ASSERT_NE(refusal(message), "accepted");
      // Also when L_MESSAGE is made to agree with what is left.
      auto relabelled = message;
      if (relabelled.size() < 3) continue;
      set_bits(relabelled, 8, 10, static_cast<uint32_t>(relabelled.size()));
      const auto decoded = decode(relabelled, Baseline::b3);
      if (decoded.ok()) {  // cut exactly between two packets
        ASSERT_EQ(bytes_of(decoded.value()), relabelled);
      }
    }
  }
}

TEST(TrainPositionReport, EverySingleBitFlipIsRefusedOrMeansAnotherMessage) {
  core::Random random(2);
  for (int i = 0; i < 100; ++i) {
    const auto baseline = i % 2 == 0 ? Baseline::b3 : Baseline::b4;
    const auto report = random_report(random, baseline);
    const auto message = bytes_of(report, baseline);
    for (size_t bit = 0; bit < message.size() * 8; ++bit) {
      auto flipped = message;
      flipped[bit / 8] = static_cast<uint8_t>(flipped[bit / 8] ^ 0x80U >> bit % 8);
      const auto decoded = decode(flipped, baseline);
      if (!decoded.ok()) continue;
      ASSERT_NE(decoded.value(), report) << "bit " << bit;
      ASSERT_EQ(bytes_of(decoded.value(), baseline), flipped) << "bit " << bit;
    }
  }
}

TEST(TrainPositionReport, NoiseNeverDecodesToSomethingElse) {
  core::Random random(3);
  for (int i = 0; i < 20000; ++i) {
    std::vector<uint8_t> message(random.next() % 60);
    for (auto& byte : message) byte = static_cast<uint8_t>(random.next());
    if (message.size() > 12) {  // so that the noise gets past the header
      set_bits(message, 0, 8, 136);
      set_bits(message, 8, 10, static_cast<uint32_t>(message.size()));
      set_bits(message, 74, 8, 0);
    }
    const auto decoded = decode(message, Baseline::b3);
    if (decoded.ok()) {
      ASSERT_EQ(bytes_of(decoded.value()), message);
    }
  }
}

TEST(TrainPositionReport, ErrorsSayWhatIsWrong) {
  const auto message = bytes_of(check_report());
  EXPECT_THAT(refusal({}), HasSubstr("empty"));
  EXPECT_THAT(refusal({0x88}), HasSubstr("ends inside L_MESSAGE"));
  const auto with = [&](size_t begin, unsigned count, uint32_t value) {
    auto changed = message;
    set_bits(changed, begin, count, value);
    return refusal(changed);
  };
  EXPECT_THAT(with(0, 8, 137), HasSubstr("NID_MESSAGE = 137"));
  EXPECT_THAT(with(8, 10, 23), HasSubstr("L_MESSAGE says 23 bytes, but the message has 24"));
  EXPECT_THAT(with(74, 8, 3), HasSubstr("NID_PACKET = 3"));
  EXPECT_THAT(with(82, 13, 115), HasSubstr("L_PACKET of packet 0 is 115 bits, but with these fields it must be 114"));
  EXPECT_THAT(with(95, 2, 3), HasSubstr("Q_SCALE = 3 is a spare value"));
  EXPECT_THAT(with(136, 2, 3), HasSubstr("Q_DIRLRBG = 3 is a spare value"));
  EXPECT_THAT(with(138, 2, 3), HasSubstr("Q_DLRBG = 3 is a spare value"));
  EXPECT_THAT(with(172, 7, 121), HasSubstr("V_TRAIN = 121 is a spare value"));
  EXPECT_THAT(with(179, 2, 3), HasSubstr("Q_DIRTRAIN = 3 is a spare value"));
  EXPECT_THAT(with(185, 3, 5), HasSubstr("M_LEVEL = 5 is a spare value"));
  EXPECT_THAT(with(170, 2, 1), HasSubstr("ends inside V_TRAIN at bit 187: 7 bits needed, 5 left"));
  EXPECT_THAT(with(188, 4, 1), HasSubstr("padding after bit 188 is not zero"));
  auto longer = message;
  longer.push_back(0);
  set_bits(longer, 8, 10, 25);
  EXPECT_THAT(refusal(longer), HasSubstr("goes on after its last packet"));
  longer.resize(27);
  set_bits(longer, 8, 10, 27);
  set_bits(longer, 188, 8, 2);
  EXPECT_THAT(refusal(longer), HasSubstr("Packet 2 does not belong in message 136"));
}

TEST(TrainPositionReport, ALengthShorterThanThePacketsOwnHeadIsToldAsItIs) {
  auto message = bytes_of(check_report());
  message.resize(30);
  set_bits(message, 8, 10, 30);
  const auto with = [&](uint32_t nid_packet, uint32_t l_packet) {
    set_bits(message, 188, 8, nid_packet);
    set_bits(message, 196, 13, l_packet);
    return refusal(message);
  };
  EXPECT_THAT(with(4, 5), HasSubstr("L_PACKET of packet 4 is 5 bits, but must be 29."));
  EXPECT_THAT(with(5, 0), HasSubstr("L_PACKET of packet 5 is 0 bits, but must be 53."));
  EXPECT_THAT(with(44, 20), HasSubstr("L_PACKET of packet 44 is 20 bits, but must be at least 30."));
  EXPECT_THAT(with(44, 22), HasSubstr("L_PACKET of packet 44 is 22 bits, but must be at least 30."));
}

TEST(TrainPositionReport, OtherPacketsAreChecked) {
  auto report = check_report();
  report.other_packets = {{4, std::vector<bool>(8)}, {4, std::vector<bool>(8)}};
  EXPECT_THAT(encode_refusal(report), HasSubstr("Packet 4 comes twice"));
  report.other_packets = {{5, std::vector<bool>(31)}};
  EXPECT_THAT(encode_refusal(report), HasSubstr("L_PACKET of packet 5 is 52 bits, but must be 53"));
  report.other_packets = {{44, std::vector<bool>(8)}};
  EXPECT_THAT(encode_refusal(report), HasSubstr("at least 30"));
  report.other_packets = {{44, std::vector<bool>(8000)}, {44, std::vector<bool>(30)}};
  EXPECT_THAT(encode_refusal(report), HasSubstr("more than L_MESSAGE can say"));
  report.other_packets = {{44, std::vector<bool>(9000)}};
  EXPECT_THAT(encode_refusal(report), HasSubstr("longer than L_PACKET can say"));
}

TEST(TrainPositionReport, EncoderRefusesWhatDoesNotBelongTogether) {
  auto report = check_report();
  report.nid_packet = 1;
  EXPECT_THAT(encode_refusal(report), HasSubstr("NID_PRVLRBG is missing"));
  report = check_report();
  report.nid_ntc = 1;
  EXPECT_THAT(encode_refusal(report), HasSubstr("NID_NTC must not be there"));
  report = check_report();
  report.d_lrbg = 32768;
  EXPECT_THAT(encode_refusal(report), HasSubstr("D_LRBG = 32768 does not fit: its range is 0 to 32767"));
  report = check_report();
  report.nid_packet = 2;
  EXPECT_THAT(encode_refusal(report), HasSubstr("NID_PACKET = 2"));
}

TEST(TrainPositionReport, TheOtherBaselineIsAdvisedWhereItFits) {
  const auto message = encode(check_report(), Baseline::b3).value();
  EXPECT_TRUE(decode_or_advise(message, Baseline::b3, "--baseline").ok());
  EXPECT_THAT(decode_or_advise(message, Baseline::b4, "--baseline").error().message,
              ::testing::EndsWith(" It reads well as --baseline 3."));
  const std::vector<uint8_t> short_one{136};
  EXPECT_EQ(decode_or_advise(short_one, Baseline::b3, "--baseline").error().message,
            decode(short_one, Baseline::b3).error().message);
}

TEST(Hex, IsReadStrictly) {
  EXPECT_EQ(parse_hex("A5 0f").value(), (std::vector<uint8_t>{0xA5, 0x0F}));
  EXPECT_THAT(parse_hex("A5G0").error().message, HasSubstr("Character 3 ('G')"));
  EXPECT_THAT(parse_hex("A50").error().message, HasSubstr("odd number"));
  EXPECT_THAT(parse_hex("A 50").error().message, HasSubstr("Character 2"));
  EXPECT_THAT(parse_hex("").error().message, HasSubstr("empty"));
}

TEST(TrainPositionReport, WhatIsSaidOfAnUnknownGroupIsTold) {
  TrainPositionReport report;
  EXPECT_EQ(said_of_no_group(report), "");
  const auto said = [&](uint32_t TrainPositionReport::*field) {
    TrainPositionReport known = report;
    known.*field = 1;
    EXPECT_EQ(decode(encode(known, Baseline::b3).value(), Baseline::b3).value(), known);
    const std::string message = said_of_no_group(known);
    known.nid_lrbg = 7;
    EXPECT_EQ(said_of_no_group(known), "");
    known.nid_lrbg = 123U << kNidBgBits | kUnknownNidBg;
    EXPECT_NE(said_of_no_group(known), "");
    const std::string before = "nothing is said by ";
    EXPECT_THAT(message, ::testing::StartsWith(before));
    return message.substr(before.size(), message.find(" = ") - before.size());
  };
  EXPECT_EQ(said(&TrainPositionReport::d_lrbg), "D_LRBG");
  EXPECT_EQ(said(&TrainPositionReport::q_dirlrbg), "Q_DIRLRBG");
  EXPECT_EQ(said(&TrainPositionReport::q_dlrbg), "Q_DLRBG");
  EXPECT_EQ(said(&TrainPositionReport::l_doubtover), "L_DOUBTOVER");
  EXPECT_EQ(said(&TrainPositionReport::l_doubtunder), "L_DOUBTUNDER");
  EXPECT_EQ(said(&TrainPositionReport::q_dirtrain), "Q_DIRTRAIN");
}

// Of a single balise the sides are relative to the group before it.
TEST(TrainPositionReport, SidesOfPacket1SayNothingWithoutAGroupBefore) {
  TrainPositionReport report;
  report.nid_lrbg = 7;
  report.d_lrbg = 20;
  report.l_doubtover = report.l_doubtunder = 3;
  report.nid_packet = 1;
  report.nid_prvlrbg = kUnknownBaliseGroup;
  EXPECT_EQ(said_of_no_group(report), "");
  report.q_dirtrain = kNominal;
  EXPECT_EQ(said_of_no_group(report),
            "nothing is said by Q_DIRTRAIN = 1, in relation to a group before the LRBG that is unknown (NID_PRVLRBG = "
            "16777215).");
  report.nid_prvlrbg = 6;
  EXPECT_EQ(said_of_no_group(report), "");
}

TEST(TrainPositionReport, MetresAreThoseThatTheFieldSays) {
  EXPECT_EQ(metres(3, 0), 0.3);
  EXPECT_EQ(metres(12, 0), 1.2);
  EXPECT_EQ(metres(32766, 0), 3276.6);
  EXPECT_EQ(metres(12, 1), 12);
  EXPECT_EQ(metres(32766, 2), 327660);
}

TEST(TrainPositionReport, AGroupIsNamedByItsOwnNumber) {
  EXPECT_TRUE(names_group(0));
  EXPECT_TRUE(names_group(1023U << kNidBgBits | 16382U));
  EXPECT_FALSE(names_group(kUnknownNidBg));
  EXPECT_FALSE(names_group(kUnknownBaliseGroup));
}

}  // namespace
}  // namespace railfix::etcs
