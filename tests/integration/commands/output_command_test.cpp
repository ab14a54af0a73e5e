// Commands that read pictures or recordings never write over them.
#include <csignal>

#include "core/whole_file.hpp"
#include "integration/commands/refusal.hpp"
#include "unit/dataset/temporary_folder.hpp"

namespace railfix {
namespace {

class OutputCommand : public testing::TemporaryFolder {
 protected:
  void SetUp() override {
    TemporaryFolder::SetUp();
    write("film.mp4", "a film");
    write("seq/mav0/cam0/data/0001.jpg", "a picture");
  }
  [[nodiscard]] std::string path(const std::string& name) const { return (root_ / name).string(); }
  [[nodiscard]] std::string text_of(const std::string& name) const {
    return core::value_or_throw(core::read_whole(root_ / name));
  }
  static void refuses(std::vector<std::string> arguments, const std::string& words) {
    arguments.insert(arguments.begin(), "railfix");
    expect_refusal(test::run_program(arguments, kPatienceS), words);
  }
};

TEST_F(OutputCommand, CalibrateLeavesWhatItReads) {
  refuses({"calibrate", "mount", "--video", path("film.mp4"), "--out", path("film.mp4")}, "itself, which is read");
  refuses({"calibrate", "mount", "--pictures", path("seq"), "--out", path("camera.yaml"), "--draw",
           path("seq/mav0/cam0/data/0001.jpg")},
          "belongs to");
  refuses({"calibrate", "lens", "--board", "9x7", "--square", "0.03", "--pictures", path("seq/mav0/cam0/data"), "--out",
           path("camera.yaml"), "--draw", path("seq/mav0/cam0/data/0001.jpg")},
          "belongs to");
  EXPECT_EQ(text_of("film.mp4"), "a film");
  EXPECT_EQ(text_of("seq/mav0/cam0/data/0001.jpg"), "a picture");
}

TEST_F(OutputCommand, RunDrawsIntoNoFolderOfPictures) {
  for (const char* pictures : {"seq/mav0/cam0/data", "seq/mav0/cam0/../cam0/data"}) {
    refuses({"run", "--dataset", path("seq"), "--draw", path(pictures), "--out", path("out")},
            "is the folder of the pictures themselves");
  }
  EXPECT_EQ(text_of("seq/mav0/cam0/data/0001.jpg"), "a picture");
  EXPECT_FALSE(std::filesystem::exists(path("out")));
}

TEST_F(OutputCommand, FoldersAreNoFilesAndNotOnesOwn) {
  refuses({"simulate", "--out", path("film.mp4")}, "film.mp4 is a file; name a new folder with --out");
  const auto train = path("train");
  std::filesystem::copy(std::string(RAILFIX_SOURCE_DIR) + "/deploy/trains/am843-017", train,
                        std::filesystem::copy_options::recursive);
  refuses({"train", "render", train, "--out", train + "/"}, "is the train's own folder; name another one");
  refuses({"train", "render", train, "--out", ""}, "--out is missing");
  const auto root = test::run_program({"railfix", "train", "status", "--root", path("film.mp4")}, kPatienceS);
  EXPECT_EQ(root.exit_code, 2);
  EXPECT_THAT(root.err, ::testing::HasSubstr("film.mp4 is a file; give a folder"));
}

TEST(Words, ThatMeanNothingAreNamed) {
  expect_refusal(test::run_program({"railfix", "tpr", "onboard", "packet_58=zz"}, kPatienceS),
                 "packet_58=zz: Character 1 ('z') is not a hexadecimal digit");
  expect_refusal(test::run_program({"railfix", "tell", "", "stop"}, kPatienceS), "a service and a command have names");
  expect_refusal(
      test::run_program({"railfix", "tpr", "listen", "--broker", "localhost", "--ca", "/none.pem"}, kPatienceS),
      "TLS of the ground link: cannot read /none.pem (No such file or directory)");
}

TEST(StandardOutput, IsMissedWhereItIsFullAndNotWhereNobodyReadsOn) {
  const auto shell = [](const std::string& command) {
    return test::run_program({"/bin/bash", "-c", std::string(RAILFIX_BIN_DIR) + "/railfix " + command}, kPatienceS);
  };
  for (const char* command : {"--version", "map --help", "tpr encode --help"}) {
    const auto full = shell(std::string(command) + " > /dev/full");
    EXPECT_EQ(full.exit_code, 1) << command;
    EXPECT_EQ(full.err, "railfix: cannot write to standard output (No space left on device); make space there\n");
    const auto ignored = shell(std::string(command) + " | true; exit ${PIPESTATUS[0]}");
    EXPECT_THAT(ignored.exit_code, ::testing::AnyOf(0, 128 + SIGPIPE));
    EXPECT_EQ(ignored.err, "");
  }
}

}  // namespace
}  // namespace railfix
