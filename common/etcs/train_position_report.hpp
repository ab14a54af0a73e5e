// Message 136 "Train Position Report" with packet 0 or 1, bit-exact (SUBSET-026 chapters 7 and 8, issues 3.x
// and 4.0.0). Members hold the raw field values and have the standard's names in lower case.
#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "core/result.hpp"
#include "etcs/field.hpp"

namespace railfix::etcs {

constexpr uint32_t kNidMessagePositionReport = 136;
constexpr uint32_t kUnknownBaliseGroup = 16777215;
constexpr unsigned kNidBgBits = 14;  // of NID_LRBG, below NID_C
constexpr uint32_t kUnknownNidBg =
    16383;  // "unknown", whatever NID_C stands beside it; kUnknownBaliseGroup has it, too
constexpr uint32_t kUnknownDistance = 32767;  // D_LRBG, L_DOUBTOVER, L_DOUBTUNDER; also farther than 327.66 km
constexpr uint32_t kUnknownTime = 4294967295;
constexpr uint32_t kStandstillSpeed = 127;  // V_TRAIN of 4.0.0
constexpr uint32_t kSpeedStepKmh = 5;       // of V_TRAIN
// Q_LENGTH, Q_INTEGRITY of 4.0.0: train integrity.
constexpr uint32_t kNoIntegrityInformation = 0;
constexpr uint32_t kConfirmedByDevice = 1;
constexpr uint32_t kConfirmedByDriver = 2;
constexpr uint32_t kIntegrityLost = 3;

enum Side : uint32_t { kReverse = 0, kNominal = 1, kUnknownSide = 2 };  // Q_DIRLRBG, Q_DLRBG, Q_DIRTRAIN
enum Level : uint32_t { kLevel0 = 0, kLevelNtc = 1, kLevel1 = 2, kLevel2 = 3, kLevel3 = 4 };

/// Packets 4 (error reporting), 5 (train running number) and 44 (external data) are kept bit by bit.
struct OtherPacket {
  uint32_t nid_packet = 0;
  std::vector<bool> content;  // everything after L_PACKET
  bool operator==(const OtherPacket&) const = default;
};

struct TrainPositionReport {
  uint32_t t_train = kUnknownTime;  // 10 ms
  uint32_t nid_engine = 0;
  uint32_t nid_packet = 0;  // 0 or 1
  uint32_t q_scale = 1;     // 0 = 10 cm, 1 = 1 m, 2 = 10 m
  uint32_t nid_lrbg = kUnknownBaliseGroup;
  std::optional<uint32_t> nid_prvlrbg;  // packet 1 only
  uint32_t d_lrbg = kUnknownDistance;
  uint32_t q_dirlrbg = kUnknownSide;
  uint32_t q_dlrbg = kUnknownSide;
  uint32_t l_doubtover = kUnknownDistance;
  uint32_t l_doubtunder = kUnknownDistance;
  uint32_t q_length = 0;               // Q_INTEGRITY in 4.0.0
  std::optional<uint32_t> l_trainint;  // 1 m; only with q_length 1 or 2
  uint32_t v_train = 0;                // 5 km/h
  uint32_t q_dirtrain = kUnknownSide;
  uint32_t m_mode = 0;
  uint32_t m_level = kLevel2;
  std::optional<uint32_t> nid_ntc;  // only with level NTC
  std::vector<OtherPacket> other_packets;
  bool operator==(const TrainPositionReport&) const = default;
};

/// The message in whole bytes, or why it cannot be built (value out of range, spare, missing or not allowed).
core::Result<std::vector<uint8_t>> encode(const TrainPositionReport& report, Baseline baseline);

/// Only a message that encode() would give back byte by byte is accepted; for every other one sentence says what is
/// wrong.
core::Result<TrainPositionReport> decode(std::span<const uint8_t> message, Baseline baseline);

/// decode() that takes spare values, too, and lists them: nothing else can be done with such a report but to print it.
core::Result<TrainPositionReport> decode_with_spare(std::span<const uint8_t> message, Baseline baseline,
                                                    std::vector<SpareValue>& spare);

/// decode(); where it refuses a message of the other baseline, the sentence ends with "It reads well as `option` 4.",
/// or 3.
core::Result<TrainPositionReport> decode_or_advise(std::span<const uint8_t> message, Baseline baseline,
                                                   const std::string& option);

constexpr uint32_t nid_c_of(uint32_t nid_lrbg) {
  return nid_lrbg >> kNidBgBits;
}
constexpr uint32_t nid_bg_of(uint32_t nid_lrbg) {
  return nid_lrbg & ((1U << kNidBgBits) - 1);
}
/// NID_LRBG or NID_PRVLRBG is of a group.
constexpr bool names_group(uint32_t nid_lrbg) {
  return nid_bg_of(nid_lrbg) != kUnknownNidBg;
}

/// What stands in relation to the LRBG (its distance, sides and doubts) says nothing where that is unknown, and in
/// packet 1 the sides nothing where NID_PRVLRBG is: a sentence that names such fields, empty without any. encode() and
/// decode() carry them, because any train may say so.
std::string said_of_no_group(const TrainPositionReport& report);

/// L_PACKET of packet 0 or 1 of this report in bits. REQUIRES: encode() accepts the report.
uint32_t position_packet_bits(const TrainPositionReport& report, Baseline baseline);

/// L_MESSAGE in bytes, spare values or not.
size_t message_bytes(const TrainPositionReport& report, Baseline baseline);

/// Metres per step of a distance, by Q_SCALE (0 to 2).
double scale_m(uint32_t q_scale);
/// What a distance of the message says: 3 of 10 cm are 0.3, which 3 * scale_m(0) is not.
double metres(uint32_t raw, uint32_t q_scale);
/// The same of a distance that may be unknown.
std::optional<double> metres_if_known(uint32_t raw, uint32_t q_scale);
/// "A5 0F" -> bytes; digits in pairs, spaces between pairs allowed.
core::Result<std::vector<uint8_t>> parse_hex(const std::string& text);
std::string to_hex(std::span<const uint8_t> bytes);

}  // namespace railfix::etcs
