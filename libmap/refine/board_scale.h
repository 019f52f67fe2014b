// Scale of refined poses from a chessboard of known size that does not move in the scene.
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

// Parses COLUMNSxROWS:METERS, the numbers of inner corners and the side of a square <= 1 m, e.g.
// "8x6:0.03". Throws Error with the text as value.
Chessboard parse_known_board(const std::string& text);

// Corners of the board in one image.
struct BoardView {
  int node = 0;
  std::size_t camera = 0;                  // index of the node's camera
  std::vector<Eigen::Vector2d> corners{};  // px, in the order of find_chessboard
};

// Finds the board in all images of the frames; needs no poses. Returns one entry per image that
// shows the whole board, in the order of the frames; the result does not depend on the number of
// threads. Throws Error if fewer than two nodes see the whole board.
std::vector<BoardView> find_boards(const ScanSource& scan, const std::vector<FrameFeatures>& frames,
                                   const Chessboard& board, Progress& progress = no_progress());

// Estimates the pose and size of the board by generalized least squares of the corners' pixels.
// Each view has the noise of the corners and the uncertainty of the view's pose. `covariance`: 6x6
// per node, of a pose step (rigid_motion.h) in map units and rad; poses without an entry are exact.
// Views of another or a moved board are skipped. `frames` have the stored calibration;
// `calibration` is applied to them. In the result, `lengths` is the number of views used,
// `chi_square` is per degree of freedom, of the views' poses against the board. If `chi_square` is
// above 1, `deviation` is multiplied by sqrt(chi_square). Throws Error if no two images agree on
// the board's pose, or if the views do not determine the scale to 3 %, e.g. if all are from one
// location.
ScaleEstimate scale_by_board(const std::vector<FrameFeatures>& frames,
                             const SensorCalibration& calibration,
                             const std::map<int, Pose>& map_from_base,
                             const std::map<int, Matrix6d>& covariance,
                             const std::vector<BoardView>& views, const Chessboard& board);

}  // namespace libmap
