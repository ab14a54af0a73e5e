#include "etcs/train_position_report.hpp"

#include <array>
#include <cmath>

#include "core/joined.hpp"
#include "etcs/layout.hpp"

namespace railfix::etcs {

namespace {

constexpr size_t kLongestMessageBytes = kLMessage.limit();

class BitCounter {
 public:
  void field(const Field& field, uint32_t /*value*/) { bits_ += field.bits; }
  void field_if(bool present, const char* /*when*/, const Field& field, const std::optional<uint32_t>& /*value*/) {
    if (present) bits_ += field.bits;
  }
  [[nodiscard]] uint32_t bits() const { return bits_; }

 private:
  uint32_t bits_ = 0;
};

std::string number(size_t value) {
  return std::to_string(value);
}

core::Status check_position_packet(uint32_t nid_packet) {
  if (nid_packet <= 1) return {};
  return core::Error{"NID_PACKET = " + number(nid_packet) + ", but the first packet of message 136 must be 0 or 1."};
}

/// Lengths of packets 4 (M_ERROR), 5 (NID_OPERATIONAL) and 44 (at least NID_XUSER); 4 and 5 may come once.
core::Status check_other_packet(uint32_t nid_packet, size_t packet_bits, const std::vector<OtherPacket>& before) {
  const std::string packet = "Packet " + number(nid_packet);
  if (nid_packet != 4 && nid_packet != 5 && nid_packet != 44) {
    return core::Error{packet +
                       " does not belong in message 136: after the position only packets 4, 5 and 44 may follow."};
  }
  const size_t least = kPacketHeadBits + (nid_packet == 4 ? 8 : nid_packet == 5 ? 32 : 9);
  if (nid_packet == 44 ? packet_bits < least : packet_bits != least) {
    return core::Error{"L_PACKET of packet " + number(nid_packet) + " is " + number(packet_bits) +
                       " bits, but must be " + (nid_packet == 44 ? "at least " : "") + number(least) + "."};
  }
  if (packet_bits > kLPacket.limit()) return core::Error{packet + " is longer than L_PACKET can say."};
  for (const auto& other : before) {
    if (nid_packet != 44 && other.nid_packet == nid_packet) return core::Error{packet + " comes twice."};
  }
  return {};
}

core::Status write_other_packets(const std::vector<OtherPacket>& packets, BitWriter& bits) {
  std::vector<OtherPacket> before;
  for (const auto& packet : packets) {
    const size_t packet_bits = kPacketHeadBits + packet.content.size();
    const auto status = check_other_packet(packet.nid_packet, packet_bits, before);
    if (!status.ok()) return status;
    bits.write(packet.nid_packet, kNidPacket.bits);
    bits.write(static_cast<uint32_t>(packet_bits), kLPacket.bits);
    for (const bool bit : packet.content) bits.write_bit(bit);
    before.push_back(packet);
  }
  return {};
}

core::Status read_other_packet(BitReader& bits, std::vector<OtherPacket>& packets) {
  const size_t begin = bits.position();
  FieldReader reader(bits);
  OtherPacket packet;
  uint32_t l_packet = 0;
  reader.field(kNidPacket, packet.nid_packet);
  if (reader.status().ok() && packet.nid_packet == 0) {
    return core::Error{"The message goes on after its last packet (bit " + number(begin) +
                       "): at most 7 bits of padding may follow."};
  }
  reader.field(kLPacket, l_packet);
  if (!reader.status().ok()) return reader.status();
  if (auto status = check_other_packet(packet.nid_packet, l_packet, packets); !status.ok()) return status;
  const size_t content_bits = l_packet - kPacketHeadBits;
  if (content_bits > bits.left()) {
    return core::Error{"The message ends inside packet " + number(packet.nid_packet) + ": L_PACKET is " +
                       number(l_packet) + " bits, " + number(bits.left() + kPacketHeadBits) + " are there."};
  }
  packet.content.reserve(content_bits);
  for (size_t i = 0; i < content_bits; ++i) packet.content.push_back(bits.read_bit());
  packets.push_back(std::move(packet));
  return {};
}

/// NID_MESSAGE, L_MESSAGE, T_TRAIN, NID_ENGINE.
core::Status read_header(BitReader& bits, size_t message_bytes, TrainPositionReport& report) {
  FieldReader reader(bits);  // none of its values is spare
  uint32_t nid_message = 0;
  uint32_t l_message = 0;
  reader.field(kNidMessage, nid_message);
  if (reader.status().ok() && nid_message != kNidMessagePositionReport) {
    return core::Error{"NID_MESSAGE = " + number(nid_message) + ", but a train position report is message 136."};
  }
  reader.field(kLMessage, l_message);
  if (reader.status().ok() && l_message != message_bytes) {
    return core::Error{"L_MESSAGE says " + number(l_message) + " bytes, but the message has " + number(message_bytes) +
                       "."};
  }
  visit_header(report, reader);
  return reader.status();
}

core::Status read_position(BitReader& bits, Baseline baseline, std::vector<SpareValue>* spare,
                           TrainPositionReport& report) {
  FieldReader reader(bits, spare);
  uint32_t l_packet = 0;
  reader.field(kNidPacket, report.nid_packet);
  if (!reader.status().ok()) return reader.status();
  if (auto status = check_position_packet(report.nid_packet); !status.ok()) return status;
  reader.field(kLPacket, l_packet);
  visit_position(report, baseline, reader);
  if (!reader.status().ok()) return reader.status();
  const uint32_t expected = position_packet_bits(report, baseline);
  if (l_packet == expected) return {};
  return core::Error{"L_PACKET of packet " + number(report.nid_packet) + " is " + number(l_packet) +
                     " bits, but with these fields it must be " + number(expected) + " in Baseline " +
                     number(static_cast<size_t>(baseline)) + "."};
}

core::Result<TrainPositionReport> read_message(std::span<const uint8_t> message, Baseline baseline,
                                               std::vector<SpareValue>* spare) {
  if (message.empty()) return core::Error{"The message is empty."};
  BitReader bits(message);
  TrainPositionReport report;
  if (const auto status = read_header(bits, message.size(), report); !status.ok()) return status.error();
  if (const auto status = read_position(bits, baseline, spare, report); !status.ok()) return status.error();
  while (bits.left() >= 8) {
    if (const auto status = read_other_packet(bits, report.other_packets); !status.ok()) return status.error();
  }
  if (const auto status = read_padding(bits); !status.ok()) return status.error();
  return report;
}

}  // namespace

uint32_t position_packet_bits(const TrainPositionReport& report, Baseline baseline) {
  BitCounter counter;
  visit_position(report, baseline, counter);
  return counter.bits() + kPacketHeadBits;
}

core::Result<std::vector<uint8_t>> encode(const TrainPositionReport& report, Baseline baseline) {
  if (const auto status = check_position_packet(report.nid_packet); !status.ok()) return status.error();
  BitWriter body;  // measured first, because L_MESSAGE stands in front of it
  BitWriter bits;
  for (BitWriter* pass : {&body, &bits}) {
    FieldWriter writer(*pass);
    writer.field(kNidMessage, kNidMessagePositionReport);
    writer.field(kLMessage, static_cast<uint32_t>(body.bytes().size()));
    visit_header(report, writer);
    writer.field(kNidPacket, report.nid_packet);
    writer.field(kLPacket, position_packet_bits(report, baseline));
    visit_position(report, baseline, writer);
    if (!writer.status().ok()) return writer.status().error();
    if (const auto status = write_other_packets(report.other_packets, *pass); !status.ok()) return status.error();
    if (pass->bytes().size() > kLongestMessageBytes) {
      return core::Error{"The message has " + number(pass->bytes().size()) +
                         " bytes, more than L_MESSAGE can say (1023)."};
    }
  }
  return bits.bytes();
}

size_t message_bytes(const TrainPositionReport& report, Baseline baseline) {
  BitCounter header;
  header.field(kNidMessage, 0);
  header.field(kLMessage, 0);
  visit_header(report, header);
  size_t bits = header.bits() + position_packet_bits(report, baseline);
  for (const auto& packet : report.other_packets) bits += kPacketHeadBits + packet.content.size();
  return (bits + 7) / 8;
}

core::Result<TrainPositionReport> decode(std::span<const uint8_t> message, Baseline baseline) {
  return read_message(message, baseline, nullptr);
}

core::Result<TrainPositionReport> decode_with_spare(std::span<const uint8_t> message, Baseline baseline,
                                                    std::vector<SpareValue>& spare) {
  spare.clear();
  return read_message(message, baseline, &spare);
}

core::Result<TrainPositionReport> decode_or_advise(std::span<const uint8_t> message, Baseline baseline,
                                                   const std::string& option) {
  auto report = decode(message, baseline);
  if (report.ok()) return report;
  const auto other = baseline == Baseline::b3 ? Baseline::b4 : Baseline::b3;
  if (!decode(message, other).ok()) return report;
  return core::Error{report.error().message + " It reads well as " + option + " " + number(static_cast<int>(other)) +
                     "."};
}

std::string said_of_no_group(const TrainPositionReport& report) {
  const bool has_group = names_group(report.nid_lrbg);
  const uint32_t previous = report.nid_prvlrbg.value_or(kUnknownBaliseGroup);
  const bool has_direction = has_group && (report.nid_packet != 1 || names_group(previous));
  std::vector<std::string> said;
  const auto look = [&said](bool has_relation, const char* field, uint32_t value, uint32_t unknown) {
    if (!has_relation && value != unknown) said.push_back(std::string(field) + " = " + number(value));
  };
  look(has_group, "D_LRBG", report.d_lrbg, kUnknownDistance);
  look(has_direction, "Q_DIRLRBG", report.q_dirlrbg, kUnknownSide);
  look(has_direction, "Q_DLRBG", report.q_dlrbg, kUnknownSide);
  look(has_group, "L_DOUBTOVER", report.l_doubtover, kUnknownDistance);
  look(has_group, "L_DOUBTUNDER", report.l_doubtunder, kUnknownDistance);
  look(has_direction, "Q_DIRTRAIN", report.q_dirtrain, kUnknownSide);
  if (said.empty()) return "";
  const std::string unknown = has_group ? "a group before the LRBG that is unknown (NID_PRVLRBG = " + number(previous)
                                        : "an LRBG that is unknown (NID_LRBG = " + number(report.nid_lrbg);
  return "nothing is said by " + core::joined(said) + ", in relation to " + unknown + ").";
}

double scale_m(uint32_t q_scale) {
  constexpr std::array<double, 3> kScales{0.1, 1.0, 10.0};
  return kScales.at(q_scale);
}

double metres(uint32_t raw, uint32_t q_scale) {
  return std::round(raw * scale_m(q_scale) * 10) / 10;
}

std::optional<double> metres_if_known(uint32_t raw, uint32_t q_scale) {
  return raw == kUnknownDistance ? std::nullopt : std::optional(metres(raw, q_scale));
}

core::Result<std::vector<uint8_t>> parse_hex(const std::string& text) {
  const auto digit = [](char c) -> int {
    if (c >= '0' && c <= '9') return c - '0';
    if (c >= 'a' && c <= 'f') return c - 'a' + 10;
    if (c >= 'A' && c <= 'F') return c - 'A' + 10;
    return -1;
  };
  std::vector<uint8_t> bytes;
  for (size_t i = 0; i < text.size();) {
    if (text[i] == ' ' && !bytes.empty()) {
      ++i;
      continue;
    }
    for (size_t k = i; k < std::min(i + 2, text.size()); ++k) {
      if (digit(text[k]) < 0) {
        return core::Error{"Character " + number(k + 1) + " ('" + std::string(1, text[k]) +
                           "') is not a hexadecimal digit."};
      }
    }
    if (i + 1 == text.size())
      return core::Error{"The hexadecimal text has an odd number of digits: half of the last byte is missing."};
    bytes.push_back(static_cast<uint8_t>(digit(text[i]) * 16 + digit(text[i + 1])));
    i += 2;
  }
  if (bytes.empty()) return core::Error{"The hexadecimal text is empty."};
  return bytes;
}

std::string to_hex(std::span<const uint8_t> bytes) {
  constexpr const char* kDigits = "0123456789ABCDEF";
  std::string text;
  for (const uint8_t byte : bytes) {
    text += kDigits[byte >> 4U];
    text += kDigits[byte & 15U];
  }
  return text;
}

}  // namespace railfix::etcs
