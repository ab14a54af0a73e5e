// What each computer of a train gets: configuration, compose file, unit.
#include <gmock/gmock.h>

#include <algorithm>

#include "support/program.hpp"
#include "train/containers.hpp"
#include "train/disk_need.hpp"
#include "train/render.hpp"
#include "unit/train_tools/train_folder.hpp"

namespace railfix::tool {
namespace {

using ::testing::AllOf;
using ::testing::Contains;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::Not;

TEST_F(TrainFolder, EachHostGetsItsConfigurationComposeFileAndUnit) {
  write_map();
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
  EXPECT_THAT(config["monitor"]["expected"].as<std::vector<std::string>>(),
              AllOf(Contains("frame_grabber@cab"), Contains("fusion@coach"), Contains("fusion@cab")))
      << "the standby, too";
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
  write_map();
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
  const auto missing = check_train(manifest(with_link).value(), kNoPrograms).findings;
  EXPECT_TRUE(std::any_of(missing.begin(), missing.end(), [](const Finding& finding) {
    return finding.error && finding.text.find("settings.tpr_publisher.ground_link.password_file") == 0;
  }));
}

TEST_F(TrainFolder, KeysThatWereRenderedBeforeDoNotStay) {
  write_map();
  std::ofstream(folder_ / "word") << "secret";
  auto train = manifest(kTrain, "settings:\n", "settings:\n  monitor: { token_file: word }\n").value();
  const auto out = folder_ / "out";
  const auto security = out / "coach/security";
  train.security = true;
  for (const char* host : {"cab", "coach"}) {
    fs::create_directories(folder_ / "security" / host);
    std::ofstream(folder_ / "security" / host / "fusion.key.pem") << "new";
    ASSERT_TRUE(render_host(train, *train.host(host), out / host).ok());
  }
  for (const char* file : {"fusion.key.pem", "odometry.key.pem", "odometry.permissions.p7s", "notes.txt"})
    std::ofstream(security / file) << "old";
  fs::create_directories(out / "other/security");
  std::ofstream(out / "other/security/mine.key.pem") << "foreign";
  ASSERT_TRUE(render_host(train, *train.host("coach"), out / "coach").ok());
  EXPECT_EQ(test::slurp(security / "fusion.key.pem"), "new");
  for (const char* file : {"odometry.key.pem", "odometry.permissions.p7s"}) EXPECT_FALSE(fs::exists(security / file));
  EXPECT_TRUE(fs::exists(security / "notes.txt")) << "somebody else's";

  // A train without certificates and without that host.
  train = manifest(kTrain).value();
  ASSERT_TRUE(render_host(train, *train.host("coach"), out / "coach").ok());
  EXPECT_FALSE(fs::exists(security / "fusion.key.pem"));
  EXPECT_FALSE(fs::exists(out / "coach/files/monitor.token_file"));
  train.hosts.erase(train.hosts.begin());
  EXPECT_THAT(remove_secrets_of_others(train, out), ElementsAre(out / "cab"));
  EXPECT_FALSE(fs::exists(out / "cab/security/fusion.key.pem"));
  EXPECT_TRUE(fs::exists(out / "other/security/mine.key.pem")) << "nothing was rendered there";
}

TEST_F(TrainFolder, ThePageIsOnTheTrainNetworkOnly) {
  write_map();
  const auto train = manifest(kTrain).value();
  EXPECT_THAT(render_config(train, *train.host("coach"), "FOLDER"), HasSubstr("address: 10.42.1.12"));
}

// Services run in HostFolder::home(), which is below --root.
TEST_F(TrainFolder, RecordingsLieBelowTheFolderThatServicesRunIn) {
  write_map();
  const auto folder = [&](const Manifest& train) {
    return YAML::Load(render_config(train, *train.host("cab"), "FOLDER"))["recorder"]["folder"].Scalar();
  };
  EXPECT_EQ(folder(manifest(kTrain).value()), "recordings");
  EXPECT_EQ(folder(manifest(kTrain, "settings:\n", "settings:\n  recorder: { folder: /data }\n").value()), "/data");
  const auto needs = disk_needs(manifest(kTrain).value(), *manifest(kTrain).value().host("cab"), folder_);
  EXPECT_TRUE(std::ranges::any_of(
      needs, [&](const auto& need) { return need.folder == HostFolder(folder_).home() / "recordings"; }));
}

TEST_F(TrainFolder, AContainerIsLockedDownAndSeesNoKeysButItsOwn) {
  write_map();
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
  write_map();
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

TEST_F(TrainFolder, TheWordForControlStandsInNoConfiguration) {
  write_map();
  std::ofstream(folder_ / "word") << "secret";
  const auto train = manifest(kTrain, "settings:\n", "settings:\n  monitor: { token_file: word }\n").value();
  ASSERT_TRUE(render_host(train, *train.host("coach"), folder_ / "out").ok());
  const auto file = folder_ / "out/files/monitor.token_file";
  EXPECT_EQ(test::slurp(file), "secret");
  EXPECT_THAT(test::slurp(folder_ / "out/config.yaml"),
              AllOf(HasSubstr("token_file: " + file.string()), Not(HasSubstr("secret"))));
  EXPECT_THAT(settings_of(train, *train.host("coach"), "monitor"), Not(HasSubstr("secret")));
}

}  // namespace
}  // namespace railfix::tool
