#include "system/random_faults.hpp"

#include <iostream>
#include <random>

#include "core/joined.hpp"
#include "core/time.hpp"
#include "system/faults.hpp"

namespace railfix::system_test {
namespace {

constexpr double kTurnS = 0.1;
constexpr double kStaysS = 5;        // of what heals itself
constexpr double kLongestS = 15;     // of one fault: the longer ones leave no time for others
constexpr double kEndOfRideS = 60;   // before which the ride begins anew
constexpr double kWholeAgainS = 60;  // when nothing is broken any more

/// What is broken at the moment.
class Broken {
 public:
  explicit Broken(Rig& rig) : rig_(rig) {}
  void begin(const Fault& fault) {
    for (const auto& one : faults_) {
      if (one.fault.name == fault.name) return;
    }
    std::cerr << "  " << static_cast<int>(rig_.ridden_s()) << " s: " << fault.name << '\n';
    fault.begin(rig_);
    faults_.push_back({fault, now_s() + (fault.lasts_s > 0 ? fault.lasts_s : kStaysS)});
  }
  void turn() {
    std::erase_if(faults_, [&](const One& one) {
      const bool over = one.fault.over ? one.fault.over(rig_) : now_s() > one.until_s;
      if (over && one.fault.end) one.fault.end(rig_);
      return over;
    });
  }
  [[nodiscard]] bool any() const { return !faults_.empty(); }

 private:
  struct One {
    Fault fault;
    double until_s = 0;
  };
  Rig& rig_;
  std::vector<One> faults_;
};

/// Of one ride.
struct Sum {
  uint64_t states = 0;
  uint64_t located = 0;
  uint64_t outside = 0;
  uint64_t reports_lost = 0;
  int not_whole = 0;  // rides at whose end the train did not become whole again
};

void end_of_ride(Rig& rig, Observer& observer, Sum& sum) {
  if (!observer.wait_whole(kWholeAgainS)) ++sum.not_whole;
  const auto heard = observer.end();
  sum.states += heard.states;
  sum.located += heard.located;
  sum.outside += heard.outside;
  sum.reports_lost += heard.reports_lost + heard.ground_lost;
  if (!heard.not_usual.empty() && !heard.course.empty())
    std::cerr << "  not as usual at the end: " << core::joined(heard.course.back().what) << '\n';
  for (const auto& text : heard.said) {
    if (text.find("wrong since") != std::string::npos) std::cerr << "  " << text << '\n';
  }
  if (heard.outside > 0) std::cerr << "  recordings and logs: " << rig.keep_evidence().string() << '\n';
}

}  // namespace

int random_faults(Rig& rig, std::unique_ptr<Observer>& observer, const RandomFaults& options, double ride_s,
                  const std::function<void()>& depart) {
  auto table = fault_table(rig);
  std::erase_if(table, [](const Fault& fault) {
    // What says itself when it is over lasts less than its limit.
    return fault.lasts_s > (fault.over ? 2 * kEndOfRideS : kLongestS);
  });
  std::mt19937 random(options.seed);
  std::exponential_distribution<double> pause_s(1 / options.every_s);
  Sum sum;
  int count = 0;
  Broken broken(rig);
  observer->begin();
  double next_s = now_s();
  for (const double until_s = now_s() + 60 * options.minutes; now_s() < until_s || broken.any();) {
    const bool ends = now_s() >= until_s || rig.ridden_s() + kEndOfRideS > ride_s;
    if (ends && !broken.any() && now_s() < until_s) {
      end_of_ride(rig, *observer, sum);
      depart();
      observer->begin();
      continue;
    }
    if (!ends && now_s() >= next_s) {
      broken.begin(table[random() % table.size()]);
      ++count;
      next_s = now_s() + pause_s(random);
    }
    observer->run(kTurnS);
    broken.turn();
  }
  end_of_ride(rig, *observer, sum);
  std::printf(
      "%d faults at random (seed %u) in %.0f minutes: %llu of %llu states that say a place are confident and "
      "wrong (%llu states in all), %llu reports lost, %d times not whole again within %.0f s\n",
      count, options.seed, options.minutes, static_cast<unsigned long long>(sum.outside),
      static_cast<unsigned long long>(sum.located), static_cast<unsigned long long>(sum.states),
      static_cast<unsigned long long>(sum.reports_lost), sum.not_whole, kWholeAgainS);
  // A place that both fusions have lost comes back with the next landmarks, which may take longer.
  return sum.outside + sum.reports_lost == 0 ? 0 : 1;
}

}  // namespace railfix::system_test
