#include "tpr_publisher/tpr_publisher_config.hpp"

namespace railfix::tpr_publisher {

void GroundLinkConfig::describe(service::Fields& fields) {
  fields.text(
      "broker", broker,
      "MQTT broker, HOST or HOST:PORT, an IPv6 address as [ADDRESS]:PORT; empty = reports are not sent to the ground.");
  fields.text("topic", topic, "MQTT topic; {train} becomes common.train_id, {host} common.host.");
  fields.text("client_id", client_id,
              "MQTT client id, another one for every client of the broker; empty = railfix-{train}-{host}.");
  fields.text("store", store, "File for reports that the broker does not have yet; needed with a broker.");
  fields.integer("store_limit", store_limit, {1, 10000000}, "reports",
                 "Most that wait in the store; beyond it the oldest are lost.");
  fields.number("longest_retry_s", longest_retry_s, {0.1, 600}, "s",
                "Longest pause between two attempts to connect; the first is 0.1 s, each next one twice as long, until "
                "one lasts 15 s.");
  fields.integer("keep_alive_s", keep_alive_s, {5, 3600}, "s",
                 "A broker that is silent for twice as long is taken for gone, and one that confirms nothing for so "
                 "long is left.");
  fields.text("ca_file", ca_file, "Certificate authority of the broker, PEM; empty = no TLS.");
  fields.text("certificate_file", certificate_file, "This train's certificate, PEM; empty = none.");
  fields.text("key_file", key_file, "Key of this train's certificate, PEM.");
  fields.text("user", user, "User name at the broker; empty = none.");
  fields.text("password_file", password_file, "File whose first line is the password.");
}

core::Status GroundLinkConfig::check_topic(const std::string& filled_in) {
  if (const auto fits = ground_link::check_topic(filled_in); !fits.ok())
    return core::Error{"tpr_publisher.ground_link.topic: " + fits.error().message};
  return {};
}

core::Result<ground_link::MqttOptions> GroundLinkConfig::mqtt() const {
  if (store.empty()) return core::Error{"tpr_publisher.ground_link.store is not set: name a file on a lasting disk."};
  if (const auto fits = check_topic(topic); !fits.ok()) return fits.error();
  ground_link::MqttOptions options;
  if (const auto address = ground_link::parse_broker(broker, options); !address.ok()) return address.error();
  options.ca_file = ca_file;
  options.certificate_file = certificate_file;
  options.key_file = key_file;
  options.user = user;
  options.keep_alive_s = static_cast<int>(keep_alive_s);
  options.longest_retry_s = longest_retry_s;
  if (const auto tls = ground_link::check_tls(options); !tls.ok())
    return core::Error{"tpr_publisher.ground_link: " + tls.error().message};
  return options;
}

core::Status GroundLinkConfig::check() const {
  if (broker.empty()) return {};
  if (const auto options = mqtt(); !options.ok()) return options.error();
  return {};
}

std::optional<GroundLinkSettings> GroundLinkConfig::settings(const std::string& train_id,
                                                             const std::string& host) const {
  if (broker.empty()) return std::nullopt;
  const auto filled_in = [&](std::string text) {
    for (const auto& [word, value] : {std::pair<std::string, std::string>("{train}", train_id), {"{host}", host}}) {
      if (const auto place = text.find(word); place != std::string::npos) text.replace(place, word.size(), value);
    }
    return text;
  };
  GroundLinkSettings settings;
  settings.mqtt = core::value_or_throw(mqtt());
  settings.mqtt.client_id = filled_in(client_id.empty() ? "railfix-{train}-{host}" : client_id);
  if (!password_file.empty()) settings.mqtt.password = core::value_or_throw(ground_link::read_password(password_file));
  settings.topic = filled_in(topic);
  core::ok_or_throw(check_topic(settings.topic));
  settings.store = store;
  settings.store_limit = static_cast<size_t>(store_limit);
  return settings;
}

void TprPublisherConfig::describe(service::Fields& fields) {
  fields.text("map", map, "Compiled map with the balise groups; empty = every report says LRBG unknown.");
  fields.choice("baseline", baseline, {"3", "4"},
                "Layout of the message: 3 = SUBSET-026 3.x, 4 = 4.0.0 on trackside of system version 3.0.");
  fields.integer("nid_engine", nid_engine, {0, 16777215}, "", "On-board ETCS identity, NID_ENGINE.");
  fields.integer("m_mode", m_mode, {0, 31}, "", "On-board operating mode to report, M_MODE (0 = full supervision).");
  fields.integer("m_level", m_level, {0, 4}, "", "ETCS level to report, M_LEVEL (1 = NTC, 3 = level 2).");
  fields.integer("nid_ntc", nid_ntc, {0, 255}, "", "National system, NID_NTC; used with level NTC only.");
  fields.number("foot_to_front_m", foot_to_front_m, {-500, 500}, "m",
                "From the camera's foot forward to the train's front end.");
  fields.number("foot_to_rear_m", foot_to_rear_m, {-1, 2000}, "m",
                "From the camera's foot backward to the other end, the front end while its cab is active; -1 = nobody "
                "drives from there.");
  fields.number("train_length_m", train_length_m, {0, 2000}, "m",
                "For reports where the rear end passes, and valid train data, until onboard_status says a length; 0 = "
                "not known.");
  fields.number("train_over_m", train_over_m, {-1, 2000}, "m",
                "4.0.0, supervised manoeuvre or stand-by without train data: added to L_DOUBTOVER; -1 = not known.");
  fields.number("train_under_m", train_under_m, {-1, 2000}, "m",
                "4.0.0, supervised manoeuvre or stand-by without train data: added to L_DOUBTUNDER; -1 = not known.");
  fields.number("search_behind_m", search_behind_m, {0, 100000}, "m",
                "How far behind the train a balise group is looked for when none has been passed yet.");
  fields.choice("finest_step", finest_step, {"10 cm", "1 m", "10 m"},
                "Finest resolution of distances, Q_SCALE; coarser ones are taken when a distance does not fit.");
  fields.integer("t_cycloc_s", t_cycloc_s, {1, 255}, "s", "Time between reports, T_CYCLOC; 255 = not cyclic in time.");
  fields.integer("d_cycloc_m", d_cycloc_m, {1, 32767}, "m",
                 "Distance between reports, D_CYCLOC; 32767 = not cyclic in space.");
  fields.choice("m_loc", m_loc, {"groups", "not_at_groups"}, "Report at every new balise group or not, M_LOC.");
  fields.text("packet_58", packet_58,
              "Position report parameters as a packet 58 in hexadecimal digits; replaces the three keys above.");
  fields.group("ground_link", "Reports to the ground over MQTT, QoS 1.",
               [this](service::Fields& inner) { ground_link.describe(inner); });
}

Settings TprPublisherConfig::settings() const {
  Settings settings;
  settings.report.baseline = baseline == "4" ? etcs::Baseline::b4 : etcs::Baseline::b3;
  settings.report.nid_engine = static_cast<uint32_t>(nid_engine);
  settings.report.m_mode = static_cast<uint32_t>(m_mode);
  settings.report.m_level = static_cast<uint32_t>(m_level);
  settings.report.nid_ntc = static_cast<uint32_t>(nid_ntc);
  settings.report.finest_q_scale = finest_step == "10 cm" ? 0 : finest_step == "1 m" ? 1 : 2;
  settings.report.foot_to_front_m = foot_to_front_m;
  settings.report.train_data = train_length_m > 0;
  settings.report.train_over_m = train_over_m;
  settings.report.train_under_m = train_under_m;
  settings.train_length_m = train_length_m;
  settings.foot_to_rear_m = foot_to_rear_m;
  settings.search_behind_m = search_behind_m;
  settings.parameters = core::value_or_throw(parameters());
  return settings;
}

core::Status TprPublisherConfig::check() const {
  if (const auto link = ground_link.check(); !link.ok()) return link;
  if (const auto out = parameters(); !out.ok()) return out.error();
  return {};
}

core::Result<etcs::ReportParameters> TprPublisherConfig::parameters() const {
  if (packet_58.empty()) {
    etcs::ReportParameters parameters;
    parameters.t_cycloc = static_cast<uint32_t>(t_cycloc_s);
    parameters.d_cycloc = static_cast<uint32_t>(d_cycloc_m);
    parameters.m_loc = m_loc == "groups" ? etcs::kReportAtGroups : etcs::kReportNotAtGroups;
    return parameters;
  }
  const auto refused = [](const core::Error& error) {
    return core::Error{"tpr_publisher.packet_58: " + error.message};
  };
  const auto bytes = etcs::parse_hex(packet_58);
  if (!bytes.ok()) return refused(bytes.error());
  auto parameters = etcs::decode_report_parameters(bytes.value());
  if (!parameters.ok()) return refused(parameters.error());
  return parameters;
}

}  // namespace railfix::tpr_publisher
