// What `railfix map` says of maps, for people and as JSON.
#pragma once

#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "track/import/build.hpp"

namespace railfix::tool {

double total_length_m(const track::Map& map);
/// "straight", "arc" or "clothoid".
const char* kind_of(const track::Element& element);

void print_problems(const std::vector<std::string>& problems, size_t most);
void print_summary(const track::Map& map);
/// Nothing where there are no elements.
void print_figures(const char* source, const track::FitFigures& figures);
/// Nothing where none were asked for.
void print_virtual_balises(const track::VirtualBalises& groups);
void print_fit(const track::FitReport& fit);
void print_info(const track::Map& map, size_t most_edges);
void print_place(const track::Map& map, const track::EdgePosition& place, bool as_json);

nlohmann::ordered_json to_json(const track::FitReport& fit);
nlohmann::ordered_json to_json(const track::FitFigures& figures);
nlohmann::ordered_json to_json(const track::VirtualBalises& groups);
nlohmann::ordered_json map_json(const track::Map& map);
/// On standard output.
void print_json(const nlohmann::ordered_json& json);

}  // namespace railfix::tool
