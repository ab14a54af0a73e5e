// A file on its way to be one: gone again when the command fails or is ended (Ctrl-C, SIGTERM) before it is whole.
#pragma once

#include <filesystem>
#include <memory>
#include <string>

#include "core/result.hpp"

namespace railfix::tool {

class Draft {
 public:
  /// It need not be there yet. REQUIRES: no other one lives.
  explicit Draft(std::filesystem::path file);
  /// What core::draft_beside() makes; there is no moment in which it would stay. REQUIRES: no other thread runs yet.
  static core::Result<std::unique_ptr<Draft>> beside(const std::filesystem::path& file, const std::string& ending);
  /// Removes it, unless it was kept or moved.
  ~Draft();
  Draft(const Draft&) = delete;
  Draft& operator=(const Draft&) = delete;

  void keep();
  [[nodiscard]] const std::filesystem::path& file() const { return file_; }

 private:
  std::filesystem::path file_;
  bool kept_ = false;
};

}  // namespace railfix::tool
