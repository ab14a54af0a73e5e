#include "output_file.hpp"

#include <gmock/gmock.h>

#include "core/result.hpp"
#include "unit/dataset/temporary_folder.hpp"

namespace railfix::tool {
namespace {

using ::testing::HasSubstr;
namespace fs = std::filesystem;

class OutputFile : public railfix::testing::TemporaryFolder {
 protected:
  static std::string refusal(const fs::path& out, const std::vector<fs::path>& inputs) {
    try {
      check_output("--out", out, inputs);
    } catch (const core::BadInput& bad) {
      return bad.what();
    }
    return "";
  }
};

TEST_F(OutputFile, IsNoInputHoweverItsPathIsSpelled) {
  const auto survey = write("in.landxml", "survey");
  fs::create_symlink("in.landxml", root_ / "link");
  fs::create_hard_link(survey, root_ / "hard");
  for (const auto& out : {survey, root_ / "." / "in.landxml", root_ / "link", root_ / "hard"}) {
    EXPECT_THAT(refusal(out, {root_ / "none", survey}), HasSubstr("in.landxml itself, which is read; give another"));
  }
  const auto old = write("old.map", "of yesterday");
  for (const auto& out : {old, root_ / "new.map", fs::path("new.map"), fs::path()})
    EXPECT_EQ(refusal(out, {survey}), "");
}

TEST_F(OutputFile, IsNoTableOfARunAndNoPictureOfADataset) {
  for (const char* name : {"run/train_state.csv", "run/log/a.csv", "run/picture.png"}) {
    EXPECT_THAT(refusal(write(name, "data"), {root_ / "run"}), HasSubstr("run, which is read; give another name"));
    EXPECT_EQ(refusal(root_ / name, {root_ / "runner"}), "");
  }
  EXPECT_EQ(refusal(write("run/report.html", "of the last time"), {root_ / "run"}), "");
  EXPECT_EQ(refusal(write("running/table.csv", ""), {root_ / "run"}), "");
  EXPECT_EQ(refusal(root_ / "run/new.csv", {root_ / "run"}), "");
}

TEST_F(OutputFile, HasAFolderAndIsNone) {
  EXPECT_THAT(refusal(root_ / "no/such/out.json", {}), HasSubstr("/no/such; make it first"));
  EXPECT_THAT(refusal(root_, {}), HasSubstr("is a folder"));
}

TEST_F(OutputFile, OfAnotherKindHasAnotherName) {
  fs::create_symlink(write("there", ""), root_ / "link");
  for (const auto& [a, b] : {std::pair(root_ / "new", root_ / "./new"),
                             {root_ / "there", root_ / "link"},
                             {fs::path("none.gpx"), fs::path("./none.gpx")}}) {
    try {
      check_different({{"--json", a}, {"--csv", ""}, {"--report", b}});
      ADD_FAILURE() << a;
    } catch (const core::BadInput& bad) {
      EXPECT_EQ(bad.what(), "--json and --report are both " + b.string() + "; give each a file of its own");
    }
  }
  check_different({{"--json", root_ / "new"}, {"--report", root_ / "other"}, {"--csv", ""}, {"--mp4", ""}});
}

}  // namespace
}  // namespace railfix::tool
