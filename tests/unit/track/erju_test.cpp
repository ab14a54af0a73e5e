// The ERJU digital map: where things lie on its track edges, and what of it is not read.
#include "import_fixture.hpp"
#include "track/import/build.hpp"

namespace railfix::track {
namespace {

using testing::Contains;
using testing::ElementsAre;
using testing::HasSubstr;
using testing::IsEmpty;

class ErjuTest : public ImportTest {
 protected:
  /// T1, T2 and T3, 300 m each, in a row.
  [[nodiscard]] Map map_of(const std::string& elements) const {
    const std::string text =
        R"(<infrastructure xmlns="https://erju.org/infra"><trackEdges><trackEdge id="T1" trackEdgeLength="300000"/>
<trackEdge id="T2" trackEdgeLength="300000"/><trackEdge id="T3" trackEdgeLength="300000"/></trackEdges><trackEdgeLinks>
<trackEdgeLink id="l12" trackEdgeA="T1" trackEdgeB="T2" startOfA="false" startOfB="true"/>
<trackEdgeLink id="l23" trackEdgeA="T2" trackEdgeB="T3" startOfA="false" startOfB="true"/></trackEdgeLinks>)" +
        elements + "</infrastructure>";
    return core::value_or_throw(build_map({write("infra.xml", text)}, {})).map;
  }

  static std::string section(const std::string& edge, const std::string& from_start, const std::string& from_end) {
    return "<trackEdgeSection trackEdge=\"" + edge + "\" skipFromStart=\"" + from_start + "\" skipFromEnd=\"" +
           from_end + "\"/>";
  }
  static std::string tunnel(const std::string& sections) {
    return "<tunnels><tunnel tunnelIdentification=\"TU\"><tunnelTubes><tunnelTube crossSection=\"40\"><trackArea>"
           "<trackEdgeSections>" +
           sections + "</trackEdgeSections></trackArea></tunnelTube></tunnelTubes></tunnel></tunnels>";
  }
  static std::vector<std::string> portals(const Map& map) {
    return marks_of(map, {LandmarkKind::portal_in, LandmarkKind::portal_out});
  }
};

TEST_F(ErjuTest, ATunnelHasItsPortalsWhereNothingOfItGoesOn) {
  EXPECT_THAT(portals(map_of(tunnel(section("T2", "0", "0")))),
              ElementsAre("portal_in TU at 0.0 on 2", "portal_out TU at 300.0 on 2"));
  EXPECT_THAT(
      portals(map_of(tunnel(section("T1", "200000", "0") + section("T2", "0", "0") + section("T3", "0", "250000")))),
      ElementsAre("portal_in TU at 200.0 on 1", "portal_out TU at 50.0 on 3"));
  EXPECT_THAT(portals(map_of(tunnel(section("T1", "200000", "0") + section("T3", "0", "250000")))),
              ElementsAre("portal_in TU at 200.0 on 1", "portal_out TU at 300.0 on 1", "portal_in TU at 0.0 on 3",
                          "portal_out TU at 50.0 on 3"));
}

TEST_F(ErjuTest, WhatIsNotOnItsTrackEdgeIsLeftOutAndTold) {
  const std::string told = " is not on its track edge \"T3\"; it is left out there";
  for (const auto& [from_start, from_end] :
       {std::pair("900000", "0"), {"0", "900000"}, {"200000", "200000"}, {"-1", "0"}}) {
    SCOPED_TRACE(std::string(from_start) + " " + from_end);
    const std::string there = section("T3", from_start, from_end);
    const Map map = map_of(tunnel(there) + "<bridges><bridge id=\"BR\"><trackArea>" + there +
                           "</trackArea></bridge></bridges><levelCrossings><levelCrossing id=\"LX\">"
                           "<spotLocation trackEdge=\"T3\" pos=\"300100\"/></levelCrossing></levelCrossings>");
    EXPECT_THAT(map.landmarks, IsEmpty());
    EXPECT_THAT(map.problems, testing::IsSupersetOf({"<tunnel> \"TU\"" + told, "<bridge> \"BR\"" + told,
                                                     "<levelCrossing> \"LX\"" + told}));
  }
}

TEST_F(ErjuTest, WhatIsNotReadIsTold) {
  const auto alignment = [](const std::string& edge, const std::string& items) {
    return "<trackEdgeGeometry id=\"" + edge + "\"><verticalAlignment>" + items +
           "</verticalAlignment></trackEdgeGeometry>";
  };
  const std::string line =
      "<verticalAlignmentItem><verticalSegmentLine trackGeometryPos=\"0\" slope=\"12.5\"/></verticalAlignmentItem>";
  const std::string cants =
      "<sampledTrackEdgeGeometry id=\"T2\"><slopes><slope pos=\"0\" samplePointSlope=\"10\"/></slopes><cants>"
      "<cant pos=\"0\" samplePointCant=\"60\"/></cants></sampledTrackEdgeGeometry>";
  EXPECT_THAT(
      map_of(alignment("T1", line) + alignment("T2", "") + alignment("T3", line) + cants).problems,
      testing::IsSupersetOf(
          {"track edge \"T1\", as 1 more, has gradients in its vertical alignment, whose units no schema at hand "
           "gives; they are left out, only sampled slopes are read",
           "track edge \"T2\" has sampled cants, whose unit and sign no schema at hand gives; they are left out, "
           "only cant points are read"}));
  EXPECT_THAT(map_of(alignment("T1", "")).problems, testing::Not(Contains(HasSubstr("no schema at hand"))));
}

}  // namespace
}  // namespace railfix::track
