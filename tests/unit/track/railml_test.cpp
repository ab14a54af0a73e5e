// What railML says of cant and of places over several net elements, and what it says wrongly.
#include "import_fixture.hpp"
#include "track/import/build.hpp"
#include "track/path.hpp"

namespace railfix::track {
namespace {

using RailmlTest = ImportTest;

// 1000 m with a left curve from 300 m to 800 m; a branch leaves to the right at the place put in.
std::string railml2(const std::string& switch_pos, const std::string& cant = "100") {
  return R"(<railml version="2.4"><infrastructure><tracks>
<track id="t1"><trackTopology><trackBegin id="b1" pos="0"/><trackEnd id="e1" pos="1000"/><connections>
<switch id="w1" pos=")" +
         switch_pos +
         R"("><connection id="c1" ref="c2" orientation="outgoing" course="right"/></switch></connections></trackTopology>
<trackElements><radiusChanges><radiusChange id="r1" pos="300" radius="-500" superelevation=")" +
         cant + R"("/>
<radiusChange id="r2" pos="800" radius="0"/></radiusChanges></trackElements></track>
<track id="t2"><trackTopology><trackBegin id="b2" pos="0"><connection id="c2" ref="c1"/></trackBegin><trackEnd id="e2" pos="300"/>
</trackTopology></track></tracks></infrastructure></railml>)";
}

TEST_F(RailmlTest, CantHoldsFromOneRadiusChangeToTheNextOverCutsToo) {
  for (const char* switch_pos : {"200", "300", "500", "800", "900"}) {
    const auto built = core::value_or_throw(build_map({write("a.railml", railml2(switch_pos))}, {}));
    const auto map = std::make_shared<const Map>(built.map);
    const Path main = core::value_or_throw(Path::follow(map, {1, 0, Direction::forward}, 2000, 0));
    ASSERT_NEAR(main.end_m(), 1000, 1e-6);
    for (const auto& [at_m, cant_m] : {std::pair(0.0, 0.0),
                                       {150.0, 0.0},
                                       {299.0, 0.0},
                                       {301.0, 0.1},
                                       {499.0, 0.1},
                                       {501.0, 0.1},
                                       {799.0, 0.1},
                                       {801.0, 0.0},
                                       {999.0, 0.0}})
      EXPECT_NEAR(main.at(at_m).cant_m, cant_m, 1e-9) << at_m << " m, switch at " << switch_pos;
  }
}

}  // namespace
}  // namespace railfix::track
