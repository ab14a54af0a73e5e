#include <algorithm>
#include <cstdio>
#include <filesystem>
#include <iostream>
#include <nlohmann/json.hpp>

#include "commands.hpp"
#include "core/json_text.hpp"
#include "core/time.hpp"
#include "dataset/dataset.hpp"
#include "frame_grabber/live_camera.hpp"
#include "lens/lens_calibration.hpp"
#include "lens/lens_drawing.hpp"
#include "number_between.hpp"
#include "output_file.hpp"
#include "picture_file.hpp"
#include "progress.hpp"

namespace railfix::tool {
namespace {

constexpr double kLivePauseS = 0.5;    // between two pictures of a live camera, for the board to move
constexpr size_t kLiveEnough = 25;     // pictures of the board
constexpr size_t kLongestSize = 10;    // of a text: more is no number
constexpr size_t kMostPictures = 150;  // of a recording, spread over it

struct LensArguments {
  std::string pictures;
  std::string live;
  std::string size_text;
  std::string out;
  std::string draw;
  BoardDescription board;
  double seconds = 90;
  bool json = false;
};

/// Boards that were seen, and one picture of them to draw.
struct Boards {
  cv::Size size;
  std::vector<BoardView> views;
  cv::Mat picture;  // of views[pictured]
  size_t pictured = 0;
  size_t looked = 0;

  void look(const BoardFinder& finder, const std::string& name, const cv::Mat& grey) {
    if (size.empty()) size = grey.size();
    if (grey.size() != size)
      throw core::BadInput(name + " has another size than the pictures before; give one camera's");
    ++looked;
    auto view = finder.find(name, grey);
    if (!view) return;
    if (picture.empty() || view->pixels.size() > views[pictured].pixels.size()) {
      picture = grey.clone();
      pictured = views.size();
    }
    views.push_back(std::move(*view));
  }
};

void parse_board(const LensArguments& arguments, BoardDescription& board) {
  char more = 0;
  if (arguments.size_text.size() < kLongestSize &&
      std::sscanf(arguments.size_text.c_str(), "%dx%d%c", &board.columns, &board.rows, &more) == 2)
    return;
  throw core::BadInput("--board must be COLUMNSxROWS of squares, as 9x7, not '" + arguments.size_text + "'");
}

Boards from_recording(const LensArguments& arguments, const BoardFinder& finder) {
  const auto source = core::value_or_throw(dataset::open_pictures(arguments.pictures, {}));
  const auto count = source->count();
  const size_t stride = count ? std::max<size_t>(1, (*count + kMostPictures - 1) / kMostPictures) : 5;
  Progress progress("looking for the board", count.value_or(0), arguments.json);
  Boards boards;
  for (size_t i = 0; boards.looked < kMostPictures; ++i) {
    const auto picture = core::value_or_throw(source->next());
    if (!picture) break;
    progress.update(i + 1);
    if (i % stride == 0) boards.look(finder, picture->name, picture->grey);
  }
  progress.finish();
  return boards;
}

Boards from_camera(const LensArguments& arguments, const BoardFinder& finder) {
  const auto camera = core::value_or_throw(frame_grabber::make_live_camera(arguments.live, {}));
  if (!camera) throw core::BadInput("--live must be genicam:ID or capture:DEVICE, not '" + arguments.live + "'");
  std::fprintf(stderr, "%s\n", core::value_or_throw(camera->connect()).c_str());
  Boards boards;
  const int64_t end_ns = core::monotonic_ns() + core::to_ns(arguments.seconds);
  int64_t next_ns = 0;
  while (core::monotonic_ns() < end_ns && boards.views.size() < kLiveEnough) {
    const auto picture = core::value_or_throw(camera->next(std::chrono::milliseconds(100)));
    if (!picture || core::monotonic_ns() < next_ns) continue;
    next_ns = core::monotonic_ns() + core::to_ns(kLivePauseS);
    cv::Mat grey(picture->size, CV_8UC1);
    frame_grabber::to_mono8(*picture, grey.data);
    const size_t before = boards.views.size();
    boards.look(finder, "picture " + std::to_string(boards.looked + 1), grey);
    std::fprintf(stderr, "%s, %zu pictures of it, %.0f %% of the field\n",
                 boards.views.size() > before ? "board seen" : "no board", boards.views.size(),
                 100 * coverage(boards.views, boards.size));
  }
  return boards;
}

/// What an older file at this place knows of the mount stays.
dataset::CameraCalibration merged(const LensArguments& arguments, const LensCalibration& found, bool& mount_kept) {
  dataset::CameraCalibration calibration;
  if (std::filesystem::exists(arguments.out)) {
    calibration = core::value_or_throw(dataset::read_calibration(arguments.out));
  }
  calibration.intrinsics = found.lens;
  calibration.intrinsics_sigma = found.sigma;
  mount_kept = calibration.mount.has_value();
  return calibration;
}

void print(const LensCalibration& found, const Boards& boards) {
  const auto& c = found.lens;
  const auto& s = found.sigma;
  std::printf("board seen in %zu of %zu pictures, %zu used", boards.views.size(), boards.looked, found.views.size());
  if (!found.alike.empty()) std::printf(", %zu left out because they are alike", found.alike.size());
  for (const auto& name : found.outliers) std::printf(", %s left out because it does not agree", name.c_str());
  std::printf("\nfocal length  %9.2f +- %.2f px across, %9.2f +- %.2f px down\n", c.fu_px, s.fu_px, c.fv_px, s.fv_px);
  std::printf("centre        %9.2f +- %.2f px across, %9.2f +- %.2f px down\n", c.cu_px, s.cu_px, c.cv_px, s.cv_px);
  std::printf("distortion    k1 %+.5f +- %.5f, k2 %+.5f +- %.5f, p1 %+.6f +- %.6f, p2 %+.6f +- %.6f\n", c.k1, s.k1,
              c.k2, s.k2, c.p1, s.p1, c.p2, s.p2);
  std::printf("reprojection  %.3f px RMS, boards in %.0f %% of the picture's fields, tilted by up to %.0f degrees\n",
              found.rms_px, 100 * found.coverage, found.tilt_rad * 57.29578);
}

nlohmann::json json_of(const LensCalibration& found, const Boards& boards) {
  const auto numbers = [](const geometry::Intrinsics& c) {
    return nlohmann::json{{"fu_px", c.fu_px}, {"fv_px", c.fv_px}, {"cu_px", c.cu_px}, {"cv_px", c.cv_px},
                          {"k1", c.k1},       {"k2", c.k2},       {"p1", c.p1},       {"p2", c.p2}};
  };
  return {{"lens", numbers(found.lens)}, {"sigma", numbers(found.sigma)}, {"rms_px", found.rms_px},
          {"coverage", found.coverage},  {"tilt_rad", found.tilt_rad},    {"pictures", boards.looked},
          {"seen", boards.views.size()}, {"used", found.views.size()}};
}

int calibrate(LensArguments arguments) {
  if (arguments.pictures.empty() == arguments.live.empty()) {
    throw core::BadInput("give either --pictures DIR (or video) or --live SOURCE");
  }
  parse_board(arguments, arguments.board);
  check_output("--out", arguments.out, {});  // what an older file knows of the mount stays
  check_output("--draw", arguments.draw, {arguments.pictures});
  check_different({{"--out", arguments.out}, {"--draw", arguments.draw}});
  const auto finder = core::value_or_throw(BoardFinder::make(arguments.board));
  const Boards boards = arguments.live.empty() ? from_recording(arguments, finder) : from_camera(arguments, finder);
  const auto found = calibrate_lens(boards.views, boards.size);
  if (!found.ok()) {
    std::cerr << "railfix: " << found.error().message << '\n';
    return 1;
  }
  bool mount_kept = false;
  core::ok_or_throw(dataset::write_calibration(arguments.out, merged(arguments, found.value(), mount_kept)));
  say_beside({arguments.out});
  const std::string drawn = arguments.draw.empty()
                                ? std::filesystem::path(arguments.out).replace_extension(".lens.png").string()
                                : arguments.draw;
  core::ok_or_throw(write_picture(drawn, draw_lens(found.value(), boards.picture, boards.views[boards.pictured])));
  if (arguments.json) {
    std::cout << core::json_text(json_of(found.value(), boards), 2) << '\n';
    return 0;
  }
  print(found.value(), boards);
  std::printf("written to %s; look at %s\n", arguments.out.c_str(), drawn.c_str());
  std::printf(
      mount_kept
          ? "the mount in this file was kept: run railfix calibrate mount again, it was found with another lens\n"
          : "next: railfix calibrate mount --camera %s\n",
      arguments.out.c_str());
  return 0;
}

}  // namespace

void add_calibrate_lens(CLI::App& calibrate_app, Action& chosen) {
  auto* lens = calibrate_app.add_subcommand("lens", "Focal length, centre and distortion from pictures of a board");
  lens->footer(
      "Examples: railfix calibrate lens --pictures boards --board 9x7 --square 0.03 --out camera.yaml\n"
      "          railfix calibrate lens --live genicam:any --board 9x7 --square 0.04 --marker 0.03 --out camera.yaml");
  auto arguments = std::make_shared<LensArguments>();
  lens->add_option("--pictures", arguments->pictures, "Folder of pictures or a video: the board in all places, tilted");
  lens->add_option("--live", arguments->live, "Live camera instead: genicam:ID, capture:DEVICE");
  lens->add_option("--seconds", arguments->seconds, "How long the live camera is watched")
      ->check(number_between(5.0, 3600.0))
      ->capture_default_str();
  lens->add_option("--board", arguments->size_text, "Squares of the board, COLUMNSxROWS")->required();
  lens->add_option("--square", arguments->board.square_m, "Side of a square in metres")
      ->required()
      ->check(number_between(0.001, 10));
  lens->add_option("--marker", arguments->board.marker_m,
                   "Side of a ChArUco marker in metres; without it: a chessboard")
      ->check(number_between(0.001, 10));
  lens->add_option("--dictionary", arguments->board.dictionary, "Of the markers")->capture_default_str();
  lens->add_option("--out", arguments->out, "Calibration file to write; a mount in it is kept")->required();
  lens->add_option("--draw", arguments->draw, "Picture to check by eye; else beside --out");
  lens->add_flag("--json", arguments->json, "Print the result as JSON");
  lens->callback([arguments, &chosen] { chosen = [arguments] { return calibrate(*arguments); }; });
}

}  // namespace railfix::tool
