// The folder of a train with two computers, in which tests change one thing.
#pragma once

#include <gtest/gtest.h>
#include <unistd.h>

#include <filesystem>
#include <fstream>

#include "track/map.hpp"
#include "train/check.hpp"

namespace railfix::tool {

namespace fs = std::filesystem;

inline const FindProgram kNoPrograms = [](const HostedService&) { return std::nullopt; };

inline constexpr const char* kTrain = R"(train:
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
  /// Why the usual train is refused with that instead.
  std::string told(const std::string& replace, const std::string& by) {
    const auto read = manifest(kTrain, replace, by);
    return read.ok() ? "nothing" : read.error().message;
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

}  // namespace railfix::tool
