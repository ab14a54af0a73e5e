// railML as short as it can be, for tests that put one thing into it.
#pragma once

#include <string>

namespace railfix::track {

// 1000 m with a left curve from 300 m to 800 m; a branch leaves to the right at the place put in.
inline std::string railml2(const std::string& switch_pos, const std::string& cant = "100") {
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

// n1 (1000 m) leads into n2 (800 m) or, over a switch, into n3 (500 m).
inline std::string railml3(const std::string& infrastructure) {
  return R"(<railML version="3.2"><infrastructure><topology><netElements>
<netElement id="n1" length="1000"/><netElement id="n2" length="800"/><netElement id="n3" length="500"/></netElements><netRelations>
<netRelation id="r12" navigability="Both" positionOnA="1" positionOnB="0"><elementA ref="n1"/><elementB ref="n2"/></netRelation>
<netRelation id="r13" navigability="Both" positionOnA="1" positionOnB="0"><elementA ref="n1"/><elementB ref="n3"/></netRelation>
<netRelation id="r23" navigability="None" positionOnA="0" positionOnB="0"><elementA ref="n2"/><elementB ref="n3"/></netRelation>
</netRelations></topology><functionalInfrastructure>)" +
         infrastructure + "</functionalInfrastructure></infrastructure></railML>";
}

inline std::string on(const std::string& net_element, const std::string& attributes) {
  return "<associatedNetElement netElementRef=\"" + net_element + "\" " + attributes + "/>";
}

inline std::string crossing(const std::string& attributes, const std::string& places) {
  return "<overCrossing " + attributes + "><linearLocation>" + places + "</linearLocation></overCrossing>";
}

}  // namespace railfix::track
