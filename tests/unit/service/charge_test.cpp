// Who is in charge when services come, fail, hang, lose each other and meet again: the rule itself, in simulated time.
#include "service/charge.hpp"

#include <gtest/gtest.h>

#include <random>
#include <vector>

namespace railfix::service::charge_test {
namespace {

constexpr int64_t kMs = 1'000'000;
constexpr int64_t kPeriodNs = 25 * kMs;
constexpr int64_t kSilenceNs = 250 * kMs;

struct One {
  One(uint64_t instance, int64_t strength) : charge(instance, strength, kSilenceNs) {}
  Charge charge;
  int fitness = 4;
  bool frozen = false;
  bool speaks = false;
};

/// Two computers and a cable. A beat takes one period to arrive, or is lost.
class Train {
 public:
  explicit Train(uint32_t seed = 1) : random_(seed) { start(0), start(1); }
  void start(size_t host) { hosts_[host].emplace(next_instance_++, host == 0 ? 20 : 10); }
  void kill(size_t host) { hosts_[host].reset(); }
  void leave(size_t host) {
    auto last = hosts_[host]->charge.beat();
    last.leaving = true;
    kill(host);
    if (connected) hosts_[1 - host]->charge.hear(last, now_ns_);
  }
  [[nodiscard]] One& at(size_t host) { return *hosts_[host]; }
  [[nodiscard]] bool lives(size_t host) const { return hosts_[host].has_value(); }
  [[nodiscard]] bool speaks(size_t host) const { return hosts_[host] && hosts_[host]->speaks; }
  [[nodiscard]] bool runs(size_t host) const { return hosts_[host] && !hosts_[host]->frozen; }

  void run(double seconds) {
    for (auto left = static_cast<int64_t>(seconds * 40); left > 0; --left) step();
  }
  bool connected = true;
  double loss = 0;
  int changes = 0;       // somebody has begun to speak
  int longest_both = 0;  // periods in which both spoke although connected
  int longest_none = 0;  // periods in which somebody ran and nobody spoke

 private:
  void step() {
    now_ns_ += kPeriodNs;
    std::vector<std::pair<size_t, ChargeBeat>> under_way;
    for (size_t host : {0U, 1U}) {
      if (!runs(host)) continue;
      One& one = at(host);
      changes += one.charge.update(one.fitness, now_ns_) ? 1 : 0;
      one.speaks = one.charge.in_charge(now_ns_);
      under_way.emplace_back(1 - host, one.charge.beat());
      under_way.back().second.host = "host " + std::to_string(host);
    }
    for (const auto& [to, beat] : under_way) {
      if (connected && runs(to) && uniform_(random_) >= loss) at(to).charge.hear(beat, now_ns_);
    }
    const int speaking = (runs(0) && speaks(0) ? 1 : 0) + (runs(1) && speaks(1) ? 1 : 0);
    both_ = speaking == 2 && connected ? both_ + 1 : 0;
    none_ = speaking == 0 && (runs(0) || runs(1)) ? none_ + 1 : 0;
    longest_both = std::max(longest_both, both_);
    longest_none = std::max(longest_none, none_);
  }
  std::optional<One> hosts_[2];
  uint64_t next_instance_ = 1;
  int64_t now_ns_ = 0;
  int both_ = 0;
  int none_ = 0;
  std::mt19937 random_;
  std::uniform_real_distribution<double> uniform_{0, 1};
};

TEST(Charge, TheStrongerOneBeginsAndNobodyElse) {
  Train train;
  train.run(60);
  EXPECT_TRUE(train.speaks(0));
  EXPECT_FALSE(train.speaks(1));
  EXPECT_EQ(train.changes, 1);
  EXPECT_EQ(train.at(1).charge.holder(), "host 0");
}

TEST(Charge, AStandbyTakesOverAfterTheSilenceAndTheOneThatComesBackStandsBy) {
  Train train;
  train.run(10);
  train.kill(0);
  train.run(0.25);
  EXPECT_FALSE(train.speaks(1)) << "too early: a lost beat or two are no failure";
  train.run(0.05);
  EXPECT_TRUE(train.speaks(1));
  train.start(0);
  train.run(600);
  EXPECT_TRUE(train.speaks(1));
  EXPECT_FALSE(train.speaks(0));
  EXPECT_EQ(train.changes, 2);
}

TEST(Charge, OneThatHungDoesNotSpeakAtItsFirstMoment) {
  Train train;
  train.run(10);
  train.at(0).frozen = true;
  train.run(5);
  EXPECT_TRUE(train.speaks(1));
  train.at(0).frozen = false;
  train.run(0.025);
  EXPECT_FALSE(train.speaks(0));
  train.run(600);
  EXPECT_TRUE(train.speaks(1));
  EXPECT_FALSE(train.speaks(0));
  EXPECT_EQ(train.changes, 2);
}

TEST(Charge, OneThatHungWhileItHeardNobodyAsksFirstToo) {
  Train train;
  train.run(10);
  train.at(1).frozen = true;
  train.run(0.5);
  train.at(0).frozen = true;
  train.at(1).frozen = false;
  train.run(5);
  EXPECT_TRUE(train.speaks(1));
  train.at(0).frozen = false;
  train.run(0.025);
  EXPECT_FALSE(train.speaks(0));
  train.run(60);
  EXPECT_TRUE(train.speaks(1));
  EXPECT_FALSE(train.speaks(0));
}

TEST(Charge, HavingBeenHeldUpIsKnownWithoutAnUpdate) {
  Charge charge(1, 20, kSilenceNs);
  ChargeBeat other;
  other.instance = 2;
  int64_t now_ns = 0;
  for (; now_ns < 2000 * kMs; now_ns += kPeriodNs) {
    charge.hear(other, now_ns);
    charge.update(4, now_ns);
  }
  EXPECT_TRUE(charge.in_charge(now_ns));
  EXPECT_TRUE(charge.in_charge(now_ns + 150 * kMs));
  EXPECT_FALSE(charge.in_charge(now_ns + 250 * kMs));
}

TEST(Charge, TheOnlyOneOfItsKindIsNotDisturbedByBeingHeldUp) {
  Charge alone(1, 0, kSilenceNs, false);
  for (int64_t now_ns = 0; now_ns < 5000 * kMs; now_ns += kPeriodNs) alone.update(4, now_ns);
  EXPECT_TRUE(alone.in_charge(25'000 * kMs));
}

TEST(Charge, OneOfTwoAsksFirstAlsoWhenItHasNeverHeardTheOther) {
  Train train;
  train.kill(1);
  train.run(5);
  train.at(0).frozen = true;
  train.run(20);
  EXPECT_FALSE(train.at(0).charge.in_charge(26'000 * kMs));
  train.at(0).frozen = false;
  train.run(1.9);
  EXPECT_FALSE(train.speaks(0)) << "DDS may have to find the other one again";
  train.run(0.2);
  EXPECT_TRUE(train.speaks(0)) << "nobody answers";
}

TEST(Charge, TheOnlyOneSendsAtOnceUntilItsSuccessorTakesItsPlace) {
  Charge only(1, 0, kSilenceNs, false);
  EXPECT_TRUE(only.in_charge(0));
  int64_t now_ns = 0;
  only.update(4, now_ns);
  EXPECT_TRUE(only.in_charge(now_ns));
  EXPECT_TRUE(only.alone());
  // Its successor, started beside it, listens first and never speaks at the same time.
  Charge successor(2, 0, kSilenceNs, true);
  for (; now_ns < 4000 * kMs; now_ns += kPeriodNs) {
    only.update(4, now_ns);
    successor.update(4, now_ns);
    only.hear(successor.beat(), now_ns);
    successor.hear(only.beat(), now_ns);
    EXPECT_TRUE(only.in_charge(now_ns));
    EXPECT_FALSE(successor.in_charge(now_ns));
  }
  auto last = only.beat();
  last.leaving = true;
  successor.hear(last, now_ns);
  EXPECT_TRUE(successor.update(4, now_ns));
}

TEST(Charge, ACutCableMakesTwoAndWhenTheyMeetTheOneThatKnowsMoreStays) {
  for (const bool first_knows_more : {true, false}) {
    Train train;
    train.run(10);
    train.connected = false;
    train.at(first_knows_more ? 1 : 0).fitness = 2;
    train.run(10);
    EXPECT_TRUE(train.speaks(0));
    EXPECT_TRUE(train.speaks(1));
    train.connected = true;
    train.run(0.1);
    EXPECT_EQ(train.speaks(0), first_knows_more);
    EXPECT_EQ(train.speaks(1), !first_knows_more);
    train.at(0).fitness = train.at(1).fitness = 4;
    train.run(600);
    EXPECT_EQ(train.speaks(0), first_knows_more);
    EXPECT_EQ(train.changes, 2);
    EXPECT_LE(train.longest_both, 2);
  }
}

TEST(Charge, OfTwoThatKnowEquallyMuchTheStrongerStays) {
  Train train;
  train.run(10);
  train.connected = false;
  train.run(10);
  train.connected = true;
  train.run(1);
  EXPECT_TRUE(train.speaks(0));
  EXPECT_FALSE(train.speaks(1));
}

TEST(Charge, AStandbyThatHasKnownMoreForAWhileGetsTheCharge) {
  Train train;
  train.run(10);
  train.at(0).fitness = 2;
  train.run(2);
  train.at(0).fitness = 4;
  train.run(4);
  EXPECT_EQ(train.changes, 1) << "a tunnel is no reason";
  train.run(60);
  train.at(0).fitness = 2;
  train.run(5.2);
  EXPECT_TRUE(train.speaks(1));
  EXPECT_LE(train.longest_none, 42) << "but for the start nobody was silent for long";
  train.at(0).fitness = 4;
  train.run(600);
  EXPECT_TRUE(train.speaks(1));
  EXPECT_EQ(train.changes, 2);
}

TEST(Charge, OneThatIsWorthNothingGivesTheChargeAwayAndDoesNotGetItBack) {
  Train train;
  train.run(10);
  train.at(0).fitness = 0;
  train.run(0.25);
  EXPECT_TRUE(train.speaks(1));
  EXPECT_FALSE(train.speaks(0));
  train.at(0).fitness = 4;
  train.run(600);
  EXPECT_TRUE(train.speaks(1));
  EXPECT_EQ(train.changes, 2);
  EXPECT_LE(train.longest_both, 0);
}

TEST(Charge, WhenNobodyIsWorthAnythingYetTheOneInChargeStays) {
  Train train;
  train.at(0).fitness = train.at(1).fitness = 0;
  train.run(10);
  EXPECT_TRUE(train.speaks(0));
  for (const size_t first : {1U, 0U}) {  // data begins here, a moment later there
    train.at(first).fitness = 3;
    train.run(0.2);
    train.at(1 - first).fitness = 3;
    train.run(10);
    EXPECT_TRUE(train.speaks(0));
    EXPECT_EQ(train.changes, 1);
    train.at(0).fitness = train.at(1).fitness = 0;
    train.run(10);
  }
}

// On a busy host every other turn comes late, and the beats of the other one wait in a queue meanwhile.
TEST(Charge, WhoseOwnTurnsComeLateDoesNotTakeTheOtherOneForSilent) {
  Charge standby(1, 10, kSilenceNs);
  ChargeBeat holder{2, 20, 4, true, false, "coach"};
  int64_t now_ns = 0;
  for (; now_ns < 3000 * kMs; now_ns += kPeriodNs) {
    standby.hear(holder, now_ns);
    standby.update(4, now_ns);
  }
  for (int i = 0; i < 5; ++i) EXPECT_FALSE(standby.update(4, now_ns += 150 * kMs)) << "held up itself for 0.75 s";
  standby.hear(holder, now_ns);
  int64_t silent_ns = 0;
  while (!standby.update(4, now_ns += kPeriodNs)) silent_ns += kPeriodNs;
  EXPECT_LE(silent_ns, kSilenceNs + kPeriodNs) << "in time again: as quick as ever";
}

// Where discovery takes seconds the other one may be there and not be heard yet.
TEST(Charge, ANewcomerWaitsUntilItHasFoundAnybodyAndListensThen) {
  for (const bool finds_somebody : {true, false}) {
    Charge newcomer(1, 20, kSilenceNs);
    const ChargeBeat holder{2, 10, 4, true, false, "cab"};
    int64_t now_ns = 0;
    for (; now_ns < 4000 * kMs; now_ns += kPeriodNs) {
      newcomer.found_nobody(now_ns);
      ASSERT_FALSE(newcomer.update(4, now_ns));
    }
    for (; finds_somebody && now_ns < 4900 * kMs; now_ns += kPeriodNs) ASSERT_FALSE(newcomer.update(4, now_ns));
    for (; finds_somebody && now_ns < 20'000 * kMs; now_ns += kPeriodNs) {
      newcomer.hear(holder, now_ns);
      ASSERT_FALSE(newcomer.update(4, now_ns));
    }
    bool taken = finds_somebody;
    for (; !taken && now_ns < 7000 * kMs; now_ns += kPeriodNs) {
      newcomer.found_nobody(now_ns);
      taken = newcomer.update(4, now_ns);
    }
    EXPECT_TRUE(taken) << "nobody is there: it does not wait for ever";
  }
}

TEST(Charge, WhoEndsInOrderIsFollowedAtOnce) {
  Train train;
  train.run(10);
  train.leave(0);
  train.run(0.025);
  EXPECT_TRUE(train.speaks(1));
}

TEST(Charge, NothingFlapsWithEveryTenthBeatLost) {
  Train train(7);
  train.loss = 0.1;
  train.run(3600);
  EXPECT_EQ(train.changes, 1);
  EXPECT_LE(train.longest_both, 0);
}

// Whatever happens: two that reach each other do not both speak for longer than they need to hear of it, and who runs
// is not silent for longer than two starts take: the first one may be killed meanwhile.
TEST(Charge, AnyRowOfFailuresLeavesOneThatSpeaks) {
  for (uint32_t seed = 0; seed < 30; ++seed) {
    Train train(seed);
    std::mt19937 random(seed + 1000);
    const auto pick = [&](int n) { return std::uniform_int_distribution<int>(0, n - 1)(random); };
    for (int i = 0; i < 200; ++i) {
      const auto host = static_cast<size_t>(pick(2));
      switch (pick(7)) {
        case 0:
          train.kill(host);
          break;
        case 1:
          train.start(host);
          break;
        case 2:
          if (train.lives(host)) train.at(host).frozen = true;
          break;
        case 3:
          if (train.lives(host)) train.at(host).frozen = false;
          break;
        case 4:
          train.connected = false;
          break;
        case 5:
          train.connected = true;
          break;
        default:
          if (train.lives(host)) train.at(host).fitness = pick(5);
          break;
      }
      train.run(0.025 * (1 + pick(160)));
    }
    EXPECT_LE(train.longest_both, 2) << "seed " << seed;
    EXPECT_LE(train.longest_none, 90) << "seed " << seed;
  }
}

}  // namespace
}  // namespace railfix::service::charge_test
