// A file on its way to be one: it is gone again when the command fails before it is whole.
#pragma once

#include <filesystem>

namespace railfix::tool {

class Draft {
 public:
  explicit Draft(std::filesystem::path file) : file_(std::move(file)) {}
  /// Removes it, unless it was kept or moved.
  ~Draft();
  Draft(const Draft&) = delete;
  Draft& operator=(const Draft&) = delete;

  void keep() { kept_ = true; }
  [[nodiscard]] const std::filesystem::path& file() const { return file_; }

 private:
  std::filesystem::path file_;
  bool kept_ = false;
};

}  // namespace railfix::tool
