// Parts of `railfix map` with a file of their own.
#pragma once

#include "commands.hpp"

namespace railfix::tool {

void add_map_draw(CLI::App& map, Action& chosen);
void add_map_coverage(CLI::App& map, Action& chosen);
void add_map_learn(CLI::App& map, Action& chosen);

}  // namespace railfix::tool
