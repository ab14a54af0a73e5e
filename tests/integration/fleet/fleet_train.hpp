// `railfix train` as an operator uses it: real services under a real supervisor, in a folder of their own.
#pragma once

#include <gtest/gtest.h>
#include <poll.h>

#include <nlohmann/json.hpp>

#include "core/time.hpp"
#include "support/program.hpp"

namespace railfix {

namespace fs = std::filesystem;

class FleetTest : public ::testing::Test {
 protected:
  FleetTest() { fs::create_directories(folder_ / "train"); }
  ~FleetTest() override {
    train({"down", "--root", root()});
    for (const auto& notes : in_memory("notes")) fs::remove(notes);  // they are for a restart
    fs::remove_all(folder_);
  }
  [[nodiscard]] std::string root() const { return (folder_ / "root").string(); }
  [[nodiscard]] std::string manifest() const { return (folder_ / "train").string(); }
  void write_manifest(const std::string& release, const std::string& more = "") {
    std::ofstream(folder_ / "train" / "train.yaml")
        << "train:\n  id: " << id_ << "\n  domain: 95\n  release: " << release
        << "\n  run_as: programs\n  hosts: { cab: { address: 127.0.0.1 } }\n"
           "  services: { fusion: cab, tpr_publisher: cab }\n"
           "settings: { common: { log_level: warning }"
        << more << " }\n";
  }
  /// 9.9.9, whose fusion does not live.
  void install_dead_release() const {
    const auto bin = folder_ / "root/opt/railfix/9.9.9/bin";
    fs::create_directories(bin);
    std::ofstream(bin / "railfix-fusion") << "#!/bin/sh\ncase \"$*\" in *--check*) exit 0 ;; esac\nexit 3\n";
    fs::permissions(bin / "railfix-fusion", fs::perms::owner_all);
    fs::create_symlink(fs::path(RAILFIX_BIN_DIR) / "railfix-tpr-publisher", bin / "railfix-tpr-publisher");
  }
  static test::Outcome train(std::vector<std::string> arguments) {
    arguments.insert(arguments.begin(), {"railfix", "train"});
    return test::run_program(arguments, 180);
  }
  test::Outcome up() { return train({"up", manifest(), "--root", root(), "--healthy-for", "1", "--patience", "60"}); }
  test::Outcome upgrade(const std::string& patience_s = "60") {
    return train({"upgrade", manifest(), "--root", root(), "--healthy-for", "1", "--patience", patience_s});
  }
  nlohmann::json status() { return nlohmann::json::parse(train({"status", "--root", root(), "--json"}).out); }
  nlohmann::json status(const std::string& service) {
    const auto all = status();
    for (const auto& one : all["services"]) {
      if (one["service"] == service) return one;
    }
    return {};
  }
  template <class Condition>
  static bool wait_until(Condition condition) {
    const int64_t deadline_ns = core::monotonic_ns() + 60 * core::kNsPerSecond;
    while (!condition()) {
      if (core::monotonic_ns() > deadline_ns) return false;
      poll(nullptr, 0, 100);
    }
    return true;
  }
  /// Of this train, in the host's memory.
  [[nodiscard]] std::vector<fs::path> in_memory(const std::string& what) const {
    std::vector<fs::path> files;
    for (const auto& entry : fs::directory_iterator("/dev/shm")) {
      if (entry.path().filename().string().starts_with("railfix-" + what + "-" + id_)) files.push_back(entry.path());
    }
    return files;
  }
  /// Not when it only waits for whoever reaps orphans here.
  static bool lives(pid_t pid) {
    const auto line = test::slurp("/proc/" + std::to_string(pid) + "/stat");
    const size_t name_end = line.rfind(')');
    return name_end != std::string::npos && name_end + 2 < line.size() && line[name_end + 2] != 'Z';
  }
  const std::string id_ = "fleet-" + std::to_string(getpid());
  const fs::path folder_ = fs::temp_directory_path() / id_;
};

}  // namespace railfix
