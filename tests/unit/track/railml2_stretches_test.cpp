// Tunnels and platforms of railML 2, which every track tells for itself.
#include "import_fixture.hpp"
#include "track/import/build.hpp"

namespace railfix::track {
namespace {

using testing::ElementsAre;
using testing::IsEmpty;

class Railml2StretchesTest : public ImportTest {
 protected:
  /// t1 and t2, 1000 m each, joined at the end of t1 and one end of t2.
  [[nodiscard]] Map joined(const std::string& on_t1, const std::string& on_t2, bool at_begin_of_t2 = true) const {
    const std::string connection = R"(<connection id="c2" ref="c1"/>)";
    const std::string text =
        R"(<railml version="2.4"><infrastructure><tracks>
<track id="t1"><trackTopology><trackBegin id="b1" pos="0"/><trackEnd id="e1" pos="1000"><connection id="c1" ref="c2"/></trackEnd>
</trackTopology><trackElements>)" +
        on_t1 + R"(</trackElements></track><track id="t2"><trackTopology><trackBegin id="b2" pos="0">)" +
        (at_begin_of_t2 ? connection : "") + R"(</trackBegin><trackEnd id="e2" pos="1000">)" +
        (at_begin_of_t2 ? "" : connection) + "</trackEnd></trackTopology><trackElements>" + on_t2 +
        "</trackElements></track></tracks></infrastructure></railml>";
    return core::value_or_throw(build_map({write("a.railml", text)}, {})).map;
  }

  /// t1, 1000 m, which t2 leaves to the right at 500 m.
  [[nodiscard]] Map branching(const std::string& on_t1, const std::string& on_t2) const {
    const std::string text =
        R"(<railml version="2.4"><infrastructure><tracks>
<track id="t1"><trackTopology><trackBegin id="b1" pos="0"/><trackEnd id="e1" pos="1000"/><connections><switch id="w1" pos="500">
<connection id="c1" ref="c2" orientation="outgoing" course="right"/></switch></connections></trackTopology><trackElements>)" +
        on_t1 +
        R"(</trackElements></track><track id="t2"><trackTopology><trackBegin id="b2" pos="0"><connection id="c2" ref="c1"/></trackBegin>
<trackEnd id="e2" pos="300"/></trackTopology><trackElements>)" +
        on_t2 + "</trackElements></track></tracks></infrastructure></railml>";
    return core::value_or_throw(build_map({write("a.railml", text)}, {})).map;
  }

  static std::string tunnel(const std::string& name, const std::string& pos, const std::string& length) {
    return "<tunnels><tunnel id=\"" + name + "\" pos=\"" + pos + "\" length=\"" + length + "\"/></tunnels>";
  }
  static std::string platform(const std::string& name, const std::string& pos, const std::string& length,
                              const std::string& side) {
    return "<platformEdges><platformEdge id=\"" + name + "\" pos=\"" + pos + "\" length=\"" + length + "\" side=\"" +
           side + "\"/></platformEdges>";
  }
  static std::vector<std::string> portals(const Map& map) {
    return marks_of(map, {LandmarkKind::portal_in, LandmarkKind::portal_out});
  }
  static std::vector<std::string> platform_ends(const Map& map) { return marks_of(map, {LandmarkKind::platform}); }
};

TEST_F(Railml2StretchesTest, ATunnelOverATracksEndHasNoPortalsThere) {
  EXPECT_THAT(portals(joined(tunnel("a", "820", "180"), tunnel("b", "0", "100"))),
              ElementsAre("portal_in a at 820.0 on 1", "portal_out b at 100.0 on 2"));
  EXPECT_THAT(portals(joined(tunnel("a", "820", "180"), tunnel("b", "900", "100"), false)),
              ElementsAre("portal_in a at 820.0 on 1", "portal_in b at 900.0 on 2"));
  EXPECT_THAT(portals(joined(tunnel("a", "820", "180"), tunnel("b", "20", "100"))),
              ElementsAre("portal_in a at 820.0 on 1", "portal_out a at 1000.0 on 1", "portal_in b at 20.0 on 2",
                          "portal_out b at 120.0 on 2"));
}

TEST_F(Railml2StretchesTest, AnEndBeyondTheTrackIsLeftOutAndTold) {
  const Map map = joined(tunnel("a", "820", "300"), "");
  EXPECT_THAT(portals(map), ElementsAre("portal_in a at 820.0 on 1"));
  EXPECT_THAT(map.problems, testing::Contains("<tunnel> \"a\" is not on its track; it is left out"));
  EXPECT_THAT(portals(joined(tunnel("a", "1200", "100"), "")), IsEmpty());
}

TEST_F(Railml2StretchesTest, EveryWayOutOfATunnelHasAPortal) {
  EXPECT_THAT(portals(branching(tunnel("a", "400", "200"), tunnel("b", "0", "50"))),
              ElementsAre("portal_in a at 400.0 on 1", "portal_out b at 50.0 on 2", "portal_out a at 100.0 on 3"));
  EXPECT_THAT(portals(branching(tunnel("a", "400", "200"), "")),
              ElementsAre("portal_in a at 400.0 on 1", "portal_out a at 0.0 on 2", "portal_out a at 100.0 on 3"));
  EXPECT_THAT(portals(branching(tunnel("a", "500", "200"), "")),
              ElementsAre("portal_in a at 0.0 on 3", "portal_out a at 200.0 on 3"));
  EXPECT_THAT(portals(branching(tunnel("a", "499.999", "200"), "")),
              ElementsAre("portal_in a at 0.0 on 3", "portal_out a at 200.0 on 3"));
  EXPECT_THAT(portals(branching(tunnel("a", "500", "0"), "")),
              ElementsAre("portal_in a at 0.0 on 3", "portal_out a at 0.0 on 3"));
}

TEST_F(Railml2StretchesTest, APlatformOverATracksEndHasNoEndsThere) {
  const std::string left = platform("a", "900", "100", "left");
  EXPECT_THAT(platform_ends(joined(left, platform("b", "0", "50", "left"))),
              ElementsAre("platform a at 900.0 on 1", "platform b at 50.0 on 2"));
  EXPECT_EQ(platform_ends(joined(left, platform("b", "0", "50", "right"))).size(), 4U) << "across the track";
  EXPECT_THAT(platform_ends(joined(left, platform("b", "950", "50", "right"), false)),
              ElementsAre("platform a at 900.0 on 1", "platform b at 950.0 on 2"));
  EXPECT_EQ(platform_ends(joined(left, platform("b", "950", "50", "left"), false)).size(), 4U);
  EXPECT_THAT(platform_ends(branching(platform("a", "400", "200", "left"), "")),
              ElementsAre("platform a at 400.0 on 1", "platform a at 100.0 on 3"));
}

}  // namespace
}  // namespace railfix::track
