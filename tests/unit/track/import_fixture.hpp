// A folder of its own for every test, and the shared data where they are at hand.
#pragma once

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <unistd.h>

#include <algorithm>
#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <string>
#include <vector>

#include "track/map.hpp"

namespace railfix::track {

/// "KIND NAME at OFFSET on EDGE" of every landmark of these kinds, in order of the edges.
inline std::vector<std::string> marks_of(const Map& map, std::initializer_list<LandmarkKind> kinds) {
  std::vector<std::string> out;
  for (const Edge& edge : map.edges) {
    for (const Landmark* mark : map.landmarks_on(edge.id)) {
      if (std::find(kinds.begin(), kinds.end(), mark->kind) == kinds.end()) continue;
      char text[120];
      std::snprintf(text, sizeof text, "%s %s at %.1f on %u", to_string(mark->kind).c_str(), mark->name.c_str(),
                    mark->offset_m, mark->edge);
      out.emplace_back(text);
    }
  }
  return out;
}

class ImportTest : public testing::Test {
 protected:
  ImportTest() {
    const testing::TestInfo& test = *testing::UnitTest::GetInstance()->current_test_info();
    folder_ = std::filesystem::temp_directory_path() /
              ("railfix_import_" + std::to_string(::getpid()) + "_" + test.test_suite_name() + "_" + test.name());
    std::filesystem::create_directories(folder_);
  }
  ~ImportTest() override { std::filesystem::remove_all(folder_); }

  [[nodiscard]] std::filesystem::path in_folder(const std::string& name) const { return folder_ / name; }
  [[nodiscard]] std::filesystem::path write(const std::string& name, const std::string& text) const {
    std::ofstream(folder_ / name, std::ios::binary) << text;
    return folder_ / name;
  }
  static std::string content(const std::filesystem::path& file) {
    std::ifstream in(file, std::ios::binary);
    return {std::istreambuf_iterator<char>(in), {}};
  }

 public:
  static std::filesystem::path shared_data(const std::string& name) {
    const char* told = std::getenv("RAILFIX_DATA");
    const std::filesystem::path root = told != nullptr
                                           ? std::filesystem::path(told)
                                           : std::filesystem::path(RAILFIX_SOURCE_DIR) / ".." / "shared" / "data";
    return root / name;
  }

 private:
  std::filesystem::path folder_;
};

}  // namespace railfix::track
