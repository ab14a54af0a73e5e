#include <gmock/gmock.h>

#include <fstream>
#include <nlohmann/json.hpp>
#include <sstream>

#include "evaluation/evaluation.hpp"
#include "evaluation/html_report.hpp"
#include "made_truth.hpp"
#include "unit/dataset/temporary_folder.hpp"

namespace railfix::evaluation {
namespace {

using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::Not;

class RunFolder : public railfix::testing::TemporaryFolder {
 protected:
  void write_run() const {
    write("out/odometry.csv",
          "stamp_ns,valid,distance_m,speed_mps,lateral_speed_mps,yaw_rate_rps,step_sigma_m,mode\n"
          "0,1,0,20,0,0,0.001,search\n10000000000,1,202,20,0,0,0.001,track\n20000000000,0,404,,,,,blind\n");
    write("out/train_state.csv",
          "stamp_ns,edge,offset_m,direction,track_known,distance_m,speed_mps,over_m,under_m,sigma_m,integrity,lat_deg,"
          "lon_deg,"
          "easting_m,northing_m,heading_rad\n"
          "0,,,,0,0,20,,,,unusable,,,,,\n10000000000,1,5,forward,1,200,20,1,1,0.3,ok,,,5000,7200.5,0\n");
    write("out/status.csv",
          "stamp_ns,service,host,state,frames_in,frames_out,dropped,latency_p50_ms,latency_p99_ms,cpu_percent,rss_mb\n"
          "1,odometry,cab,active,60,59,1,2.0,4.0,30,50\n2,fusion,coach,active,60,60,0,1.0,2.0,10,40\n"
          "3,odometry,cab,degraded,120,118,2,3.0,9.0,50,60\n");
  }
};

// It must not look as if the whole ride had been driven, nor be blamed for what it never came to.
TEST_F(RunFolder, ARunThatWasBrokenOffIsAPartOfTheRide) {
  write_run();  // 20 s
  write("out/sightings.csv",
        "stamp_ns,kind,distance_ahead_m,lateral_m,sigma_m,confidence\n10000000000,mast,10,3,0.1,1\n");
  MadeTruth made;  // 50 s, 1000 m to 2000 m
  made.landmarks = {{{"mast", 1210, 3}, {"mast", 1700, 3}}};
  const auto evaluation = evaluate(made.make(), core::value_or_throw(read_run(root_ / "out")));
  EXPECT_TRUE(is_part(evaluation));
  EXPECT_DOUBLE_EQ(evaluation.duration_s, 20);
  EXPECT_NEAR(evaluation.travelled_m, 400, 1e-6);
  EXPECT_EQ(evaluation.sightings->all.real, 1U);
  std::ostringstream text;
  print(evaluation, text);
  EXPECT_THAT(text.str(), HasSubstr("run of 400.000 m in 20.0 s, a part of the ride of 1000.000 m in 50.0 s\n"));
  made.seconds = 20;
  EXPECT_FALSE(is_part(evaluate(made.make(), core::value_or_throw(read_run(root_ / "out")))));
}

TEST_F(RunFolder, WhatIsMissingOfTheRunOrOfTheTruthIsTold) {
  std::string states = "stamp_ns,track_known,distance_m,speed_mps,over_m,under_m,integrity,easting_m,northing_m\n";
  for (int s = 0; s <= 40; ++s) {
    if (s > 5 && s < 21) continue;
    const bool known = s < 30;
    states += std::to_string(s * kSecond) + (known ? ",1," : ",0,") + std::to_string(20 * s) + ",20,1,1,ok," +
              (known ? "5000," + std::to_string(7000 + 20 * s) : ",") + "\n";
  }
  write("out/train_state.csv", states);
  MadeTruth made;
  made.seconds = 25;
  const auto evaluation = evaluate(made.make(), core::value_or_throw(read_run(root_ / "out")));
  std::ostringstream text;
  print(evaluation, text);
  EXPECT_THAT(text.str(), HasSubstr("of 25.0 s for a run of 40.0 s: errors are of these, "));
  EXPECT_THAT(text.str(), HasSubstr("11 of 26, 0 have no place on the map, 15 no truth\n"));
  EXPECT_THAT(text.str(), HasSubstr("train_state.csv: NO ROWS for 16.0 s from 5.0 s on\n"));
  made.seconds = 40;
  const auto whole = evaluate(made.make(), core::value_or_throw(read_run(root_ / "out")));
  EXPECT_FALSE(is_longer_than_truth(whole));
  EXPECT_EQ(to_json(whole)["position"]["states"], 26);
  EXPECT_EQ(to_json(whole)["position"]["judged"], 15);
}

TEST_F(RunFolder, FiguresOfTheTablesThatAreThere) {
  write_run();
  const auto run = read_run(root_ / "out");
  ASSERT_TRUE(run.ok()) << run.error().message;
  EXPECT_THAT(run.value().missing,
              ElementsAre("track_view.csv", "rails.csv", "sightings.csv", "position_fix.csv", "tpr.csv"));
  const MadeTruth made;
  const auto json = to_json(evaluate(made.make(), run.value()));
  EXPECT_NEAR(json["odometry"]["drift_percent"].get<double>(), 1.0, 1e-9);
  EXPECT_NEAR(json["odometry"]["blind_percent"].get<double>(), 100.0 / 3, 1e-9);
  EXPECT_EQ(json["position"]["basis"], "map");
  EXPECT_NEAR(json["position"]["position_error_m"]["max"].get<double>(), 0.5, 1e-6);
  EXPECT_EQ(json["position"]["coverage_percent"], 100.0);
  EXPECT_EQ(json["track_choice"]["known_percent"], 50.0);
  EXPECT_TRUE(json["edges"].is_null());
  EXPECT_TRUE(json["sightings"].is_null());
  EXPECT_EQ(json["dropped"], 2.0);
  ASSERT_EQ(json["services"].size(), 2U);
  EXPECT_EQ(json["services"][1]["service"], "odometry");
  EXPECT_EQ(json["services"][1]["frames_in"], 120.0);
  EXPECT_EQ(json["services"][1]["latency_p50_ms"], 2.5);
  EXPECT_EQ(json["services"][1]["latency_p99_ms"], 9.0);
  EXPECT_EQ(json["services"][1]["cpu_percent"], 40.0);
  EXPECT_EQ(json["services"][1]["last_state"], "degraded");
}

TEST_F(RunFolder, TextSaysWhatIsNotInTheRun) {
  write_run();
  std::ostringstream out;
  print(evaluate(MadeTruth().make(), read_run(root_ / "out").value()), out);
  EXPECT_THAT(out.str(), HasSubstr("drift                   1.0000 % of 400.000 m"));
  EXPECT_THAT(out.str(), HasSubstr("rails.csv: not in this run"));
  EXPECT_THAT(out.str(), Not(HasSubstr("nan")));
}

TEST_F(RunFolder, ReportNeedsNothingElse) {
  write_run();
  const Truth truth = MadeTruth().make();
  const std::string html = html_report(truth, evaluate(truth, read_run(root_ / "out").value()), "a <run>");
  EXPECT_THAT(html, HasSubstr("a &lt;run&gt;"));
  for (const char* title : {"Distance error", "Position error along", "Speed", "Path on the map", "Stanford diagram"}) {
    EXPECT_THAT(html, HasSubstr(std::string("aria-label=\"") + title)) << title;
  }
  for (const char* outside : {"http://", "https://", "<script", "<link", "nan"})
    EXPECT_THAT(html, Not(HasSubstr(outside))) << outside;
}

TEST(Services, ThatAreStartedAnewCountOnAndSilenceIsNoLatency) {
  StatusRow row{"odometry", "cab", "active", 60, 59, 5, 4, 8, 10, 50};
  std::vector<StatusRow> rows{row};
  row.frames_in = row.frames_out = row.dropped = row.latency_p50_ms = row.latency_p99_ms = 0;
  rows.push_back(row);
  row.frames_in = 30;
  row.dropped = 2;
  rows.push_back(row);
  const auto result = judge_services(rows).front();
  EXPECT_EQ(result.frames_in, 90);
  EXPECT_EQ(result.dropped, 7);
  EXPECT_EQ(result.restarts, 1U);
  EXPECT_EQ(result.latency_p50_ms, 4);
  EXPECT_TRUE(std::isnan(judge_services({row}).front().latency_p50_ms));
}

TEST_F(RunFolder, EmptyTablesGiveNoFiguresAndNoCrash) {
  for (const char* table :
       {"odometry.csv:stamp_ns,valid,distance_m,speed_mps,mode", "rails.csv:stamp_ns,rail,u_px,v_px",
        "train_state.csv:stamp_ns,track_known,distance_m,speed_mps,over_m,under_m,integrity,easting_m,northing_m",
        "sightings.csv:stamp_ns,kind,distance_ahead_m", "position_fix.csv:kind",
        "tpr.csv:stamp_ns,d_lrbg_m,l_doubtover_m,l_doubtunder_m",
        "track_view.csv:stamp_ns,seen,roll_rad,pitch_rad,yaw_rad,lateral_m,height_m,curvature_per_m,vertical_curvature_"
        "per_m,"
        "roll_rad_sigma,pitch_rad_sigma,yaw_rad_sigma,lateral_m_sigma,height_m_sigma,curvature_per_m_sigma,"
        "vertical_curvature_per_m_sigma",
        "status.csv:service,host,state,frames_in,frames_out,dropped,latency_p50_ms,latency_p99_ms,cpu_percent,rss_"
        "mb"}) {
    const std::string text = table;
    const size_t colon = text.find(':');
    write("out/" + text.substr(0, colon), text.substr(colon + 1) + "\n");
  }
  MadeTruth made;
  made.landmarks = {{{"frog", 1500, 0}}};
  const Truth truth = made.make();
  const auto run = read_run(root_ / "out");
  ASSERT_TRUE(run.ok()) << run.error().message;
  const auto evaluation = evaluate(truth, run.value());
  EXPECT_TRUE(to_json(evaluation)["odometry"]["drift_percent"].dump() == "null");
  std::ostringstream out;
  print(evaluation, out);
  EXPECT_THAT(out.str(), HasSubstr("train_state.csv: has a header and no row, not judged"));
  EXPECT_THAT(out.str(), Not(HasSubstr("no map coordinates")));
  EXPECT_THAT(to_json(evaluation)["empty"], ElementsAre("odometry.csv", "train_state.csv", "track_view.csv"));
  const std::string html = html_report(truth, evaluation, "empty");
  EXPECT_THAT(html, HasSubstr("Without a row: odometry.csv"));
  EXPECT_THAT(html, Not(HasSubstr("nan")));
}

TEST_F(RunFolder, RowsOutOfOrderAreTold) {
  write_run();
  write("out/sightings.csv",
        "stamp_ns,kind,distance_ahead_m\n5000000000,frog,1\n9000000000,frog,1\n4000000000,frog,1\n9000000000,frog,1\n"
        "8500000000,mast,1\n7000000000,frog,1\n");  // the mast left the picture before it was told
  const auto run = read_run(root_ / "out").value();
  EXPECT_THAT(run.out_of_order, ElementsAre(::testing::Pair("sightings.csv", 2U)));
  EXPECT_EQ(run.sightings->front().stamp_ns, 4'000'000'000);
  EXPECT_EQ(run.sightings->at(3).kind, "mast");
  const auto evaluation = evaluate(MadeTruth().make(), run);
  EXPECT_EQ(to_json(evaluation)["out_of_order"].dump(), "{\"sightings.csv\":2}");
  std::ostringstream out;
  print(evaluation, out);
  EXPECT_THAT(out.str(), HasSubstr("sightings.csv: OUT OF ORDER, 2 rows are older than one above them"));
}

TEST_F(RunFolder, OfAnotherTimeThanTheTruthCannotBeJudged) {
  write_run();
  const Truth truth = MadeTruth().make();  // 50 s
  EXPECT_TRUE(check_times(truth, read_run(root_ / "out").value()).ok());
  const auto rows = [&](const std::string& first_s) {
    write("later/odometry.csv", "stamp_ns,valid,distance_m,speed_mps,mode\n" + first_s +
                                    "000000000,1,0,20,track\n90000000000,1,202,20,track\n");
    return check_times(truth, read_run(root_ / "later").value());
  };
  EXPECT_TRUE(rows("50").ok());
  EXPECT_THAT(rows("51").error().message,
              HasSubstr("the run is from 51.000 to 90.000 s and the truth from 0.000 to 50.000 s"));
  write("later/sightings.csv", "stamp_ns,kind,distance_ahead_m\n1,mast,5\n");
  EXPECT_THAT(rows("51").error().message,
              HasSubstr("odometry.csv is from 51.000 to 90.000 s and the truth from 0.000 to 50.000 s, with no time"));
}

TEST_F(RunFolder, BrokenInputIsASentence) {
  EXPECT_THAT(read_run(root_ / "nothing").error().message, HasSubstr("is not a folder"));
  EXPECT_THAT(read_run(root_).error().message, HasSubstr("holds no table"));
  write("out/rails.csv", "stamp_ns,rail,u_px,v_px\n1,L,3,4\n2,X,3,4\n");
  EXPECT_THAT(read_run(root_ / "out").error().message, HasSubstr("rails.csv line 3: has the rail 'X'"));
  write("out/rails.csv", "stamp_ns,rail,u_px\n");
  EXPECT_THAT(read_run(root_ / "out").error().message, HasSubstr("rails.csv line 1: has no column 'v_px'"));
  write("out/rails.csv", "stamp_ns,rail,u_px,v_px\n");
  write_run();
  write("out/tpr.csv", "stamp_ns,d_lrbg_m,l_doubtover_m,l_doubtunder_m\n1,5,1,1\n2,5,1,1e308\n");
  EXPECT_THAT(read_run(root_ / "out").error().message,
              HasSubstr("tpr.csv line 3: '1e308' in column l_doubtunder_m is beyond"));
  write("seq/truth/track.csv", "timestamp,distance\n1,1\n");
  EXPECT_THAT(Truth::read(root_ / "seq/truth").error().message, HasSubstr("at least two rows"));
}

TEST_F(RunFolder, TruthFolderWithLandmarksAndTheCamerasCalibration) {
  write("seq/truth/track.csv", "timestamp,distance\n1,1\n2,2\n");
  EXPECT_FALSE(Truth::read(root_ / "seq/truth").value().calibration().has_value());
  write("seq/truth/landmarks.csv", "kind,distance,lateral\nfrog,1,0\n");
  write("seq/mav0/cam0/sensor.yaml", "resolution: [8, 6]\nintrinsics: [5, 5, 4, 3]\n");
  for (const char* spelling : {"seq/truth", "seq/truth/"}) {
    const auto truth = Truth::read(root_ / spelling);
    ASSERT_TRUE(truth.ok()) << truth.error().message;
    EXPECT_TRUE(truth.value().calibration().has_value()) << spelling;
    EXPECT_EQ(truth.value().landmarks()->size(), 1U);
  }
}

}  // namespace
}  // namespace railfix::evaluation
