// Balise groups of railML: their reference balise, their direction, and what is wrong with them.
#include "import_fixture.hpp"
#include "railml_text.hpp"
#include "track/import/build.hpp"

namespace railfix::track {
namespace {

using testing::Contains;
using testing::HasSubstr;
using testing::Not;
using RailmlBalises = ImportTest;

std::string balise(const std::string& id, const std::string& pos, const std::string& number = "",
                   const std::string& location = "") {
  return "<balise id=\"" + id + "\" belongsToBaliseGroup=\"g\"><spotLocation netElementRef=\"n1\" pos=\"" + pos + "\"" +
         location + "/><isEurobalise positionInGroup=\"" + number + "\"/></balise>";
}

std::string group3(const std::string& attributes = "", const std::string& place = "") {
  return "<baliseGroup id=\"g\" " + attributes + ">" + place +
         "<isEurobaliseGroup countryID=\"2\" groupID=\"55\"/></baliseGroup>";
}

/// "first balise at OFFSET, nominal forward (or: reverse)" of the only group.
std::string group_of(const Map& map) {
  if (map.balise_groups.size() != 1) return std::to_string(map.balise_groups.size()) + " groups";
  const BaliseGroup& group = map.balise_groups[0];
  char text[80];
  std::snprintf(text, sizeof text, "%s at %.1f, nominal %s", map.landmark(group.balises[0])->name.c_str(),
                group.offset_m, group.nominal_is_forward ? "forward" : "reverse");
  return text;
}

TEST_F(RailmlBalises, GroupsOfRailml3HaveTheDirectionThatTheFileSays) {
  const auto read = [&](const std::string& text) {
    const Map map = core::value_or_throw(build_map({write("a.railml", railml3(text))}, {})).map;
    EXPECT_THAT(map.problems, Not(Contains(HasSubstr("balise group"))));
    return group_of(map);
  };
  const std::string reverse = group3("mileageDirection=\"reverse\"");
  // By the file's word, the reference balise by its number, wherever it stands in the file.
  EXPECT_EQ(read(balise("b0", "103", "0") + balise("b1", "100", "1") + reverse), "b0 at 103.0, nominal reverse");
  EXPECT_EQ(read(balise("b2", "100", "2") + balise("b1", "103", "1") + reverse), "b1 at 103.0, nominal reverse");
  EXPECT_EQ(read(balise("b", "100") + group3("mileageDirection=\"nominal\"")), "b at 100.0, nominal forward");
  EXPECT_EQ(read(balise("near", "100") + balise("far", "103") + reverse), "far at 103.0, nominal reverse");
  EXPECT_EQ(read(group3("mileageDirection=\"reverse\"", "<spotLocation netElementRef=\"n1\" pos=\"70\"/>")),
            "g at 70.0, nominal reverse");
  // Without it: by the numbers, the order in the file, the direction that the balise applies to.
  EXPECT_EQ(read(balise("b1", "100", "1") + balise("b0", "103", "0") + group3()), "b0 at 103.0, nominal reverse");
  EXPECT_EQ(read(balise("b0", "103") + balise("b1", "100") + group3()), "b0 at 103.0, nominal reverse");
  EXPECT_EQ(read(balise("b0", "100") + balise("b1", "103") + group3()), "b0 at 100.0, nominal forward");
  EXPECT_EQ(read(balise("b", "100", "", " applicationDirection=\"reverse\"") + group3()),
            "b at 100.0, nominal reverse");
}

// A bound that the trackside counts with, not the sigma of the landmarks.
TEST_F(RailmlBalises, WhatTheFileDoesNotSayOfLocationAccuracyTheBuilderIsTold) {
  const auto file = write("a.railml", railml3(balise("b", "100") + group3("mileageDirection=\"nominal\"")));
  const auto accuracy_m = [&](const BuildOptions& options) {
    return core::value_or_throw(build_map({file}, options)).map.balise_groups.at(0).q_locacc_m;
  };
  EXPECT_EQ(accuracy_m({}), 12) << "Q_NVLOCACC";
  EXPECT_EQ(accuracy_m({.q_locacc_m = 5}), 5);
}

// The mileage that mileageDirection speaks of may fall along the net element, and the place may be told against it.
TEST_F(RailmlBalises, DirectionsTurnWithTheNetElement) {
  const auto along_mileage = [](const std::string& things, const std::string& begin_m, const std::string& end_m) {
    const std::string element = "<netElement id=\"n1\" length=\"1000\"/>";
    const auto coordinate = [](const std::string& along, const std::string& measure) {
      return "<intrinsicCoordinate intrinsicCoord=\"" + along +
             "\"><linearCoordinate positioningSystemRef=\"s\" measure=\"" + measure + "\"/></intrinsicCoordinate>";
    };
    std::string text = railml3(things);
    return text.replace(text.find(element), element.size(),
                        element.substr(0, element.size() - 2) + "><associatedPositioningSystem>" +
                            coordinate("0", begin_m) + coordinate("1", end_m) +
                            "</associatedPositioningSystem></netElement>");
  };
  const std::string falling =
      along_mileage(balise("b", "100") + group3("mileageDirection=\"reverse\""), "5000", "4000");
  EXPECT_EQ(group_of(core::value_or_throw(build_map({write("a.railml", falling)}, {})).map),
            "b at 100.0, nominal forward");
  const std::string against =
      "<linearLocation>" + on("n1", "posBegin=\"90\" posEnd=\"90\" keepsOrientation=\"false\"") + "</linearLocation>";
  const std::string text = railml3(balise("b", "90") + group3("mileageDirection=\"nominal\"", against));
  EXPECT_EQ(group_of(core::value_or_throw(build_map({write("b.railml", text)}, {})).map), "b at 90.0, nominal reverse");
  const std::string known =
      along_mileage(balise("b", "90") + group3("mileageDirection=\"nominal\"", against), "4000", "5000");
  EXPECT_EQ(group_of(core::value_or_throw(build_map({write("c.railml", known)}, {})).map), "b at 90.0, nominal forward")
      << "it is the mileage that the direction is of";
}

// Two without numbers, in the order of the file against which they apply.
TEST_F(RailmlBalises, WhatBalisesApplyToIsMoreThanTheOrderOfTheFile) {
  const std::string reverse = " applicationDirection=\"reverse\"";
  const std::string text = balise("a", "100", "", reverse) + balise("b", "103", "", reverse) + group3();
  const Map map = core::value_or_throw(build_map({write("a.railml", railml3(text))}, {})).map;
  ASSERT_EQ(map.balise_groups.size(), 1U);
  EXPECT_FALSE(map.balise_groups[0].nominal_is_forward);
}

TEST_F(RailmlBalises, WhatIsWrongWithAGroupOfRailml3IsTold) {
  const auto read = [&](const std::string& text, const std::string& problem) {
    const Map map = core::value_or_throw(build_map({write("a.railml", railml3(text))}, {})).map;
    EXPECT_THAT(map.problems, Contains(problem));
    return group_of(map);
  };
  EXPECT_EQ(read(balise("b", "100") + group3(),
                 "balise group \"g\" says no direction: it has no mileageDirection, nor balises at two places; its "
                 "balises are kept as landmarks"),
            "0 groups");
  EXPECT_EQ(
      read(balise("b0", "100", "0") + balise("b1", "103", "1") + group3("mileageDirection=\"reverse\""),
           "balise group \"g\" has a mileageDirection against the numbers of its balises; the mileageDirection is "
           "taken"),
      "b0 at 100.0, nominal reverse");
  EXPECT_EQ(read(balise("b2", "100", "2") + balise("b3", "103", "3") + group3("mileageDirection=\"nominal\""),
                 "balise group \"g\" has no balise number 0 or 1, which its place counts from; its balises are kept as "
                 "landmarks"),
            "0 groups");
  EXPECT_EQ(read(group3("mileageDirection=\"nominal\""),
                 "balise group \"g\" has no place on a track, nor has a balise of it; it is left out"),
            "0 groups");
}

/// railML 2.4 with these balises on its first track.
std::string with_balises(const std::string& balises) {
  std::string text = railml2("500");
  text.insert(text.find("</track>"), "<ocsElements><balises>" + balises + "</balises></ocsElements>");
  return text;
}

std::string group2(const std::string& first, const std::string& second) {
  return "<baliseGroup id=\"g\" countryID=\"2\" groupID=\"55\"><baliseRef ref=\"" + first +
         "\" sequence=\"1\"/><baliseRef ref=\"" + second + "\" sequence=\"2\"/></baliseGroup>";
}

TEST_F(RailmlBalises, OneIdentityOfTwoGroupsIsToldThoughOneIsNotOnTheMap) {
  const std::string two = balise("b1", "100") + group3("mileageDirection=\"nominal\"") +
                          "<baliseGroup id=\"h\"><spotLocation netElementRef=\"n1\" pos=\"300\"/>"
                          "<isEurobaliseGroup countryID=\"2\" groupID=\"55\"/></baliseGroup>";
  const Map map = core::value_or_throw(build_map({write("a.railml", railml3(two))}, {})).map;
  ASSERT_EQ(map.balise_groups.size(), 1U) << "the other one says no direction";
  EXPECT_THAT(map.problems, Contains(HasSubstr("\"g\" and <baliseGroup> \"h\" have one identity, 2/55")));
}

// A group that its balises locate has a place.
TEST_F(RailmlBalises, AGroupWithoutALocationOfItsOwnLiesWhereItsBalisesDo) {
  const std::string text = balise("b1", "100") + group3("mileageDirection=\"nominal\"");
  const Map map = core::value_or_throw(build_map({write("a.railml", railml3(text))}, {})).map;
  EXPECT_THAT(map.problems, Not(Contains(HasSubstr("has no location"))));
}

TEST_F(RailmlBalises, BalisesOfRailml2BesideTheirTrackAreLeftOut) {
  const std::string text = with_balises("<balise id=\"a\" pos=\"-500\"/><balise id=\"b\" pos=\"103\"/>" +
                                        group2("a", "b") + "<balise id=\"c\" pos=\"9000\"/>");
  const Map map = core::value_or_throw(build_map({write("a.railml", text)}, {})).map;
  EXPECT_THAT(marks_of(map, {LandmarkKind::balise}), testing::ElementsAre("balise b at 103.0 on 1"));
  EXPECT_TRUE(map.balise_groups.empty()) << "nobody knows where it is without its first balise";
  EXPECT_THAT(map.problems, testing::IsSupersetOf(
                                {"<balise> \"a\" is not on its track; it is left out",
                                 "<balise> \"c\" is not on its track; it is left out",
                                 "balise group \"g\" lacks its first balise, which its place counts from; its other "
                                 "balises are kept as landmarks"}));
}

TEST_F(RailmlBalises, BalisesOfRailml2ThatAreNotThereAreTold) {
  const std::string text =
      with_balises("<balise id=\"a\" pos=\"100\"/><balise id=\"b\" pos=\"97\"/>" + group2("a", "nope"));
  const Map map = core::value_or_throw(build_map({write("a.railml", text)}, {})).map;
  EXPECT_EQ(group_of(map), "0 groups");
  EXPECT_THAT(map.problems, testing::IsSupersetOf({"balise group \"g\" names the balise \"nope\", which is not on its "
                                                   "track or in another group; it goes without",
                                                   "balise group \"g\" says no direction: it has no balises at two "
                                                   "places, nor one with \"dir\" up or down; its balises are kept as "
                                                   "landmarks"}));
}

TEST_F(RailmlBalises, GroupsOfRailml2HaveTheDirectionOfTheirBalises) {
  const auto read = [&](const std::string& balises) {
    const Map map = core::value_or_throw(build_map({write("a.railml", with_balises(balises))}, {})).map;
    EXPECT_THAT(map.problems, Not(Contains(HasSubstr("balise group"))));
    return group_of(map);
  };
  const auto at = [](const std::string& a, const std::string& b) {
    return "<balise id=\"a\" dir=\"down\" pos=\"" + a + "\"/><balise id=\"b\" pos=\"" + b + "\"/>" + group2("a", "b");
  };
  EXPECT_EQ(read(at("100", "103")), "a at 100.0, nominal forward");
  EXPECT_EQ(read(at("103", "100")), "a at 103.0, nominal reverse");
  EXPECT_EQ(read(at("100", "100")), "a at 100.0, nominal reverse") << "at one place they say nothing, \"dir\" does";
}

}  // namespace
}  // namespace railfix::track
