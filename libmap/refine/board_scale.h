// Determines the scale of refined poses from a static chessboard of known size in the scene.
#pragma once

#include <Eigen/Core>
#include <cstddef>
#include <map>
#include <string>
#include <vector>

#include "libmap/camera/camera_calibration.h"
#include "libmap/core/progress.h"
#include "libmap/refine/scan_scale.h"
#include "libmap/scan/scan_source.h"

namespace libmap {

// Parses COLUMNSxROWS:METERS, e.g. "8x6:0.03": columns and rows of inner corners (3 to 100), and
// side of a square (> 0, at most 1 m). Throws Error for any other text.
Chessboard parse_known_board(const std::string& text);

// Corners of the board in one image.
struct BoardView {
  int node = 0;
  std::size_t camera = 0;                  // index of the node's camera
  std::vector<Eigen::Vector2d> corners{};  // px, in the order of find_chessboard
};

// Finds the board in all images of the frames; skips unreadable images. Returns one entry per image
// that shows the whole board, in the order of the frames. Throws Error if images of fewer than two
// nodes show the whole board.
std::vector<BoardView> find_boards(const ScanSource& scan, const std::vector<FrameFeatures>& frames,
                                   const Chessboard& board, Progress& progress = no_progress());

// Estimates pose and size of the board in the map by generalized least squares of the corners'
// pixels, with the noise of the corners and of the poses. Inputs: `frames` with the stored
// calibration; `calibration`, which is applied to them; `covariance` by node, for a pose step
// (rigid_motion.h), map units and rad (poses of nodes without an entry are exact). Skips views of
// nodes without a pose, and views that contradict the others (another board, or a moved one). In
// the result, `lengths` is the number of used views, and `chi_square` compares the views with the
// board; if > 1, `deviation` is multiplied by sqrt(chi_square). Throws Error if no two images
// agree on the board's pose, or if the standard deviation of the scale is above 3 %, e.g. because
// all views are from one location.
ScaleEstimate scale_by_board(const std::vector<FrameFeatures>& frames,
                             const SensorCalibration& calibration,
                             const std::map<int, Pose>& map_from_base,
                             const std::map<int, Matrix6d>& covariance,
                             const std::vector<BoardView>& views, const Chessboard& board);

}  // namespace libmap
