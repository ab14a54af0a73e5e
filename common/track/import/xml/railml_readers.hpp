// The two generations of railML, one reader each.
#pragma once

#include <set>

#include "track/import/xml/rail_net.hpp"
#include "track/import/xml/xml_source.hpp"

namespace railfix::track {

/// Both throw core::BadInput.
RailNet read_railml2(const XmlSource& source);
RailNet read_railml3(const XmlSource& source);

constexpr double kRailmlSigmaM = 1.0;
constexpr double kLastReferenceNumber = 1;  // balises of a group count from 0 as in ETCS, or from 1

/// Name of an element for a human: its name, else its code, else its id.
std::string railml_name(const pugi::xml_node& node);

/// "<element> "name"", for the sentence that says what is wrong with it.
std::string railml_called(const pugi::xml_node& node);

/// "<element> "name" of track T has ATTRIBUTE value ...", for the sentence about a value that is left out.
std::string railml_has(const pugi::xml_node& node, const NetTrack& track, const char* attribute,
                       const std::string& why);

/// Whether a place lies on a track of railML 2, to a centimetre, and the sentence for one that does not.
bool is_on_track(double offset_m, double length_m);
std::string not_on_its_track(const pugi::xml_node& node);
constexpr double kAtEndM = 0.01;

/// Coordinates that end farther from an end of their track say nothing of the rest.
constexpr double kNearEndM = 1.0;
constexpr const char* kNotFromEndToEnd = "has coordinates, but not from end to end";

/// 1 on the "left", -1 on the "right", else 0: the file does not say on which side.
double left_of(const std::string& side);

/// Speed profiles for some trains only (tilting, temporary, ...), by id: what is not the basic profile, or, where the
/// file marks none as that, what lowers it.
std::set<std::string> special_speed_profiles(const XmlSource& source);

/// The ETCS identity of a balise group, wherever the file has it; nothing when it has none.
std::optional<EtcsIdentity> etcs_identity(const XmlSource& source, const pugi::xml_node& group);

/// The id of the group that a balise of railML 3 says it belongs to; empty when it says none.
std::string balise_group_of(const pugi::xml_node& balise);

/// Whether the nominal direction runs where offsets grow, by the order of the group's balises; nothing where all lie at
/// one place.
std::optional<bool> nominal_by_order(const std::vector<TrackMark>& balises);

}  // namespace railfix::track
