// The two generations of railML, one reader each.
#pragma once

#include "track/import/rail_net.hpp"
#include "track/import/xml_source.hpp"

namespace railfix::track {

/// Both throw core::BadInput.
RailNet read_railml2(const XmlSource& source);
RailNet read_railml3(const XmlSource& source);

constexpr double kRailmlSigmaM = 1.0;

/// Name of an element for a human: its name, else its code, else its id.
std::string railml_name(const pugi::xml_node& node);

/// The ETCS identity of a balise group, wherever the file has it; nothing when it has none.
struct EtcsIdentity {
  uint32_t nid_c = 0;
  uint32_t nid_bg = 0;
};
std::optional<EtcsIdentity> etcs_identity(const XmlSource& source, const pugi::xml_node& group);

}  // namespace railfix::track
