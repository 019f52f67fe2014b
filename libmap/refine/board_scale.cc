#include "libmap/refine/board_scale.h"

#include <Eigen/Cholesky>
#include <Eigen/LU>
#include <algorithm>
#include <cmath>
#include <optional>
#include <set>
#include <utility>

#include "libmap/camera/stereo_depth.h"
#include "libmap/core/error.h"
#include "libmap/core/median.h"
#include "libmap/core/parallel.h"
#include "libmap/core/text.h"
#include "libmap/features/bundle_residuals.h"
#include "libmap/geometry/least_squares.h"
#include "libmap/geometry/rigid_motion.h"
#include "libmap/scan/image_export.h"

namespace libmap {

namespace {

constexpr double max_square_m = 1.0;   // a larger number is in millimeters
constexpr double min_noise_px = 0.01;  // minimum standard deviation of a corner
constexpr int max_iterations = 50;
constexpr double settled_step = 1e-10;
constexpr double max_deviation = 0.03;  // of the scale; above the error of any depth camera
// Maximum chi-square of a view against the board, relative to the median of the views.
constexpr double max_disagreement = 9.0;
constexpr std::size_t max_pairs = 200;
constexpr double freedom_of_pose = 6.0;
constexpr double freedom_of_board = 7.0;

using Corners = std::vector<Eigen::Vector3d>;  // in the board's frame, m

struct BoardObservation {
  Pose map_from_base = Pose::Identity();
  Pose base_from_camera = Pose::Identity();
  Pose camera_from_board = Pose::Identity();  // from this image only, m
  Matrix6d covariance = Matrix6d::Zero();
  Eigen::Vector2d focal_px = Eigen::Vector2d::Zero();
  std::vector<Eigen::Vector2d> rays{};  // x/z, y/z of the corners

  Eigen::Vector3d in_camera(const Eigen::Vector3d& in_map) const {
    return base_from_camera.inverse() * (map_from_base.inverse() * in_map);
  }
};

struct PlacedBoard {
  Pose map_from_board = Pose::Identity();
  double size = 1.0;  // lengths in the map divided by true lengths
};

[[noreturn]] void refuse_board(const Chessboard& board, const std::string& reason) {
  throw Error(reason, {.field = "board",
                       .value = std::to_string(board.columns) + "x" + std::to_string(board.rows) +
                                ":" + to_text(1e-3 * board.square_mm)});
}

// Returns nullopt if the frame has no pose or a corner has no ray.
std::optional<BoardObservation> sight_of(const BoardView& view,
                                         const std::vector<FrameFeatures>& frames,
                                         const SensorCalibration& calibration,
                                         const std::map<int, Pose>& map_from_base,
                                         const std::map<int, Matrix6d>& covariance,
                                         const Chessboard& board) {
  const auto found = std::find_if(frames.begin(), frames.end(), [&](const FrameFeatures& frame) {
    return frame.node == view.node;
  });
  const auto pose = map_from_base.find(view.node);
  if (found == frames.end() || pose == map_from_base.end()) return std::nullopt;
  // Corners are calibrated like features, with the motion of the camera between rows.
  FrameFeatures frame;
  frame.node = view.node;
  frame.cameras = found->cameras;
  const Camera& camera = frame.cameras.at(view.camera);
  BoardObservation observation;
  for (const Eigen::Vector2d& corner : view.corners)
    if (const auto ray = pixel_to_ray(camera, corner)) observation.rays.push_back(*ray);
  if (observation.rays.size() != view.corners.size()) return std::nullopt;
  const auto located = locate_chessboard(observation.rays, board);
  if (!located) return std::nullopt;
  observation.camera_from_board = *located;
  const Corners corners = corners_on_board(board);
  for (std::size_t n = 0; n < corners.size(); ++n)
    frame.features.push_back({observation.rays[n].cast<float>(),
                              static_cast<float>((*located * corners[n]).z()), 0.0F, 0.0F,
                              static_cast<std::uint16_t>(view.camera)});
  calibrate(frame, calibration);
  for (std::size_t n = 0; n < corners.size(); ++n)
    observation.rays[n] = frame.features[n].ray.cast<double>();
  observation.map_from_base = pose->second;
  observation.base_from_camera = camera.base_from_camera;
  observation.focal_px = {camera.fx, camera.fy};
  if (const auto known = covariance.find(view.node); known != covariance.end())
    observation.covariance = known->second;
  return observation;
}

// Mean squared distance between found and projected corners, px^2; nullopt if one is behind the
// camera.
std::optional<double> squared_distance(const BoardObservation& observation,
                                       const PlacedBoard& board, const Corners& corners) {
  double sum = 0.0;
  for (std::size_t n = 0; n < corners.size(); ++n) {
    const Eigen::Vector3d point =
        observation.in_camera(board.map_from_board * Eigen::Vector3d(board.size * corners[n]));
    if (!(point.z() > 0.0)) return std::nullopt;
    sum +=
        observation.focal_px.cwiseProduct(point.hnormalized() - observation.rays[n]).squaredNorm();
  }
  return sum / static_cast<double>(corners.size());
}

// The first corner of the board is unknown. Returns the orders of corners by its symmetries.
std::vector<Corners> orders_of(const Chessboard& board) {
  const Corners corners = corners_on_board(board);
  const auto at = [&](int column, int row) {
    return corners[static_cast<std::size_t>(row * board.columns + column)];
  };
  std::vector<Corners> orders(board.columns == board.rows ? 8 : 4);
  for (int row = 0; row < board.rows; ++row)
    for (int column = 0; column < board.columns; ++column)
      for (std::size_t n = 0; n < orders.size(); ++n) {
        const int x = n % 2 == 0 ? column : board.columns - 1 - column;
        const int y = n / 2 % 2 == 0 ? row : board.rows - 1 - row;
        orders[n].push_back(n < 4 ? at(x, y) : at(y, x));
      }
  return orders;
}

using OrderedObservation =
    std::pair<BoardObservation, Corners>;  // with the board's corners in the view's order
struct AgreeingSights {
  PlacedBoard board{};
  std::vector<OrderedObservation> observations{};
};

// Views that agree with the board's pose from the view `first` within half of the board's size.
AgreeingSights sights_that_agree(const std::vector<BoardObservation>& observations,
                                 std::size_t first, const std::vector<Corners>& orders) {
  AgreeingSights agreeing;
  const BoardObservation& reference = observations[first];
  agreeing.board.map_from_board =
      reference.map_from_base * reference.base_from_camera * reference.camera_from_board;
  for (const BoardObservation& observation : observations) {
    const double extent_px =
        observation.focal_px.cwiseProduct(observation.rays.back() - observation.rays.front())
            .norm();
    double least = std::pow(0.5 * extent_px, 2);
    const Corners* best = nullptr;
    for (const Corners& order : orders)
      if (const auto distance = squared_distance(observation, agreeing.board, order);
          distance && *distance < least) {
        least = *distance;
        best = &order;
      }
    if (best != nullptr) agreeing.observations.emplace_back(observation, *best);
  }
  return agreeing;
}

// Sums over residuals r = projected minus found, px. J (7 columns) contains the derivatives by a
// step of the board and the board's size, H (6 columns) the derivatives by a step of the base.
using Sums = Eigen::Matrix<double, 14, 14>;  // [J r H]^T [J r H]
using System = Eigen::Matrix<double, 8, 8>;  // [J r]^T [J r], weighted

Sums sums_of(const BoardObservation& observation, const Corners& corners,
             const PlacedBoard& board) {
  const Eigen::Matrix3d camera_from_base = observation.base_from_camera.linear().transpose();
  const Pose base_from_board = observation.map_from_base.inverse() * board.map_from_board;
  const Eigen::Matrix3d turn = camera_from_base * base_from_board.linear();
  Sums sums = Sums::Zero();
  for (std::size_t n = 0; n < corners.size(); ++n) {
    const Eigen::Vector3d on_board = board.size * corners[n];
    const Eigen::Vector3d in_base = base_from_board * on_board;
    const Eigen::Vector3d point = observation.base_from_camera.inverse() * in_base;
    const Projection projection = project(point, observation.focal_px, observation.rays[n], 0.0);
    const Eigen::Matrix<double, 2, 3> by_point = projection.by_point.topRows<2>();
    Eigen::Matrix<double, 2, 14> row;
    row << by_point * turn, -by_point * turn * cross_matrix(on_board), by_point * turn * on_board,
        projection.residual.head<2>(), -by_point * camera_from_base,
        by_point * camera_from_base * cross_matrix(in_base);
    sums += row.transpose() * row;
  }
  return sums;
}

struct WeighedView {
  System system = System::Zero();
  double disagreement = 0.0;  // chi-square of the view's pose against the board
};

// (v I + H P H^T)^-1 = (I - H P (v I + H^T H P)^-1 H^T) / v (Woodbury). v is the variance of a
// corner, from the residuals with a free pose of the view; P is the covariance of its pose.
WeighedView weigh(const Sums& sums, const Matrix6d& covariance, std::size_t corners) {
  const Matrix6d by_pose = sums.bottomRightCorner<6, 6>();
  const Eigen::Matrix<double, 8, 6> mixed = sums.topRightCorner<8, 6>();
  const Eigen::Matrix<double, 6, 1> side = mixed.row(7).transpose();
  const double alone = std::max(0.0, sums(7, 7) - side.dot(by_pose.ldlt().solve(side)));
  const double variance = std::max(min_noise_px * min_noise_px,
                                   alone / (2.0 * static_cast<double>(corners) - freedom_of_pose));
  const Matrix6d pose_variance =
      covariance * (variance * Matrix6d::Identity() + by_pose * covariance).inverse();
  WeighedView view;
  view.system = (sums.topLeftCorner<8, 8>() - mixed * pose_variance * mixed.transpose()) / variance;
  view.disagreement = view.system(7, 7) - alone / variance;
  return view;
}

struct SystemSum {
  System system = System::Zero();
  std::vector<double> disagreements{};  // WeighedView::disagreement of each view
};

SystemSum weigh(const std::vector<OrderedObservation>& observations, const PlacedBoard& board) {
  SystemSum all;
  for (const auto& [observation, corners] : observations) {
    const WeighedView view =
        weigh(sums_of(observation, corners, board), observation.covariance, corners.size());
    all.system += view.system;
    all.disagreements.push_back(view.disagreement);
  }
  return all;
}

struct BoardPosition {
  PlacedBoard board{};
  double size_variance = 0.0;  // of the logarithm of the size
};

// Gauss-Newton from `start`. Returns nullopt if the views do not determine the board.
std::optional<BoardPosition> fit(const std::vector<OrderedObservation>& observations,
                                 const PlacedBoard& start) {
  BoardPosition found{start};
  const GaussNewtonSummary summary = gauss_newton(max_iterations, [&] {
    const System system = weigh(observations, found.board).system;
    const Eigen::LLT<Eigen::Matrix<double, 7, 7>> normal(system.topLeftCorner<7, 7>());
    const Eigen::Matrix<double, 7, 1> step = normal.solve(-system.topRightCorner<7, 1>());
    if (normal.info() != Eigen::Success || !step.allFinite()) return StepState::failed;
    found.board.map_from_board = moved(found.board.map_from_board, step.head<6>());
    found.board.size *= std::exp(std::clamp(step[6], -0.5, 0.5));
    const Eigen::Matrix<double, 7, 1> unit = Eigen::Matrix<double, 7, 1>::Unit(6);
    found.size_variance = normal.solve(unit)[6];
    return step.norm() < settled_step ? StepState::converged : StepState::moving;
  });
  if (summary.state == StepState::failed) return std::nullopt;
  return found;
}

double largest_usual(const std::vector<double>& disagreements) {
  return max_disagreement * std::max(freedom_of_pose, median(disagreements));
}

// Drops views that contradict the pair of views with the least median of squares (Rousseeuw 1984).
void leave_out_contradicting(AgreeingSights& views) {
  const std::size_t count = views.observations.size();
  const std::size_t pairs = count * (count - 1) / 2;
  const std::size_t stride = pairs / max_pairs + 1;
  std::vector<double> best;
  std::size_t next = 0;
  for (std::size_t a = 0; a < count; ++a)
    for (std::size_t b = a + 1; b < count; ++b) {
      if (next++ % stride != 0) continue;
      const auto found = fit({views.observations[a], views.observations[b]}, views.board);
      if (!found) continue;
      std::vector<double> disagreements = weigh(views.observations, found->board).disagreements;
      if (!best.empty() && median(best) <= median(disagreements)) continue;
      best = std::move(disagreements);
      views.board = found->board;
    }
  if (best.empty()) return;
  const double limit = largest_usual(best);
  std::vector<OrderedObservation> kept;
  for (std::size_t n = 0; n < count; ++n)
    if (best[n] <= limit) kept.push_back(std::move(views.observations[n]));
  views.observations = std::move(kept);
}

}  // namespace

Chessboard parse_known_board(const std::string& text) {
  const std::size_t colon = text.find(':');
  const auto square_m =
      colon == std::string::npos ? std::nullopt : parse_double(text.substr(colon + 1));
  if (!square_m || !(*square_m > 0.0 && *square_m <= max_square_m))
    throw Error("not a board of known size",
                {.field = "board",
                 .value = text,
                 .bound = "COLUMNSxROWS:METERS with METERS > 0 and <= 1, e.g. 8x6:0.03"});
  Chessboard board = parse_chessboard(text.substr(0, colon), "board");
  board.square_mm = 1e3 * *square_m;
  return board;
}

std::vector<BoardView> find_boards(const ScanSource& scan, const std::vector<FrameFeatures>& frames,
                                   const Chessboard& board, Progress& progress) {
  std::vector<std::vector<BoardView>> found(frames.size());
  progress.begin("board", frames.size());
  parallel_each(frames.size(), [&](std::size_t n) {
    progress.advance(1);
    std::vector<CameraView> images;
    try {
      images = read_views(scan, frames[n].node, {.color = true, .depth = false});
    } catch (const Error&) {
      return;  // a frame without images
    }
    for (std::size_t camera = 0; camera < images.size(); ++camera)
      if (auto corners = find_chessboard(luminance(images[camera].color), board))
        found[n].push_back({frames[n].node, camera, std::move(*corners)});
  });
  progress.end();
  std::vector<BoardView> views;
  std::set<int> nodes;
  for (const std::vector<BoardView>& of_frame : found)
    for (const BoardView& view : of_frame) {
      views.push_back(view);
      nodes.insert(view.node);
    }
  if (nodes.size() < 2)
    refuse_board(board, "images of only " + std::to_string(nodes.size()) +
                            " of the required 2 nodes show the whole board; COLUMNSxROWS counts "
                            "inner corners, one fewer than squares in each direction");
  return views;
}

ScaleEstimate scale_by_board(const std::vector<FrameFeatures>& frames,
                             const SensorCalibration& calibration,
                             const std::map<int, Pose>& map_from_base,
                             const std::map<int, Matrix6d>& covariance,
                             const std::vector<BoardView>& views, const Chessboard& board) {
  std::vector<BoardObservation> observations;
  for (const BoardView& view : views)
    if (auto observation = sight_of(view, frames, calibration, map_from_base, covariance, board))
      observations.push_back(std::move(*observation));
  const std::vector<Corners> orders = orders_of(board);
  AgreeingSights best;
  for (std::size_t n = 0;
       n < observations.size() && 2 * best.observations.size() < observations.size(); ++n) {
    AgreeingSights agreeing = sights_that_agree(observations, n, orders);
    if (agreeing.observations.size() > best.observations.size()) best = std::move(agreeing);
  }
  leave_out_contradicting(best);
  std::optional<BoardPosition> found;
  std::vector<double> disagreements;
  while (best.observations.size() >= 2 && (found = fit(best.observations, best.board))) {
    disagreements = weigh(best.observations, found->board).disagreements;
    const auto worst = std::max_element(disagreements.begin(), disagreements.end());
    if (*worst <= largest_usual(disagreements)) break;
    best.observations.erase(best.observations.begin() + (worst - disagreements.begin()));
    found.reset();
  }
  if (!found)
    refuse_board(board, "no two images agree on the board's pose; the board must not move");
  ScaleEstimate scale;
  scale.factor = 1.0 / found->board.size;
  scale.lengths = best.observations.size();
  for (const double disagreement : disagreements) scale.chi_square += disagreement;
  scale.chi_square /=
      freedom_of_pose * static_cast<double>(best.observations.size()) - freedom_of_board;
  const double relative_deviation =
      std::sqrt(found->size_variance * std::max(1.0, scale.chi_square));
  scale.deviation = scale.factor * relative_deviation;
  if (!(relative_deviation <= max_deviation))
    refuse_board(board, "the standard deviation of the scale by the board is " +
                            to_fixed_text(100.0 * relative_deviation, 1) +
                            " %, more than the permitted " + to_text(100.0 * max_deviation) +
                            " %; record the board from locations that are farther apart");
  return scale;
}

}  // namespace libmap
