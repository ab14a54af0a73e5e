// The report of `railfix evaluate --report`: one file that needs nothing else.
#pragma once

#include <string>

#include "evaluation/evaluation.hpp"
#include "evaluation/truth.hpp"

namespace railfix::evaluation {

std::string html_report(const Truth& truth, const Evaluation& evaluation, const std::string& run_name);

}  // namespace railfix::evaluation
