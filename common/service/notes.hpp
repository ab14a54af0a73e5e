// What a service keeps in the host's memory for the process that comes after it: survives a crash and a swap, not a
// restart of the computer, after which nothing about the train is sure.
#pragma once

#include <filesystem>
#include <string>

#include "service/service.hpp"

namespace railfix::service {

/// One a service, host and train.
std::filesystem::path notes_path(const CommonConfig& common, const std::string& service);

class Notes {
 public:
  /// Reads what the process before has kept.
  explicit Notes(std::filesystem::path path);
  [[nodiscard]] const std::string& kept() const { return kept_; }
  /// Whole or not at all, also when the process is killed meanwhile. What cannot be written is left out.
  void keep(const std::string& notes);

 private:
  std::filesystem::path path_;
  std::string kept_;
};

}  // namespace railfix::service
