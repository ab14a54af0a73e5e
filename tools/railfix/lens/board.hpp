// The board that is held in front of the camera: a chessboard, or a ChArUco board, of which a part is enough.
#pragma once

#include <opencv2/aruco/charuco.hpp>
#include <opencv2/core.hpp>
#include <optional>
#include <string>
#include <vector>

#include "core/result.hpp"

namespace railfix::tool {

struct BoardDescription {
  int columns = 0;  // squares, as counted on the board
  int rows = 0;
  double square_m = 0;
  double marker_m = 0;                 // 0 = a chessboard
  std::string dictionary = "5X5_100";  // of the markers, without DICT_
};

/// One picture of the board: corners and where they are on it.
struct BoardView {
  std::string name;
  std::vector<cv::Point2f> pixels;
  std::vector<cv::Point3f> board_m;
};

class BoardFinder {
 public:
  static core::Result<BoardFinder> make(const BoardDescription& board);
  /// REQUIRES: CV_8UC1.
  [[nodiscard]] std::optional<BoardView> find(const std::string& name, const cv::Mat& grey) const;
  /// The board as it is printed, `pixels_per_square` wide squares with a white margin.
  [[nodiscard]] cv::Mat draw(int pixels_per_square) const;

 private:
  explicit BoardFinder(const BoardDescription& board) : board_(board) {}
  [[nodiscard]] std::optional<BoardView> find_chessboard(const cv::Mat& grey) const;
  [[nodiscard]] std::optional<BoardView> find_charuco(const cv::Mat& grey) const;
  BoardDescription board_;
  cv::Ptr<cv::aruco::CharucoBoard> charuco_;  // nullptr for a chessboard
};

}  // namespace railfix::tool
