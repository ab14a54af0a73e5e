// What an operator may write into train.yaml, what is said of mistakes, and what each host gets.
#include <fcntl.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sched.h>
#include <sys/mount.h>
#include <sys/stat.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <fstream>

#include "recorder/recorder_config.hpp"
#include "support/program.hpp"
#include "tpr_publisher/tpr_publisher_config.hpp"
#include "track/map.hpp"
#include "train/check.hpp"
#include "train/containers.hpp"
#include "train/disk_need.hpp"
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
using ::testing::StartsWith;

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
  void write_map() {
    track::Map map;
    map.edges = {{1, "line", 1, 2, "", track::Alignment::chained({0, 0, 1}, {{1000, 0, 0}})}};
    map.nodes = {{1, track::NodeKind::end, "", 0, 0}, {2, track::NodeKind::end, "", 1000, 0}};
    core::ok_or_throw(map.save(folder_ / "line.map"));
  }
  core::Result<Manifest> manifest(std::string text, const std::string& replace = "", const std::string& by = "") {
    if (!replace.empty()) text.replace(text.find(replace), replace.size(), by);
    std::ofstream(folder_ / "train.yaml") << text;
    return read_manifest(folder_);
  }
  std::vector<std::string> findings(const std::string& replace = "", const std::string& by = "",
                                    const std::string& train = kTrain) {
    std::vector<std::string> texts;
    for (const auto& finding : check_train(manifest(train, replace, by).value(), kNoPrograms).findings) {
      if (finding.text.find("are not checked") != std::string::npos) continue;  // there are no programs
      const auto is_of = [&](const char* part) { return finding.text.find(part) != std::string::npos; };
      if (!is_of("there is no token") && !is_of("source is not given")) texts.push_back(finding.text);
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
  EXPECT_THAT(told("settings:\n", "settings:\n  common: 3\n"),
              HasSubstr("line 20: settings.common must be a section of keys, such as {key: value}"));
  EXPECT_THAT(told("run_as: programs", "run_as: magic"),
              HasSubstr("train.run_as must be containers, podman, docker or programs"));
  EXPECT_THAT(told("id: re460-042", "id: a/b"), HasSubstr("train.id must be a name"));
  EXPECT_THAT(told("train:", "train: ["), HasSubstr("not valid YAML"));
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

// An operator begins with a copy of one.
TEST(Examples, HaveNothingMissingButTheirKeys) {
  const fs::path trains = fs::path(RAILFIX_SOURCE_DIR) / "deploy/trains";
  const auto problems = [&](const std::string& train) {
    std::vector<std::string> texts;
    for (const auto& finding : check_train(read_manifest(trains / train).value(), kNoPrograms).findings) {
      if (finding.text.find("are not checked") == std::string::npos) texts.push_back(finding.text);
    }
    return texts;
  };
  EXPECT_THAT(problems("am843-017"), IsEmpty()) << "the complete one";
  const auto missing = problems("re460-042");
  EXPECT_THAT(missing, Contains(HasSubstr("security/cab is missing; make the train's certificates")));
  EXPECT_THAT(missing, Not(Contains(HasSubstr("source is not given"))));
}

TEST_F(TrainFolder, CertificatesThatAreMissingOrRunOutAreTold) {
  write_map();
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
  write_map();
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

// A folder that was copied in parts.
TEST_F(TrainFolder, ACertificateOfAnotherAuthorityIsTold) {
  write_map();
  const auto secured = manifest(kTrain, "run_as: programs", "security: true").value();
  ASSERT_TRUE(make_keys(secured, {}).ok());
  const auto certificate = folder_ / "security/cab/fusion.cert.pem";
  const auto key = folder_ / "security/cab/fusion.key.pem";
  fs::copy_file(certificate, folder_ / "cert");
  fs::copy_file(key, folder_ / "key");
  fs::remove_all(folder_ / "security");
  ASSERT_TRUE(make_keys(secured, {}).ok());
  EXPECT_THAT(findings("run_as: programs", "security: true"), IsEmpty());
  fs::copy_file(folder_ / "cert", certificate, fs::copy_options::overwrite_existing);
  fs::copy_file(folder_ / "key", key, fs::copy_options::overwrite_existing);
  EXPECT_THAT(findings("run_as: programs", "security: true"),
              ElementsAre(HasSubstr("fusion.cert.pem was not signed by the authority in " +
                                    (folder_ / "security/cab/ca.pem").string() + "; copy the whole folder anew")));
  // While the authority is exchanged both count.
  ASSERT_TRUE(make_keys(secured, {.renew = true}).ok());
  ASSERT_TRUE(make_keys(secured, {.next_authority = true}).ok());
  EXPECT_THAT(findings("run_as: programs", "security: true"), IsEmpty());
  fs::copy_file(certificate, folder_ / "cert", fs::copy_options::overwrite_existing);
  fs::copy_file(key, folder_ / "key", fs::copy_options::overwrite_existing);
  ASSERT_TRUE(make_keys(secured, {.renew = true}).ok());
  fs::copy_file(folder_ / "cert", certificate, fs::copy_options::overwrite_existing);
  fs::copy_file(folder_ / "key", key, fs::copy_options::overwrite_existing);
  EXPECT_THAT(findings("run_as: programs", "security: true"), IsEmpty()) << "by the former one";
}

// Another authority would be a stranger to the train that runs.
TEST_F(TrainFolder, NoOtherAuthorityIsMadeWhereTheOneOfTheCertificatesIsNot) {
  const auto secured = manifest(kTrain, "run_as: programs", "security: true").value();
  ASSERT_TRUE(make_keys(secured, {}).ok());
  const auto trusted = test::slurp(folder_ / "security/cab/ca.pem");
  fs::rename(folder_ / "security/authority", folder_ / "aside");  // as a host has it
  for (const bool renew : {false, true}) {
    const auto refused = make_keys(secured, {.renew = renew});
    ASSERT_FALSE(refused.ok());
    EXPECT_THAT(refused.error().message, AllOf(HasSubstr("authority/ca.key.pem is not here, and "),
                                               HasSubstr("has certificates by that authority"),
                                               HasSubstr("If it is lost: railfix train keys --next-authority")));
  }
  EXPECT_EQ(test::slurp(folder_ / "security/cab/ca.pem"), trusted);
  EXPECT_FALSE(fs::exists(folder_ / "security/authority"));
  fs::rename(folder_ / "aside", folder_ / "security/authority");
  EXPECT_TRUE(make_keys(secured, {.renew = true}).ok());
}

TEST_F(TrainFolder, PermissionsThatDoNotFitAreTold) {
  write_map();
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

TEST_F(TrainFolder, CertificatesThatOthersHaveMadeRunOutToo) {
  write_map();
  const auto make = [&](const char* name) {
    const auto made = test::run_program({"/usr/bin/openssl", "req", "-x509", "-newkey", "ec", "-pkeyopt",
                                         "ec_paramgen_curve:prime256v1", "-nodes", "-days", "20", "-subj", "/CN=broker",
                                         "-keyout", (folder_ / "key.pem").string(), "-out", (folder_ / name).string()},
                                        60);
    ASSERT_EQ(made.exit_code, 0) << made.err;
  };
  make("ca.pem");
  make("page.pem");
  std::ofstream(folder_ / "train.pem") << "no certificate";
  const auto train = [&](const std::string& more) {
    return manifest(std::string(kTrain) +
                    "    ground_link: { broker: \"ground.example:8883\", store: reports.db, ca_file: ca.pem,\n"
                    "      certificate_file: train.pem, key_file: key.pem }\n"
                    "  monitor: { tls_certificate: " +
                    (folder_ / "page.pem").string() + ", tls_key: key.pem" + more + " }\n")
        .value();
  };
  const auto texts = [](const std::vector<Finding>& findings) {
    std::vector<std::string> of;
    for (const auto& finding : findings) of.push_back((finding.error ? "error: " : "warning: ") + finding.text);
    return of;
  };
  const auto told = texts(check_certificates(train(""), *train("").host("coach")));
  EXPECT_THAT(told, ElementsAre(AllOf(HasSubstr("warning: "), HasSubstr("/ca.pem runs out in 19 days; get a new one")),
                                HasSubstr("error: settings.tpr_publisher.ground_link.certificate_file: "),
                                HasSubstr("/page.pem runs out in 19 days; get a new one")));
  fs::remove(folder_ / "train.pem");
  const auto patient = train(", certificate_days: 5");
  EXPECT_THAT(texts(check_certificates(patient, *patient.host("coach"))), IsEmpty());
  EXPECT_THAT(texts(check_certificates(train(""), *train("").host("cab"))), ElementsAre(HasSubstr("/ca.pem runs out")))
      << "the page is on the other host";

  // The same files, as a host runs with them.
  const HostFolder installed(folder_ / "host");
  const auto generation = installed.generation(1);
  HostPlan plan{"re460-042", "coach", 1, 0, false, {{"tpr_publisher", "1.2.0", 1, false, {"x"}, {}, ""}}};
  ASSERT_TRUE(installed.write(plan).ok());
  fs::create_directories(generation);
  std::ofstream(generation / "config.yaml")
      << "tpr_publisher: { ground_link: { ca_file: " << (folder_ / "ca.pem").string() << " } }\n";
  EXPECT_THAT(texts(check_installed_certificates(installed)), ElementsAre(HasSubstr("/ca.pem runs out in 19 days")));
  std::ofstream(generation / "config.yaml", std::ios::app) << "monitor: { certificate_days: 5 }\n";
  EXPECT_THAT(texts(check_installed_certificates(installed)), IsEmpty());
}

TEST_F(TrainFolder, APrivateKeyOfAnotherCertificateIsTold) {
  write_map();
  const auto secured = manifest(kTrain, "run_as: programs", "security: true").value();
  ASSERT_TRUE(make_keys(secured, {}).ok());
  const auto security = folder_ / "security/cab";
  fs::copy_file(security / "odometry.key.pem", security / "fusion.key.pem", fs::copy_options::overwrite_existing);
  EXPECT_THAT(findings("run_as: programs", "security: true"),
              ElementsAre(HasSubstr("security/cab/fusion.key.pem is not the private key of " +
                                    (security / "fusion.cert.pem").string() + "; railfix train keys --renew")));

  // Those of the broker and of the page, as the manifest names them and as a host runs with them.
  const auto tool = [&](const char* what) { return (security / (std::string("tool.") + what)).string(); };
  const auto link = [&](const std::string& key) {
    return "ground_link: { broker: \"g:8883\", store: s, certificate_file: " + tool("cert.pem") + ", key_file: " + key +
           " }\n";
  };
  const auto told = [&](const std::string& key) {
    const auto train = manifest(std::string(kTrain) + "    " + link(key)).value();
    return check_certificates(train, *train.host("coach"));
  };
  const auto is = [](const std::string& text) {
    return ElementsAre(AllOf(Field(&Finding::error, true), Field(&Finding::text, HasSubstr(text))));
  };
  EXPECT_THAT(told(tool("key.pem")), IsEmpty());
  const auto other = (security / "odometry.key.pem").string();
  EXPECT_THAT(told(other), is("settings.tpr_publisher.ground_link.key_file: " + other + " is not the private key of " +
                              tool("cert.pem") + "; put there the one that the certificate was made with"));
  EXPECT_THAT(told(tool("cert.pem")), is("tool.cert.pem is not a private key in PEM without password"));
  const HostFolder installed(folder_ / "host");
  HostPlan plan{"re460-042", "coach", 1, 0, false, {{"tpr_publisher", "1.2.0", 1, false, {"x"}, {}, ""}}};
  ASSERT_TRUE(installed.write(plan).ok());
  fs::create_directories(installed.generation(1));
  std::ofstream(installed.generation(1) / "config.yaml") << "tpr_publisher:\n  " << link(other);
  EXPECT_THAT(check_installed_certificates(installed), is(other + " is not the private key of"));
}

TEST_F(TrainFolder, ReportsThatLeaveASecuredTrainInTheOpenAreTold) {
  write_map();
  for (const char* file : {"ca.pem", "password"}) std::ofstream(folder_ / file) << "x";
  ASSERT_TRUE(make_keys(manifest(kTrain, "run_as: programs", "security: true").value(), {}).ok());
  const auto told = [&](const std::string& link, const char* run_as = "security: true") {
    std::string train = kTrain;
    train.replace(train.find("run_as: programs"), 16, run_as);
    return findings("settings:\n  tpr_publisher:\n",
                    "settings:\n  tpr_publisher:\n    ground_link: { broker: g:1883, store: s" + link + " }\n", train);
  };
  EXPECT_THAT(told(""), ElementsAre(HasSubstr("reports go to g:1883 without TLS: who is on the way"),
                                    HasSubstr("reports go to g:1883 without a name: the broker cannot tell")));
  EXPECT_THAT(told(", user: a, password_file: password"), ElementsAre(HasSubstr("without TLS")));
  EXPECT_THAT(told("", "run_as: programs"), IsEmpty()) << "nothing is locked down there";
  EXPECT_THAT(told(", user: a, password_file: password", "run_as: programs"),
              ElementsAre(HasSubstr("a password in plain text")));
}

TEST_F(TrainFolder, APageThatNobodyCanControlIsTold) {
  write_map();
  std::ofstream(folder_ / "word") << "secret";
  const auto told = [&](const std::string& monitor) {
    const auto train = manifest(kTrain, "settings:\n", "settings:\n  monitor: " + monitor + "\n").value();
    const auto found = check_train(train, kNoPrograms).findings;
    return std::any_of(found.begin(), found.end(), [](const Finding& finding) {
      return !finding.error && finding.text.find("nobody can control recorder and player") != std::string::npos;
    });
  };
  EXPECT_TRUE(told("{ port: 8080 }"));
  EXPECT_FALSE(told("{ token_file: word }"));
  EXPECT_FALSE(told("{ control: false }"));
  EXPECT_FALSE(told("{ address: 127.0.0.1 }")) << "who sits there may";
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

TEST_F(TrainFolder, AComputerThatIsNotSetUpIsTold) {
  const auto conf = YAML::Load(
      "{net.core.rmem_max: 212992, net.core.wmem_max: 212992, net.ipv4.ipfrag_time: 30, "
      "net.ipv4.ipfrag_high_thresh: 4194304}");
  const auto set = [&](const std::string& name, const std::string& value) {
    std::string path = name;
    std::replace(path.begin(), path.end(), '.', '/');
    fs::create_directories((folder_ / path).parent_path());
    std::ofstream(folder_ / path) << value << '\n';
  };
  for (const auto& entry : conf) set(entry.first.Scalar(), entry.second.Scalar());
  const auto found = check_kernel(folder_);
  ASSERT_EQ(found.size(), conf.size()) << "as Linux begins";
  EXPECT_THAT(found[2].text, HasSubstr("net.ipv4.ipfrag_time is 30, so long that lost fragments block the link"));
  std::ifstream ours(std::string(RAILFIX_SOURCE_DIR) + "/deploy/host/60-railfix.conf");
  for (std::string name, equals, value; ours >> name;) {
    if (name.starts_with("net.")) ours >> equals >> value, set(name, value);
  }
  EXPECT_THAT(check_kernel(folder_), IsEmpty()) << "60-railfix.conf sets it";
}

TEST_F(TrainFolder, AnAddressThatThisComputerHasNotIsTold) {
  const auto told = [&](const std::string& address) {
    const auto train = manifest(kTrain, "10.42.1.11", address).value();
    std::vector<std::string> texts;
    for (const auto& finding : check_computer(&train, train.host("cab"), folder_)) texts.push_back(finding.text);
    return texts;
  };
  EXPECT_THAT(told("203.0.113.7"), Contains(AllOf(HasSubstr("host cab: "), HasSubstr("203.0.113.7"))));
  EXPECT_THAT(told("127.0.0.1"), Not(Contains(HasSubstr("host cab: "))));
}

TEST_F(TrainFolder, SharedMemoryThatIsTooSmallForPicturesIsTold) {
  if (geteuid() != 0) GTEST_SKIP() << "needs root, for a /dev/shm of its own";
  const auto train = manifest(kTrain).value();
  const auto told_with = [&](const char* size) {
    const pid_t child = fork();
    if (child == 0) {
      const bool own = unshare(CLONE_NEWNS) == 0 && mount("none", "/", nullptr, MS_REC | MS_PRIVATE, nullptr) == 0 &&
                       mount("tmpfs", "/dev/shm", "tmpfs", 0, size) == 0;
      const auto findings = check_computer(&train, train.host("cab"), folder_);
      const bool told = std::ranges::any_of(
          findings, [](const auto& finding) { return finding.error && finding.text.starts_with("/dev/shm has "); });
      _exit(!own ? 2 : told ? 1 : 0);
    }
    int status = 0;
    waitpid(child, &status, 0);
    return WEXITSTATUS(status);
  };
  EXPECT_EQ(told_with("size=64M"), 1);
  EXPECT_EQ(told_with("size=1G"), 0);
}

TEST_F(TrainFolder, AClockThatSaysLessThanWhatIsThereIsWrong) {
  constexpr int64_t kYearS = 365 * 86400;
  const auto old = folder_ / "old.yaml";
  const auto young = folder_ / "young.yaml";
  for (const auto& file : {old, young}) std::ofstream(file) << "x";
  fs::last_write_time(old, fs::last_write_time(young) - std::chrono::hours(48));
  const int64_t now_s = time(nullptr);
  EXPECT_THAT(check_clock_date({old, young, folder_ / "missing"}, now_s), IsEmpty());
  EXPECT_THAT(check_clock_date({old, young}, now_s - 1800), IsEmpty()) << "written on another computer";
  const auto found = check_clock_date({young, old}, 1'000'000'000);
  ASSERT_EQ(found.size(), 1U);
  EXPECT_TRUE(found[0].error);
  EXPECT_THAT(found[0].text, AllOf(HasSubstr("it says 2001-09-09 01:46 UTC, but " + young.string() + " is of 20"),
                                   HasSubstr("chronyc makestep"), HasSubstr("touch " + young.string())));
  const auto train = manifest(kTrain).value();
  const timespec next_year[2]{{now_s + kYearS, 0}, {now_s + kYearS, 0}};
  ASSERT_EQ(utimensat(AT_FDCWD, (folder_ / "train.yaml").c_str(), next_year, 0), 0);
  std::vector<std::string> texts;
  for (const auto& finding : check_computer(&train, train.host("cab"), folder_)) texts.push_back(finding.text);
  EXPECT_THAT(texts, Contains(AllOf(HasSubstr("clock is wrong"), HasSubstr("train.yaml"))));
}

TEST_F(TrainFolder, DisksOfTheRootAndOfRecordingsAreLookedAt) {
  const auto told = [&](const std::string& recorder, const fs::path& root) {
    const auto train = manifest(kTrain, "settings:\n", "settings:\n  recorder: " + recorder + "\n").value();
    std::vector<std::string> texts;
    for (const auto& finding : check_computer(&train, train.host("cab"), root)) texts.push_back(finding.text);
    return texts;
  };
  // Nothing can be written below /proc: it has no room.
  EXPECT_THAT(
      told("{ folder: /proc/recordings }", folder_),
      Contains(AllOf(HasSubstr("/proc has 0 MB free, this host needs 2500 MB there (2000 MB to begin recording"),
                     HasSubstr("recorder.quota_mb is not set"), HasSubstr("recorder.keep_free_mb"))));
  EXPECT_THAT(told("{ folder: recordings, quota_mb: 150, keep_free_mb: 20 }", "/proc/root-of-nobody"),
              Contains(HasSubstr("/proc has 0 MB free, this host needs 370 MB there (200 MB of logs and "
                                 "configurations, 150 MB of recordings up to recorder.quota_mb, 20 MB that")));
  EXPECT_THAT(told("{ folder: recordings }", folder_), Not(Contains(HasSubstr("/proc has"))));
}

TEST_F(TrainFolder, DisksNeedRoomForWhatTheSettingsAllowBesideWhatIsThere) {
  const auto needed_mb = [&](const char* host, const std::string& settings) {
    const auto train = manifest(kTrain, "settings:\n  tpr_publisher:\n", "settings:\n" + settings).value();
    double sum = 0;
    for (const auto& need : disk_needs(train, *train.host(host), folder_)) sum += need.mb;
    return sum;
  };
  const std::string link =
      "  tpr_publisher:\n    ground_link: { broker: b, store: reports.db, store_limit: 1000000 }\n";
  EXPECT_DOUBLE_EQ(needed_mb("cab", "  recorder: { quota_mb: 150, keep_free_mb: 20 }\n  tpr_publisher:\n"), 370);
  EXPECT_DOUBLE_EQ(needed_mb("coach", "  recorder: { quota_mb: 150 }\n  tpr_publisher:\n"), 200) << "records nothing";
  EXPECT_DOUBLE_EQ(needed_mb("coach", link), 456) << "a million reports";
  EXPECT_DOUBLE_EQ(needed_mb("cab", "  recorder: { quota_mb: 150, keep_free_mb: 20 }\n" + link), 626) << "a standby";
  const auto recordings = HostFolder(folder_).home() / "recordings";
  fs::create_directories(recordings);
  std::ofstream(recordings / "re460-042-1.mcap");
  fs::resize_file(recordings / "re460-042-1.mcap", 100'000'000);
  const std::string quota = "  recorder: { folder: recordings, quota_mb: 150, keep_free_mb: 20 }\n  tpr_publisher:\n";
  EXPECT_DOUBLE_EQ(needed_mb("cab", quota), 270);
  std::ofstream(recordings / "re460-042-2.mcap.active");
  fs::resize_file(recordings / "re460-042-2.mcap.active", 50'000'000);
  EXPECT_DOUBLE_EQ(needed_mb("cab", quota), 200) << "an upgrade of a train whose quota is full";
}

TEST_F(TrainFolder, SettingsThatAreNotGivenBeginAsTheServicesSay) {
  EXPECT_EQ(recorder::RecorderConfig{}.keep_free_mb, kUsualKeepFreeMb);
  EXPECT_EQ(recorder::RecorderConfig{}.quota_mb, 0);
  EXPECT_EQ(tpr_publisher::GroundLinkConfig{}.store_limit, kUsualStoreLimit);
}

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

TEST_F(TrainFolder, ThePageIsOnTheTrainNetworkOnly) {
  write_map();
  const auto train = manifest(kTrain).value();
  EXPECT_THAT(render_config(train, *train.host("coach"), "FOLDER"), HasSubstr("address: 10.42.1.12"));
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

}  // namespace
}  // namespace railfix::tool
