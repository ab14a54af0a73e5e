// What an operator may write into train.yaml, and what is said of mistakes.
#include <gmock/gmock.h>

#include "train/containers.hpp"
#include "train/disk_need.hpp"
#include "train/roll_out.hpp"
#include "unit/train_tools/train_folder.hpp"

namespace railfix::tool {
namespace {

using ::testing::AllOf;
using ::testing::Contains;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
using ::testing::Not;
using ::testing::StartsWith;

TEST_F(TrainFolder, IsReadWithServicesInTheOrderOfTheData) {
  const auto read = manifest(kTrain);
  ASSERT_TRUE(read.ok()) << read.error().message;
  const auto& train = read.value();
  EXPECT_EQ(train.train_id, "re460-042");
  EXPECT_EQ(train.release_of(*train.service("fusion")), "1.3.0");
  EXPECT_EQ(train.release_of(*train.service("odometry")), "1.2.0");
  std::vector<std::string> cab;
  for (const auto& service : services_on(train, "cab"))
    cab.push_back(service.name + (service.standby ? " standby" : ""));
  EXPECT_THAT(cab, ElementsAre("frame_grabber", "track_detector", "odometry", "fusion standby", "tpr_publisher standby",
                               "recorder"));
}

TEST_F(TrainFolder, MistakesAreToldWithLineKeyAndWayOut) {
  EXPECT_THAT(told("domain: 12", "domain: 512"), HasSubstr("train.yaml line 3: train.domain must be a whole number"));
  EXPECT_THAT(told("domain: 12", "domian: 12"),
              HasSubstr("line 3: train.domian is not known here; did you mean domain?"));
  EXPECT_THAT(told("settings:", "setings:"), HasSubstr("setings is not known here; did you mean settings?"));
  EXPECT_THAT(told("run_as: programs", "security: yess"), HasSubstr("train.security 'yess' is not true or false"));
  EXPECT_THAT(told("  domain: 12", "\tdomain: 12"),
              HasSubstr("line 3: a tab is at the beginning; YAML wants spaces there"));
  EXPECT_THAT(
      told("odometry: cab", "odometry: caboose"),
      HasSubstr("train.services.odometry runs on 'caboose', which is no host of this train; there are: cab, coach"));
  EXPECT_THAT(told("recorder: cab", "recorder: { host: cab, standby: coach }"),
              HasSubstr("train.services.recorder.standby is not possible; only fusion and tpr_publisher"));
  EXPECT_THAT(told("standby: cab, release", "standby: coach, release"), HasSubstr("is the same host"));
  EXPECT_THAT(told("10.42.1.12", "10.42.1.11"), HasSubstr("10.42.1.11 is the address of cab, too"));
  EXPECT_THAT(told("10.42.1.12", "coach.local"), HasSubstr("'coach.local' is not an IPv4 address such as 10.42.1.11"));
  EXPECT_THAT(told("settings:\n", "settings:\n  common: { domain: 3 }\n"),
              HasSubstr("settings.common.domain is made from the section train; leave it out"));
  EXPECT_THAT(told("settings:\n", "settings:\n  common: 3\n"),
              HasSubstr("line 20: settings.common must be a section of keys, such as {key: value}"));
  EXPECT_THAT(told("run_as: programs", "run_as: magic"),
              HasSubstr("train.run_as must be containers, podman, docker or programs"));
  EXPECT_THAT(told("id: re460-042", "id: a/b"), HasSubstr("train.id must be a name"));
  EXPECT_THAT(told("train:", "train: ["), HasSubstr("not valid YAML"));
}

TEST_F(TrainFolder, MistakesInSettingsAreToldWithTheLineOfTheManifest) {
  const auto train = manifest(kTrain).value();
  const auto told = [&](const std::string& said) {
    return with_own_lines(train, said, "/tmp/r.yaml", "settings for cab");
  };
  const auto file = (folder_ / "train.yaml").string();
  EXPECT_EQ(told("tpr_publisher: /tmp/r.yaml line 3: tpr_publisher.nid_engine 1 is outside 2 to 3\n"
                 "/tmp/r.yaml line 9: common.host must be a text"),
            "tpr_publisher: " + file +
                " line 21: tpr_publisher.nid_engine 1 is outside 2 to 3\n"
                "settings for cab: common.host must be a text");
  EXPECT_EQ(told("/tmp/r.yaml cannot be read"), "settings for cab cannot be read");
}

TEST_F(TrainFolder, TheCheckSaysWhatWouldGoWrong) {
  write_map();
  EXPECT_THAT(findings(), IsEmpty());
  EXPECT_THAT(findings("odometry: cab", "odometry: coach"),
              Contains(HasSubstr("odometry is on coach, but full pictures do not leave the camera's host cab")));
  EXPECT_THAT(findings("recorder: cab", "recorder: coach"), Contains(HasSubstr("records no pictures")));
  EXPECT_THAT(findings("settings:\n", "settings:\n  fusion: { start: '1:250:+' }\n"),
              Contains(HasSubstr("a train that was switched off elsewhere would believe to stand there")));
  EXPECT_THAT(findings("settings:\n", "settings:\n  monitor: { port: 8080, foxglove_port: 8080 }\n"),
              Contains(HasSubstr("want the same port 8080 on coach")));
  fs::remove(folder_ / "line.map");
  EXPECT_THAT(findings(), Contains(HasSubstr("line.map is missing or cannot be read; put it beside train.yaml")));
}

TEST_F(TrainFolder, WhatAServiceSaysOnTwoHostsIsToldOnce) {
  write_map();
  size_t told = 0;
  for (const auto& finding : check_train(manifest(kTrain).value(), kNoPrograms).findings)
    told += finding.text.starts_with("settings of fusion are not checked") ? 1 : 0;
  EXPECT_EQ(told, 1U) << "it has a standby";
}

TEST_F(TrainFolder, AStartThatIsNotOnTheMapIsAnError) {
  write_map();  // edge 1 of 1,000 m
  const auto told = [&](const std::string& start, const char* map = "map: line.map") {
    auto train = manifest(kTrain, "map: line.map", map).value();
    train.settings["fusion"]["start"] = start;
    std::string text;
    for (const auto& finding : check_train(train, kNoPrograms).findings) {
      if (finding.error && finding.text.starts_with("settings.fusion.start")) text += finding.text;
    }
    return text;
  };
  for (const char* right : {"1:100:+", "line:1000", "unknown"}) EXPECT_EQ(told(right), "");
  EXPECT_THAT(told("9999:100"), HasSubstr("settings.fusion.start: the map has no edge \"9999\""));
  EXPECT_THAT(told("1;100"), HasSubstr("\"1;100\" is not a place on the map; write EDGE:OFFSET"));
  EXPECT_THAT(told("1:1000.5:+"), HasSubstr("offset 1000.5 is not on edge 1, which is 1000.0"));
  EXPECT_THAT(told("1:100", "calibration: \"\""), HasSubstr("a place on a map, but train.map is empty"));
}

TEST_F(TrainFolder, FilesThatNoServiceCouldReadAreTold) {
  for (const char* file : {"line.map", "camera.yaml"}) std::ofstream(folder_ / file) << "what a broken copy has left";
  EXPECT_THAT(findings("map: line.map", "map: line.map\n  calibration: camera.yaml"),
              ElementsAre(AllOf(HasSubstr("train.map: "), HasSubstr("line.map is not a compiled map or is cut short")),
                          AllOf(HasSubstr("train.calibration: "), HasSubstr("camera.yaml"))));
  write_map();
  std::ofstream(folder_ / "camera.yaml")
      << "resolution: [640, 480]\ncamera_model: pinhole\nintrinsics: [600, 600, 320, 240]\n"
         "distortion_model: radial-tangential\ndistortion_coefficients: [0, 0, 0, 0]\n";
  EXPECT_THAT(findings("map: line.map", "map: line.map\n  calibration: camera.yaml"), IsEmpty());
}

TEST_F(TrainFolder, ALiveCameraWithoutCalibrationIsTold) {
  write_map();
  const auto told = [&](const std::string& settings) {
    return findings("settings:\n", "settings:\n  frame_grabber: { " + settings + " }\n");
  };
  for (const char* live : {"source: 'genicam:any'", "source: 'capture:/dev/video0'"})
    EXPECT_THAT(told(live), Contains(StartsWith("train.calibration is empty: focal length and height of the camera")));
  EXPECT_THAT(told("source: /data/ride"), IsEmpty()) << "it lies beside the pictures";
  EXPECT_THAT(told("source: 'genicam:any', calibration: /data/camera.yaml"), IsEmpty());
}

TEST_F(TrainFolder, DataThatAreToBePlayedAndAreNotOnTheComputerAreTold) {
  const auto told = [&](const std::string& source) {
    auto train = manifest(kTrain).value();
    train.settings["frame_grabber"]["source"] = source;
    std::string text;
    for (const char* host : {"cab", "coach"}) {
      for (const auto& finding : check_computer(&train, train.host(host), folder_))
        text += finding.text.find("settings.frame_grabber.source") == 0 ? host + (": " + finding.text) : "";
    }
    return text;
  };
  EXPECT_THAT(told("/nonexistent/ride"),
              StartsWith("cab: settings.frame_grabber.source: /nonexistent/ride is not on this computer"));
  EXPECT_THAT(told("/nonexistent/ride"), Not(HasSubstr("coach"))) << "it stands in the cab";
  EXPECT_EQ(told(folder_.string()), "");
  EXPECT_EQ(told("genicam:any"), "");
  EXPECT_EQ(place_on_host("/var/lib/railfix/ride", "/host/home", true), "/host/home/ride") << "as a container sees it";
}

TEST_F(TrainFolder, AQualityOfServiceThatDoesNotMatchIsTold) {
  write_map();
  const auto with_profiles =
      [&](const std::string& reliability) {
        std::ofstream(folder_ / "qos.xml")
            << "<?xml version=\"1.0\"?><dds xmlns=\"http://www.eprosima.com/XMLSchemas/fastRTPS_Profiles\"><profiles>"
               "<data_writer profile_name=\"train_state\"><qos><reliability><kind>"
            << reliability << "</kind></reliability><ownership><kind>EXCLUSIVE</kind></ownership></qos></data_writer>"
            << "</profiles></dds>";
        return findings("map: line.map", "map: line.map\n  qos_profiles: qos.xml");
      };
  EXPECT_THAT(with_profiles("BEST_EFFORT"),
              Contains(HasSubstr("qos.xml: nobody will hear train_state: the reader wants RELIABLE")));
}

TEST_F(TrainFolder, SourcesThatAreNotGivenAreTold) {
  const auto told = [&](const std::string& settings) {
    auto train = manifest(kTrain, "    odometry: cab", "    odometry: cab\n    sensor_gateway: cab").value();
    train.settings = YAML::Load(settings);
    std::string text;
    for (const auto& finding : check_train(train, kNoPrograms).findings) text += finding.text + "\n";
    return text;
  };
  EXPECT_THAT(told("{}"),
              AllOf(HasSubstr("settings.frame_grabber.source is not given, and frame_grabber does not start"),
                    HasSubstr("settings.sensor_gateway.source is not given")));
  EXPECT_THAT(told("{ frame_grabber: { source: genicam:any }, sensor_gateway: { source: /data/ride } }"),
              Not(HasSubstr("is not given")));
}

TEST_F(TrainFolder, ImagesThatAreMissingAreToldInOneSentenceWithBothWaysOut) {
  if (geteuid() != 0) GTEST_SKIP() << "containers are root's";
  const auto engine = folder_ / "podman";
  std::ofstream(engine) << "#!/bin/sh\n[ \"$1\" = info ]\n";  // it works, and has no image
  fs::permissions(engine, fs::perms::owner_all);
  const std::string usual = getenv("PATH");
  setenv("PATH", (folder_.string() + ":" + usual).c_str(), 1);
  const auto train = manifest(kTrain, "run_as: programs", "run_as: podman").value();
  const auto told = container_problems(train, *train.host("coach"));
  setenv("PATH", usual.c_str(), 1);
  EXPECT_THAT(told, ElementsAre(AllOf(StartsWith("not on this computer: images railfix/map-matcher:1.2.0, "),
                                      HasSubstr("railfix/monitor:1.2.0; " + engine.string() + " load --input"),
                                      HasSubstr("or set train.run_as to programs"))));
}

TEST_F(TrainFolder, AnotherTrainThanTheOneThatRunsHereIsTold) {
  const auto train = manifest(kTrain).value();
  const HostFolder here(folder_);
  EXPECT_FALSE(runs_another_train(folder_, train)) << "nothing is here";
  HostPlan plan{"re460-042", "cab", 1, 0, false, {}};
  ASSERT_TRUE(here.write(plan).ok());
  EXPECT_FALSE(runs_another_train(folder_, train));
  plan.train_id = "re460-007";
  ASSERT_TRUE(here.write(plan).ok());
  const auto told = runs_another_train(folder_, train);
  ASSERT_TRUE(told);
  const auto folder = folder_.string();
  EXPECT_EQ(*told, "this computer runs train re460-007; " + folder +
                       " is of train re460-042: railfix train down --root " + folder +
                       " first, then railfix train up " + folder + " --root " + folder);
  plan.down = true;
  ASSERT_TRUE(here.write(plan).ok());
  EXPECT_FALSE(runs_another_train(folder_, train));
}

// An operator begins with a copy of one.
TEST(Examples, HaveNothingMissingButTheirKeysAndWords) {
  const fs::path trains = fs::path(RAILFIX_SOURCE_DIR) / "deploy/trains";
  const auto problems = [&](const std::string& train) {
    std::vector<std::string> texts;
    for (const auto& finding : check_train(read_manifest(trains / train).value(), kNoPrograms).findings) {
      if (finding.text.find("are not checked") == std::string::npos) texts.push_back(finding.text);
    }
    return texts;
  };
  const std::string ground = "settings.tpr_publisher.ground_link.";
  EXPECT_THAT(problems("am843-017"),
              ElementsAre(StartsWith(ground + "broker: ground.example:8883 is the example's"),
                          AllOf(StartsWith(ground + "password_file: "), HasSubstr("holds the example's password")),
                          AllOf(StartsWith("settings.monitor.token_file: "), HasSubstr("holds the example's word"))))
      << "the complete one: nothing but what only its owner knows";
  const auto missing = problems("re460-042");
  EXPECT_THAT(missing, Contains(HasSubstr("security/cab is missing; make the train's certificates")));
  EXPECT_THAT(missing, Not(Contains(HasSubstr("source is not given"))));
}

TEST_F(TrainFolder, WhatIsThereTwiceIsTold) {
  EXPECT_THAT(told("nid_engine: 460042", "nid_engine: 460042\n    nid_engine: 4711"),
              HasSubstr("train.yaml: settings.tpr_publisher.nid_engine is given twice, lines 21 and 22; remove one"));
  EXPECT_THAT(told("    odometry: cab\n", "    odometry: cab\n    odometry: coach\n"),
              HasSubstr("train.services.odometry is given twice, lines 13 and 14; remove one"));
  EXPECT_THAT(told("    cab: {", "    coach: { address: 10.42.1.13 }\n    cab: {"),
              HasSubstr("train.hosts.coach is given twice, lines 8 and 10; remove one"));
  EXPECT_THAT(told("settings:", "---\nsettings:"), HasSubstr("a second document begins in line 19"));
}

TEST_F(TrainFolder, AFolderForDraftsThatIsNoneIsTold) {
  write_map();
  const char* before = getenv("TMPDIR");
  const std::string usual = before == nullptr ? "" : before;
  setenv("TMPDIR", "/nonexistent", 1);
  const auto told = findings();
  if (before == nullptr) {
    unsetenv("TMPDIR");
  } else {
    setenv("TMPDIR", usual.c_str(), 1);
  }
  EXPECT_THAT(told,
              ElementsAre("settings cannot be checked: TMPDIR (/nonexistent) is no folder; set TMPDIR to one where "
                          "you may write"));
}

}  // namespace
}  // namespace railfix::tool
