// A plan in each of the three languages of planners, and what tests ask of the maps that come of them.
#pragma once

#include <string>
#include <utility>
#include <vector>

#include "core/units.hpp"
#include "track/map.hpp"

namespace railfix::track {

inline double length_of(const Map& map) {
  double sum = 0;
  for (const Edge& edge : map.edges) sum += edge.alignment.length_m();
  return sum;
}

/// Name and offset of the only level crossing.
inline std::pair<std::string, double> level_crossing_of(const Map& map) {
  std::vector<const Landmark*> found;
  for (const Landmark& mark : map.landmarks) {
    if (mark.kind == LandmarkKind::level_crossing) found.push_back(&mark);
  }
  return found.size() == 1 ? std::pair(found[0]->name, found[0]->offset_m)
                           : std::pair(std::string("none or many"), 0.0);
}

/// km/h, 0 = none said.
inline double limit_kmh(const Map& map, uint32_t edge, double offset_m, Direction running) {
  return core::kmh_from_mps(map.edge(edge)->speed_limit_mps(offset_m, running).value_or(0));
}

// A line of 1000 m with a right curve; a siding leaves it to the left at 300 m and comes back at 700 m.
inline constexpr const char* kRailml2 = R"(<?xml version="1.0"?>
<railml xmlns="https://www.railml.org/schemas/2018" version="2.4"><infrastructure id="i"><tracks>
<track id="t1" name="main"><trackTopology><trackBegin id="b1" pos="0"><openEnd id="o1"/></trackBegin>
<trackEnd id="e1" pos="1000"><bufferStop id="o2"/></trackEnd><connections>
<switch id="w1" name="W1" pos="300" trackContinueCourse="straight"><connection id="c1" ref="c3" orientation="outgoing" course="left"/></switch>
<switch id="w2" name="W2" pos="700" trackContinueCourse="straight"><connection id="c2" ref="c4" orientation="incoming" course="right"/></switch>
</connections></trackTopology><trackElements><radiusChanges><radiusChange id="r1" pos="800" radius="500" superelevation="60"/>
<radiusChange id="r2" pos="950" radius="0"/></radiusChanges><gradientChanges><gradientChange id="g1" pos="0" slope="5"/>
<gradientChange id="g2" pos="400" slope="-10"/></gradientChanges>
<bridges><brigde id="br1" name="B" pos="40" length="20" kind="under"/><bridge id="br2" name="C" pos="80" length="20"/>
<brigde id="br3" name="D" pos="120" length="10" kind="crossing"/></bridges>
<tunnels><tunnel id="tu1" name="T" pos="820" length="100"/></tunnels>
<platformEdges><platformEdge id="pe1" name="P" pos="400" length="150" side="left"/></platformEdges>
<levelCrossings><levelCrossing id="lc1" name="Mill Lane" pos="100"/></levelCrossings>
<speedChanges><speedChange id="v1" pos="0" dir="up" vMax="80"/><speedChange id="v2" pos="500" dir="up" vMax="120"/>
<speedChange id="v3" pos="900" dir="down" vMax="60"/><speedChange id="v4" pos="200" dir="down" vMax="end"/>
<speedChange id="v5" pos="0" dir="up" vMax="20" profileRef="slow"/></speedChanges></trackElements>
<ocsElements><signals><signal id="s1" name="S" pos="280"/></signals><balises><balise id="x1" pos="200"/><balise id="x2" pos="203"/>
<baliseGroup id="bg1" name="BG" countryID="97" groupID="1234"><baliseRef ref="x1" sequence="1"/><baliseRef ref="x2" sequence="2"/></baliseGroup>
</balises></ocsElements></track>
<track id="t2" name="siding"><trackTopology><trackBegin id="b2" pos="0"><connection id="c3" ref="c1"/></trackBegin>
<trackEnd id="e2" pos="400"><connection id="c4" ref="c2"/></trackEnd></trackTopology></track>
</tracks><infraAttrGroups/><speedProfiles><speedProfile id="slow" influence="decreasing"/></speedProfiles></infrastructure></railml>)";

inline constexpr const char* kRailml3 = R"(<?xml version="1.0"?>
<railML xmlns="https://www.railml.org/schemas/3.2" version="3.2"><common><positioning><geometricPositioningSystems>
<geometricPositioningSystem id="gps" crsDefinition="EPSG:25832"/></geometricPositioningSystems></positioning></common>
<infrastructure><topology><netElements>
<netElement id="n1" length="300"><associatedPositioningSystem><intrinsicCoordinate intrinsicCoord="0"><geometricCoordinate positioningSystemRef="gps" x="500000" y="5500000"/></intrinsicCoordinate>
<intrinsicCoordinate intrinsicCoord="1"><geometricCoordinate positioningSystemRef="gps" x="500300" y="5500000"/></intrinsicCoordinate></associatedPositioningSystem></netElement>
<netElement id="n2" length="200"/><netElement id="n3" length="200"/></netElements><netRelations>
<netRelation id="r12" navigability="Both" positionOnA="1" positionOnB="0"><elementA ref="n1"/><elementB ref="n2"/></netRelation>
<netRelation id="r13" navigability="Both" positionOnA="1" positionOnB="0"><elementA ref="n1"/><elementB ref="n3"/></netRelation>
<netRelation id="r23" navigability="None" positionOnA="0" positionOnB="0"><elementA ref="n2"/><elementB ref="n3"/></netRelation>
</netRelations></topology><geometry><gradientCurves><gradientCurve id="g1" curveType="straight" gradient="5"><linearLocation>
<associatedNetElement netElementRef="n2" posBegin="0" posEnd="200"/></linearLocation></gradientCurve></gradientCurves></geometry><functionalInfrastructure>
<switchesIS><switchIS id="s1" branchCourse="right" continueCourse="left" type="ordinarySwitch"><name name="W7"/>
<leftBranch netRelationRef="r12"/><rightBranch netRelationRef="r13"/></switchIS></switchesIS>
<overCrossings><overCrossing id="o1" constructionType="tunnel"><linearLocation><associatedNetElement netElementRef="n2" posBegin="50" posEnd="150"/></linearLocation></overCrossing>
<overCrossing id="o2" constructionType="bridge"><linearLocation><associatedNetElement netElementRef="n3" posBegin="20" posEnd="30"/></linearLocation></overCrossing></overCrossings>
<underCrossings><underCrossing id="u1" constructionType="bridge"><linearLocation><associatedNetElement netElementRef="n3" posBegin="40" posEnd="60"/></linearLocation></underCrossing></underCrossings>
<signalsIS><signalIS id="s2"><spotLocation netElementRef="n1" pos="250"/></signalIS></signalsIS>
<balises><balise id="b1" baliseGroupRef="bg"><spotLocation netElementRef="n1" pos="200"/></balise>
<balise id="b2" baliseGroupRef="bg"><spotLocation netElementRef="n1" pos="203"/></balise><balise id="b3"><spotLocation netElementRef="n2" pos="20"/></balise></balises>
<baliseGroups><baliseGroup id="bg"><etcs countryID="97" groupID="77"/></baliseGroup></baliseGroups>
<platformEdges><platformEdge id="p1"><linearLocation><associatedNetElement netElementRef="n3" posBegin="100" posEnd="180"/></linearLocation></platformEdge></platformEdges>
<levelCrossingsIS><levelCrossingIS id="x1"><name name="Mill Lane"/><spotLocation netElementRef="n1" pos="120"/></levelCrossingIS></levelCrossingsIS>
<speeds><speedProfile id="basic" isBasicSpeedProfile="true"/><speedProfile id="tilting" isBasicSpeedProfile="false"/>
<speedSection id="v1" maxSpeed="100"><linearLocation><associatedNetElement netElementRef="n1" posBegin="50" posEnd="300"/></linearLocation><validForSpeedProfile ref="basic"/></speedSection>
<speedSection id="v2" maxSpeed="130"><linearLocation><associatedNetElement netElementRef="n2" posBegin="0" posEnd="200"/></linearLocation><validForSpeedProfile ref="tilting"/></speedSection>
<speedSection id="v3" maxSpeed="40"><linearLocation applicationDirection="reverse"><associatedNetElement netElementRef="n3" posBegin="0" posEnd="200"/></linearLocation></speedSection></speeds>
</functionalInfrastructure></infrastructure></railML>)";

inline constexpr const char* kInfra = R"(<?xml version="1.0"?>
<infrastructure xmlns="https://erju.org/infra"><trackEdges><trackEdge id="T1" trackEdgeLength="500000"/><trackEdge id="T2" trackEdgeLength="300000"/></trackEdges>
<trackEdgeLinks><trackEdgeLink id="l" trackEdgeA="T1" trackEdgeB="T2" startOfA="false" startOfB="true"/></trackEdgeLinks>
<trackEdgeGeometries><trackEdgeGeometry id="T1"><cantPoints><cantPoint trackGeometryPos="0" appliedCant="0"/><cantPoint trackGeometryPos="100000" appliedCant="50"/></cantPoints></trackEdgeGeometry></trackEdgeGeometries>
<sampledTrackEdgeGeometry id="T1"><slopes><slope pos="0" samplePointSlope="100"/></slopes></sampledTrackEdgeGeometry>
<teSpeedProfiles><teSpeedProfile id="T1"><sameDirProfile><staticSpeedProfile><staticSpeedProfileItem pos="0" speed="60"/>
<staticSpeedProfileItem pos="200000" speed="40"/></staticSpeedProfile></sameDirProfile><oppositeDirProfile><staticSpeedProfile>
<staticSpeedProfileItem pos="300000" speed="50"/><staticSpeedProfileItem pos="500000" speed="70"/></staticSpeedProfile></oppositeDirProfile></teSpeedProfile></teSpeedProfiles>
<platforms><platform id="P"><platformEdges><platformEdge platformId="P1" height="380"><linearLocation skipFromPathStart="420000" skipFromPathEnd="260000">
<dirTrackEdges><dirTrackEdge trackEdge="T1" sameDir="true"/><dirTrackEdge trackEdge="T2" sameDir="true"/></dirTrackEdges></linearLocation></platformEdge>
<platformEdge platformId="P2" height="380"><linearLocation skipFromPathStart="200000" skipFromPathEnd="50000"><dirTrackEdges>
<dirTrackEdge trackEdge="T2" sameDir="false"/></dirTrackEdges></linearLocation></platformEdge>
<platformEdge platformId="P3" height="380"><linearLocation skipFromPathStart="900000" skipFromPathEnd="0"><dirTrackEdges>
<dirTrackEdge trackEdge="T2" sameDir="true"/></dirTrackEdges></linearLocation></platformEdge></platformEdges></platform></platforms>
<tunnels><tunnel id="TU"><trackArea><trackEdgeSections><trackEdgeSection trackEdge="T2" skipFromStart="120000" skipFromEnd="80000"/></trackEdgeSections></trackArea></tunnel></tunnels>
<bridges><bridge id="BR"><trackArea><trackEdgeSections><trackEdgeSection trackEdge="T2" skipFromStart="240000" skipFromEnd="40000"/></trackEdgeSections></trackArea></bridge></bridges>
<levelCrossings><levelCrossing id="LX"><trackArea><trackEdgeSection trackEdge="T2" skipFromStart="100000" skipFromEnd="190000"/></trackArea></levelCrossing></levelCrossings>
<baliseGroups><baliseGroup id="G" nid_c="97" nid_bg="5050" linkOrientationDirection="dirReverse"><balises>
<balise id="G0"><spotLocation trackEdge="T2" pos="13000"/></balise><balise id="G1"><spotLocation trackEdge="T2" pos="10000"/></balise></balises></baliseGroup></baliseGroups>
<etcsMarkers><etcsMarker id="12" markerFunctionStop="false"><dirSpotLocation trackEdge="T1" pos="92073" sameDir="false"/></etcsMarker>
<etcsMarker id="13" markerFunctionStop="true"><dirSpotLocation trackEdge="T2" pos="300001" sameDir="true"/></etcsMarker></etcsMarkers>
<timingPoints><timingPoint id="TP"><activeObject><etcsMarker ref="12"/></activeObject></timingPoint></timingPoints>
</infrastructure>)";

}  // namespace railfix::track
