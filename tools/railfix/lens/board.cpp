#include "lens/board.hpp"

#include <algorithm>
#include <opencv2/aruco.hpp>
#include <opencv2/calib3d.hpp>
#include <opencv2/imgproc.hpp>

namespace railfix::tool {
namespace {

constexpr size_t kFewestCorners = 8;
constexpr int kMostSquares = 60;

constexpr std::pair<const char*, int> kDictionaries[] = {
    {"4X4_50", cv::aruco::DICT_4X4_50}, {"4X4_100", cv::aruco::DICT_4X4_100}, {"4X4_250", cv::aruco::DICT_4X4_250},
    {"5X5_50", cv::aruco::DICT_5X5_50}, {"5X5_100", cv::aruco::DICT_5X5_100}, {"5X5_250", cv::aruco::DICT_5X5_250},
    {"6X6_50", cv::aruco::DICT_6X6_50}, {"6X6_100", cv::aruco::DICT_6X6_100}, {"6X6_250", cv::aruco::DICT_6X6_250}};

}  // namespace

core::Result<BoardFinder> BoardFinder::make(const BoardDescription& board) {
  if (board.columns < 4 || board.rows < 4) return core::Error{"a board has at least 4x4 squares, as --board 9x7"};
  if (board.columns > kMostSquares || board.rows > kMostSquares)
    return core::Error{"a board of " + std::to_string(board.columns) + "x" + std::to_string(board.rows) +
                       " squares is none that a camera sees: at most " + std::to_string(kMostSquares) + " a side"};
  if (!(board.square_m > 0)) return core::Error{"give the side of a square in metres, as --square 0.03"};
  BoardFinder finder(board);
  if (board.marker_m <= 0) return finder;
  if (board.marker_m >= board.square_m) return core::Error{"a marker is smaller than its square: check --marker"};
  for (const auto& [name, number] : kDictionaries) {
    if (board.dictionary != name) continue;
    const auto dictionary = cv::aruco::getPredefinedDictionary(number);
    const int markers = board.columns * board.rows / 2;  // one in every second square
    if (markers > dictionary->bytesList.rows)
      return core::Error{"--dictionary " + board.dictionary + " has " + std::to_string(dictionary->bytesList.rows) +
                         " markers, and the board has " + std::to_string(markers) + "; 5X5_250 and the like have more"};
    finder.charuco_ = cv::aruco::CharucoBoard::create(board.columns, board.rows, static_cast<float>(board.square_m),
                                                      static_cast<float>(board.marker_m), dictionary);
    return finder;
  }
  return core::Error{"--dictionary " + board.dictionary + " is not known; 5X5_100 and the like are"};
}

std::optional<BoardView> BoardFinder::find(const std::string& name, const cv::Mat& grey) const {
  auto view = charuco_ ? find_charuco(grey) : find_chessboard(grey);
  if (view) view->name = name;
  return view;
}

std::optional<BoardView> BoardFinder::find_chessboard(const cv::Mat& grey) const {
  const cv::Size corners(board_.columns - 1, board_.rows - 1);
  BoardView view;
  const int how = cv::CALIB_CB_NORMALIZE_IMAGE | cv::CALIB_CB_ACCURACY;
  if (!cv::findChessboardCornersSB(grey, corners, view.pixels, how)) return std::nullopt;
  for (int y = 0; y < corners.height; ++y) {
    for (int x = 0; x < corners.width; ++x) {
      view.board_m.emplace_back(static_cast<float>(x * board_.square_m), static_cast<float>(y * board_.square_m), 0.0F);
    }
  }
  return view;
}

std::optional<BoardView> BoardFinder::find_charuco(const cv::Mat& grey) const {
  std::vector<std::vector<cv::Point2f>> markers;
  std::vector<int> marker_ids;
  cv::aruco::detectMarkers(grey, charuco_->dictionary, markers, marker_ids);
  if (marker_ids.empty()) return std::nullopt;
  BoardView view;
  std::vector<int> ids;
  cv::aruco::interpolateCornersCharuco(markers, marker_ids, grey, charuco_, view.pixels, ids);
  if (ids.size() < kFewestCorners) return std::nullopt;
  for (const int id : ids) view.board_m.push_back(charuco_->chessboardCorners[static_cast<size_t>(id)]);
  const auto [low, high] = std::minmax_element(view.board_m.begin(), view.board_m.end(),
                                               [](const auto& a, const auto& b) { return a.y < b.y; });
  if (high->y - low->y < 0.5F * static_cast<float>(board_.square_m)) return std::nullopt;  // one row fixes nothing
  return view;
}

cv::Mat BoardFinder::draw(int pixels_per_square) const {
  const cv::Size inside(board_.columns * pixels_per_square, board_.rows * pixels_per_square);
  cv::Mat board(inside, CV_8UC1);
  if (charuco_) {
    charuco_->draw(inside, board, 0, 1);
  } else {
    for (int y = 0; y < inside.height; ++y) {
      for (int x = 0; x < inside.width; ++x) {
        const bool black = (x / pixels_per_square + y / pixels_per_square) % 2 == 0;
        board.at<uint8_t>(y, x) = black ? 0 : 255;
      }
    }
  }
  cv::Mat framed;
  cv::copyMakeBorder(board, framed, pixels_per_square, pixels_per_square, pixels_per_square, pixels_per_square,
                     cv::BORDER_CONSTANT, cv::Scalar(255));
  return framed;
}

}  // namespace railfix::tool
