// Message 136, or packet 58, as one JSON object: keys are the field names of SUBSET-026, values the raw integers, in
// the message's order.
#pragma once

#include <nlohmann/json_fwd.hpp>

#include "core/result.hpp"
#include "etcs/report_parameters.hpp"
#include "etcs/train_position_report.hpp"

namespace railfix::etcs {

/// NID_C and NID_BG stand beside NID_LRBG; packets 4, 5 and 44 are listed under "packets" with their bits as text.
/// REQUIRES: encode() accepts the report, or would but for spare values.
nlohmann::ordered_json to_json(const TrainPositionReport& report, Baseline baseline);

/// The other way. NID_MESSAGE, L_MESSAGE and L_PACKET may be left out, but must be right when given; NID_C with NID_BG
/// may replace NID_LRBG. A missing, unknown or out-of-range key is named. encode() accepts the result.
core::Result<TrainPositionReport> report_from_json(const nlohmann::ordered_json& json, Baseline baseline);

/// Packet 58, with its locations as a list.
nlohmann::ordered_json to_json(const ReportParameters& parameters);
/// N_ITER and L_PACKET may be left out, but must be right when given.
core::Result<ReportParameters> parameters_from_json(const nlohmann::ordered_json& json);

}  // namespace railfix::etcs
