// What `railfix doctor` and the commands of `railfix train` have in common, and those that change what runs on a
// computer.
#pragma once

#include <CLI/CLI.hpp>
#include <filesystem>
#include <string>
#include <vector>

#include "train/check.hpp"
#include "train/keys.hpp"
#include "train/roll_out.hpp"

namespace railfix::tool {

struct TrainOptions {
  std::filesystem::path train;
  std::filesystem::path out;
  std::filesystem::path root = "/";
  std::string host;
  KeysOptions keys;
  HealthGate gate;
  bool json = false;
};

/// Prints what was found; false when one of it is an error.
bool say(const std::vector<Finding>& findings);
/// For an option that names a folder, which need not be there.
CLI::Validator no_file();
TrainCheck checked(const Manifest& manifest, const TrainOptions& options);
/// These throw BadInput: no host of the train, nothing here, another train.
const TrainHost& chosen_host(const Manifest& manifest, const TrainOptions& options);
HostPlan plan_here(const TrainOptions& options);
void refuse_another_train(const TrainOptions& options, const Manifest& manifest);

/// Each gives the exit code of the command.
int say_status(const TrainOptions& options);
int train_up(const TrainOptions& options);
int train_down(const TrainOptions& options);
int train_upgrade(const TrainOptions& options);
int train_rollback(const TrainOptions& options);

}  // namespace railfix::tool
