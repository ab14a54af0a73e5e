#include "etcs/report_json.hpp"

#include <nlohmann/json.hpp>
#include <set>

#include "etcs/layout.hpp"

namespace railfix::etcs {

namespace {

using Json = nlohmann::ordered_json;

constexpr Field kNidC = full_field("NID_C", 10);
constexpr Field kNidBg = full_field("NID_BG", kNidBgBits);

class JsonWriter {
 public:
  explicit JsonWriter(Json& json) : json_(json) {}
  void field(const Field& field, uint32_t value) {
    json_[field.name] = value;
    if (std::string_view(field.name) == "NID_LRBG") {
      json_[kNidC.name] = value >> kNidBg.bits;
      json_[kNidBg.name] = value & kNidBg.limit();
    }
  }
  void field_if(bool present, const char* /*when*/, const Field& field, const std::optional<uint32_t>& value) {
    if (present) this->field(field, value.value());
  }

 private:
  Json& json_;
};

/// Takes keys out of an object; what is left at the end is unknown. The first error stays.
class JsonReader {
 public:
  explicit JsonReader(const Json& json) : json_(json) {}

  void field(const Field& field, uint32_t& value) {
    if (const auto found = optional(field)) {
      value = *found;
    } else if (status_.ok()) {
      status_ = core::Error{std::string(field.name) + " is missing."};
    }
  }
  void field_if(bool present, const char* when, const Field& field, std::optional<uint32_t>& value) {
    value = optional(field);
    if (!status_.ok() || present == value.has_value()) return;
    status_ = core::Error{std::string(field.name) +
                          (present ? " is missing: it must be there with " : " goes only with ") + when + "."};
  }
  std::optional<uint32_t> optional(const Field& field) {
    const auto found = json_.find(key_of(field));
    if (!status_.ok() || found == json_.end()) return std::nullopt;
    used_.insert(found.key());
    const bool negative = !found->is_number_unsigned() && found->is_number_integer() && found->get<int64_t>() < 0;
    if (!found->is_number_integer() || negative || found->get<uint64_t>() > field.limit()) {
      status_ = core::Error{found.key() + " = " + found->dump() + " must be a whole number from 0 to " +
                            std::to_string(field.limit()) + "."};
      return std::nullopt;
    }
    const auto value = found->get<uint32_t>();
    if (!field.meaningful(value))
      status_ = core::Error{found.key() + " = " + std::to_string(value) + " is a spare value."};
    return value;
  }
  /// A length or name that the encoder knows anyway.
  void expect(const Field& field, uint32_t expected) {
    const auto value = optional(field);
    if (!status_.ok() || !value || *value == expected) return;
    status_ = core::Error{std::string(field.name) + " = " + std::to_string(*value) +
                          ", but with these fields it must be " + std::to_string(expected) + "."};
  }
  void use(const std::string& key) { used_.insert(key); }
  void fail(const core::Error& error) {
    if (status_.ok()) status_ = error;
  }
  core::Status finish() {
    for (const auto& item : json_.items()) {
      if (!used_.contains(item.key())) fail({"Key \"" + item.key() + "\" is not a field of this message."});
    }
    return status_;
  }
  [[nodiscard]] const core::Status& status() const { return status_; }

 private:
  /// Q_LENGTH and Q_INTEGRITY are the same field before and since 4.0.0.
  [[nodiscard]] std::string key_of(const Field& field) const {
    const std::string name = field.name;
    if (name == "Q_INTEGRITY" && !json_.contains(name)) return "Q_LENGTH";
    if (name == "Q_LENGTH" && !json_.contains(name)) return "Q_INTEGRITY";
    return name;
  }

  const Json& json_;
  std::set<std::string> used_;
  core::Status status_;
};

std::string text_of(const std::vector<bool>& bits) {
  std::string text;
  for (const bool bit : bits) text += bit ? '1' : '0';
  return text;
}

core::Result<OtherPacket> packet_from_json(const Json& json) {
  if (!json.is_object()) return core::Error{"An entry of \"packets\" is not a JSON object."};
  JsonReader reader(json);
  OtherPacket packet;
  reader.field(kNidPacket, packet.nid_packet);
  const auto content = json.find("content");
  if (content == json.end() || !content->is_string()) {
    reader.fail({"An entry of \"packets\" needs \"content\": the bits after L_PACKET as a text of 0 and 1."});
  } else {
    reader.use("content");
    for (const char bit : content->get<std::string>()) {
      if (bit != '0' && bit != '1') reader.fail({"\"content\" of a packet holds other characters than 0 and 1."});
      packet.content.push_back(bit == '1');
    }
  }
  reader.expect(kLPacket, static_cast<uint32_t>(packet.content.size()) + kPacketHeadBits);
  if (const auto status = reader.finish(); !status.ok()) return status.error();
  return packet;
}

/// Empty where the key is not there.
Json list_of(const Json& json, const std::string& key, JsonReader& reader) {
  const auto list = json.find(key);
  if (list == json.end()) return Json::array();
  reader.use(key);
  if (list->is_array()) return *list;
  reader.fail({"\"" + key + "\" must be a list."});
  return Json::array();
}

void read_packets(const Json& json, JsonReader& reader, std::vector<OtherPacket>& packets) {
  for (const auto& entry : list_of(json, "packets", reader)) {
    auto packet = packet_from_json(entry);
    if (!packet.ok()) return reader.fail(packet.error());
    packets.push_back(std::move(packet).value());
  }
}

/// The object with NID_LRBG made of NID_C and NID_BG where they are given.
core::Result<Json> with_lrbg(Json json) {
  if (!json.contains(kNidC.name) && !json.contains(kNidBg.name)) return json;
  JsonReader reader(json);
  uint32_t nid_c = 0;
  uint32_t nid_bg = 0;
  reader.field(kNidC, nid_c);
  reader.field(kNidBg, nid_bg);
  const uint32_t nid_lrbg = nid_c << kNidBg.bits | nid_bg;
  if (const auto given = reader.optional(full_field("NID_LRBG", 24)); given && *given != nid_lrbg) {
    reader.fail({"NID_LRBG = " + std::to_string(*given) + " contradicts NID_C and NID_BG, which make " +
                 std::to_string(nid_lrbg) + "."});
  }
  if (!reader.status().ok()) return reader.status().error();
  json.erase(kNidC.name);
  json.erase(kNidBg.name);
  json["NID_LRBG"] = nid_lrbg;
  return json;
}

void read_locations(const Json& json, JsonReader& reader, std::vector<ReportLocation>& locations) {
  for (const auto& entry : list_of(json, "locations", reader)) {
    if (!entry.is_object()) return reader.fail({"An entry of \"locations\" is not a JSON object."});
    JsonReader fields(entry);
    visit_location(locations.emplace_back(), fields);
    if (const auto status = fields.finish(); !status.ok()) return reader.fail(status.error());
  }
}

}  // namespace

nlohmann::ordered_json to_json(const TrainPositionReport& report, Baseline baseline) {
  Json json;
  JsonWriter writer(json);
  writer.field(kNidMessage, kNidMessagePositionReport);
  writer.field(kLMessage, static_cast<uint32_t>(message_bytes(report, baseline)));
  visit_header(report, writer);
  writer.field(kNidPacket, report.nid_packet);
  writer.field(kLPacket, position_packet_bits(report, baseline));
  visit_position(report, baseline, writer);
  for (const auto& packet : report.other_packets) {
    json["packets"].push_back({{"NID_PACKET", packet.nid_packet},
                               {"L_PACKET", packet.content.size() + kPacketHeadBits},
                               {"content", text_of(packet.content)}});
  }
  return json;
}

core::Result<TrainPositionReport> report_from_json(const nlohmann::ordered_json& input, Baseline baseline) {
  if (!input.is_object()) return core::Error{"A train position report must be one JSON object."};
  const auto json = with_lrbg(input);
  if (!json.ok()) return json.error();
  JsonReader reader(json.value());
  TrainPositionReport report;
  reader.expect(kNidMessage, kNidMessagePositionReport);
  visit_header(report, reader);
  reader.field(kNidPacket, report.nid_packet);
  visit_position(report, baseline, reader);
  read_packets(json.value(), reader, report.other_packets);
  if (!reader.status().ok()) return reader.status().error();
  const auto message = encode(report, baseline);
  if (!message.ok()) return message.error();
  reader.expect(kLMessage, static_cast<uint32_t>(message.value().size()));
  reader.expect(kLPacket, position_packet_bits(report, baseline));
  if (const auto status = reader.finish(); !status.ok()) return status.error();
  return report;
}

nlohmann::ordered_json to_json(const ReportParameters& parameters) {
  Json json;
  JsonWriter writer(json);
  writer.field(kNidPacket, kNidPacketReportParameters);
  writer.field(kQDir, parameters.q_dir);
  writer.field(kLPacket, packet_bits(parameters));
  visit_cycles(parameters, writer);
  writer.field(kNIter, static_cast<uint32_t>(parameters.locations.size()));
  json["locations"] = Json::array();
  for (const auto& location : parameters.locations) {
    JsonWriter fields(json["locations"].emplace_back());
    visit_location(location, fields);
  }
  return json;
}

core::Result<ReportParameters> parameters_from_json(const nlohmann::ordered_json& json) {
  if (!json.is_object()) return core::Error{"Position report parameters must be one JSON object."};
  JsonReader reader(json);
  ReportParameters parameters;
  reader.expect(kNidPacket, kNidPacketReportParameters);
  reader.field(kQDir, parameters.q_dir);
  visit_cycles(parameters, reader);
  read_locations(json, reader, parameters.locations);
  reader.expect(kNIter, static_cast<uint32_t>(parameters.locations.size()));
  reader.expect(kLPacket, packet_bits(parameters));
  if (const auto status = reader.finish(); !status.ok()) return status.error();
  if (const auto packet = encode(parameters); !packet.ok()) return packet.error();
  return parameters;
}

}  // namespace railfix::etcs
