// The files of the built page, for HTTP.
#pragma once

#include <filesystem>

#include "monitor/http_types.hpp"

namespace railfix::monitor {

class StaticFiles {
 public:
  explicit StaticFiles(std::filesystem::path folder) : folder_(std::move(folder)) {}

  /// "/" is index.html. Nothing outside of the folder is ever read. Without a built page "/" says so.
  [[nodiscard]] Response get(const Request& request) const;

 private:
  std::filesystem::path folder_;
};

}  // namespace railfix::monitor
