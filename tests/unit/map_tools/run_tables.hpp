// A folder with the tables of a run on the small map.
#pragma once

#include <gtest/gtest.h>
#include <unistd.h>

#include <filesystem>
#include <fstream>
#include <memory>
#include <string>

#include "map/survey.hpp"
#include "unit/track/small_map.hpp"

namespace railfix::tool {

class RunTables : public testing::Test {
 protected:
  RunTables() { std::filesystem::create_directories(folder_); }
  ~RunTables() override { std::filesystem::remove_all(folder_); }
  void write(const std::string& name, const std::string& text) const { std::ofstream(folder_ / name) << text; }
  const std::filesystem::path folder_ =
      std::filesystem::temp_directory_path() / ("railfix_survey_" + std::to_string(::getpid()));
  const std::shared_ptr<const track::Map> map_ = std::make_shared<const track::Map>(track::small_map());
};

}  // namespace railfix::tool
