// What people and other programs write into files beside the pictures: configuration, calibration, tables of sensors
// and of the truth, reports to compare, scenarios, scales of an earlier trip, a train's manifest, the plan and the
// state of a host. The first byte of the input chooses.
#include <array>
#include <cmath>

#include "compare/report_file.hpp"
#include "dataset/calibration.hpp"
#include "dataset/dataset.hpp"
#include "fusion/odometer_scales.hpp"
#include "fuzz/fuzz_target.hpp"
#include "fuzz/input_file.hpp"
#include "service/config.hpp"
#include "simulator/simulator_config.hpp"
#include "support/every_setting.hpp"
#include "train/plan.hpp"
#include "train/render.hpp"

namespace railfix {

namespace {

template <class T>
bool taken(const core::Result<T>& result) {
  if (!result.ok()) fuzz::require(!result.error().message.empty(), "a refusal says why");
  return result.ok();
}

void configuration(const std::filesystem::path& file) {
  const auto read = service::read_config<test::EverySetting>("odometry", file, {}, {"common"});
  if (!taken(read)) return;
  const auto& config = read.value();
  fuzz::require(config.speed_mps >= 0 && config.speed_mps <= 100 && config.count >= 1 && config.count <= 5 &&
                    config.inner_m >= 0 && config.inner_m <= 2 && (config.mode == "a" || config.mode == "b"),
                "what is taken is in its range");
}

void scenario(const std::filesystem::path& file) {
  const auto read = service::read_config<simulator::SimulatorConfig>("simulator", file, {}, {});
  if (taken(read)) (void)taken(simulator::Scenario::make(read.value().scenario, 1));
}

void calibration(const std::filesystem::path& file, const std::filesystem::path& out) {
  const auto read = dataset::read_calibration(file);
  if (!taken(read)) return;
  fuzz::require(dataset::write_calibration(out, read.value()).ok(), "a calibration that was taken can be written");
  const auto again = dataset::read_calibration(out);
  fuzz::require(again.ok(), "a written calibration is read again");
  fuzz::require(std::abs(again.value().intrinsics.fu_px / read.value().intrinsics.fu_px - 1) < 1e-6,
                "a written calibration is the same");
}

void manifest(const std::filesystem::path& file) {
  const auto read = tool::read_manifest(file);
  if (!taken(read)) return;
  const auto& train = read.value();
  fuzz::require(!train.train_id.empty() && !train.release.empty() && !train.hosts.empty(), "a train has what it needs");
  for (const auto& service : train.services)
    fuzz::require(train.host(service.host) != nullptr, "every service runs on a host of the train");
  for (const auto& host : train.hosts) {
    fuzz::require(!tool::render_config(train, host, "/g").empty(), "a manifest that was taken is made into settings");
    fuzz::require(!tool::render_compose(train, host, "/g").empty(), "and into containers");
  }
}

// Written by ourselves; a broken disk may give back anything.
template <class Read>
void host_file(Read read) {
  try {
    read();
  } catch (const core::BadInput& damaged) {
    fuzz::require(std::string(damaged.what()).find("is damaged") != std::string::npos, "what is damaged is told");
  }
}

void plan(const tool::HostFolder& folder) {
  host_file([&] {
    auto read = folder.plan();
    if (!read) return;
    for (const auto& service : read->services) fuzz::require(!service.command.empty(), "a service has a command");
    // Bytes that are no UTF-8 are replaced the first time.
    for (int times = 0; times < 2; ++times) {
      fuzz::require(folder.write(*read).ok(), "a plan that was taken can be written");
      const auto again = folder.plan();
      fuzz::require(again && (times == 0 || again->services == read->services), "a written plan is the same");
      read = again;
    }
  });
}

void scales(const std::string& text) {
  const auto read = fusion::saved_scales(text);
  if (!taken(read)) return;
  const auto now = fusion::aged(read.value(), 0, {});
  fuzz::require(std::abs(now.camera) < 0.2 && std::abs(now.wheel) < 0.2 && now.camera_sigma > 0 && now.wheel_sigma > 0,
                "scales that are taken are those of odometers");
}

}  // namespace

}  // namespace railfix

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
  using namespace railfix;
  if (size == 0) return 0;
  static const fuzz::InputFolder folder;
  const std::span<const uint8_t> rest{data + 1, size - 1};
  static constexpr std::array kTables{"imu0", "wheel0", "gnss0"};
  static const std::string letters = "skmpr";
  const auto letter = letters.find(static_cast<char>(data[0]));
  const int choice = letter != std::string::npos ? 10 + static_cast<int>(letter) : (data[0] + 2) % 10;  // as digits go
  switch (choice) {
    case 0:
      configuration(folder.write("a.yaml", rest));
      break;
    case 1:
      calibration(folder.write("camera.yaml", rest), folder.at("out.yaml"));
      break;
    case 2:
      (void)taken(dataset::find_calibration(folder.write("kitti/calib.txt", rest).parent_path()));
      break;
    case 3:
    case 4:
    case 5: {
      const std::string table = kTables[choice - 3];
      const auto sequence = folder.at("seq-" + table);
      (void)folder.write("seq-" + table + "/mav0/" + table + "/data.csv", rest);
      (void)taken(dataset::read_sensors(sequence));
      break;
    }
    case 6:
      (void)taken(dataset::read_truth(folder.write("track.csv", rest)));
      break;
    case 7:
      (void)taken(dataset::read_truth_landmarks(folder.write("landmarks.csv", rest)));
      break;
    case 11:
      scales({rest.begin(), rest.end()});
      break;
    case 12:
      manifest(folder.write("train/train.yaml", rest));
      break;
    case 13:
      (void)folder.write("host/var/lib/railfix-train/plan.yaml", rest);
      plan(tool::HostFolder(folder.at("host")));
      break;
    case 14:
      (void)folder.write("host/var/lib/railfix-train/state.yaml", rest);
      host_file([] { (void)tool::HostFolder(folder.at("host")).state(); });
      break;
    case 10:
      scenario(folder.write("scenario.yaml", rest));
      break;
    case 8:
      (void)taken(compare::read_reports(folder.write("reports.csv", rest), etcs::Baseline::b3));
      break;
    default:
      (void)taken(compare::read_reports(folder.write("reports.jsonl", rest), etcs::Baseline::b4));
  }
  return 0;
}
