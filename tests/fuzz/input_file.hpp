// The input as a file, for parsers that take paths.
#pragma once

#include <unistd.h>

#include <filesystem>
#include <fstream>
#include <span>
#include <string>

namespace railfix::fuzz {

/// A folder of this process that goes with it.
class InputFolder {
 public:
  InputFolder() { std::filesystem::create_directories(folder_); }
  ~InputFolder() { std::filesystem::remove_all(folder_); }
  InputFolder(const InputFolder&) = delete;
  InputFolder& operator=(const InputFolder&) = delete;

  [[nodiscard]] std::filesystem::path at(const std::string& name) const { return folder_ / name; }
  std::filesystem::path write(const std::string& name, std::span<const uint8_t> bytes) const {
    const auto file = at(name);
    std::filesystem::create_directories(file.parent_path());
    std::ofstream(file, std::ios::binary)
        .write(reinterpret_cast<const char*>(bytes.data()), static_cast<std::streamsize>(bytes.size()));
    return file;
  }

 private:
  std::filesystem::path folder_ = std::filesystem::temp_directory_path() / ("railfix-fuzz-" + std::to_string(getpid()));
};

}  // namespace railfix::fuzz
