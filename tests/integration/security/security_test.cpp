// DDS Security with the keys that `railfix train keys` makes, over real DDS: who has no certificate of this train, or
// not for this topic, hears and says nothing.
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <unistd.h>

#include <fstream>
#include <thread>

#include "messaging/security.hpp"
#include "messaging/topics.hpp"
#include "support/program.hpp"
#include "support/run_until.hpp"
#include "train/keys.hpp"

namespace railfix {
namespace {

namespace fs = std::filesystem;
namespace topics = messaging::topics;

constexpr int kDomain = 93;
constexpr uint64_t kStates = 40;

class Security : public ::testing::Test {
 protected:
  Security() { fs::create_directories(folder_); }
  ~Security() override { fs::remove_all(folder_); }

  // The train's folder with keys, under an authority of its own.
  fs::path keys_of(const std::string& name, const std::string& train_id = "", const fs::path& authority = {}) {
    const auto train = folder_ / name;
    fs::create_directories(train);
    if (!authority.empty()) {
      fs::create_directories(train / "security");
      fs::copy(authority, train / "security/authority", fs::copy_options::recursive);
    }
    std::ofstream(train / "train.yaml")
        << "train:\n  id: " << (train_id.empty() ? train_ : train_id) << "\n  domain: " << kDomain
        << "\n  release: 1.0\n  security: true\n  hosts: { cab: { address: 127.0.0.1 } }\n"
           "  services: { frame_grabber: cab, odometry: cab, fusion: cab, monitor: cab }\n";
    const auto made = tool::make_keys(core::value_or_throw(tool::read_manifest(train)), {});
    if (!made.ok()) throw std::runtime_error(made.error().message);
    return train / "security" / "cab";
  }
  messaging::ParticipantOptions options(const std::string& service, const fs::path& keys) const {
    messaging::ParticipantOptions options;
    options.train_id = train_;
    options.domain = kDomain;
    options.service = service;
    options.host = "cab";
    options.security_folder = keys.string();
    return options;
  }
  const std::string train_ = "secure-" + std::to_string(getpid());
  const fs::path folder_ = fs::temp_directory_path() / train_;
};

/// A fusion and a monitor with right certificates, and what the monitor has heard.
struct Train {
  explicit Train(const messaging::ParticipantOptions& fusion_options,
                 const messaging::ParticipantOptions& monitor_options)
      : fusion(fusion_options), monitor(monitor_options) {}
  void write(uint64_t seq) {
    msg::TrainState state;
    state.seq(seq);
    writer.write(state);
  }
  messaging::Queue queue;
  messaging::Participant fusion;
  messaging::Participant monitor;
  std::vector<uint64_t> heard;
  messaging::Writer<msg::TrainState> writer{fusion, topics::train_state};
  messaging::Reader<msg::TrainState> reader{monitor, topics::train_state, "", queue,
                                            [this](const msg::TrainState& state) { heard.push_back(state.seq()); }};
};

// Somebody who reads and writes train_state.
struct Rogue {
  explicit Rogue(const messaging::ParticipantOptions& options) : participant(options) {}
  messaging::Queue queue;
  messaging::Participant participant;
  uint64_t heard = 0;
  messaging::Writer<msg::TrainState> writer{participant, topics::train_state};
  messaging::Reader<msg::TrainState> reader{participant, topics::train_state, "", queue,
                                            [this](const msg::TrainState&) { ++heard; }};
};

// Both live side by side until the train has exchanged enough; then nothing of it may have crossed.
void expect_nothing_crosses(Train& train, Rogue& rogue) {
  msg::TrainState lie;
  lie.seq(666);
  uint64_t seq = 0;
  ASSERT_TRUE(test::run_until(train.queue,
                              [&] {
                                train.write(++seq);
                                rogue.writer.write(lie);
                                while (rogue.queue.run_one(0)) {
                                }
                                return train.heard.size() >= kStates && seq >= 150;
                              }))
      << "the train itself hears only " << train.heard.size();
  // Its own reader hears its own writer, nobody else's.
  EXPECT_EQ(rogue.reader.matched_writers(), 1);
  EXPECT_EQ(rogue.writer.matched_readers(), 1);
  EXPECT_EQ(train.reader.matched_writers(), 1);
  EXPECT_THAT(train.heard, ::testing::Not(::testing::Contains(666U)));
}

// Service by service, as an upgrade goes: each step's keys are understood by those that still have the step before.
class Exchange : public Security, public ::testing::WithParamInterface<bool> {};
INSTANTIATE_TEST_SUITE_P(LostKey, Exchange, ::testing::Bool());

TEST_P(Exchange, OfTheAuthorityInThreeStepsWithoutSilence) {
  const bool key_is_lost = GetParam();
  const auto keys = keys_of("train");
  const auto manifest = core::value_or_throw(tool::read_manifest(folder_ / "train"));
  EXPECT_FALSE(tool::make_keys(manifest, {.drop_authority = true}).ok()) << "there is no other one";
  const std::vector<tool::KeysOptions> steps{{}, {.next_authority = true}, {.renew = true}, {.drop_authority = true}};
  std::vector<fs::path> stages;
  for (const auto& step : steps) {
    if (step.next_authority && key_is_lost) fs::remove_all(folder_ / "train/security/authority");
    const auto made = tool::make_keys(manifest, step);
    ASSERT_TRUE(made.ok()) << made.error().message;
    stages.push_back(folder_ / ("stage" + std::to_string(stages.size())));
    fs::copy(keys, stages.back(), fs::copy_options::recursive);
  }
  for (size_t i = 1; i < stages.size(); ++i) {
    for (const auto& [writes, reads] : {std::pair(i - 1, i), std::pair(i, i - 1)}) {
      Train train(options("fusion", stages[writes]), options("monitor", stages[reads]));
      uint64_t seq = 0;
      EXPECT_TRUE(test::run_until(train.queue,
                                  [&] {
                                    train.write(++seq);
                                    return train.heard.size() >= 3;
                                  }))
          << "step " << reads << " does not hear step " << writes;
    }
  }
  Train train(options("fusion", stages[3]), options("monitor", stages[3]));
  Rogue former(options("fusion", stages[0]));
  expect_nothing_crosses(train, former);
}

// So a dashboard on one host warns of those on the others.
TEST_F(Security, EverybodySaysWhenHisCertificateEnds) {
  const auto keys = keys_of("train");
  Train train(options("fusion", keys), options("monitor", keys));
  Rogue rogue(options("odometry", ""));
  uint64_t seq = 0;
  std::vector<messaging::CertificateEnd> ends;
  EXPECT_TRUE(test::run_until(train.queue, [&] {
    train.write(++seq);
    ends = train.monitor.certificates();
    return ends.size() == 2;
  }));
  ASSERT_EQ(ends.size(), 2U);
  EXPECT_EQ(ends[0].process, "fusion@cab");
  EXPECT_EQ(ends[1].process, "monitor@cab") << "its own, too";
  EXPECT_EQ(messaging::days_until(ends[0].ends_ns), messaging::days_left(keys / "fusion.cert.pem").value());
  EXPECT_TRUE(rogue.participant.certificates().empty()) << "it has none, and nobody is known to it";
}

TEST_F(Security, WithoutACertificateNothingIsHeardAndNothingSaid) {
  const auto keys = keys_of("train");
  Train train(options("fusion", keys), options("monitor", keys));
  Rogue rogue(options("fusion", ""));
  expect_nothing_crosses(train, rogue);
}

TEST_F(Security, WithACertificateOfAnotherAuthorityNothingIsHeardAndNothingSaid) {
  const auto keys = keys_of("train");
  Train train(options("fusion", keys), options("monitor", keys));
  Rogue rogue(options("fusion", keys_of("foreign")));
  expect_nothing_crosses(train, rogue);
}

// A right certificate of this train, for a service that has nothing to do with positions.
TEST_F(Security, ARightCertificateOfAnotherServiceSeesNothing) {
  const auto keys = keys_of("train");
  messaging::Participant odometry(options("odometry", keys));
  messaging::Queue queue;
  const auto read = [&] {
    messaging::Reader<msg::TrainState> reader(odometry, topics::train_state, "", queue, [](const msg::TrainState&) {});
  };
  EXPECT_THROW(read(), core::BadInput);
  EXPECT_NO_THROW(
      messaging::Reader<msg::TrackView>(odometry, topics::track_view, "", queue, [](const msg::TrackView&) {}));
}

// Two trains under one authority: the certificates of one do not open the other.
TEST_F(Security, TheCertificateOfAnotherTrainOfTheSameOperatorOpensNothing) {
  const auto keys = keys_of("train");
  const auto other = keys_of("other", "another-train", keys.parent_path() / "authority");
  Train train(options("fusion", keys), options("monitor", keys));
  messaging::Participant stranger(options("fusion", other));
  EXPECT_THROW(messaging::Writer<msg::TrainState>(stranger, topics::train_state), core::BadInput);
  messaging::Queue queue;
  EXPECT_THROW(
      messaging::Reader<msg::TrainState>(stranger, topics::train_state, "", queue, [](const msg::TrainState&) {}),
      core::BadInput);
}

// The test can fail: with a right certificate the same rogue is heard.
TEST_F(Security, WithTheRightCertificateASecondFusionIsHeard) {
  const auto keys = keys_of("train");
  Train train(options("fusion", keys), options("monitor", keys));
  Rogue second(options("fusion", keys));
  msg::TrainState state;
  state.seq(666);
  EXPECT_TRUE(test::run_until(train.queue, [&] {
    second.writer.write(state);
    return !train.heard.empty() && train.heard.back() == 666;
  }));
}

TEST_F(Security, ARightCertificateDoesNotOpenAnotherServicesTopic) {
  const auto keys = keys_of("train");
  messaging::Participant odometry(options("odometry", keys));
  EXPECT_THROW(messaging::Writer<msg::TrainState>(odometry, topics::train_state), core::BadInput);
  EXPECT_NO_THROW(messaging::Writer<msg::OdometryStep>(odometry, topics::odometry_step));
}

// A stolen key in a program that does not keep to the rules: it believes a governance of its own, without access
// control, so its library refuses nothing. The train's services must.
TEST_F(Security, AStolenKeyWhoseProgramRefusesNothingHearsAndSaysNothing) {
  const auto keys = keys_of("train");
  const auto own = keys_of("own").parent_path() / "authority";
  const auto stolen = folder_ / "stolen";
  fs::create_directories(stolen);
  // As if it were the fusion's: what the library asks for by name, with the rights of odometry.
  for (const char* part : {".cert.pem", ".key.pem", ".permissions.p7s"})
    fs::copy_file(keys / (std::string("odometry") + part), stolen / (std::string("odometry") + part));
  std::ofstream(stolen / "ca.pem") << test::slurp(keys / "ca.pem") << test::slurp(own / "ca.pem");
  auto governance = tool::governance_xml(core::value_or_throw(tool::read_manifest(folder_ / "train")));
  for (const char* control : {"join", "read", "write"}) {
    const std::string on = std::string("<enable_") + control + "_access_control>true";
    for (size_t at = 0; (at = governance.find(on)) != std::string::npos;)
      governance.replace(at + on.size() - 4, 4, "false");
  }
  std::ofstream(stolen / "governance.xml") << governance;
  ASSERT_EQ(test::run_program({"/usr/bin/openssl", "smime", "-sign", "-in", (stolen / "governance.xml").string(),
                               "-text", "-out", (stolen / "governance.p7s").string(), "-signer",
                               (own / "ca.pem").string(), "-inkey", (own / "ca.key.pem").string()},
                              60)
                .exit_code,
            0);
  Train train(options("fusion", keys), options("monitor", keys));
  Rogue rogue(options("odometry", stolen));  // its own library lets it make reader and writer of train_state
  messaging::Writer<msg::OdometryStep> own_topic(rogue.participant, topics::odometry_step);
  expect_nothing_crosses(train, rogue);
  const auto is_let_in = [&] {
    return std::ranges::any_of(train.monitor.certificates(),
                               [](const auto& end) { return end.process == "odometry@cab"; });
  };
  EXPECT_TRUE(test::run_until(train.queue, is_let_in)) << "it was kept out as a whole: its topics were not refused";
}

TEST_F(Security, ToolsHaveTheOperatorsCertificate) {
  const auto keys = keys_of("train");
  messaging::Participant tool(options("railfix-tell", keys));
  EXPECT_NO_THROW(messaging::Writer<msg::ControlRequest>(tool, topics::service_control));
  EXPECT_THROW(messaging::Writer<msg::TrainState>(tool, topics::train_state), core::BadInput);
}

TEST_F(Security, FullPicturesReachTheirOwnHost) {
  const auto keys = keys_of("train");
  messaging::Participant grabber(options("frame_grabber", keys));
  messaging::Participant odometry(options("odometry", keys));
  messaging::Queue queue;
  uint64_t pictures = 0;
  messaging::Writer<msg::CameraFrame> writer(grabber, topics::camera_frame, "cam0");
  messaging::Reader<msg::CameraFrame> reader(odometry, topics::camera_frame, "cam0", queue,
                                             [&](const msg::CameraFrame&) { ++pictures; });
  EXPECT_TRUE(test::run_until(queue, [&] {
    writer.write_in_place([](msg::CameraFrame& frame) {
      frame.width_px(64);
      frame.height_px(48);
    });
    return pictures >= 5;
  }));
}

TEST_F(Security, AKeyThatIsMissingIsNamed) {
  const auto keys = keys_of("train");
  fs::remove(keys / "fusion.key.pem");
  try {
    messaging::Participant participant(options("fusion", keys));
    FAIL() << "joined without its key";
  } catch (const core::BadInput& error) {
    EXPECT_THAT(error.what(), ::testing::HasSubstr("fusion.key.pem is missing or cannot be read"));
    EXPECT_THAT(error.what(), ::testing::HasSubstr("railfix train keys"));
  }
}

// All are discovered by all in the same moment, on more than one thread of the library.
// Last, because the library numbers the participants of a process on, and peers are asked for the first 32.
class Together : public Security, public ::testing::WithParamInterface<size_t> {};
INSTANTIATE_TEST_SUITE_P(Services, Together, ::testing::Values(12));

TEST_P(Together, AreWholeWhenTheyStartInOneMoment) {
  const auto keys = keys_of("train");
  struct Service {
    explicit Service(const messaging::ParticipantOptions& options) : participant(options) {}
    messaging::Participant participant;
    messaging::Writer<msg::OdometryStep> writer{participant, topics::odometry_step};
  };
  std::vector<std::unique_ptr<Service>> services(GetParam());
  const auto start = [&](auto& service) { service = std::make_unique<Service>(options("odometry", keys)); };
  const auto knows_all = [&](const auto& service) {
    return service->participant.certificates().size() == services.size();
  };
  messaging::Queue queue;
  {
    std::vector<std::jthread> starts;
    for (auto& service : services) starts.emplace_back([&] { start(service); });
  }
  EXPECT_TRUE(test::run_until(queue, [&] { return std::ranges::all_of(services, knows_all); }));
  EXPECT_EQ(std::ranges::count_if(services, knows_all), services.size()) << "know everybody";
  services.front().reset();
  start(services.front());
  EXPECT_TRUE(test::run_until(queue, [&] { return std::ranges::all_of(services, knows_all); }))
      << "one that came back is known to " << std::ranges::count_if(services, knows_all);
}

}  // namespace
}  // namespace railfix
