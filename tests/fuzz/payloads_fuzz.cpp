// What comes over a network: reports to the ground over MQTT, samples over DDS (taken apart by their IDL, and by the
// generated code), and the IDL texts of others' recordings. The first byte of the input chooses.
#include "cdr/decode.hpp"
#include "fuzz/fuzz_target.hpp"
#include "ground_link/ground_report.hpp"
#include "messaging/topics.hpp"

namespace railfix {

namespace {

using Bytes = std::span<const uint8_t>;

void ground_report(Bytes bytes) {
  const auto report = ground_link::ground_report_from(bytes);
  if (!report.ok()) return fuzz::require(!report.error().message.empty(), "a refusal says why");
  const auto again = ground_link::ground_report_from(ground_link::to_bytes(report.value()));
  fuzz::require(again.ok() && again.value() == report.value(), "a report comes back");
}

void sample(Bytes bytes) {
  if (bytes.empty()) return;
  const auto& topics = messaging::all_topics();
  const auto& topic = topics[bytes[0] % topics.size()];
  const std::vector<uint8_t> cdr(bytes.begin() + 1, bytes.end());
  const auto json = cdr::decode(cdr::own_types(), topic.type->name(), cdr);
  if (!json.ok()) fuzz::require(!json.error().message.empty(), "a refusal says why");
  const auto made = topic.type->make();
  if (!topic.type->deserialize(cdr, made.get())) return;
  const auto written = topic.type->serialize(made.get());
  fuzz::require(cdr::decode(cdr::own_types(), topic.type->name(), written).ok(), "what was read can be written");
}

void idl(Bytes text) {
  cdr::Types types;
  const auto status = types.add({reinterpret_cast<const char*>(text.data()), text.size()});
  if (!status.ok()) fuzz::require(!status.error().message.empty(), "a refusal says why");
  const std::vector<uint8_t> zeros(64);
  (void)cdr::decode(types, "a::B", zeros);
}

}  // namespace

}  // namespace railfix

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
  if (size == 0) return 0;
  const std::span<const uint8_t> rest{data + 1, size - 1};
  switch (data[0] % 3) {
    case 0:
      railfix::ground_report(rest);
      break;
    case 1:
      railfix::sample(rest);
      break;
    default:
      railfix::idl(rest);
  }
  return 0;
}
