// Configuration of the tpr_publisher: section `tpr_publisher`.
#pragma once

#include <cstdint>
#include <optional>
#include <string>

#include "service/config.hpp"
#include "tpr_publisher/ground_link/ground_link.hpp"
#include "tpr_publisher/tpr_publisher.hpp"

namespace railfix::tpr_publisher {

struct GroundLinkConfig {
  std::string broker;
  std::string topic = "railfix/{train}/position_report";
  std::string client_id;
  std::string store;
  int64_t store_limit = 100000;
  double longest_retry_s = 10;
  int64_t keep_alive_s = 10;
  std::string ca_file;
  std::string certificate_file;
  std::string key_file;
  std::string user;
  std::string password_file;

  void describe(service::Fields& fields);
  /// Whether the keys go together; looks into no file.
  [[nodiscard]] core::Status check() const;
  /// Nothing without a broker. Throws BadInput when check() refuses, or the password cannot be read.
  [[nodiscard]] std::optional<GroundLinkSettings> settings(const std::string& train_id, const std::string& host) const;

 private:
  [[nodiscard]] static core::Status check_topic(const std::string& filled_in);
  /// Without the password. An error where the keys do not go together.
  [[nodiscard]] core::Result<ground_link::MqttOptions> mqtt() const;
};

struct TprPublisherConfig {
  std::string map;
  std::string baseline = "3";
  int64_t nid_engine = 0;
  int64_t m_mode = 0;
  int64_t m_level = 3;
  int64_t nid_ntc = 0;
  double foot_to_front_m = 0;
  double foot_to_rear_m = -1;
  double train_length_m = 0;
  double train_over_m = -1;
  double train_under_m = -1;
  double search_behind_m = 5000;
  std::string finest_step = "10 cm";
  int64_t t_cycloc_s = 6;
  int64_t d_cycloc_m = 32767;
  std::string m_loc = "groups";
  std::string packet_58;
  GroundLinkConfig ground_link;

  void describe(service::Fields& fields);
  [[nodiscard]] core::Status check() const;
  /// Throws BadInput when packet_58 cannot be read.
  [[nodiscard]] Settings settings() const;

 private:
  /// Out of packet_58, or of the three keys before it.
  [[nodiscard]] core::Result<etcs::ReportParameters> parameters() const;
};

}  // namespace railfix::tpr_publisher
