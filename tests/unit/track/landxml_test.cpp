#include "track/import/xml/landxml.hpp"

#include <ctime>
#include <pugixml.hpp>
#include <sstream>

#include "core/random.hpp"
#include "core/units.hpp"
#include "import_fixture.hpp"
#include "track/import/build.hpp"

namespace railfix::track {
namespace {

using testing::HasSubstr;
using LandXmlTest = ImportTest;

// A straight of 100 m northwards, a clothoid of 60 m into a right curve of radius 300 m, 100 m of that.
constexpr const char* kSample = R"(<?xml version="1.0"?>
<LandXML version="1.2"><Units><Metric linearUnit="meter"/></Units><Alignments><Alignment name="L1" length="260" staStart="1000">
<CoordGeom>
<Line length="100"><Start>5000 2000</Start><End>5100 2000</End></Line>
<Spiral length="60" radiusStart="INF" radiusEnd="300" rot="cw" spiType="clothoid"><Start>5100 2000</Start><End>5159.940027771 2001.998571883</End></Spiral>
<Curve rot="cw" radius="300" length="100" crvType="arc"><Start>5159.940027771 2001.998571883</Start><End>5255.959512788 2028.228481536</End></Curve>
</CoordGeom>
<Profile><ProfAlign><PVI>1000 400</PVI><CircCurve length="40" radius="4000">1130 401.3</CircCurve><PVI>1260 401.3</PVI></ProfAlign></Profile>
<Cant gauge="1.435"><CantStation station="1100" appliedCant="0" curvature="cw"/><CantStation station="1160" appliedCant="120" curvature="cw"/></Cant>
</Alignment></Alignments></LandXML>)";

TEST_F(LandXmlTest, ReadsPlanProfileAndCant) {
  const LandXml read = core::value_or_throw(read_landxml(write("l.xml", kSample)));
  ASSERT_EQ(read.tracks.size(), 1U);
  const Alignment& track = read.tracks[0].alignment;
  EXPECT_EQ(read.tracks[0].name, "L1");
  EXPECT_EQ(read.crs, "");
  EXPECT_NEAR(track.length_m(), 260, 1e-3);
  EXPECT_NEAR(track.at(0).pose.northing_m, 5000, 1e-9);
  EXPECT_NEAR(track.at(0).pose.easting_m, 2000, 1e-9);
  EXPECT_NEAR(track.at(50).pose.heading_rad, 0, 1e-9);
  EXPECT_NEAR(track.at(200).curvature_per_m, -1.0 / 300, 1e-12);  // clockwise is to the right
  EXPECT_GT(track.at(200).pose.heading_rad, 0.1);
  EXPECT_NEAR(track.at(130).cant_m, -0.06, 1e-6);  // the left rail is the outer, higher one
  EXPECT_NEAR(track.at(130).elevation_m, 401.3 - 0.01 * 40 / 8, 1e-5);
  EXPECT_NEAR(track.at(20).grade, 0.01, 1e-6);
  EXPECT_THAT(read.problems, testing::IsEmpty());
  EXPECT_LT(read.figures.max_heading_step_rad, 1e-6);
}

TEST_F(LandXmlTest, AnArcThatDoesNotLeadToItsEndShowsInTheFigures) {
  std::string text = kSample;
  EXPECT_LT(core::value_or_throw(read_landxml(write("l.xml", text))).figures.max_end_error_m, 1e-4);
  const std::string radius = "cw\" radius=\"300\"";
  text.replace(text.find(radius), radius.size(), "cw\" radius=\"310\"");
  EXPECT_NEAR(core::value_or_throw(read_landxml(write("w.xml", text))).figures.max_end_error_m, 0.029, 0.002);
}

// A length that is wrong moves neither profile nor cant: every element says its own station.
TEST_F(LandXmlTest, StationsOfTheElementsHoldWhereLengthsDoNotAddUp) {
  const auto sample = [](const std::string& length_of_line, const std::string& length_of_arc) {
    std::string text = kSample;
    const auto replace = [&](const std::string& from, const std::string& to) {
      const size_t at = text.find(from);
      ASSERT_NE(at, std::string::npos) << from;
      text.replace(at, from.size(), to);
    };
    replace("<Line length=\"100\"", "<Line length=\"" + length_of_line + "\" staStart=\"1000\"");
    replace("<Spiral length=\"60\"", "<Spiral length=\"60\" staStart=\"1100\"");
    replace("radius=\"300\" length=\"100\"", "radius=\"300\" length=\"" + length_of_arc + "\" staStart=\"1160\"");
    return text;
  };
  const auto right = core::value_or_throw(read_landxml(write("r.xml", sample("100", "100"))));
  EXPECT_THAT(right.problems, testing::IsEmpty());
  for (const auto& [line, arc, told] : {std::tuple("118", "100", "line 5 begins at 1100.00 m, 18.00 m before the end"),
                                        {"82", "100", "line 5 begins at 1100.00 m, 18.00 m behind the end"},
                                        {"100", "-100", "has the length -100.00 m; it gets that of the arc"}}) {
    const auto read = core::value_or_throw(read_landxml(write("w.xml", sample(line, arc))));
    EXPECT_THAT(read.problems, testing::Contains(HasSubstr(told))) << line << arc;
    const Alignment& track = read.tracks[0].alignment;
    EXPECT_NEAR(track.length_m(), 260, 1e-3);
    for (const double at_m : {110.0, 130.0, 150.0, 170.0, 250.0}) {
      EXPECT_NEAR(track.at(at_m).elevation_m, right.tracks[0].alignment.at(at_m).elevation_m, 1e-4) << line << arc;
      EXPECT_NEAR(track.at(at_m).cant_m, right.tracks[0].alignment.at(at_m).cant_m, 1e-5) << line << arc;
    }
  }
}

TEST_F(LandXmlTest, ClosesElementsOntoTheirEndsAndKeepsTheCurvature) {
  core::Random random(5);
  for (int i = 0; i < 200; ++i) {
    const Element drawn{random.uniform(1, 500), random.uniform(-0.004, 0.004),
                        i % 3 == 0 ? 0.0 : random.uniform(-0.004, 0.004)};
    const PlanPose start{random.uniform(0, 1e6), random.uniform(0, 1e6), random.uniform(-3, 3)};
    const PlanPose end = advance(start, drawn, drawn.length_m);
    const ClosedElement closed =
        close_element({start.easting_m, start.northing_m}, {end.easting_m, end.northing_m}, drawn.curvature_start_per_m,
                      drawn.curvature_end_per_m, drawn.length_m * 1.0001);
    EXPECT_NEAR(closed.element.length_m, drawn.length_m, 1e-6);
    EXPECT_NEAR(core::wrap_pi(closed.start.heading_rad - start.heading_rad), 0, 1e-9);
    const PlanPose reached = advance(closed.start, closed.element, closed.element.length_m);
    EXPECT_NEAR(std::hypot(reached.easting_m - end.easting_m, reached.northing_m - end.northing_m), 0, 1e-8);
  }
}

// The file itself is the reference: every element must end where the file says, at the station the file says.
TEST_F(LandXmlTest, SwissMainLineIsReproducedWithinATenthOfAMillimetre) {
  const std::filesystem::path file = shared_data("alignment/sbb_mszw_a2.landxml");
  if (!std::filesystem::exists(file)) GTEST_SKIP() << "skipped: no " << file;
  const LandXml read = core::value_or_throw(read_landxml(file));
  EXPECT_EQ(read.crs, "EPSG:2056");
  ASSERT_EQ(read.tracks.size(), 10U);
  pugi::xml_document document;
  ASSERT_TRUE(document.load_file(file.c_str()));
  const pugi::xml_node alignment = document.child("LandXML").child("Alignments").child("Alignment");
  const Alignment& track = read.tracks[0].alignment;
  ASSERT_EQ(read.tracks[0].name, "A50034A");
  size_t i = 0;
  double worst_m = 0;
  for (const pugi::xml_node& element : alignment.child("CoordGeom").children()) {
    std::istringstream text(element.child("End").text().get());
    double northing = 0;
    double easting = 0;
    text >> northing >> easting;
    const double length = element.attribute("length").as_double();
    const PlanPose end = advance(track.starts()[i], track.elements()[i], length);
    worst_m = std::max(worst_m, std::hypot(end.easting_m - easting, end.northing_m - northing));
    // And by dead reckoning with the file's own stations over all the elements before.
    const double station = element.attribute("staStart").as_double() + length;
    const PlanPose at = track.at(station - 1e-6).pose;
    EXPECT_LT(std::hypot(at.easting_m - easting, at.northing_m - northing), 1e-3) << station;
    ++i;
  }
  EXPECT_EQ(i, 103U);
  EXPECT_EQ(track.elements().size(), 103U);
  EXPECT_LT(worst_m, 1e-4);
  EXPECT_LT(read.figures.max_heading_step_rad, 1e-3);
}

TEST_F(LandXmlTest, TellsCantOnTheInnerRailCantInMetresAndALengthWithoutUnit) {
  const auto problems = [&](const std::vector<std::pair<std::string, std::string>>& changes) {
    std::string text = kSample;
    for (const auto& [from, to] : changes) {
      const size_t at = text.find(from);
      EXPECT_NE(at, std::string::npos) << from;
      text.replace(at, from.size(), to);
    }
    return core::value_or_throw(build_map({write("c.xml", text)}, {})).map.problems;
  };
  const auto inner = HasSubstr("the inner rail is the higher one on ");
  const auto metres = HasSubstr("the largest cant is 0.12 mm: the source has it in metres");
  const auto unit = HasSubstr("the file names no unit of length");
  EXPECT_THAT(problems({}), testing::Each(testing::Not(testing::AnyOf(inner, metres, unit))));
  EXPECT_THAT(problems({{"appliedCant=\"120\"", "appliedCant=\"-120\""}}), testing::Contains(inner));
  EXPECT_THAT(problems({{"curvature=\"cw\"", "curvature=\"ccw\""},
                        {"appliedCant=\"120\" curvature=\"cw\"", "appliedCant=\"120\" curvature=\"ccw\""}}),
              testing::Contains(inner));
  EXPECT_THAT(problems({{"appliedCant=\"120\"", "appliedCant=\"0.12\""}}), testing::Contains(metres));
  EXPECT_THAT(problems({{" linearUnit=\"meter\"", ""}}), testing::Contains(unit));
}

// Of a plan whose axes are exchanged nothing else is wrong.
TEST_F(LandXmlTest, APlanThatLiesWhereItsSystemIsNotMadeForIsTold) {
  const auto problems = [&](const std::string& begin, const std::string& end, const std::string& epsg) {
    const std::string text =
        "<LandXML version=\"1.2\"><Units><Metric linearUnit=\"meter\"/></Units><CoordinateSystem epsgCode=\"" + epsg +
        "\"/><Alignments><Alignment name=\"L\" length=\"1000\" staStart=\"0\"><CoordGeom><Line "
        "length=\"1000\"><Start>" +
        begin + "</Start><End>" + end + "</End></Line></CoordGeom></Alignment></Alignments></LandXML>";
    return core::value_or_throw(build_map({write("w.xml", text)}, {})).map.problems;
  };
  const auto elsewhere = HasSubstr("the tracks lie around ");
  EXPECT_THAT(problems("1200000 2600000", "1201000 2600000", "2056"), testing::Each(testing::Not(elsewhere)));
  EXPECT_THAT(problems("2600000 1200000", "2601000 1200000", "2056"),
              testing::Contains(HasSubstr("eastings and northings are exchanged, and the map is a mirror image")));
  EXPECT_THAT(problems("1200000 2600000", "1201000 2600000", "21781"),
              testing::Contains(testing::AllOf(elsewhere, HasSubstr("the coordinates are of another system"))));
}

TEST_F(LandXmlTest, NamesTheLineThatIsWrong) {
  const auto message = [&](const std::string& from, const std::string& to) {
    std::string text = kSample;
    text.replace(text.find(from), from.size(), to);
    const core::Result<LandXml> read = read_landxml(write("bad.xml", text));
    return read.ok() ? std::string("was read") : read.error().message;
  };
  EXPECT_THAT(message("radius=\"300\" ", "radius=\"abc\" "), HasSubstr("line 6"));
  EXPECT_THAT(message("radius=\"300\" ", "radius=\"3\" "), HasSubstr("less than 10 m"));
  EXPECT_THAT(message("rot=\"cw\" radius", "rot=\"up\" radius"), HasSubstr("cw or ccw"));
  EXPECT_THAT(message("5100 2000</End>", "5100</End>"), HasSubstr("line 4"));
  EXPECT_THAT(message("5255.959512788", "1e300"), HasSubstr("1000 km"));
  EXPECT_THAT(message("linearUnit=\"meter\"", "linearUnit=\"foot\""), HasSubstr("metres"));
  EXPECT_THAT(message("<PVI>1260", "<PVI>1100"), HasSubstr("must grow"));
  EXPECT_THAT(message("appliedCant=\"120\"", "appliedCant=\"nan\""), HasSubstr("appliedCant"));
  EXPECT_THAT(message("staStart=\"1000\"", "staStart=\"1+000\""),
              HasSubstr("line 2: <Alignment> needs a number in the attribute \"staStart\", not \"1+000\""));
  EXPECT_THAT(message("staStart=\"1000\"", "staStart=\"1000,0\""), HasSubstr("not \"1000,0\""));
  EXPECT_THAT(message("<PVI>1000 400", "<PVI>1+000 400"), HasSubstr("not \"1+000 400\""));
  EXPECT_THAT(message("<Line length=\"100\"", "<Line length=\"0\""), HasSubstr("its length is not above 0"));
  EXPECT_THAT(message("</CoordGeom>", ""), HasSubstr("not sound XML"));
  EXPECT_THAT(message("<Line ", "<Chain "), HasSubstr("not sound XML"));
  EXPECT_FALSE(read_landxml(in_folder("none.xml")).ok());
}

TEST_F(LandXmlTest, TellsOfElementsThatDoNotFit) {
  std::string text = kSample;
  text.replace(text.find("5255.959512788"), 14, "5254.959512788");
  const LandXml read = core::value_or_throw(read_landxml(write("bad.xml", text)));
  ASSERT_THAT(read.problems, testing::Not(testing::IsEmpty()));
  EXPECT_THAT(read.problems[0], HasSubstr("line 6"));
}

TEST_F(LandXmlTest, TellsOfStationsOutsideTheAlignment) {
  std::string text = kSample;
  text.replace(text.find(" staStart=\"1000\""), 16, "");
  EXPECT_THAT(core::value_or_throw(read_landxml(write("a.xml", text))).problems,
              testing::ElementsAre(AllOf(HasSubstr("L1: 3 of 3 profile stations"), HasSubstr(": 1000")),
                                   AllOf(HasSubstr("L1: 2 of 2 cant stations"), HasSubstr(": 1100"))));
}

TEST_F(LandXmlTest, TellsAnAlignmentWithoutAPlan) {
  std::string text = kSample;
  text.insert(text.find("</Alignments>"), "<Alignment name=\"L2\" length=\"5\" staStart=\"0\"/>");
  const LandXml read = core::value_or_throw(read_landxml(write("l.xml", text)));
  EXPECT_EQ(read.tracks.size(), 1U);
  EXPECT_THAT(read.problems, testing::ElementsAre("L2 in line 10 has no <CoordGeom>; it is left out"));
}

TEST_F(LandXmlTest, TellsWhatIsThereTwice) {
  std::string text = kSample;
  text.insert(text.find("</Alignment>"), "<Cant/>");
  EXPECT_THAT(core::value_or_throw(read_landxml(write("a.xml", text))).problems,
              testing::ElementsAre(HasSubstr("L1: it has more than one <Cant>")));
}

TEST_F(LandXmlTest, TakesTheDesignOutOfSeveralProfiles) {
  const std::string profile = "<Profile><ProfAlign>";
  const auto elevation_m = [&](const std::string& before, const std::string& of_design,
                               const std::vector<std::string>& problems) {
    std::string text = kSample;
    text.replace(text.find(profile), profile.size(), before + "<ProfAlign" + of_design + ">");
    const LandXml read = core::value_or_throw(read_landxml(write("a.xml", text)));
    EXPECT_EQ(read.problems, problems);
    return read.tracks[0].alignment.at(0).elevation_m;
  };
  const std::string ground = "<PVI>1000 0</PVI><PVI>1260 0</PVI></ProfAlign>";
  const std::string unused = "L1: the <ProfAlign> \"Existing\" in line 8 is not used";
  EXPECT_NEAR(elevation_m("<Profile><ProfAlign name=\"Existing\">" + ground, "", {unused}), 400, 1e-9);
  EXPECT_NEAR(elevation_m("<Profile name=\"g\" state=\"existing\"><ProfAlign name=\"Existing\">" + ground +
                              "</Profile><Profile>",
                          "", {unused}),
              400, 1e-9);
  EXPECT_NEAR(
      elevation_m("<Profile><ProfSurf name=\"s\"><PntList2D>1000 0 1260 0</PntList2D></ProfSurf></Profile><Profile>",
                  "", {"L1: the <ProfSurf> \"s\" in line 8 is not used"}),
      400, 1e-9);
  // One without heights is none; of two alike the first holds.
  EXPECT_NEAR(elevation_m("<Profile><ProfAlign name=\"e\"/>", "", {"L1: the <ProfAlign> \"e\" in line 8 is not used"}),
              400, 1e-9);
  EXPECT_NEAR(elevation_m("<Profile><ProfAlign name=\"a\">" + ground, " name=\"b\"",
                          {"L1: the <ProfAlign> \"b\" in line 8 is not used"}),
              0, 1e-9);
}

TEST_F(LandXmlTest, NoDamageToTheFileCrashesIt) {
  const std::string whole = kSample;
  core::Random random(9);
  for (size_t length = 0; length < whole.size(); length += 11) {
    EXPECT_FALSE(read_landxml(write("cut.xml", whole.substr(0, length))).ok());
  }
  for (int i = 0; i < 150; ++i) {
    std::string bad = whole;
    for (int k = 0; k < 3; ++k) bad[random.next() % bad.size()] = static_cast<char>(random.next());
    const core::Result<LandXml> read = read_landxml(write("bad.xml", bad));
    if (!read.ok()) continue;
    for (const ImportedTrack& track : read.value().tracks) {
      EXPECT_TRUE(std::isfinite(track.alignment.at(10).pose.easting_m));
    }
  }
}

/// A straight of 5 km with this in its alignment.
std::string straight_with(const std::string& parts) {
  return "<LandXML version=\"1.2\"><Units><Metric linearUnit=\"meter\"/></Units><Alignments><Alignment name=\"A\" "
         "length=\"5000\" staStart=\"0\"><CoordGeom><Line><Start>5300000 600000</Start><End>5300000 605000</End></Line>"
         "</CoordGeom>" +
         parts + "</Alignment></Alignments></LandXML>";
}
std::string profile_of(const std::string& points) {
  return "<Profile><ProfAlign name=\"p\">" + points + "</ProfAlign></Profile>";
}

TEST_F(LandXmlTest, WhatEndsBeforeItsAlignmentIsAGuessAndTold) {
  const auto read = [&](const std::string& parts) {
    return core::value_or_throw(read_landxml(write("a.xml", straight_with(parts))));
  };
  const LandXml half = read(profile_of("<PVI>200 400</PVI><PVI>700 410</PVI>"));
  const Alignment& track = half.tracks[0].alignment;
  EXPECT_TRUE(track.grade_known_at(450));
  EXPECT_NEAR(track.at(450).grade, 0.02, 1e-12);
  for (const auto& [at_m, elevation_m] : {std::pair(0.0, 400.0), {100.0, 400.0}, {4000.0, 410.0}, {5000.0, 410.0}}) {
    EXPECT_FALSE(track.grade_known_at(at_m)) << at_m;
    EXPECT_NEAR(track.at(at_m).elevation_m, elevation_m, 1e-9) << at_m;
    EXPECT_EQ(track.at(at_m).grade, 0) << at_m;
  }
  EXPECT_THAT(half.problems,
              testing::ElementsAre("A: the profile reaches from 200.000 to 700.000, the alignment from 0.000 to "
                                   "5000.000; it is level beyond: a guess"));
  const LandXml single = read(profile_of("<PVI>200 400</PVI>"));
  for (const double at_m : {0.0, 200.0, 300.0, 5000.0}) EXPECT_FALSE(single.tracks[0].alignment.grade_known_at(at_m));
  EXPECT_THAT(single.problems, testing::ElementsAre(HasSubstr("the profile reaches from 200.000 to 200.000")));
  for (const char* at_an_end : {"<PVI>0 400</PVI>", "<PVI>5000 400</PVI>"})
    EXPECT_THAT(read(profile_of(at_an_end)).problems, testing::ElementsAre(HasSubstr("the profile reaches from")));
  EXPECT_THAT(read(profile_of("<PVI>0 400</PVI><PVI>5000 410</PVI>")).problems, testing::IsEmpty());
}

TEST_F(LandXmlTest, CantThatRunsOnBehindItsLastStationIsTold) {
  const auto problems = [&](const std::string& last_mm) {
    const std::string cant =
        "<Cant><CantStation station=\"100\" appliedCant=\"0\" curvature=\"ccw\"/><CantStation station=\"200\" "
        "appliedCant=\"" +
        last_mm + "\" curvature=\"ccw\"/></Cant>";
    return core::value_or_throw(read_landxml(write("a.xml", straight_with(cant)))).problems;
  };
  EXPECT_THAT(problems("80"),
              testing::ElementsAre("A: the last cant station, 200.000, has a cant of 0.080 m; it holds up to the "
                                   "alignment's end at 5000.000: is a station with 0 missing?"));
  EXPECT_THAT(problems("0"), testing::IsEmpty());
}

TEST_F(LandXmlTest, StationsOnBothSidesOfAJumpAreOnePlace) {
  const auto read = [&](const std::string& behind_m) {
    return core::value_or_throw(read_landxml(
        write("a.xml",
              "<LandXML><Units><Metric linearUnit=\"meter\"/></Units><Alignments><Alignment name=\"J\" "
              "staStart=\"0\"><CoordGeom><Line staStart=\"0\"><Start>0 0</Start><End>0 1000</End></Line>"
              "<Line staStart=\"5000\"><Start>0 1000</Start><End>0 2000</End></Line></CoordGeom>" +
                  profile_of("<PVI>0 400</PVI><PVI>1000 410</PVI><PVI>5000 " + behind_m + "</PVI><PVI>6000 400</PVI>") +
                  "</Alignment></Alignments></LandXML>")));
  };
  const LandXml jump = read("410");
  EXPECT_NEAR(jump.tracks[0].alignment.at(500).elevation_m, 405, 1e-9);
  EXPECT_NEAR(jump.tracks[0].alignment.at(1500).elevation_m, 405, 1e-9);
  EXPECT_THAT(jump.problems, testing::ElementsAre(HasSubstr("behind the end of the one before")));
  EXPECT_THAT(
      read("411").problems,
      testing::Contains("J: the profile's point at 5000.000 is at the place of the one before it, 1.000 m above "
                        "or below; it is left out"));
}

TEST_F(LandXmlTest, AHalfCircleIsNotTooMuch) {
  const LandXml read = core::value_or_throw(read_landxml(
      write("a.xml",
            "<LandXML><Units><Metric linearUnit=\"meter\"/></Units><Alignments><Alignment name=\"H\"><CoordGeom>"
            "<Curve rot=\"cw\" radius=\"300\" length=\"942.478\" crvType=\"arc\"><Start>0 0</Start><End>0 600</End>"
            "</Curve></CoordGeom></Alignment></Alignments></LandXML>")));
  EXPECT_NEAR(read.tracks[0].alignment.length_m(), 300 * core::kPi, 1e-2);
  EXPECT_NEAR(read.tracks[0].alignment.at(150 * core::kPi).pose.northing_m, 300, 1e-2);
}

// Every element knows its line, and most of a file may be other things.
TEST_F(LandXmlTest, ManyElementsBehindManyLinesAreReadInTheTimeOfBoth) {
  std::string text = "<LandXML><Units><Metric linearUnit=\"meter\"/></Units>";
  text += std::string(4000000, '\n') + "<Alignments><Alignment name=\"L\"><CoordGeom>";
  for (int i = 0; i < 10000; ++i) {
    text +=
        "<Line><Start>0 " + std::to_string(10 * i) + "</Start><End>0 " + std::to_string(10 * i + 10) + "</End></Line>";
  }
  text += "\n<Chain/></CoordGeom></Alignment></Alignments></LandXML>";
  const auto file = write("long.xml", text);
  const std::clock_t begin = std::clock();
  EXPECT_THAT(read_landxml(file).error().message, HasSubstr("line 4000002: <Chain> cannot be read"));
  EXPECT_LT(std::clock() - begin, 5 * CLOCKS_PER_SEC);
}

TEST_F(LandXmlTest, ARingIsConnectedWithItself) {
  std::string text =
      "<LandXML><Units><Metric linearUnit=\"meter\"/></Units><Alignments><Alignment name=\"ring\"><CoordGeom>";
  const char* const ends[] = {"0 200", "200 0", "0 -200", "-200 0", "0 200"};
  for (int i = 0; i < 4; ++i) {
    text += std::string("<Curve rot=\"ccw\" radius=\"200\" length=\"314.159265359\"><Start>") + ends[i] +
            "</Start><End>" + ends[i + 1] + "</End></Curve>";
  }
  text += "</CoordGeom></Alignment></Alignments></LandXML>";
  const Map map = core::value_or_throw(build_map({write("a.xml", text)}, {})).map;
  EXPECT_EQ(map.nodes.size(), 1U);
  EXPECT_THAT(map.problems, testing::Not(testing::Contains(HasSubstr("is not connected"))));
}

}  // namespace
}  // namespace railfix::track
