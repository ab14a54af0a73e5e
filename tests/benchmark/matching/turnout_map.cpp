// railfix-make-turnout --radius-m R [--vertical-curvature-per-m V] --out line.map: one turnout from a straight track,
// with its frogs, for `railfix simulate --map`. Edge 1 is the stem, edge 2 goes straight on, edge 3 to the left.
#include <CLI/CLI.hpp>
#include <cstdio>
#include <string>

#include "number_between.hpp"
#include "support/turnout.hpp"

int main(int argc, char** argv) {
  CLI::App app("One turnout from a straight track, for `railfix simulate --map`");
  double radius_m = 500;
  double vertical_per_m = 0;
  std::string out;
  app.add_option("--radius-m", radius_m, "Of the diverging leg")->check(railfix::tool::number_between(100, 3000));
  app.add_option("--vertical-curvature-per-m", vertical_per_m, "Around the points; negative on a crest")
      ->check(railfix::tool::number_between(-0.002, 0.002));
  app.add_option("--out", out, "The map file to write")->required();
  CLI11_PARSE(app, argc, argv);
  const auto saved = railfix::testing::turnout(radius_m, vertical_per_m).save(out);
  if (!saved.ok()) {
    std::fprintf(stderr, "%s\n", saved.error().message.c_str());
    return 2;
  }
  return 0;
}
