// A CDR sample as JSON, by the layout that its IDL gives. Reads plain CDR (XCDR1, both byte orders) with the four bytes
// of encapsulation in front, as DDS sends and our recordings store it. No bytes can make it read outside of them.
#pragma once

#include <nlohmann/json.hpp>
#include <span>

#include "cdr/types.hpp"

namespace railfix::cdr {

struct DecodeOptions {
  /// Arrays and sequences of octets become hexadecimal text; of longer ones only this many bytes are shown, then how
  /// many there are.
  size_t octets_shown = 64;
  /// Members called padding are left out.
  bool hide_padding = true;
  /// Values whose IDL comment names their constants ("ODOMETRY_*") become the constant's name without the prefix.
  bool name_constants = false;
};

/// Members in the order of the IDL; NaN stays NaN (JSON text: null). Error: says which member the bytes do not hold.
core::Result<nlohmann::ordered_json> decode(const Types& types, const std::string& type_name,
                                            std::span<const uint8_t> cdr, const DecodeOptions& options = {});

}  // namespace railfix::cdr
