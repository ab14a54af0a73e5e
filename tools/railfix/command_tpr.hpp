// The larger commands below `railfix tpr`.
#pragma once

#include "commands.hpp"

namespace railfix::tool {

void add_tpr_compare(CLI::App& tpr, Action& chosen);
void add_tpr_listen(CLI::App& tpr, Action& chosen);
void add_tpr_onboard(CLI::App& tpr, Action& chosen);

}  // namespace railfix::tool
