// The scale of refined poses by a chessboard of known size that lies still in the scene.
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

// COLUMNSxROWS:METERS, inner corners and side of a square, as "8x6:0.03". Throws Error with the
// text as value.
Chessboard parse_known_board(const std::string& text);

// Where one picture shows the board.
struct BoardView {
  int node = 0;
  std::size_t camera = 0;                  // of the node's
  std::vector<Eigen::Vector2d> corners{};  // px, as of find_chessboard
};

// In all pictures of the frames, in their order. Throws Error if fewer than two nodes see all of
// the board: known before the poses are. The same for any number of threads.
std::vector<BoardView> find_boards(const ScanSource& scan, const std::vector<FrameFeatures>& frames,
                                   const Chessboard& board, Progress& progress = no_progress());

// Place and size of the one board that all views see, by generalized least squares of its corners'
// pixels. A view has the noise that its own corners show and the uncertainty of its pose:
// `covariance` of steps of the poses (rigid_motion.h) in units of the map, taken as independent;
// poses that are not in it are certain. Views that contradict the others, of another board or of
// one that was moved, are left out. `frames` are as stored, the calibration is applied to them.
// The result's lengths are the views that are used. Its deviation is the larger for a chi_square
// above 1, which is that of the views' positions and directions. Throws Error where the views do
// not determine the scale, such as those from one place.
ScaleEstimate scale_by_board(const std::vector<FrameFeatures>& frames,
                             const SensorCalibration& calibration,
                             const std::map<int, Pose>& map_from_base,
                             const std::map<int, Matrix6d>& covariance,
                             const std::vector<BoardView>& views, const Chessboard& board);

}  // namespace libmap
