#include <gmock/gmock.h>

#include "unit/map_tools/run_tables.hpp"

namespace railfix::tool {
namespace {

using testing::HasSubstr;
using track::LandmarkKind;

TEST_F(RunTables, SightingsArePutOnTheMap) {
  write("train_state.csv",
        "stamp_ns,edge,offset_m,direction,track_known,speed_mps,sigma_m\n"
        "1000000000,1,980,+,1,20,0.4\n2000000000,2,0,+,1,20,0.5\n3000000000,2,23,+,1,20,0.1\n");
  write("sightings.csv",
        "stamp_ns,kind,distance_ahead_m,lateral_m,sigma_m,confidence\n"
        "1500000000,mast,5,-3,0.1,0.9\n1500000000,mast,30,3,0.2,0.9\n9000000000,mast,5,3,0.2,0.9\n");
  const auto sightings = core::value_or_throw(read_sightings(map_, folder_, 7));
  const auto& read = sightings.placed;
  ASSERT_EQ(read.size(), 2U);
  EXPECT_EQ(sightings.placeless, 1U) << "the third is after the last state";
  EXPECT_EQ(read[0].edge, 1U);
  EXPECT_NEAR(read[0].offset_m, 995, 1e-6);
  EXPECT_EQ(read[0].run, 7U);
  EXPECT_EQ(read[1].edge, 2U);  // beyond the switch
  EXPECT_NEAR(read[1].offset_m, 20, 1e-6);
  EXPECT_NEAR(read[1].run_sigma_m, 0.4, 1e-9);
  EXPECT_NEAR(read[1].place_ahead_m, 0, 1e-9);
  write("sightings.csv", "stamp_ns,kind,distance_ahead_m,lateral_m,sigma_m,confidence\n3000000000,mast,5,-3,0.1,0.9\n");
  write("train_state.csv",
        "stamp_ns,edge,offset_m,direction,track_known,speed_mps,sigma_m\n"
        "1000000000,1,980,+,1,20,0.4\n2000000000,2,3,+,1,20,0.5\n4000000000,2,43,+,1,20,0.1\n");
  const auto moved = core::value_or_throw(read_sightings(map_, folder_, 7)).placed;
  ASSERT_EQ(moved.size(), 1U);
  EXPECT_NEAR(moved[0].way_m, 20, 1e-9);
  EXPECT_NEAR(moved[0].place_ahead_m, 3, 1e-9) << "a fix moved the place by 3 m, beyond the switch";
}

// The cab looks ahead while the train runs back: forwards along the edge, and against it.
TEST_F(RunTables, ATrainThatBacksSeesFromWhereItIs) {
  const auto seen_from = [&](const std::string& states, const std::string& ahead) {
    write("train_state.csv", "stamp_ns,edge,offset_m,direction,track_known,speed_mps,sigma_m\n" + states);
    write("sightings.csv", "stamp_ns,kind,distance_ahead_m,lateral_m,sigma_m,confidence\n1500000000,portal_in," +
                               ahead + ",-3,0.1,0.9\n");
    return core::value_or_throw(read_sightings(map_, folder_, 0)).placed.at(0);
  };
  const std::string forward = "1000000000,1,500,+,1,-20,0.4\n2000000000,1,480,+,1,-20,0.4\n";
  EXPECT_NEAR(seen_from(forward, "5").offset_m, 495, 1e-6);
  EXPECT_NEAR(seen_from(forward, "-5").offset_m, 485, 1e-6);
  EXPECT_EQ(seen_from(forward, "5").kind, LandmarkKind::portal_in);
  EXPECT_NEAR(seen_from(forward, "5").place_ahead_m, 0, 1e-9);
  const std::string reverse = "1000000000,1,500,-,1,-20,0.4\n2000000000,1,520,-,1,-20,0.4\n";
  const SurveySighting against = seen_from(reverse, "5");
  EXPECT_NEAR(against.offset_m, 505, 1e-6);
  EXPECT_EQ(against.kind, LandmarkKind::portal_out);
  EXPECT_NEAR(against.lateral_m, 3, 1e-9);
  // Back over the switch: the cab still looks to edge 2.
  const SurveySighting over = seen_from("1000000000,2,5,+,1,-20,0.4\n2000000000,1,985,+,1,-20,0.4\n", "2");
  EXPECT_EQ(over.edge, 1U);
  EXPECT_NEAR(over.offset_m, 997, 1e-6);
}

TEST_F(RunTables, ASightingThatWeighsNothingOrAllIsRefused) {
  write("train_state.csv",
        "stamp_ns,edge,offset_m,direction,track_known,speed_mps,sigma_m\n"
        "1000000000,1,980,+,1,20,0.4\n2000000000,2,0,+,1,20,0.5\n");
  const auto reading = [&](const std::string& ahead, const std::string& sigma) {
    write("sightings.csv", "stamp_ns,kind,distance_ahead_m,lateral_m,sigma_m,confidence\n1500000000,mast," + ahead +
                               ",-3," + sigma + ",0.9\n");
    return read_sightings(map_, folder_, 0);
  };
  EXPECT_TRUE(reading("5", "0.1").ok());
  for (const char* sigma : {"inf", "nan", "-1", "0", ""}) {
    const auto read = reading("5", sigma);
    ASSERT_FALSE(read.ok()) << sigma;
    EXPECT_THAT(read.error().message, HasSubstr("sightings.csv line 2"));
    EXPECT_THAT(read.error().message, HasSubstr("column sigma_m"));
  }
  EXPECT_FALSE(reading("nan", "0.1").ok());
  write("train_state.csv",
        "stamp_ns,edge,offset_m,direction,track_known,speed_mps,sigma_m\n1000000000,1,980,+,1,20,-0.4\n");
  EXPECT_THAT(reading("5", "0.1").error().message, HasSubstr("train_state.csv line 2"));
}

TEST_F(RunTables, WhatNoTrainDoesOrSeesIsRefused) {
  const auto refusal = [&](const std::string& speed, const std::string& ahead, const std::string& confidence) {
    write("train_state.csv", "stamp_ns,edge,offset_m,direction,track_known,speed_mps,sigma_m\n1000000000,1,980,+,1," +
                                 speed + ",0.4\n2000000000,2,0,+,1,20,0.5\n");
    write("sightings.csv", "stamp_ns,kind,distance_ahead_m,lateral_m,sigma_m,confidence\n1500000000,mast," + ahead +
                               ",-3,0.1," + confidence + "\n");
    const auto read = read_sightings(map_, folder_, 0);
    return read.ok() ? "" : read.error().message;
  };
  EXPECT_EQ(refusal("20", "5", "1"), "");
  EXPECT_EQ(refusal("", "5", "1"), "") << "a train that is not known to move";
  EXPECT_THAT(refusal("1e308", "5", "1"), HasSubstr("train_state.csv line 2: '1e308' in column speed_mps"));
  EXPECT_THAT(refusal("20", "1e308", "1"), HasSubstr("sightings.csv line 2: '1e308' in column distance_ahead_m"));
  EXPECT_THAT(refusal("20", "5", "7"), HasSubstr("sightings.csv line 2: '7' in column confidence"));
}

TEST_F(RunTables, OneRunGivenTwiceIsRefused) {
  write("train_state.csv",
        "stamp_ns,edge,offset_m,direction,track_known,speed_mps,sigma_m\n1000000000,1,980,+,1,20,0.4\n");
  write("sightings.csv", "stamp_ns,kind,distance_ahead_m,lateral_m,sigma_m,confidence\n");
  EXPECT_TRUE(read_runs(map_, {folder_}).ok());
  for (const auto& again : {folder_, folder_ / ".", folder_ / ".." / folder_.filename()}) {
    const auto read = read_runs(map_, {folder_, again});
    ASSERT_FALSE(read.ok()) << again;
    EXPECT_THAT(read.error().message, HasSubstr("the same run as"));
  }
  EXPECT_THAT(read_runs(map_, {folder_, folder_ / "none"}).error().message, HasSubstr("none"));
}

TEST_F(RunTables, ACopyOfARunAndARunThatTheMapHasLearntFromAreRefused) {
  const auto copy = folder_.parent_path() / (folder_.filename().string() + "_copy");
  write("train_state.csv",
        "stamp_ns,edge,offset_m,direction,track_known,speed_mps,sigma_m\n"
        "1000000000,1,480,+,1,20,0.4\n2000000000,1,500,+,1,20,0.4\n");
  write("sightings.csv", "stamp_ns,kind,distance_ahead_m,lateral_m,sigma_m,confidence\n1500000000,mast,5,-3,0.1,1\n");
  std::filesystem::copy(folder_, copy);
  const auto copied = read_runs(map_, {folder_, copy});
  ASSERT_FALSE(copied.ok());
  EXPECT_THAT(copied.error().message, HasSubstr("_copy is the same run as"));

  const auto first = core::value_or_throw(read_runs(map_, {folder_}));
  track::Map learnt = *map_;
  learnt.learnt_runs = first.runs;
  ASSERT_TRUE(learnt.save(copy / "learnt.map").ok());
  const auto loaded = std::make_shared<const track::Map>(core::value_or_throw(track::Map::load(copy / "learnt.map")));
  const auto again = read_runs(loaded, {copy});
  ASSERT_FALSE(again.ok());
  EXPECT_THAT(again.error().message, HasSubstr("has learnt from"));
  write("sightings.csv",
        "stamp_ns,kind,distance_ahead_m,lateral_m,sigma_m,confidence\n1500000000,mast,5.04,-3,0.1,1\n");
  EXPECT_TRUE(read_runs(loaded, {folder_}).ok()) << "another ride";
  std::filesystem::remove_all(copy);
}

TEST_F(RunTables, BadTablesAreOneSentence) {
  EXPECT_FALSE(read_sightings(map_, folder_, 0).ok());
  write("train_state.csv", "stamp_ns,edge,offset_m,direction,track_known,speed_mps,sigma_m\n1,77,0,+,1,0,1\n");
  write("sightings.csv", "stamp_ns,kind,distance_ahead_m,lateral_m,sigma_m,confidence\n");
  EXPECT_THAT(read_sightings(map_, folder_, 0).error().message, HasSubstr("edge 77 is not on the map"));
  for (const char* edge : {"4294967297", "-4294967295", "-1"}) {  // 1, where it is cut to 32 bits
    write("train_state.csv",
          std::string("stamp_ns,edge,offset_m,direction,track_known,speed_mps,sigma_m\n1,") + edge + ",0,+,1,0,1\n");
    EXPECT_THAT(read_sightings(map_, folder_, 0).error().message,
                HasSubstr("train_state.csv line 2: edge " + std::string(edge) + " is not on the map"));
  }
  write("train_state.csv", "stamp_ns,edge\n");
  EXPECT_THAT(read_sightings(map_, folder_, 0).error().message, HasSubstr("no column"));
}

TEST_F(RunTables, ARunOnAnotherMapIsRefused) {
  write("sightings.csv", "stamp_ns,kind,distance_ahead_m,lateral_m,sigma_m,confidence\n");
  const auto reading = [&](const std::string& easting_northing) {
    write("train_state.csv",
          "stamp_ns,edge,offset_m,direction,track_known,speed_mps,sigma_m,easting_m,northing_m\n"
          "1,1,500,+,1,0,1,2680500,1250000\n2,1,500,+,1,0,1," +
              easting_northing + "\n3,,,,0,0,,1,1\n");
    return read_runs(map_, {folder_});
  };
  for (const char* alike : {"2680500.2,1249999.8", ",", "nan,nan"}) EXPECT_TRUE(reading(alike).ok()) << alike;
  const auto other = reading("2680500,1250004");  // the parallel track
  ASSERT_FALSE(other.ok());
  EXPECT_THAT(other.error().message,
              HasSubstr((folder_ / "train_state.csv").string() + " line 3: this map has edge 1"));
}

TEST_F(RunTables, StampsThatGoFarBackAreRefused) {
  const auto reading = [&](const std::string& state_s, const std::string& sighting_s) {
    write("train_state.csv",
          "stamp_ns,edge,offset_m,direction,track_known,speed_mps,sigma_m\n10000000000,1,100,+,1,20,1\n"
          "11000000000,1,120,+,1,20,1\n" +
              state_s + "000000000,1,110,+,1,20,1\n12000000000,1,140,+,1,20,1\n");
    write("sightings.csv", "stamp_ns,kind,distance_ahead_m,lateral_m,sigma_m,confidence\n11500000000,mast,5,3,0.1,1\n" +
                               sighting_s + "500000000,mast,5,3,0.1,1\n");
    return read_sightings(map_, folder_, 0);
  };
  const auto read = core::value_or_throw(reading("10", "10")).placed;
  ASSERT_EQ(read.size(), 2U) << "a standby's late state does not count, two cameras take turns";
  EXPECT_NEAR(read[0].offset_m, 135, 1e-6);
  EXPECT_NEAR(read[1].offset_m, 115, 1e-6);
  EXPECT_THAT(reading("9", "10").error().message, HasSubstr("train_state.csv line 4: the stamp 9000000000 goes back"));
  EXPECT_THAT(reading("10", "6").error().message, HasSubstr("sightings.csv line 3: the stamp 6500000000 goes back"));
}

}  // namespace
}  // namespace railfix::tool
