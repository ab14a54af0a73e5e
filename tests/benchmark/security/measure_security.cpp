// What DDS Security costs: train_state from one participant to another over the loopback, without keys and with them.
#include <sys/resource.h>
#include <unistd.h>

#include <algorithm>
#include <cstdio>
#include <fstream>

#include "core/time.hpp"
#include "messaging/topics.hpp"
#include "train/keys.hpp"

namespace {

namespace fs = std::filesystem;
using namespace railfix;

constexpr int kDomain = 96;
constexpr int kSamples = 1000;
constexpr int64_t kPeriodNs = 10'000'000;

fs::path make_keys(const std::string& train, const fs::path& folder) {
  fs::create_directories(folder);
  std::ofstream(folder / "train.yaml")
      << "train:\n  id: " << train << "\n  domain: " << kDomain
      << "\n  release: '1'\n  security: true\n  hosts: { cab: { address: 127.0.0.1 } }\n"
         "  services: { fusion: cab, monitor: cab }\n";
  core::value_or_throw(tool::make_keys(core::value_or_throw(tool::read_manifest(folder)), {}));
  return folder / "security" / "cab";
}

double used_cpu_ms() {
  rusage usage{};
  getrusage(RUSAGE_SELF, &usage);
  return 1e3 * static_cast<double>(usage.ru_utime.tv_sec + usage.ru_stime.tv_sec) +
         1e-3 * static_cast<double>(usage.ru_utime.tv_usec + usage.ru_stime.tv_usec);
}

void measure(const char* name, const std::string& train, const fs::path& keys) {
  messaging::ParticipantOptions options;
  options.train_id = train;
  options.domain = kDomain;
  options.security_folder = keys.string();
  options.service = "fusion";
  messaging::Participant from(options);
  options.service = "monitor";
  messaging::Participant to(options);
  messaging::Queue queue;
  std::vector<double> way_us;
  messaging::Reader<msg::TrainState> reader(
      to, messaging::topics::train_state, "", queue, [&](const msg::TrainState& state) {
        way_us.push_back(1e-3 * static_cast<double>(core::monotonic_ns() - state.stamp_ns()));
      });
  messaging::Writer<msg::TrainState> writer(from, messaging::topics::train_state);
  const int64_t begun_ns = core::monotonic_ns();
  while (writer.matched_readers() == 0 || reader.matched_writers() == 0)
    queue.run_one(core::monotonic_ns() + kPeriodNs);
  const double matched_ms = 1e-6 * static_cast<double>(core::monotonic_ns() - begun_ns);
  const double cpu_before_ms = used_cpu_ms();
  for (int i = 0; i < kSamples; ++i) {
    msg::TrainState state;
    state.stamp_ns(core::monotonic_ns());
    writer.write(state);
    for (const int64_t next_ns = state.stamp_ns() + kPeriodNs; core::monotonic_ns() < next_ns;) queue.run_one(next_ns);
  }
  const double cpu_us = 1e3 * (used_cpu_ms() - cpu_before_ms) / kSamples;
  std::sort(way_us.begin(), way_us.end());
  std::printf(
      "%-8s found each other in %.0f ms; %zu of %d samples; on the way p50 %.0f us, p99 %.0f us; %.0f us of processor "
      "a sample\n",
      name, matched_ms, way_us.size(), kSamples, way_us[way_us.size() / 2], way_us[way_us.size() * 99 / 100], cpu_us);
}

}  // namespace

int main() {
  const std::string train = "measure-security-" + std::to_string(getpid());
  const auto folder = fs::temp_directory_path() / train;
  const auto keys = make_keys(train, folder);
  measure("without", train, "");
  measure("with", train, keys);
  fs::remove_all(folder);
  return 0;
}
