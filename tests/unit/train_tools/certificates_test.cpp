// Certificates, keys and passwords of a train: what is missing, old or open is said.
#include <gmock/gmock.h>

#include <algorithm>

#include "messaging/security.hpp"
#include "support/program.hpp"
#include "train/keys.hpp"
#include "unit/train_tools/train_folder.hpp"

namespace railfix::tool {
namespace {

using ::testing::AllOf;
using ::testing::Contains;
using ::testing::ElementsAre;
using ::testing::EndsWith;
using ::testing::Field;
using ::testing::HasSubstr;
using ::testing::IsEmpty;

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
    EXPECT_THAT(
        refused.error().message,
        AllOf(HasSubstr("authority/ca.key.pem is not here, and "), HasSubstr("has certificates by that authority"),
              HasSubstr("If it is lost: railfix train keys " + folder_.string() + " --next-authority")));
  }
  EXPECT_EQ(test::slurp(folder_ / "security/cab/ca.pem"), trusted);
  EXPECT_FALSE(fs::exists(folder_ / "security/authority"));
  fs::rename(folder_ / "aside", folder_ / "security/authority");
  EXPECT_TRUE(make_keys(secured, {.renew = true}).ok());
}

TEST_F(TrainFolder, KeysSayWhatWasDoneAndWhatComesNext) {
  const auto secured = manifest(kTrain, "run_as: programs", "security: true").value();
  const auto keys = "railfix train keys " + folder_.string();
  const auto told = [&](const KeysOptions& options) {
    const auto done = make_keys(secured, options);
    if (!done.ok()) return std::vector<std::string>{"refused: " + done.error().message};
    return told_of_keys(secured, options, done.value());
  };
  const auto to_hosts = [](const std::string& verb) {
    return AllOf(HasSubstr("next: copy "), EndsWith("railfix train " + verb));
  };
  EXPECT_THAT(told({}), ElementsAre(HasSubstr("made: the train's authority; its key stays with you"),
                                    HasSubstr("made: 14 certificates for cab, coach, in " + folder_.string()),
                                    to_hosts("up, or upgrade where it runs")));
  EXPECT_THAT(told({}), ElementsAre("nothing to do: all certificates are there; --renew makes new ones"));
  EXPECT_THAT(told({.renew = true}), ElementsAre(HasSubstr("renewed: 14 certificates"), to_hosts("upgrade")));
  EXPECT_THAT(told({.drop_authority = true}), ElementsAre(HasSubstr("begin an exchange with " + keys + " --next-a")));
  EXPECT_THAT(told({.next_authority = true}),
              ElementsAre(HasSubstr("made: a second authority"),
                          to_hosts("upgrade; when every host has done it: " + keys + " --renew")));
  EXPECT_THAT(told({.drop_authority = true}),
              ElementsAre(AllOf(HasSubstr("refused: the next authority of "), HasSubstr("has signed nothing yet"),
                                HasSubstr(keys + " --renew, then railfix train upgrade on every host, come first"))));
  EXPECT_THAT(told({.renew = true}),
              ElementsAre(EndsWith(", by the next authority"),
                          to_hosts("upgrade; when every host has done it: " + keys + " --drop-authority")));
  EXPECT_THAT(told({.drop_authority = true}), ElementsAre(HasSubstr("dropped: the former"), to_hosts("upgrade")));
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
  EXPECT_THAT(told("13"),
              ElementsAre(AllOf(Field(&Finding::error, true),
                                Field(&Finding::text, (folder_ / "security/coach").string() +
                                                          ": 5 of 5 permissions do not allow domain 13 (tool, "
                                                          "map_matcher, fusion, tpr_publisher, monitor); railfix "
                                                          "train keys " +
                                                          folder_.string() +
                                                          " --renew, then railfix train down on every host, then up"))))
      << "one mistake, one sentence";
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
                                    (security / "fusion.cert.pem").string() + "; railfix train keys " +
                                    folder_.string() + " --renew")));

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

// As it is to be typed, wherever the folder is known.
TEST_F(TrainFolder, TheAdviceNamesTheFolderOfTheTrain) {
  const auto secured = manifest(kTrain, "run_as: programs", "security: true").value();
  ASSERT_TRUE(make_keys(secured, {.valid_days = 20}).ok());
  const auto keys = folder_ / "security/cab";
  EXPECT_EQ(messaging::keys_command(keys), "railfix train keys " + folder_.string());
  const auto missing = messaging::security_properties(keys, "monitor");
  ASSERT_FALSE(missing.ok());
  EXPECT_THAT(missing.error().message, HasSubstr("make the train's keys with railfix train keys " + folder_.string() +
                                                 ", on the computer that has security/authority, and copy"));

  const HostFolder installed(folder_ / "host");
  fs::create_directories(installed.generation(1));
  fs::copy(keys, installed.generation(1) / "security");
  HostPlan plan{"re460-042", "cab", 1, 0, false, {{"fusion", "1.2.0", 1, false, {"x"}, {}, ""}}, "/home/max/train"};
  ASSERT_TRUE(installed.write(plan).ok());
  EXPECT_THAT(check_installed_certificates(installed),
              ElementsAre(Field(&Finding::text, HasSubstr("railfix train keys /home/max/train --renew, then"))));
  // A service has its part only, and its supervisor tells it.
  EXPECT_EQ(messaging::keys_command(installed.generation(1) / "security"), "railfix train keys TRAIN");
  setenv(messaging::kTrainFolder, "/home/max/train", 1);
  EXPECT_EQ(messaging::keys_command(installed.generation(1) / "security"), "railfix train keys /home/max/train");
  unsetenv(messaging::kTrainFolder);
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

TEST_F(TrainFolder, APasswordThatIsEmptyIsTold) {
  write_map();
  std::ofstream(folder_ / "password") << "\nsecret";
  EXPECT_THAT(findings("settings:\n  tpr_publisher:\n",
                       "settings:\n  tpr_publisher:\n    ground_link: { broker: g:1883, store: s, user: a, "
                       "password_file: password }\n"),
              testing::Contains(HasSubstr("password_file: " + (folder_ / "password").string() +
                                          ": no password can be read; put it into the first line")));
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

}  // namespace
}  // namespace railfix::tool
