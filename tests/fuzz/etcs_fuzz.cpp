// Message 136 and packet 58: from bits, from fields, from JSON and from hexadecimal text. The first byte of the input
// chooses.
#include <nlohmann/json.hpp>

#include "core/json_text.hpp"
#include "etcs/report_json.hpp"
#include "etcs/report_parameters.hpp"
#include "fuzz/fuzz_target.hpp"
#include "unit/etcs/random_report.hpp"

namespace railfix::etcs {

namespace {

using fuzz::require;
using Bytes = std::span<const uint8_t>;

bool same(Bytes a, Bytes b) {
  return std::equal(a.begin(), a.end(), b.begin(), b.end());
}

/// decode() accepts only what encode() gives back byte by byte; JSON says the same.
void from_bits(Bytes message, Baseline baseline) {
  const auto report = decode(message, baseline);
  if (!report.ok()) return require(!report.error().message.empty(), "a refusal says why");
  const auto again = encode(report.value(), baseline);
  require(again.ok() && same(again.value(), message), "encode(decode(x)) = x");
  const auto back = report_from_json(to_json(report.value(), baseline), baseline);
  require(back.ok() && back.value() == report.value(), "JSON says the same");
}

void packet_58(Bytes packet) {
  const auto parameters = decode_report_parameters(packet);
  if (!parameters.ok()) return require(!parameters.error().message.empty(), "a refusal says why");
  const auto again = encode(parameters.value());
  require(again.ok() && same(again.value(), packet), "encode(decode(x)) = x for packet 58");
}

/// Every valid report is encoded and comes back.
void from_fields(fuzz::Choices& choices, Baseline baseline) {
  const auto report = testing::random_report(choices, baseline);
  const auto message = encode(report, baseline);
  require(message.ok(), "valid fields are encoded");
  const auto back = decode(message.value(), baseline);
  require(back.ok() && back.value() == report, "decode(encode(fields)) = fields");
}

void parameters_from_fields(fuzz::Choices& choices) {
  const auto parameters = testing::random_parameters(choices);
  const auto packet = encode(parameters);
  require(packet.ok(), "valid parameters are encoded");
  const auto back = decode_report_parameters(packet.value());
  require(back.ok() && back.value() == parameters, "decode(encode(parameters)) = parameters");
}

void from_json_text(Bytes text, Baseline baseline) {
  const auto json = core::parse_json<nlohmann::ordered_json>({reinterpret_cast<const char*>(text.data()), text.size()});
  if (!json.ok()) return require(!json.error().message.empty(), "a refusal says why");
  const auto report = report_from_json(json.value(), baseline);
  if (!report.ok()) return require(!report.error().message.empty(), "a refusal says why");
  const auto message = encode(report.value(), baseline);
  require(message.ok(), "what JSON gave can be encoded");
  from_bits(message.value(), baseline);
}

void from_hex(Bytes text) {
  const auto bytes = parse_hex({text.begin(), text.end()});
  if (!bytes.ok()) return require(!bytes.error().message.empty(), "a refusal says why");
  require(parse_hex(to_hex(bytes.value())).value() == bytes.value(), "hexadecimal digits come back");
  from_bits(bytes.value(), Baseline::b3);
}

}  // namespace

}  // namespace railfix::etcs

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
  using namespace railfix::etcs;
  railfix::fuzz::Choices choices({data, size});
  const uint8_t choice = choices.byte();
  const auto baseline = choice % 2 == 0 ? Baseline::b3 : Baseline::b4;
  switch (choice / 2 % 6) {
    case 0:
      from_bits(choices.rest(), baseline);
      break;
    case 1:
      packet_58(choices.rest());
      break;
    case 2:
      from_fields(choices, baseline);
      break;
    case 3:
      parameters_from_fields(choices);
      break;
    case 4:
      from_json_text(choices.rest(), baseline);
      break;
    default:
      from_hex(choices.rest());
  }
  return 0;
}
