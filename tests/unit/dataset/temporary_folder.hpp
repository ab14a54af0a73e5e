// A folder that lives as long as one test, with short verbs to fill it.
#pragma once

#include <gtest/gtest.h>
#include <stdlib.h>

#include <filesystem>
#include <fstream>
#include <opencv2/imgcodecs.hpp>
#include <string>

namespace railfix::testing {

class TemporaryFolder : public ::testing::Test {
 protected:
  void SetUp() override {
    std::string pattern = (std::filesystem::temp_directory_path() / "railfix_test_XXXXXX").string();
    ASSERT_NE(mkdtemp(pattern.data()), nullptr);
    root_ = pattern;
  }
  void TearDown() override { std::filesystem::remove_all(root_); }

  std::filesystem::path write(const std::string& name, const std::string& content) const {
    std::filesystem::create_directories((root_ / name).parent_path());
    std::ofstream(root_ / name, std::ios::binary) << content;
    return root_ / name;
  }
  std::filesystem::path write_picture(const std::string& name, int grey, int type = CV_8UC1) const {
    std::filesystem::create_directories((root_ / name).parent_path());
    cv::imwrite((root_ / name).string(), cv::Mat(6, 8, type, cv::Scalar::all(grey)));
    return root_ / name;
  }
  std::filesystem::path root_;
};

}  // namespace railfix::testing
