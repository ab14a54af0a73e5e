// What an operator may write into train.yaml, what is said of mistakes, and what each host gets.
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <unistd.h>

#include <fstream>

#include "support/program.hpp"
#include "train/check.hpp"
#include "train/containers.hpp"
#include "train/keys.hpp"
#include "train/render.hpp"

namespace railfix::tool {
namespace {

namespace fs = std::filesystem;
using ::testing::AllOf;
using ::testing::Contains;
using ::testing::ElementsAre;
using ::testing::Field;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
using ::testing::Not;

const FindProgram kNoPrograms = [](const HostedService&) { return std::nullopt; };

const char* kTrain = R"(train:
  id: re460-042
  domain: 12
  release: 1.2.0
  run_as: programs
  map: line.map
  hosts:
    cab: { address: 10.42.1.11 }
    coach: { address: 10.42.1.12, interface: eth1 }
  services:
    frame_grabber: cab
    track_detector: cab
    odometry: cab
    map_matcher: coach
    fusion: { host: coach, standby: cab, release: 1.3.0 }
    tpr_publisher: { host: coach, standby: cab }
    recorder: cab
    monitor: coach
settings:
  tpr_publisher:
    nid_engine: 460042
)";

class TrainFolder : public ::testing::Test {
 protected:
  TrainFolder() { fs::create_directories(folder_); }
  ~TrainFolder() override { fs::remove_all(folder_); }
  core::Result<Manifest> manifest(std::string text, const std::string& replace = "", const std::string& by = "") {
    if (!replace.empty()) text.replace(text.find(replace), replace.size(), by);
    std::ofstream(folder_ / "train.yaml") << text;
    return read_manifest(folder_);
  }
  std::vector<std::string> findings(const std::string& replace = "", const std::string& by = "") {
    std::vector<std::string> texts;
    for (const auto& finding : check_train(manifest(kTrain, replace, by).value(), kNoPrograms)) {
      if (finding.text.find("are not checked") == std::string::npos) texts.push_back(finding.text);
    }
    return texts;
  }
  const fs::path folder_ = fs::temp_directory_path() / ("railfix-train-folder-" + std::to_string(getpid()));
};

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
  const auto told = [&](const char* replace, const char* by) {
    const auto read = manifest(kTrain, replace, by);
    return read.ok() ? "nothing" : read.error().message;
  };
  EXPECT_THAT(told("domain: 12", "domain: 512"), HasSubstr("train.yaml line 3: train.domain must be a whole number"));
  EXPECT_THAT(told("domain: 12", "domian: 12"),
              HasSubstr("line 3: train.domian is not known here; did you mean domain?"));
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
  EXPECT_THAT(told("run_as: programs", "run_as: magic"),
              HasSubstr("train.run_as must be containers, podman, docker or programs"));
  EXPECT_THAT(told("id: re460-042", "id: a/b"), HasSubstr("train.id must be a name"));
  EXPECT_THAT(told("train:", "train: ["), HasSubstr("not valid YAML"));
}

TEST_F(TrainFolder, TheCheckSaysWhatWouldGoWrong) {
  std::ofstream(folder_ / "line.map") << "map";
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

TEST_F(TrainFolder, AQualityOfServiceThatDoesNotMatchIsTold) {
  std::ofstream(folder_ / "line.map") << "map";
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

TEST_F(TrainFolder, CertificatesThatAreMissingOrRunOutAreTold) {
  std::ofstream(folder_ / "line.map") << "map";
  EXPECT_THAT(findings("run_as: programs", "security: true"),
              Contains(HasSubstr("security/cab is missing; make the train's certificates with railfix train keys ")));
  const auto secured = manifest(kTrain, "run_as: programs", "security: true").value();
  KeysOptions soon;
  soon.valid_days = 20;
  ASSERT_TRUE(make_keys(secured, soon).ok());
  EXPECT_THAT(findings("run_as: programs", "security: true"), Contains(HasSubstr("fusion.cert.pem runs out in ")));
  const auto fusion = folder_ / "security/cab/fusion.cert.pem";
  fs::rename(fusion, folder_ / "aside");
  EXPECT_THAT(findings("run_as: programs", "security: true"),
              Contains(HasSubstr("fusion.cert.pem is missing or cannot be read by this user; make the train's keys")));
  fs::rename(folder_ / "aside", fusion);
  const auto patient =
      manifest(std::string(kTrain) + "  monitor: { certificate_days: 5 }\n", "run_as: programs", "security: true")
          .value();
  EXPECT_THAT(check_certificates(patient, *patient.host("cab")), IsEmpty()) << "the limit is a setting";
  KeysOptions renewed;
  renewed.renew = true;
  ASSERT_TRUE(make_keys(secured, renewed).ok());
  EXPECT_THAT(findings("run_as: programs", "security: true"), IsEmpty());
}

TEST_F(TrainFolder, WhatIsMissingOfASecuredTrainIsToldOnceAndMadeAgain) {
  std::ofstream(folder_ / "line.map") << "map";
  const auto secured = manifest(kTrain, "run_as: programs", "security: true").value();
  ASSERT_TRUE(make_keys(secured, {}).ok());
  const auto certificate = test::slurp(folder_ / "security/coach/fusion.cert.pem");
  for (const char* file : {"ca.pem", "governance.p7s", "fusion.key.pem", "fusion.permissions.p7s", "tool.key.pem"}) {
    fs::remove(folder_ / "security/cab" / file);
    EXPECT_THAT(findings("run_as: programs", "security: true"),
                ElementsAre(HasSubstr(std::string("security/cab/") + file + " is missing or cannot be read")));
    ASSERT_TRUE(make_keys(secured, {}).ok());
    EXPECT_THAT(findings("run_as: programs", "security: true"), IsEmpty()) << file;
  }
  EXPECT_EQ(test::slurp(folder_ / "security/coach/fusion.cert.pem"), certificate) << "what was there has stayed";
}

TEST_F(TrainFolder, PermissionsThatDoNotFitAreTold) {
  std::ofstream(folder_ / "line.map") << "map";
  const auto secured = manifest(kTrain, "run_as: programs", "security: true").value();
  ASSERT_TRUE(make_keys(secured, {}).ok());
  const auto told = [&](const std::string& domain) {
    const auto train = manifest(kTrain, "domain: 12\n  release: 1.2.0\n  run_as: programs",
                                "domain: " + domain + "\n  release: 1.2.0\n  security: true")
                           .value();
    return check_certificates(train, *train.host("coach"));
  };
  EXPECT_THAT(told("12"), IsEmpty());
  EXPECT_THAT(told("13"), Contains(AllOf(Field(&Finding::error, true),
                                         Field(&Finding::text, HasSubstr("fusion.permissions.p7s does not allow "
                                                                         "domain 13; railfix train keys --renew")))));
  // As the release before would have made them.
  const auto permissions = folder_ / "security/coach/fusion.permissions.p7s";
  auto before = test::slurp(permissions);
  const std::string pose = "<topic>train_pose</topic>";
  before.erase(before.find(pose), pose.size());
  std::ofstream(permissions) << before;
  EXPECT_THAT(told("12"), ElementsAre(AllOf(Field(&Finding::error, false),
                                            Field(&Finding::text, HasSubstr("does: publish train_pose;")))));
}

TEST_F(TrainFolder, EachHostGetsItsConfigurationComposeFileAndUnit) {
  std::ofstream(folder_ / "line.map") << "map";
  const auto train = manifest(kTrain).value();
  const auto out = folder_ / "out";
  ASSERT_TRUE(render_host(train, *train.host("coach"), out).ok());
  const auto config = YAML::LoadFile((out / "config.yaml").string());
  EXPECT_EQ(config["common"]["host"].as<std::string>(), "coach");
  EXPECT_EQ(config["common"]["domain"].as<int>(), 12);
  EXPECT_THAT(config["common"]["interfaces"].as<std::vector<std::string>>(), ElementsAre("eth1"));
  EXPECT_THAT(config["common"]["peers"].as<std::vector<std::string>>(), ElementsAre("10.42.1.11"));
  EXPECT_EQ(config["fusion"]["map"].as<std::string>(), (out / "line.map").string());
  EXPECT_EQ(config["tpr_publisher"]["nid_engine"].as<int>(), 460042);
  EXPECT_THAT(config["monitor"]["expected"].as<std::vector<std::string>>(), Contains("frame_grabber"));
  EXPECT_TRUE(fs::exists(out / "line.map"));
  const auto compose = YAML::LoadFile((out / "compose.yaml").string());
  const auto fusion = compose["services"]["fusion"];
  EXPECT_EQ(fusion["image"].as<std::string>(), "railfix/fusion:1.3.0");
  EXPECT_EQ(fusion["network_mode"].as<std::string>(), "host");
  EXPECT_THAT(fusion["command"].as<std::vector<std::string>>(), Contains("common.ownership_strength=20"));
  EXPECT_FALSE(compose["services"]["odometry"]);
  EXPECT_TRUE(fs::exists(out / "systemd" / "railfix.service"));
}

TEST_F(TrainFolder, CertificatesAndPasswordsOfTheGroundLinkComeAlong) {
  std::ofstream(folder_ / "line.map") << "map";
  fs::create_directories(folder_ / "ground");
  std::ofstream(folder_ / "ground/ca.pem") << "authority";
  std::ofstream(folder_ / "ground/password") << "secret";
  const std::string with_link =
      std::string(kTrain) +
      "    ground_link: { broker: \"ground.example:8883\", store: reports.db, user: re460-042,\n"
      "      ca_file: ground/ca.pem, password_file: ground/password, key_file: /etc/key.pem }\n";
  const auto train = manifest(with_link).value();
  const auto out = folder_ / "out";
  ASSERT_TRUE(render_host(train, *train.host("coach"), out).ok());
  EXPECT_EQ(test::slurp(out / "files/tpr_publisher.ground_link.password_file"), "secret");
  const auto config = test::slurp(out / "config.yaml");
  EXPECT_THAT(config, HasSubstr("ca_file: " + (out / "files/tpr_publisher.ground_link.ca_file.pem").string()));
  EXPECT_THAT(config, HasSubstr("key_file: /etc/key.pem")) << "the host has it";
  const auto before = settings_of(train, *train.host("coach"), "tpr_publisher");
  const auto of_fusion = settings_of(train, *train.host("coach"), "fusion");
  std::ofstream(folder_ / "ground/password") << "another";
  EXPECT_NE(settings_of(train, *train.host("coach"), "tpr_publisher"), before);
  EXPECT_EQ(settings_of(train, *train.host("coach"), "fusion"), of_fusion);
  fs::remove(folder_ / "ground/password");
  EXPECT_THAT(findings("settings:\n  tpr_publisher:", "settings:\n  monitor: { address: 0.0.0.0 }\n  tpr_publisher:"),
              Contains(HasSubstr("open to every network")));
  const auto missing = check_train(manifest(with_link).value(), kNoPrograms);
  EXPECT_TRUE(std::any_of(missing.begin(), missing.end(), [](const Finding& finding) {
    return finding.error && finding.text.find("settings.tpr_publisher.ground_link.password_file") == 0;
  }));
}

TEST_F(TrainFolder, ThePageIsOnTheTrainNetworkOnly) {
  std::ofstream(folder_ / "line.map") << "map";
  const auto train = manifest(kTrain).value();
  EXPECT_THAT(render_config(train, *train.host("coach"), "FOLDER"), HasSubstr("address: 10.42.1.12"));
}

TEST_F(TrainFolder, AContainerIsLockedDownAndSeesNoKeysButItsOwn) {
  std::ofstream(folder_ / "line.map") << "map";
  const auto train = manifest(kTrain, "run_as: programs", "security: true").value();
  const auto container = container_of(train, *train.host("coach"), {"fusion", "1.3.0", false}, "/g/7", "/home");
  EXPECT_EQ(container.image, "railfix/fusion:1.3.0");
  EXPECT_THAT(container.volumes, Contains("/home:/var/lib/railfix"));
  EXPECT_THAT(container.volumes, Contains("/g/7/security/fusion.key.pem:/g/7/security/fusion.key.pem:ro"));
  for (const auto& volume : container.volumes) {
    EXPECT_THAT(volume, Not(HasSubstr("tpr_publisher")));
    EXPECT_THAT(volume, Not(HasSubstr("/g/7:")));
    EXPECT_THAT(volume, Not(HasSubstr("security:")));
    EXPECT_THAT(volume, Not(HasSubstr("/dev")));
  }
  const auto command = run_command(container, "/usr/bin/podman");
  for (const char* option : {"--read-only", "--cap-drop=ALL", "--user=990:990", "--security-opt=no-new-privileges",
                             "--network=host", "--ipc=host", "--env=RAILFIX_CONFIG=/g/7/config.yaml"})
    EXPECT_THAT(command, Contains(std::string(option)));
}

TEST_F(TrainFolder, SettingsOfAServiceChangeWithWhatItReadsAndNothingElse) {
  std::ofstream(folder_ / "line.map") << "map";
  const auto train = manifest(kTrain).value();
  const auto settings = [](const Manifest& of, const char* service) {
    return settings_of(of, *of.host("coach"), service);
  };
  const auto fusion = settings(train, "fusion");
  const auto matcher = settings(train, "map_matcher");
  const auto other = manifest(kTrain, "nid_engine: 460042", "nid_engine: 460043").value();
  EXPECT_EQ(settings(other, "fusion"), fusion);
  EXPECT_NE(settings(other, "tpr_publisher"), settings(train, "tpr_publisher"));
  std::ofstream(folder_ / "line.map") << "another map";
  EXPECT_NE(settings(train, "fusion"), fusion);
  EXPECT_NE(settings(train, "map_matcher"), matcher);
}

}  // namespace
}  // namespace railfix::tool
