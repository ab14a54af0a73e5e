// Configuration of the tpr_publisher: section `tpr_publisher`.
#pragma once

#include <cstdint>
#include <string>

#include "service/config.hpp"
#include "tpr_publisher/tpr_publisher.hpp"

namespace railfix::tpr_publisher {

struct TprPublisherConfig {
  std::string map;
  std::string baseline = "3";
  int64_t nid_engine = 0;
  int64_t m_mode = 0;
  int64_t m_level = 3;
  int64_t nid_ntc = 0;
  double foot_to_front_m = 0;
  double train_length_m = 0;
  double search_behind_m = 5000;
  std::string finest_step = "10 cm";
  int64_t t_cycloc_s = 6;
  int64_t d_cycloc_m = 32767;
  std::string m_loc = "groups";
  std::string packet_58;

  void describe(service::Fields& fields);
  /// Throws BadInput when packet_58 cannot be read.
  [[nodiscard]] Settings settings() const;
};

}  // namespace railfix::tpr_publisher
