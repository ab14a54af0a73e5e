#include <algorithm>
#include <cstdio>
#include <iostream>
#include <memory>
#include <nlohmann/json.hpp>
#include <span>
#include <sstream>
#include <string>
#include <vector>

#include "command_tpr.hpp"
#include "core/json_text.hpp"
#include "core/result.hpp"
#include "core/whole_file.hpp"
#include "etcs/layout.hpp"
#include "etcs/report_json.hpp"
#include "etcs/report_parameters.hpp"

namespace railfix::tool {

namespace {

using core::BadInput;
using etcs::Baseline;

std::string format(const char* pattern, double value) {
  char text[64];
  std::snprintf(text, sizeof text, pattern, value);
  return text;
}

std::string metres_text(uint32_t raw, uint32_t q_scale) {
  if (q_scale > etcs::kQScale.largest) return "a distance of unknown scale";
  return format(q_scale == 0 ? "%.1f m" : "%.0f m", etcs::metres(raw, q_scale));
}

/// Of the distances that may be unknown; those of packet 58 may not.
std::string distance_text(uint32_t raw, uint32_t q_scale) {
  return raw == etcs::kUnknownDistance ? "unknown, or more than 327.66 km" : metres_text(raw, q_scale);
}

std::string group_text(uint32_t nid_lrbg) {
  if (nid_lrbg == etcs::kUnknownBaliseGroup) return "unknown";
  const std::string region = "country/region " + std::to_string(etcs::nid_c_of(nid_lrbg));
  if (!etcs::names_group(nid_lrbg)) return region + ", balise group unknown";
  return region + ", balise group " + std::to_string(etcs::nid_bg_of(nid_lrbg));
}

template <size_t N>
std::string one_of(const char* const (&names)[N], uint32_t value) {
  return value < N ? names[value] : "spare";
}

/// What a raw value says, in units.
std::string meaning(const std::string& name, uint32_t value, const etcs::TrainPositionReport& report) {
  if (name == "NID_MESSAGE") return "train position report";
  if (name == "L_MESSAGE") return "bytes";
  if (name == "L_PACKET") return "bits";
  if (name == "T_TRAIN") return value == etcs::kUnknownTime ? "unknown" : format("%.2f s", value * 0.01);
  if (name == "NID_PACKET") return value == 0 ? "position report" : "position report based on two balise groups";
  if (name == "Q_SCALE") return one_of({"10 cm", "1 m", "10 m"}, value);
  if (name == "NID_LRBG" || name == "NID_PRVLRBG") return group_text(value);
  if (name == "D_LRBG") return distance_text(value, report.q_scale) + " from the group to the estimated front end";
  if (name == "L_DOUBTOVER") return distance_text(value, report.q_scale) + " behind the estimate: min safe front end";
  if (name == "L_DOUBTUNDER") return distance_text(value, report.q_scale) + " in front of it: max safe front end";
  if (name == "Q_DIRLRBG") return "train orientation: " + one_of({"reverse", "nominal", "unknown"}, value);
  if (name == "Q_DLRBG") return "front end on the side: " + one_of({"reverse", "nominal", "unknown"}, value);
  if (name == "Q_DIRTRAIN") return "running direction: " + one_of({"reverse", "nominal", "unknown"}, value);
  if (name == "Q_LENGTH" || name == "Q_INTEGRITY") {
    if (value == etcs::kConfirmedByDevice)
      return name == "Q_LENGTH" ? "integrity confirmed by a device" : "integrity confirmed by an external source";
    return one_of({"no information", "", "integrity confirmed by the driver", "integrity lost"}, value);
  }
  if (name == "L_TRAININT") return std::to_string(value) + " m confirmed (safe) train length";
  if (name == "V_TRAIN")
    return value == etcs::kStandstillSpeed ? "standstill" : std::to_string(value * etcs::kSpeedStepKmh) + " km/h";
  if (name == "M_MODE") {
    return one_of({"full supervision", "on sight", "staff responsible", "shunting", "unfitted", "sleeping", "stand by",
                   "trip", "post trip", "system failure", "isolation", "non leading", "limited supervision",
                   "national system", "reversing", "passive shunting", "automatic driving", "supervised manoeuvre"},
                  value);
  }
  if (name == "M_LEVEL") return one_of({"level 0", "level NTC", "level 1", "level 2", "level 3"}, value);
  return "";
}

using SpareValues = std::vector<etcs::SpareValue>;

bool is_spare(const SpareValues& spare, const std::string& field) {
  return std::ranges::any_of(spare, [&](const auto& value) { return field == value.field; });
}

void print_table(const nlohmann::ordered_json& json, const etcs::TrainPositionReport& report,
                 const SpareValues& spare) {
  std::printf("%-12s %10s  %s\n", "field", "value", "meaning");
  for (const auto& [name, value] : json.items()) {
    if (!value.is_number_unsigned() || name == "NID_C" || name == "NID_BG") continue;
    const auto raw = value.get<uint32_t>();
    const std::string said = is_spare(spare, name) ? "a spare value" : meaning(name, raw, report);
    std::printf("%-12s %10u  %s\n", name.c_str(), raw, said.c_str());
  }
  for (const auto& packet : report.other_packets) {
    const char* what = packet.nid_packet == 4   ? "error reporting"
                       : packet.nid_packet == 5 ? "train running number"
                                                : "external data";
    std::string bits;
    for (const bool bit : packet.content) bits += bit ? '1' : '0';
    std::printf("packet %-5u %10zu  %s: %s\n", packet.nid_packet, packet.content.size(), what, bits.c_str());
  }
}

std::string cycle_text(uint32_t value, uint32_t none, const std::string& every) {
  if (value == none) return "not cyclic";
  return value == 0 ? "a report as often as possible" : "a report every " + every;
}

/// On standard error: the message itself goes on as it is.
void remark(const etcs::TrainPositionReport& report) {
  const std::string said = etcs::said_of_no_group(report);
  if (!said.empty()) std::cerr << "remark: " << said << '\n';
}

void print_packet_58(const etcs::ReportParameters& packet, const SpareValues& spare) {
  struct Row {
    const char* name;
    uint32_t value;
    std::string meaning;
  };
  std::vector<Row> rows{
      {"NID_PACKET", etcs::kNidPacketReportParameters, "position report parameters (SUBSET-026 3.6.5.1.5, 7.4.2)"},
      {"Q_DIR", packet.q_dir, "for trains that look: " + one_of({"reverse", "nominal", "either way"}, packet.q_dir)},
      {"Q_SCALE", packet.q_scale, one_of({"10 cm", "1 m", "10 m"}, packet.q_scale)},
      {"T_CYCLOC", packet.t_cycloc,
       cycle_text(packet.t_cycloc, etcs::kNoCycleTime, std::to_string(packet.t_cycloc) + " s")},
      {"D_CYCLOC", packet.d_cycloc,
       cycle_text(packet.d_cycloc, etcs::kNoCycleDistance, metres_text(packet.d_cycloc, packet.q_scale))},
      {"M_LOC", packet.m_loc, one_of({"a report now", "a report at every LRBG", "no report at an LRBG"}, packet.m_loc)},
      {"N_ITER", static_cast<uint32_t>(packet.locations.size()), "locations with a report"}};
  for (const auto& location : packet.locations) {
    rows.push_back({"D_LOC", location.d_loc,
                    metres_text(location.d_loc, packet.q_scale) + " from the LRBG, or from the location before"});
    rows.push_back({"Q_LGTLOC", location.q_lgtloc,
                    "when passed by the " + one_of({"min safe rear end", "max safe front end"}, location.q_lgtloc)});
  }
  std::printf("%-12s %10s  %s\n", "field", "value", "meaning");
  for (const auto& row : rows) {
    const bool means_nothing = is_spare(spare, row.name);
    std::printf("%-12s %10u  %s\n", row.name, row.value, means_nothing ? "a spare value" : row.meaning.c_str());
  }
}

/// All is printed before this is thrown, so that scripts, too, see that the message is not as it should be.
void refuse_spare(const SpareValues& spare) {
  std::string said;
  for (const auto& value : spare) said += (said.empty() ? "" : " ") + etcs::sentence(value);
  if (!said.empty()) throw BadInput(said);
}

void print_json(const nlohmann::ordered_json& json) {
  std::cout << core::json_text(json, 2) << '\n';
}

void decode_packet_58(std::span<const uint8_t> bytes, bool json_wanted) {
  SpareValues spare;
  auto packet = etcs::decode_report_parameters_with_spare(bytes, spare);
  if (!packet.ok()) packet = core::value_or_throw(etcs::decode_report_parameters(bytes));
  if (json_wanted) {
    print_json(etcs::to_json(packet.value()));
  } else {
    print_packet_58(packet.value(), spare);
  }
  refuse_spare(spare);
}

/// Spare values may come from reading a message of the other baseline.
bool reads_as_other(std::span<const uint8_t> bytes, Baseline baseline) {
  return etcs::decode(bytes, baseline == Baseline::b3 ? Baseline::b4 : Baseline::b3).ok();
}

void decode_message(std::span<const uint8_t> bytes, Baseline baseline, bool json_wanted) {
  SpareValues spare;
  auto report = etcs::decode_with_spare(bytes, baseline, spare);
  if (!report.ok() || (!spare.empty() && reads_as_other(bytes, baseline)))
    report = core::value_or_throw(etcs::decode_or_advise(bytes, baseline, "--baseline"));
  const auto json = etcs::to_json(report.value(), baseline);
  if (json_wanted) {
    print_json(json);
  } else {
    print_table(json, report.value(), spare);
  }
  remark(report.value());
  refuse_spare(spare);
}

/// As people paste it: in several words or lines, with 0x or without.
std::string hex_of(const std::vector<std::string>& words) {
  std::string text;
  for (const std::string& word : words) text += word + ' ';
  if (text == "- ") text = core::value_or_throw(core::read_whole(std::cin, "standard input"));
  std::istringstream stream(text);
  std::string hex;
  for (std::string word; stream >> word;)
    hex += word.starts_with("0x") || word.starts_with("0X") ? word.substr(2) : word;
  return hex;
}

int decode(const std::vector<std::string>& words, Baseline baseline, bool json_wanted) {
  const auto bytes = core::value_or_throw(etcs::parse_hex(hex_of(words)));
  if (!bytes.empty() && bytes.front() == etcs::kNidPacketReportParameters) {
    decode_packet_58(bytes, json_wanted);
  } else {
    decode_message(bytes, baseline, json_wanted);
  }
  return 0;
}

using Bytes = std::vector<uint8_t>;

bool is_packet_58(const nlohmann::ordered_json& json) {
  return json.is_object() && json.value("NID_PACKET", nlohmann::ordered_json()) == etcs::kNidPacketReportParameters &&
         !json.contains("NID_MESSAGE");
}

core::Result<Bytes> packet_58_of(const nlohmann::ordered_json& json) {
  const auto packet = etcs::parameters_from_json(json);
  return packet.ok() ? etcs::encode(packet.value()) : packet.error();
}

core::Result<Bytes> packed(const nlohmann::ordered_json& json, Baseline baseline) {
  const auto report = etcs::report_from_json(json, baseline);
  return report.ok() ? etcs::encode(report.value(), baseline) : report.error();
}

core::Result<Bytes> message_of(const nlohmann::ordered_json& json, Baseline baseline) {
  auto bytes = packed(json, baseline);
  if (bytes.ok()) {
    remark(etcs::report_from_json(json, baseline).value());
    return bytes;
  }
  const auto other = baseline == Baseline::b3 ? Baseline::b4 : Baseline::b3;
  if (!packed(json, other).ok()) return bytes;
  return core::Error{bytes.error().message + " It fits --baseline " + std::to_string(static_cast<int>(other)) + "."};
}

int encode(const std::string& file, Baseline baseline) {
  const std::string where = file == "-" ? "standard input" : file;
  const auto text = core::value_or_throw(file == "-" ? core::read_whole(std::cin, where) : core::read_whole(file));
  if (text.find_first_not_of(" \t\r\n") == std::string::npos)
    throw BadInput(where + ": is empty; give the fields as `railfix tpr decode HEX --json` prints them.");
  const auto json = core::parse_json_strictly<nlohmann::ordered_json>(text);
  if (!json.ok()) throw BadInput(where + ": " + json.error().message);
  const auto bytes = is_packet_58(json.value()) ? packet_58_of(json.value()) : message_of(json.value(), baseline);
  if (!bytes.ok()) throw BadInput(where + ": " + bytes.error().message);
  std::cout << etcs::to_hex(bytes.value()) << '\n';
  return 0;
}

struct TprOptions {
  std::vector<std::string> hex;
  std::string file;
  int baseline = 3;
  bool json = false;
};

}  // namespace

void add_tpr(CLI::App& app, Action& chosen) {
  auto options = std::make_shared<TprOptions>();
  auto* tpr = app.add_subcommand("tpr", "ETCS train position reports (message 136): bits, ground link, comparison");
  tpr->footer("Example: railfix tpr decode 880601D6F345402AF34000E48F68EB84D250014010C38830");
  tpr->require_subcommand(1);
  const auto add_baseline = [&](CLI::App* command) {
    command->add_option("--baseline", options->baseline, "Layout: 3 = SUBSET-026 3.x, 4 = 4.0.0")
        ->check(CLI::IsMember({3, 4}));
  };

  auto* decoder = tpr->add_subcommand(
      "decode",
      "Explain a message 136 or a packet 58, e.g. railfix tpr decode 880601D6F345402AF34000E48F68EB84D250014010C38830");
  decoder->add_option("hex", options->hex, "The message, or the packet, in hexadecimal digits, - = standard input")
      ->required();
  decoder->add_flag("--json", options->json, "One JSON object with the raw values");
  add_baseline(decoder);
  decoder->callback([options, &chosen] {
    chosen = [options] { return decode(options->hex, static_cast<Baseline>(options->baseline), options->json); };
  });

  auto* encoder =
      tpr->add_subcommand("encode", "Make a message 136 or a packet 58, e.g. railfix tpr encode --json report.json");
  encoder
      ->add_option("--json", options->file, "File with the fields as `decode --json` prints them, - = standard input")
      ->required();
  add_baseline(encoder);
  encoder->callback([options, &chosen] {
    chosen = [options] { return encode(options->file, static_cast<Baseline>(options->baseline)); };
  });
  add_tpr_compare(*tpr, chosen);
  add_tpr_listen(*tpr, chosen);
  add_tpr_onboard(*tpr, chosen);
}

}  // namespace railfix::tool
