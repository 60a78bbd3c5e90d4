#pragma once
// OpenCV's ChArUco board, drawn and found by OpenCV itself: by the module aruco up to 4.6 (Debian 12), by objdetect
// since 4.7 (Debian 13).
#include <opencv2/core/version.hpp>
#include <vector>
#if CV_VERSION_MAJOR * 100 + CV_VERSION_MINOR >= 407
#include <opencv2/objdetect/aruco_detector.hpp>
#include <opencv2/objdetect/charuco_detector.hpp>
#else
#include <opencv2/aruco/charuco.hpp>
#endif

#include "drivers/study/calibrate/board.h"

namespace epiline::test {

class OpencvCharuco {
 public:
  struct Found {
    std::size_t tags = 0;
    std::vector<int> ids;  ///< of the corners
    std::vector<cv::Point2f> corners;
  };

#if CV_VERSION_MAJOR * 100 + CV_VERSION_MINOR >= 407
  explicit OpencvCharuco(const CharucoBoard& b)
      : board_({b.columns, b.rows}, static_cast<float>(b.square_m), static_cast<float>(b.tag_m),
               cv::aruco::getPredefinedDictionary(cv::aruco::DICT_APRILTAG_36h11)) {}
  cv::Mat draw(cv::Size size, int rim_px) const {
    cv::Mat drawn;
    board_.generateImage(size, drawn, rim_px, 1);
    return drawn;
  }
  /// Of the corners, by their ids, m, y down.
  std::vector<cv::Point3f> places() const { return board_.getChessboardCorners(); }
  Found find(const cv::Mat& picture) const {
    Found found;
    std::vector<std::vector<cv::Point2f>> tags;
    std::vector<int> tag_ids;
    cv::aruco::CharucoDetector(board_).detectBoard(picture, found.corners, found.ids, tags, tag_ids);
    found.tags = tag_ids.size();
    return found;
  }

 private:
  cv::aruco::CharucoBoard board_;
#else
  explicit OpencvCharuco(const CharucoBoard& b)
      : board_(cv::aruco::CharucoBoard::create(b.columns, b.rows, static_cast<float>(b.square_m),
                                               static_cast<float>(b.tag_m),
                                               cv::aruco::getPredefinedDictionary(cv::aruco::DICT_APRILTAG_36h11))) {}
  cv::Mat draw(cv::Size size, int rim_px) const {
    cv::Mat drawn;
    board_->draw(size, drawn, rim_px, 1);
    return drawn;
  }
  std::vector<cv::Point3f> places() const { return board_->chessboardCorners; }
  Found find(const cv::Mat& picture) const {
    Found found;
    std::vector<std::vector<cv::Point2f>> tags;
    std::vector<int> tag_ids;
    cv::aruco::detectMarkers(picture, board_->dictionary, tags, tag_ids);
    cv::aruco::interpolateCornersCharuco(tags, tag_ids, picture, board_, found.corners, found.ids);
    found.tags = tag_ids.size();
    return found;
  }

 private:
  cv::Ptr<cv::aruco::CharucoBoard> board_;
#endif
};

}  // namespace epiline::test
