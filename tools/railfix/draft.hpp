// A file on its way to be one: gone again when the command fails or is ended (Ctrl-C, SIGTERM) before it is whole.
#pragma once

#include <filesystem>

namespace railfix::tool {

class Draft {
 public:
  /// It need not be there yet. REQUIRES: no other one lives.
  explicit Draft(std::filesystem::path file);
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
