// What a whole train does when one thing of it breaks: every fault of the table, one after the other, on one train.
//   railfix-measure-faults              the whole campaign, about 20 minutes; exit code 1 when a target is missed
//   railfix-measure-faults --random 15  faults at random that meet each other
//   railfix-measure-faults --soak 60    sixty minutes without a fault: memory, latency, processor time
#include <CLI/CLI.hpp>
#include <cstdio>
#include <iostream>

#include "core/joined.hpp"
#include "core/time.hpp"
#include "system/faults.hpp"
#include "system/observer.hpp"
#include "system/random_faults.hpp"
#include "system/soak.hpp"

namespace railfix::system_test {
namespace {

namespace fs = std::filesystem;

struct Targets {
  double state_gap_s = 0.35;
  double report_gap_s = 2;  // a report a second, so at most one does not come
  double recovery_s = 2;
};
// On a machine that builds and tests at the same time, times say nothing; truth and recovery do.
constexpr Targets kShort{20, 20, 20};
constexpr double kShortPatienceS = 60;

constexpr double kUsualS = 120;  // from the departure until the place is known
constexpr double kTakenAwayS = 1;
constexpr double kUsualAgainS = 15;
constexpr int64_t kSharedMemoryMb = 1024;

struct Options {
  RigOptions rig;
  fs::path ride;
  double ride_s = 900;
  double rate_hz = 10;
  std::vector<std::string> only;
  int repeat = 1;
  bool short_one = false;
  bool list = false;
  double soak_minutes = 0;
  RandomFaults at_random{.minutes = 0};
};

struct Row {
  std::string name;
  Heard heard;
  double over_s = 0;  // monotonic; when the train could begin to recover
  double recovery_s = 0;
  bool recovered = false;
  bool told = false;
};

std::string missed(const Row& row, const Targets& targets) {
  std::string text;
  const auto add = [&](bool bad, const char* what) {
    if (bad) text += (text.empty() ? "" : ", ") + std::string(what);
  };
  add(row.heard.state_gap_s > targets.state_gap_s, "gap in train_state");
  add(row.heard.report_gap_s > targets.report_gap_s, "gap in reports");
  add(!row.recovered, "not recovered");
  add(row.recovered && row.recovery_s > targets.recovery_s, "recovery");
  add(row.heard.reports_lost + row.heard.ground_lost > 0, "reports lost");
  add(row.heard.outside > 0, "WRONG POSITION");
  add(!row.told, "nobody said so");
  return text;
}

void print_head() {
  std::printf("%-42s %8s %8s %8s %9s %5s %13s %9s  %s\n", "fault", "state s", "report s", "ground s", "whole in s",
              "lost", "outside", "widest m", "missed; what was said first");
}

void print(const Row& row, const Targets& targets) {
  const auto& h = row.heard;
  char whole[32];
  if (row.recovered)
    std::snprintf(whole, sizeof whole, "%.1f", row.recovery_s);
  else
    std::snprintf(whole, sizeof whole, "never");
  const std::string lost = std::to_string(h.reports_lost) + "+" + std::to_string(h.ground_lost);
  const std::string outside = std::to_string(h.outside) + "/" + std::to_string(h.states);
  std::printf("%-42s %8.2f %8.2f %8.2f %9s %5s %13s %9.1f  %s; %s\n", row.name.c_str(), h.state_gap_s, h.report_gap_s,
              h.ground_gap_s, whole, lost.c_str(), outside.c_str(), h.widest_m, missed(row, targets).c_str(),
              h.said.empty() ? "-" : h.said.front().substr(0, 100).c_str());
  std::fflush(stdout);
}

Row measure(const Fault& fault, Rig& rig, Observer& observer, bool short_one) {
  Row row;
  row.name = fault.name;
  observer.begin();
  fault.begin(rig);
  row.over_s = now_s();
  if (fault.lasts_s > 0) {
    for (const double until_s = now_s() + fault.lasts_s; now_s() < until_s && !(fault.over && fault.over(rig));)
      observer.run(std::min(0.2, until_s - now_s()));
    if (fault.end) fault.end(rig);
    row.over_s = now_s();
  }
  observer.run(fault.watch_s);
  if (short_one) (void)observer.wait_whole(kShortPatienceS);
  row.heard = observer.end();
  row.recovered = row.heard.not_usual.empty();
  row.recovery_s = std::max(0.0, row.heard.not_whole_s - row.over_s);
  row.told = fault.named.empty() || std::any_of(row.heard.said.begin(), row.heard.said.end(), [&](const auto& text) {
               return text.find(fault.named) != std::string::npos;
             });
  if (fault.lasts_s == 0 && fault.end) fault.end(rig);
  observer.run(kTakenAwayS);  // so that the next fault does not begin before this one's end is heard
  return row;
}

// What was said, and where the time of the recovery went.
void tell_course(const Row& row) {
  for (const auto& text : row.heard.said) std::cerr << "  " << row.name << ": " << text << '\n';
  for (const auto& step : row.heard.course) {
    char when[32];
    std::snprintf(when, sizeof when, "  %+.2f s ", step.from_s - row.over_s);
    std::cerr << when << (step.what.empty() ? "as usual" : "in the way: " + core::joined(step.what)) << '\n';
  }
}

void depart(Rig& rig, std::unique_ptr<Observer>& observer) {
  observer.reset();
  rig.depart();
  observer = std::make_unique<Observer>(rig, rig.options().ride / "truth");
  if (observer->wait_whole(kUsualS)) {
    rig.forget_start();
    // Notes are for the start that a fusion was configured with.
    for (const auto& service : rig.services()) {
      if (!service.starts_with("fusion@")) continue;
      const pid_t before = rig.pid(service);
      rig.swap(service);
      while (!rig.replaced(service, before)) observer->run(0.2);
    }
    if (observer->wait_whole(kUsualS)) return;
  }
  throw std::runtime_error("the train does not get going: " + core::joined(observer->heard().not_usual) +
                           "; logs are in " + rig.folder().string());
}

int campaign(const Options& options, Rig& rig) {
  std::unique_ptr<Observer> observer;
  depart(rig, observer);
  std::vector<Row> rows;
  const Targets targets = options.short_one ? kShort : Targets{};
  std::vector<Fault> faults;
  for (int i = 0; i < options.repeat; ++i) {
    const auto once = fault_table(rig);
    faults.insert(faults.end(), once.begin(), once.end());
  }
  for (const auto& fault : faults) {
    const bool wanted = std::any_of(options.only.begin(), options.only.end(),
                                    [&](const auto& text) { return fault.name.find(text) != std::string::npos; });
    if (!options.only.empty() ? !wanted : options.short_one && !fault.in_short) continue;
    // The next fault meets a train that is as it should be.
    const bool enough_ride = rig.ridden_s() + fault.lasts_s + fault.watch_s + 40 < options.ride_s;
    if (!enough_ride || !observer->wait_whole(kUsualAgainS)) depart(rig, observer);
    if (rows.empty()) print_head();
    rows.push_back(measure(fault, rig, *observer, options.short_one));
    print(rows.back(), targets);
    tell_course(rows.back());
    if (rows.back().heard.outside > 0) std::cerr << "  recordings and logs: " << rig.keep_evidence().string() << '\n';
  }
  const auto bad =
      std::count_if(rows.begin(), rows.end(), [&](const Row& row) { return !missed(row, targets).empty(); });
  const auto wrong = std::count_if(rows.begin(), rows.end(), [](const Row& row) { return row.heard.outside > 0; });
  std::printf(
      "%zu faults: %td miss a target (train_state <= %.2f s, reports <= %.0f s, whole in %.0f s, 0 lost, somebody "
      "says so), %td with a confident wrong position\n",
      rows.size(), bad, targets.state_gap_s, targets.report_gap_s, targets.recovery_s, wrong);
  return bad == 0 ? 0 : 1;
}

// The ride is drawn once and kept.
fs::path drawn_ride(const Options& options) {
  if (!options.ride.empty()) return fs::absolute(options.ride);
  const auto ride =
      fs::temp_directory_path() / ("railfix-faults-ride-" + std::to_string(static_cast<int>(options.ride_s)) + "s");
  if (fs::exists(ride / "complete")) return ride;
  fs::remove_all(ride);
  std::cout << "draws " << options.ride_s << " s of a line ahead, kept in " << ride.string() << std::endl;
  test::Program draw({"railfix",
                      "simulate",
                      "--line",
                      "long",
                      "--start",
                      "1:100",
                      "--duration-s",
                      std::to_string(options.ride_s),
                      "--size",
                      "640x512",
                      "--rate-hz",
                      std::to_string(options.rate_hz),
                      "--speed-kmh",
                      "40",
                      "--dwell-s",
                      "5",
                      "--format",
                      "jpg",
                      "--jpeg-quality",
                      "85",
                      "--quiet",
                      "--threads",
                      "2",
                      "--out",
                      ride.string()});
  if (draw.wait_for_end() != 0) throw std::runtime_error("the line was not drawn");
  std::ofstream(ride / "complete") << "\n";
  return ride;
}

int run(Options& options) {
  if (!enter_own_mounts(kSharedMemoryMb)) {
    std::cout << "skipped: this needs root, for hosts and a memory of their own\n";
    return options.short_one ? 77 : 2;
  }
  options.rig.ride = drawn_ride(options);
  options.rig.break_pictures = options.soak_minutes <= 0;
  Rig rig(options.rig);
  if (options.list) {
    rig.prepare();
    for (const auto& fault : fault_table(rig)) std::cout << fault.name << '\n';
    return 0;
  }
  if (options.soak_minutes <= 0 && options.at_random.minutes <= 0) return campaign(options, rig);
  std::unique_ptr<Observer> observer;
  depart(rig, observer);
  if (options.at_random.minutes > 0)
    return random_faults(rig, observer, options.at_random, options.ride_s, [&] { depart(rig, observer); });
  return soak(rig, *observer, options.soak_minutes);
}

}  // namespace
}  // namespace railfix::system_test

int main(int argc, char** argv) {
  using namespace railfix;
  if (argc >= 5 && std::string(argv[1]) == "--be-rogue")
    return system_test::be_rogue(argv[2], std::stoll(argv[3]), argv[4], argc > 5 ? argv[5] : "");
  system_test::Options options;
  CLI::App app{"What a whole train does when one thing of it breaks. Needs root (own network, own /dev/shm)."};
  app.add_option("--only", options.only, "Only faults whose name contains this; may be repeated");
  app.add_option("--repeat", options.repeat, "The table so many times")->check(CLI::PositiveNumber);
  app.add_flag("--short", options.short_one,
               "A few faults in a minute, judged for truth and recovery, not for times: for every build");
  app.add_flag("--list", options.list, "Names of all faults");
  app.add_option("--soak", options.soak_minutes, "No fault: memory and latency over so many minutes");
  app.add_option("--random", options.at_random.minutes,
                 "Faults at random for so many minutes, of which several meet; judged for truth and recovery");
  app.add_option("--every-s", options.at_random.every_s, "One of them so often, on average")->capture_default_str();
  app.add_option("--seed", options.at_random.seed, "Of what is random")->capture_default_str();
  app.add_option("--ride", options.ride, "A drawn ride to play (from railfix simulate, with map and truth)");
  app.add_option("--ride-s", options.ride_s, "Length of the ride")->capture_default_str();
  app.add_option("--rate-hz", options.rate_hz, "Pictures a second of a ride that is drawn")->capture_default_str();
  app.add_option("--picture-every", options.rig.picture_every, "Record every n-th picture")->capture_default_str();
  app.add_flag("!--no-security", options.rig.security, "Without DDS Security");
  app.add_flag("!--no-standby", options.rig.standby, "Without a standby fusion and tpr_publisher");
  CLI11_PARSE(app, argc, argv);
  try {
    return system_test::run(options);
  } catch (const std::exception& error) {
    std::cerr << "railfix-measure-faults: " << error.what() << '\n';
    return 2;
  }
}
