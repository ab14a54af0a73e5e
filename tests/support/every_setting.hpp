// A configuration with one key of every kind, for those who try how configurations are read.
#pragma once

#include <string>
#include <vector>

#include "service/config.hpp"

namespace railfix::test {

struct EverySetting {
  double speed_mps = 10;
  int64_t count = 3;
  bool on = true;
  std::string mode = "a";
  std::string name = "x";
  std::vector<std::string> names;
  double inner_m = 1;
  void describe(service::Fields& fields) {
    fields.number("speed_mps", speed_mps, {0, 100}, "m/s", "How fast.");
    fields.integer("count", count, {1, 5}, "", "How many.");
    fields.flag("on", on, "Whether.");
    fields.choice("mode", mode, {"a", "b"}, "Which.");
    fields.text("name", name, "Who.");
    fields.list("names", names, "Whom.");
    fields.group("inner", "Inside.", [this](service::Fields& inner) {
      inner.number("inner_m", inner_m, {0, 2}, "m", "How far.");
    });
  }
};

}  // namespace railfix::test
