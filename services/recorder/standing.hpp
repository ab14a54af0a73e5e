// Standing values: topics whose last sample of each DDS key every file must hold (calibrations, states).
#pragma once

#include <nlohmann/json.hpp>
#include <string_view>

#include "recorder/stored_sample.hpp"

namespace railfix::recorder {

/// The topic and the members that the type's IDL marks with @key.
std::string key_of(const ChannelOf& channel, const nlohmann::ordered_json& sample);

/// StoredSample::standing of a sample of this channel.
std::string standing_of(const ChannelOf& channel, const std::vector<uint8_t>& cdr);

/// Topics whose samples are no state that lasts: each says something that happened.
bool is_said_once(std::string_view topic);

}  // namespace railfix::recorder
