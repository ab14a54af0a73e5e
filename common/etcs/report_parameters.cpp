#include "etcs/report_parameters.hpp"

#include <string>

#include "etcs/layout.hpp"

namespace railfix::etcs {

namespace {

constexpr uint32_t kBaseBits = 56;
constexpr uint32_t kLocationBits = 16;

core::Result<ReportParameters> read_packet(std::span<const uint8_t> packet, std::vector<SpareValue>* spare) {
  BitReader bits(packet);
  FieldReader reader(bits, spare);
  ReportParameters parameters;
  uint32_t nid_packet = 0;
  uint32_t l_packet = 0;
  uint32_t count = 0;
  reader.field(kNidPacket, nid_packet);
  if (reader.status().ok() && nid_packet != kNidPacketReportParameters) {
    return core::Error{"NID_PACKET = " + std::to_string(nid_packet) +
                       ", but position report parameters are packet 58."};
  }
  reader.field(kQDir, parameters.q_dir);
  reader.field(kLPacket, l_packet);
  visit_cycles(parameters, reader);
  reader.field(kNIter, count);
  for (uint32_t i = 0; i < count && reader.status().ok(); ++i)
    visit_location(parameters.locations.emplace_back(), reader);
  if (!reader.status().ok()) return reader.status().error();
  if (l_packet != bits.position()) {
    return core::Error{"L_PACKET of packet 58 is " + std::to_string(l_packet) + " bits, but with " +
                       std::to_string(count) + " locations it must be " + std::to_string(bits.position()) + "."};
  }
  if (bits.left() >= 8) {
    return core::Error{"The text goes on after packet 58 (bit " + std::to_string(bits.position()) +
                       "): at most 7 bits of padding may follow."};
  }
  if (const auto status = read_padding(bits); !status.ok()) return status.error();
  return parameters;
}

}  // namespace

uint32_t packet_bits(const ReportParameters& parameters) {
  return kBaseBits + static_cast<uint32_t>(parameters.locations.size()) * kLocationBits;
}

core::Result<std::vector<uint8_t>> encode(const ReportParameters& parameters) {
  if (parameters.locations.size() > kNIter.limit()) {
    return core::Error{"Packet 58 holds at most 31 locations, not " + std::to_string(parameters.locations.size()) +
                       "."};
  }
  const auto count = static_cast<uint32_t>(parameters.locations.size());
  BitWriter bits;
  FieldWriter writer(bits);
  writer.field(kNidPacket, kNidPacketReportParameters);
  writer.field(kQDir, parameters.q_dir);
  writer.field(kLPacket, packet_bits(parameters));
  visit_cycles(parameters, writer);
  writer.field(kNIter, count);
  for (const auto& location : parameters.locations) visit_location(location, writer);
  if (!writer.status().ok()) return writer.status().error();
  return bits.bytes();
}

core::Result<ReportParameters> decode_report_parameters(std::span<const uint8_t> packet) {
  return read_packet(packet, nullptr);
}

core::Result<ReportParameters> decode_report_parameters_with_spare(std::span<const uint8_t> packet,
                                                                   std::vector<SpareValue>& spare) {
  spare.clear();
  return read_packet(packet, &spare);
}

}  // namespace railfix::etcs
