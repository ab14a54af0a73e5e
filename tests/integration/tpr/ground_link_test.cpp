// Reports to the ground over a real Mosquitto: in order, none lost, over restarts of everything.
#include <sys/resource.h>

#include <csignal>
#include <iostream>
#include <map>
#include <nlohmann/json.hpp>

#include "integration/tpr/ground_link_fixture.hpp"

namespace railfix {
namespace {

using ::testing::HasSubstr;
using ::testing::Not;

TEST_F(GroundLinkTest, NothingIsLostOverAPowerCutAndADeadZone) {
  test::Broker broker(file("broker"));
  ASSERT_TRUE(broker.start());
  Ground ground(broker.address(), train_);
  ASSERT_TRUE(ground.subscribed());
  broker.stop();
  {
    test::Program program(linked_service(broker.address()));
    ASSERT_TRUE(run_until([&] { return connected(); }, [] {}));
    ASSERT_TRUE(run_for(5));
    ASSERT_TRUE(status_says("5 reports wait"));
    EXPECT_EQ(status_->state(), msg::STATE_DEGRADED);
    EXPECT_THAT(reason(), HasSubstr("Ground link: not connected to localhost:"));
    program.end(SIGKILL);
  }
  ASSERT_TRUE(run_until([&] { return states_.matched_readers() == 0; }, [] {}));
  test::Program program(linked_service(broker.address()));
  ASSERT_TRUE(run_until([&] { return connected() && states_.matched_readers() > 0; }, [] {}));
  ASSERT_TRUE(run_for(9));
  ASSERT_TRUE(status_says("9 reports wait"));
  EXPECT_EQ(ground.count(), 0U);
  ASSERT_TRUE(broker.start());
  ASSERT_TRUE(run_until([&] { return ground.count() >= 9; }, [&] { write_state(last_.offset_m); }));
  ASSERT_TRUE(run_until([&] { return reason().find("Ground link") == std::string::npos; },
                        [&] { write_state(last_.offset_m); }));
  const auto arrived = ground.reports();
  std::map<uint64_t, uint64_t> last;  // of each stream
  for (size_t i = 0; i < 9; ++i) {
    EXPECT_EQ(arrived[i].sequence, ++last[arrived[i].stream]);
    EXPECT_EQ(arrived[i].train, train_);
    const auto& sent = reports_[i];
    EXPECT_EQ(arrived[i].message,
              std::vector<uint8_t>(sent.message().begin(), sent.message().begin() + sent.message_bytes()));
    EXPECT_EQ(arrived[i].stamp_ns, sent.stamp_ns());
  }
  EXPECT_EQ(last.size(), 2U) << "one for each start";
}

// A limit on files stands for a full disk.
TEST_F(GroundLinkTest, WhatCannotBeStoredGoesFromMemoryUntilThereIsRoomAgain) {
  test::Broker broker(file("broker"));
  ASSERT_TRUE(broker.start());
  Ground ground(broker.address(), train_);
  ASSERT_TRUE(ground.subscribed());
  const auto usual = std::signal(SIGXFSZ, SIG_IGN);  // the service inherits it: a write fails as on a full disk
  test::Program program(linked_service(broker.address()));
  std::signal(SIGXFSZ, usual);
  const auto limit_files = [&](rlim_t bytes) {
    const rlimit limit{bytes, RLIM_INFINITY};
    ASSERT_EQ(prlimit(static_cast<pid_t>(status_->pid()), RLIMIT_FSIZE, &limit, nullptr), 0);
  };
  ASSERT_TRUE(run_until([&] { return connected(); }, [] {}));
  const auto ground_has = [&](size_t count) {
    return run_until([&] { return ground.count() >= count; }, [&] { write_state(last_.offset_m); });
  };
  ASSERT_TRUE(run_for(3));
  ASSERT_TRUE(ground_has(3));
  ASSERT_TRUE(run_until([&] { return status_.has_value(); }, [] {}));
  limit_files(1024);
  ASSERT_TRUE(run_for(6));
  ASSERT_TRUE(ground_has(6));
  ASSERT_TRUE(status_says("Reports go from memory"));
  EXPECT_EQ(status_->state(), msg::STATE_DEGRADED);
  limit_files(RLIM_INFINITY);
  ASSERT_TRUE(run_for(9));
  ASSERT_TRUE(ground_has(9));
  ASSERT_TRUE(run_until([&] { return reason().find("from memory") == std::string::npos; },
                        [&] { write_state(last_.offset_m); }));
  const auto arrived = ground.reports();
  for (size_t i = 0; i < 9; ++i) {
    EXPECT_EQ(arrived[i].stamp_ns, reports_[i].stamp_ns()) << "in order, none lost";
    EXPECT_EQ(arrived[i].stream, arrived[0].stream);
    EXPECT_EQ(arrived[i].sequence, i + 1);
  }
}

// The broker may have taken it before the connection broke: under another number the ground would have it as two.
TEST_F(GroundLinkTest, WhatWasUnderWayFromMemoryKeepsItsNumberWhenThereIsRoomAgain) {
  test::Broker broker(file("broker"));
  ASSERT_TRUE(broker.start());
  Ground ground(broker.address(), train_);
  ASSERT_TRUE(ground.subscribed());
  auto settings = link_settings(broker.address());
  settings.mqtt.keep_alive_s = 5;
  tpr_publisher::GroundLink link(settings);
  const auto usual = std::signal(SIGXFSZ, SIG_IGN);
  const auto limit_files = [](rlim_t bytes) {
    const rlimit limit{bytes, RLIM_INFINITY};
    return setrlimit(RLIMIT_FSIZE, &limit);
  };
  const auto says = [&](const char* text) { return link.trouble().find(text) != std::string::npos; };
  link.send(report(1));
  ASSERT_TRUE(wait_for([&] { return ground.count() == 1; })) << link.trouble();
  ASSERT_EQ(limit_files(1024), 0);
  link.send(report(2));
  const bool from_memory = wait_for([&] { return ground.count() == 2 && says("from memory: 0 wait"); });
  broker.pause();
  link.send(report(3));
  const bool under_way = wait_for([&] { return says("from memory: 1 wait"); });
  ASSERT_EQ(limit_files(RLIM_INFINITY), 0);
  std::signal(SIGXFSZ, usual);
  ASSERT_TRUE(from_memory && under_way) << link.trouble();
  link.send(report(4));
  EXPECT_TRUE(wait_for([&] { return says("The store works again; 1 reports"); })) << link.trouble();
  ASSERT_TRUE(wait_for([&] { return !link.connected(); }));
  link.send(report(5));
  broker.go_on();
  ASSERT_TRUE(wait_for([&] { return ground.count() >= 5 && link.connected() && link.trouble().empty(); }))
      << link.trouble();
  const auto arrived = ground.reports();
  ASSERT_EQ(arrived.size(), 5U);
  for (size_t i = 0; i < arrived.size(); ++i) EXPECT_EQ(arrived[i].stamp_ns, static_cast<int64_t>(i + 1));
  EXPECT_EQ(ground.missing(), 0U);
}

TEST_F(GroundLinkTest, ListenPrintsEachReportOnce) {
  test::Broker broker(file("broker"));
  ASSERT_TRUE(broker.start());
  test::Program listen({"railfix", "tpr", "listen", "--broker", broker.address(), "--topic",
                        "railfix/" + train_ + "/position_report", "--count", "3", "--json"},
                       {file("out"), file("err"), {}});
  test::Program program(linked_service(broker.address()));
  ASSERT_TRUE(run_until([&] { return connected(); }, [] {}));
  // Whoever subscribes late has missed the first ones: reports are made until three have been printed.
  ASSERT_TRUE(run_until([&] { return listen.exit_code().has_value(); }, [&] { write_state(last_.offset_m += 1.1); }));
  ASSERT_EQ(listen.exit_code(), 0);
  std::istringstream lines(test::slurp(file("out")));
  std::vector<nlohmann::json> printed;
  for (std::string line; std::getline(lines, line);) printed.push_back(nlohmann::json::parse(line));
  ASSERT_EQ(printed.size(), 3U);
  ASSERT_TRUE(run_until([&] { return reports_.size() >= printed[2]["sequence"].get<size_t>(); }, [] {}));
  for (size_t i = 0; i < 3; ++i) {
    const size_t sequence = printed[0]["sequence"].get<size_t>() + i;
    EXPECT_EQ(printed[i]["sequence"], sequence);
    EXPECT_EQ(printed[i]["arrival"], "new");
    const auto& sent = reports_.at(sequence - 1);
    EXPECT_EQ(printed[i]["hex"], etcs::to_hex({sent.message().data(), sent.message_bytes()}));
  }
}

TEST_F(GroundLinkTest, ListenSaysOnWhichSideOfTheGroupTheFrontIs) {
  test::Broker broker(file("broker"));
  ASSERT_TRUE(broker.start());
  const test::Program listen({"railfix", "tpr", "listen", "--broker", broker.address()},
                             {file("out"), file("err"), {}});
  ASSERT_TRUE(wait_for([&] { return test::slurp(file("err")).find("connected") != std::string::npos; }));
  std::atomic<bool> connected = false;
  ground_link::MqttOptions options;
  core::ok_or_throw(ground_link::parse_broker(broker.address(), options));
  ground_link::MqttClient train(options, {[&](auto) { connected = true; }, {}, {}, {}, {}});
  ASSERT_TRUE(wait_for([&] { return connected.load(); }));
  uint64_t sequence = 0;
  const auto send = [&](uint32_t side) {
    auto fields =
        etcs::decode(etcs::parse_hex("880601D6F345402AF34000E48F68EB84D250014010C38830").value(), etcs::Baseline::b3)
            .value();
    fields.q_dlrbg = side;
    auto sent = report(side);
    sent.sequence = ++sequence;
    sent.message = etcs::encode(fields, etcs::Baseline::b3).value();
    return train.publish("railfix/" + train_ + "/position_report", ground_link::to_bytes(sent));
  };
  const std::string group = " side of LRBG 123/4567  -10.0/+67.0 m  140 km/h\n";
  const auto says = [&](const std::string& side) {
    return test::slurp(file("out")).find("  1234.0 m on " + side + group) != std::string::npos;
  };
  EXPECT_TRUE(wait_for([&] {  // whoever subscribes late misses the first ones
    for (const auto side : {etcs::kReverse, etcs::kNominal, etcs::kUnknownSide}) (void)send(side);
    return says("the nominal") && says("the reverse") && says("an unknown");
  }));
}

TEST_F(GroundLinkTest, ACertificateWithoutAuthorityIsRefusedBeforeAnythingIsSent) {
  auto command = linked_service("localhost:1", {"tpr_publisher.ground_link.certificate_file=train.pem",
                                                "tpr_publisher.ground_link.key_file=train.key"});
  command.emplace_back("--check");
  const auto service = test::run_program(command, 20);
  EXPECT_EQ(service.exit_code, 2);
  EXPECT_THAT(service.err, HasSubstr("tpr_publisher.ground_link: certificate and key without the broker's authority"));
  const auto listen = test::run_program(
      {"railfix", "tpr", "listen", "--broker", "localhost:1", "--certificate", "train.pem", "--key", "train.key"}, 20);
  EXPECT_EQ(listen.exit_code, 2);
  EXPECT_THAT(listen.err, HasSubstr("certificate and key without the broker's authority"));
}

TEST_F(GroundLinkTest, APacket58ThatCannotBeReadIsRefusedBeforeTheServiceStarts) {
  auto command = linked_service("localhost:1", {"tpr_publisher.packet_58=3A80"});
  command.emplace_back("--check");
  const auto service = test::run_program(command, 20);
  EXPECT_EQ(service.exit_code, 2);
  EXPECT_THAT(service.err, HasSubstr("tpr_publisher.packet_58: "));
}

TEST_F(GroundLinkTest, ATopicThatNobodyCanWriteToIsRefusedBeforeTheServiceStarts) {
  for (const std::string topic : {"", "railfix/{train}/+", "railfix/#"}) {
    auto command = linked_service("localhost:1", {"tpr_publisher.ground_link.topic=" + topic});
    command.emplace_back("--check");
    const auto service = test::run_program(command, 20);
    EXPECT_EQ(service.exit_code, 2) << topic;
    EXPECT_THAT(service.err, HasSubstr("tpr_publisher.ground_link.topic: \"" + topic + "\" is no topic to write to"));
  }
}

// Own authority, a certificate for the broker and one for the train, as docs/configuration/reports.md asks for.
class Certificates {
 public:
  explicit Certificates(const std::filesystem::path& folder, const std::string& days = "400") : folder_(folder) {
    std::filesystem::create_directories(folder);
    ok_ = openssl({"req", "-x509", "-newkey", "rsa:2048", "-nodes", "-days", days, "-subj", "/CN=railfix test",
                   "-keyout", of("ca.key"), "-out", of("ca.pem")});
    for (const std::string name : {"broker", "train"}) {
      std::ofstream(folder_ / (name + ".ext")) << "subjectAltName=DNS:localhost\n";
      ok_ = ok_ && openssl({"req", "-newkey", "rsa:2048", "-nodes", "-subj", "/CN=" + name, "-keyout",
                            of(name + ".key"), "-out", of(name + ".csr")});
      ok_ =
          ok_ && openssl({"x509", "-req", "-in", of(name + ".csr"), "-CA", of("ca.pem"), "-CAkey", of("ca.key"),
                          "-CAcreateserial", "-days", days, "-extfile", of(name + ".ext"), "-out", of(name + ".pem")});
    }
  }
  [[nodiscard]] bool ok() const { return ok_; }
  [[nodiscard]] std::string of(const std::string& name) const { return (folder_ / name).string(); }

 private:
  static bool openssl(std::vector<std::string> arguments) {
    arguments.insert(arguments.begin(), "/usr/bin/openssl");
    return test::run_program(arguments, 60).exit_code == 0;
  }
  std::filesystem::path folder_;
  bool ok_ = false;
};

TEST_F(GroundLinkTest, TlsLetsOnlyTheRightCertificatesIn) {
  const Certificates ours(file("ours"));
  const Certificates others(file("others"), "5");
  ASSERT_TRUE(ours.ok() && others.ok());
  test::Broker broker(file("broker"), "cafile " + ours.of("ca.pem") + "\ncertfile " + ours.of("broker.pem") +
                                          "\nkeyfile " + ours.of("broker.key") + "\nrequire_certificate true\n");
  ASSERT_TRUE(broker.start());
  const auto secured = [&](const std::string& ca, const Certificates& train) {
    const std::string link = "tpr_publisher.ground_link.";
    return linked_service(broker.address(), {link + "ca_file=" + ca, link + "certificate_file=" + train.of("train.pem"),
                                             link + "key_file=" + train.of("train.key")});
  };
  {
    test::Program program(secured(others.of("ca.pem"), ours));  // the broker is not the one it says
    ASSERT_TRUE(run_until([&] { return connected(); }, [] {}));
    ASSERT_TRUE(run_for(2));
    ASSERT_TRUE(status_says("2 reports wait"));
    ASSERT_TRUE(status_says("Ground link: not connected"));
  }
  ASSERT_TRUE(run_until([&] { return states_.matched_readers() == 0; }, [] {}));
  {
    test::Program program(secured(ours.of("ca.pem"), others));  // the broker does not know this train
    ASSERT_TRUE(run_until([&] { return connected() && states_.matched_readers() > 0; }, [] {}));
    ASSERT_TRUE(run_for(4));
    ASSERT_TRUE(status_says("4 reports wait"));
    ASSERT_TRUE(status_says("train.pem) runs out in 4 days."));
  }
  ASSERT_TRUE(run_until([&] { return states_.matched_readers() == 0; }, [] {}));
  ground_link::MqttOptions known;
  known.ca_file = ours.of("ca.pem");
  known.certificate_file = ours.of("train.pem");
  known.key_file = ours.of("train.key");
  Ground ground(broker.address(), train_, known);
  ASSERT_TRUE(ground.subscribed());
  test::Program program(secured(ours.of("ca.pem"), ours));
  ASSERT_TRUE(run_until([&] { return connected() && states_.matched_readers() > 0; }, [] {}));
  ASSERT_TRUE(run_for(5));
  ASSERT_TRUE(run_until([&] { return ground.count() >= 5; }, [&] { write_state(last_.offset_m); })) << reason();
  ASSERT_TRUE(run_until([&] { return status_ && status_->state() == msg::STATE_ACTIVE; },
                        [&] { write_state(last_.offset_m); }));
}

TEST_F(GroundLinkTest, APasswordLetsOnlyItsTrainIn) {
  ASSERT_EQ(
      test::run_program({"/usr/bin/mosquitto_passwd", "-c", "-b", file("passwords"), train_, "right"}, 60).exit_code,
      0);
  test::Broker broker(file("broker"), "password_file " + file("passwords").string() + "\n", false);
  ASSERT_TRUE(broker.start());
  const auto with_password = [&](const std::string& password) {
    std::ofstream(file("password")) << password << '\n';
    const std::string link = "tpr_publisher.ground_link.";
    return linked_service(broker.address(),
                          {link + "user=" + train_, link + "password_file=" + file("password").string()});
  };
  {
    auto command = with_password("wrong");
    command.insert(command.end(), {"--set", "common.log_level=warning"});
    test::Program program(command, {{}, file("err"), {}});
    ASSERT_TRUE(run_until([&] { return connected(); }, [] {}));
    EXPECT_THAT(test::slurp(file("err")), HasSubstr("Ground link: the password goes in plain text to localhost:"));
    ASSERT_TRUE(run_for(2));
    ASSERT_TRUE(status_says("2 reports wait"));
    ASSERT_TRUE(status_says("Ground link: not connected"));
  }
  ASSERT_TRUE(run_until([&] { return states_.matched_readers() == 0; }, [] {}));
  ground_link::MqttOptions known;
  known.user = train_;
  known.password = "right";
  Ground ground(broker.address(), train_, known);
  ASSERT_TRUE(ground.subscribed());
  test::Program program(with_password("right"));
  ASSERT_TRUE(run_until([&] { return connected() && states_.matched_readers() > 0; }, [] {}));
  ASSERT_TRUE(run_for(3));
  ASSERT_TRUE(run_until([&] { return ground.count() >= 3; }, [&] { write_state(last_.offset_m); })) << reason();
  ASSERT_TRUE(
      run_until([&] { return status_ && status_->state() == msg::STATE_ACTIVE; }, [&] { write_state(last_.offset_m); }))
      << reason();
}

TEST_F(GroundLinkTest, ManyLateReportsArriveInOrderWhileTheBrokerComesAndGoes) {
  constexpr uint64_t kReports = 2000;
  test::Broker broker(file("broker"));
  ASSERT_TRUE(broker.start());
  Ground ground(broker.address(), train_);
  ASSERT_TRUE(ground.subscribed());
  broker.stop();
  const auto settings = link_settings(broker.address());
  {
    tpr_publisher::GroundLink link(settings);
    for (uint64_t i = 1; i <= kReports; ++i) link.send(report(i));
  }  // stored, though nobody was there
  tpr_publisher::GroundLink link(settings);
  const int64_t begun_ns = core::monotonic_ns();
  for (const size_t until : {size_t{200}, size_t{900}, size_t{1500}}) {
    ASSERT_TRUE(broker.start());
    ASSERT_TRUE(wait_for([&] { return ground.count() >= until; }));
    broker.stop();
  }
  ASSERT_TRUE(broker.start());
  ASSERT_TRUE(wait_for([&] { return ground.count() >= kReports; })) << link.trouble();
  const double took_s = core::seconds(core::monotonic_ns() - begun_ns);
  const auto arrived = ground.reports();
  for (uint64_t i = 0; i < kReports; ++i) {
    ASSERT_EQ(arrived[i].sequence, i + 1);
    ASSERT_EQ(arrived[i].stamp_ns, static_cast<int64_t>(i + 1));
  }
  std::cout << kReports << " late reports over 3 restarts of the broker: " << took_s << " s, 0 lost, " << ground.twice()
            << " came twice\n";
}

}  // namespace
}  // namespace railfix
