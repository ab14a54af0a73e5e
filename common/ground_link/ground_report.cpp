#include "ground_link/ground_report.hpp"

#include "idl/ground_link.pb.h"

namespace railfix::ground_link {

std::vector<uint8_t> to_bytes(const GroundReport& report) {
  ground::GroundReport proto;
  proto.set_train(report.train);
  proto.set_stream(report.stream);
  proto.set_sequence(report.sequence);
  proto.set_stamp_ns(report.stamp_ns);
  proto.set_sent_ns(report.sent_ns);
  proto.set_baseline(report.baseline);
  proto.set_reason(report.reason);
  proto.set_host(report.host);
  proto.set_message(report.message.data(), report.message.size());
  std::vector<uint8_t> bytes(proto.ByteSizeLong());
  proto.SerializeToArray(bytes.data(), static_cast<int>(bytes.size()));
  return bytes;
}

core::Result<GroundReport> ground_report_from(std::span<const uint8_t> bytes) {
  ground::GroundReport proto;
  if (!proto.ParseFromArray(bytes.data(), static_cast<int>(bytes.size())))
    return core::Error{"These " + std::to_string(bytes.size()) + " bytes are no GroundReport (idl/ground_link.proto)."};
  if (proto.baseline() != 3 && proto.baseline() != 4)
    return core::Error{"Baseline " + std::to_string(proto.baseline()) + " of a GroundReport is not 3 or 4."};
  if (proto.message().empty()) return core::Error{"A GroundReport has no message."};
  GroundReport report;
  report.train = proto.train();
  report.stream = proto.stream();
  report.sequence = proto.sequence();
  report.stamp_ns = proto.stamp_ns();
  report.sent_ns = proto.sent_ns();
  report.baseline = proto.baseline();
  report.reason = proto.reason();
  report.host = proto.host();
  report.message.assign(proto.message().begin(), proto.message().end());
  return report;
}

}  // namespace railfix::ground_link
