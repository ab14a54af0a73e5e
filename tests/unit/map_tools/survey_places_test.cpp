// Where sightings have a place: only where the run knew it.
#include <gmock/gmock.h>

#include <cmath>

#include "unit/map_tools/run_tables.hpp"

namespace railfix::tool {
namespace {

using testing::ElementsAre;

/// Rows of train_state.csv, 0.1 s apart unless told, over the switch of the small map at 1000 m of edge 1.
class RunPlaces : public RunTables {
 protected:
  struct Row {
    double at_m = 0;  // along edge 1; beyond 1000 m on `leg`
    int leg = 2;      // 2 or 3, which runs towards the switch
    std::string known = "1";
    std::string integrity = "ok";
    double probability = 1;
    double promise_m = 0.8;
    double told_ahead_m = 0;  // of where it is
  };
  static constexpr double kSpeedMps = 20;
  static constexpr double kStepS = 0.1;
  static constexpr int64_t kBeginNs = 1'000'000'000;

  static int64_t stamp_of(double at_m) {
    return kBeginNs + static_cast<int64_t>(std::llround(1e9 * (at_m - 900) / kSpeedMps));
  }
  /// From 900 to 1100 m; `make` gives the row of a place, or nothing.
  template <class Make>
  void ride(const Make& make) {
    std::string text =
        "stamp_ns,edge,offset_m,direction,track_known,speed_mps,over_m,under_m,sigma_m,integrity,track_probability\n";
    for (double at_m = 900; at_m <= 1100; at_m += kSpeedMps * kStepS) {
      Row row;
      row.at_m = at_m;
      if (!make(row)) continue;
      const double told_m = row.at_m + row.told_ahead_m;
      const bool beyond = told_m > 1000;
      const double on_leg_m = row.leg == 3 ? 500 - (told_m - 1000) : told_m - 1000;
      const std::string promise = std::to_string(row.promise_m);
      text += std::to_string(stamp_of(at_m)) + "," + std::to_string(beyond ? row.leg : 1) + "," +
              std::to_string(beyond ? on_leg_m : told_m) + "," + (beyond && row.leg == 3 ? "-" : "+") + "," +
              row.known + ",20," + promise + "," + promise + ",0.1," + row.integrity + "," +
              std::to_string(row.probability) + "\n";
    }
    write("train_state.csv", text);
  }
  /// Masts seen 8 m ahead, by where they stand beyond the begin of edge 1.
  [[nodiscard]] ReadSightings see(const std::vector<double>& masts_m) const {
    std::string text = "stamp_ns,kind,distance_ahead_m,lateral_m,sigma_m,confidence\n";
    for (const double at_m : masts_m) text += std::to_string(stamp_of(at_m - 8)) + ",mast,8,-3,0.1,1\n";
    write("sightings.csv", text);
    return core::value_or_throw(read_sightings(map_, folder_, 0));
  }
  /// EDGE:OFFSET, to the metre.
  static std::vector<std::string> places(const ReadSightings& read) {
    std::vector<std::string> out;
    for (const SurveySighting& seen : read.placed)
      out.push_back(std::to_string(seen.edge) + ":" + std::to_string(std::lround(seen.offset_m)));
    return out;
  }
};

// As fusion writes it: the straight leg at even odds, until the other one is declared.
TEST_F(RunPlaces, ALegThatWasDeclaredLaterHasWhatWasSeenOnIt) {
  ride([](Row& row) {
    if (row.at_m > 1000) row.leg = row.at_m < 1030 ? 2 : 3;
    if (row.leg == 2 && row.at_m > 1000) row.probability = 0.5;
    return true;
  });
  EXPECT_THAT(places(see({950, 1004, 1020, 1060})), ElementsAre("1:950", "3:496", "3:480", "3:440"));
}

TEST_F(RunPlaces, ATrackThatWasNeverDeclaredHasNoPlace) {
  ride([](Row& row) {
    if (row.at_m > 1000) row.probability = 0.998;
    return true;
  });
  const ReadSightings read = see({950, 1004, 1020, 1060});
  EXPECT_THAT(places(read), ElementsAre("1:950")) << "what was seen from the stem stands beyond the switch, too";
  EXPECT_EQ(read.placeless, 3U);
}

TEST_F(RunPlaces, BeyondASwitchThatTheRunNeverReachedIsNoPlace) {
  ride([](Row& row) { return row.at_m < 999; });
  EXPECT_THAT(places(see({950, 1004})), ElementsAre("1:950"));
}

TEST_F(RunPlaces, AStretchWithoutTrackHasNone) {
  ride([](Row& row) {
    row.known = row.at_m > 940 && row.at_m < 960 ? "0" : "1";
    return true;
  });
  const ReadSightings read = see({930, 956, 962, 990});
  EXPECT_THAT(places(read), ElementsAre("1:930", "1:990"));
  EXPECT_EQ(read.placed.back().stretch, 0U) << "by its speed it is the same way";
}

TEST_F(RunPlaces, AGapInTheRowsHasNoneAndParts) {
  for (const double gap_m : {16.0, 30.0}) {
    ride([gap_m](const Row& row) { return row.at_m < 940 || row.at_m > 940 + gap_m; });
    const ReadSightings read = see({930, 953, 990});
    if (gap_m < kSpeedMps) {
      EXPECT_THAT(places(read), ElementsAre("1:930", "1:953", "1:990")) << "less than a second";
    } else {
      EXPECT_THAT(places(read), ElementsAre("1:930", "1:990"));
      EXPECT_NE(read.placed.front().stretch, read.placed.back().stretch);
    }
  }
}

TEST_F(RunPlaces, WithoutASpeedThereIsNone) {
  write("train_state.csv",
        "stamp_ns,edge,offset_m,direction,track_known,speed_mps,sigma_m\n1000000000,1,100,+,1,20,0.1\n"
        "2000000000,1,120,+,1,20,0.1\n4000000000,1,160,+,1,,0.1\n6000000000,1,200,+,1,,0.1\n"
        "8000000000,1,240,+,1,,0.1\n10000000000,1,280,+,1,20,0.1\n11000000000,1,300,+,1,20,0.1\n");
  write("sightings.csv",
        "stamp_ns,kind,distance_ahead_m,lateral_m,sigma_m,confidence\n1500000000,mast,5,-3,0.1,1\n"
        "5000000000,mast,5,-3,0.1,1\n10500000000,mast,5,-3,0.1,1\n");
  const auto read = core::value_or_throw(read_sightings(map_, folder_, 0));
  EXPECT_THAT(places(read), ElementsAre("1:115", "1:295"));
  EXPECT_NE(read.placed.front().stretch, read.placed.back().stretch) << "nobody knows the way between";
}

TEST_F(RunPlaces, BetweenRowsTheWayIsThatOfTheSpeed) {
  write("train_state.csv",
        "stamp_ns,edge,offset_m,direction,track_known,speed_mps,sigma_m\n1000000000,1,100,+,1,0,0.1\n"
        "2000000000,1,110,+,1,20,0.1\n");
  write("sightings.csv", "stamp_ns,kind,distance_ahead_m,lateral_m,sigma_m,confidence\n1500000000,mast,5,-3,0.1,1\n");
  EXPECT_NEAR(core::value_or_throw(read_sightings(map_, folder_, 0)).placed.at(0).offset_m, 107.5, 1e-6);
}

TEST_F(RunPlaces, AnUnusablePlaceIsNone) {
  ride([](Row& row) {
    if (row.at_m > 940 && row.at_m < 960) row.integrity = "unusable";
    return true;
  });
  EXPECT_THAT(places(see({930, 956, 990})), ElementsAre("1:930", "1:990"));
}

TEST_F(RunPlaces, ASigmaIsNoLessThanThePromiseSays) {
  ride([](Row& row) {
    row.promise_m = 8;
    return true;
  });
  EXPECT_NEAR(see({950}).placed.at(0).run_sigma_m, 2, 1e-9) << "of an interval of four sigmas";
}

// It was told 25 m off, or 2 m; from 960 m on it is right.
TEST_F(RunPlaces, WhatWasOnlyToldCountsWhereTheConfirmedPlaceBearsItOut) {
  for (const double off_m : {-25.0, 2.0}) {
    ride([off_m](Row& row) {
      const bool told = row.at_m < 960;
      row.integrity = told ? "degraded" : "ok";
      row.told_ahead_m = told ? off_m : 0;
      row.promise_m = 5;
      return true;
    });
    const ReadSightings read = see({930, 990});
    if (off_m < 0) {
      EXPECT_THAT(places(read), ElementsAre("1:990"));
    } else {
      EXPECT_THAT(places(read), ElementsAre("1:932", "1:990"));
      EXPECT_NEAR(read.placed[0].unmoved_m(), read.placed[1].unmoved_m() - 60, 0.1);
    }
    EXPECT_THAT(read.never_confirmed, ElementsAre());
  }
}

TEST_F(RunPlaces, ARunThatWasNeverConfirmedTeachesNothing) {
  ride([](Row& row) {
    row.integrity = "degraded";
    return true;
  });
  const ReadSightings read = see({930, 990});
  EXPECT_THAT(places(read), ElementsAre());
  EXPECT_THAT(read.never_confirmed, ElementsAre(0U));
  EXPECT_THAT(read.runs, ElementsAre()) << "the map has not learnt from it";
}

TEST_F(RunPlaces, OnceConfirmedADegradedPlaceCounts) {
  ride([](Row& row) {
    row.integrity = row.at_m < 920 ? "ok" : "degraded";
    return true;
  });
  EXPECT_THAT(places(see({930, 990})), ElementsAre("1:930", "1:990"));
  ride([](Row& row) {
    row.integrity = row.at_m < 920 ? "ok" : "degraded";
    row.known = row.at_m > 940 && row.at_m < 960 ? "0" : "1";
    return true;
  });
  EXPECT_THAT(places(see({930, 990})), ElementsAre("1:930")) << "known anew, and not confirmed";
}

TEST_F(RunPlaces, DoubtfulSightingsAreLeftOut) {
  ride([](const Row&) { return true; });
  const std::string stamp = std::to_string(stamp_of(950));
  write("sightings.csv", "stamp_ns,kind,distance_ahead_m,lateral_m,sigma_m,confidence\n" + stamp +
                             ",mast,8,-3,0.1,0.87\n" + stamp + ",unknown,8,0,0.1,1\n" + stamp +
                             ",underbridge,8,0,0.1,1\n" + stamp + ",frog,8,,0.1,0.88\n" + stamp +
                             ",portal_in,8,,0.1,\n");
  const auto read = core::value_or_throw(read_sightings(map_, folder_, 0));
  EXPECT_EQ(read.doubtful, 3U);
  EXPECT_EQ(read.placed.size(), 2U);
}

TEST_F(RunPlaces, APartOfARunIsThatRun) {
  ride([](const Row&) { return true; });
  const std::vector<double> masts{920, 930, 940, 950, 960, 970, 980, 990};
  const auto part = folder_.parent_path() / (folder_.filename().string() + "_part");
  std::filesystem::create_directories(part);
  const auto refusal = [&](const std::vector<double>& seen_m, const std::shared_ptr<const track::Map>& map,
                           const std::vector<std::filesystem::path>& folders) {
    (void)see(seen_m);
    std::filesystem::copy(folder_, part,
                          std::filesystem::copy_options::recursive | std::filesystem::copy_options::overwrite_existing);
    (void)see(masts);
    const auto read = read_runs(map, folders);
    return read.ok() ? "" : read.error().message;
  };
  auto learnt = *map_;
  (void)see(masts);
  learnt.learnt_runs = core::value_or_throw(read_runs(map_, {folder_})).runs;
  const auto later = std::make_shared<const track::Map>(learnt);
  for (const auto& seen : {std::vector<double>{920, 930, 940, 950, 960, 970, 980}, std::vector<double>{960, 990}}) {
    EXPECT_THAT(refusal(seen, map_, {folder_, part}), testing::HasSubstr("is the same run as"));
    EXPECT_THAT(refusal(seen, later, {part}), testing::HasSubstr("has learnt from"));
  }
  EXPECT_EQ(refusal({921, 931, 940, 951, 961}, map_, {folder_, part}), "") << "simulated rides have equal stamps";
  std::filesystem::remove_all(part);
}

TEST_F(RunPlaces, WhatARunPassedItSawFromAfar) {
  ride([](const Row& row) { return row.at_m < 1060; });
  const auto read = see({950});
  ASSERT_EQ(read.passed.size(), 2U);
  EXPECT_EQ(read.passed[0].edge, 1U);
  EXPECT_NEAR(read.passed[0].from_m, 930, 3) << "before that it may have stood before the camera's view";
  EXPECT_NEAR(read.passed[0].to_m, 1000, 3);
  EXPECT_EQ(read.passed[1].edge, 2U);
  EXPECT_NEAR(read.passed[1].from_m, 0, 3);
  EXPECT_NEAR(read.passed[1].to_m, 60, 3);
}

}  // namespace
}  // namespace railfix::tool
