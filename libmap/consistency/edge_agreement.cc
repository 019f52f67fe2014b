#include "libmap/consistency/edge_agreement.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <array>
#include <cmath>
#include <functional>
#include <limits>
#include <numbers>
#include <opencv2/imgproc.hpp>
#include <optional>
#include <vector>

#include "libmap/camera/rgbd_frame.h"
#include "libmap/core/error.h"
#include "libmap/core/parallel.h"
#include "libmap/core/text.h"
#include "libmap/geometry/rigid_motion.h"

namespace libmap {

namespace {

constexpr std::size_t max_frames = 24;
constexpr std::size_t min_frames = 6;
constexpr int max_width_px = 640;  // larger images are reduced
constexpr float min_jump = 0.06F;  // minimum depth step at an edge, relative to depth
constexpr float max_step = 0.02F;  // maximum step between pixels of a surface, relative to depth
constexpr int max_shadow_px = 12;  // maximum gap without depth beside an edge
constexpr std::size_t max_edges = 1000;  // maximum number of a frame and direction
constexpr std::size_t min_edges = 2000;  // minimum number in all frames
constexpr double rough_blur_px = 3.0;
constexpr double fine_blur_px = 1.0;
// Grid of the first search.
constexpr int coarse_px = 3;
constexpr int coarse_steps = 15;
constexpr int coarse_side = 2 * coarse_steps + 1;
constexpr std::array<double, 7> coarse_factors = {1.0, 0.85, 0.9, 0.95, 1.05, 1.1, 1.18};
// A first search by so many edges ends the check if the displacement is below this share of the
// smallest one that is reported.
constexpr std::size_t quick_edges = 8000;
constexpr double quick_fraction = 0.7;
// Registered scans, simulated and real, are up to 2.3 px (0.25 deg) and 4.1 standard errors off.
constexpr double min_displacement_rad = 0.5 * std::numbers::pi / 180.0;
constexpr double smallest_displacement_px = 3.0;
constexpr double min_significance = 3.0;
constexpr double min_uncertainties = 4.0;
constexpr double max_focal_error = 0.03;

// A pixel of the nearer surface at an edge.
struct DepthEdge {
  Eigen::Vector2d pixel = Eigen::Vector2d::Zero();  // in the color image, as stored
  Eigen::Vector2d ray = Eigen::Vector2d::Zero();    // x/z, y/z
  double inverse_depth = 0.0;
};

// Edges of one frame, and the strength of changes in its color image: [0] along rows, [1] along
// columns. The color image is reduced to the size of depth and then by `reduction`.
struct EdgeFrame {
  std::array<std::vector<DepthEdge>, 2> edges;
  std::array<cv::Mat1f, 2> response;  // 0 to 1
  Eigen::Vector2d focal_px = Eigen::Vector2d::Ones();
  double reduction = 1.0;
};

// Rotations about x, y, z in rad, shifts along x, y in meters, logarithm of the focal factor.
using Alternative = Eigen::Matrix<double, 6, 1>;
const Alternative usual_size = (Alternative() << 0.05, 0.05, 0.05, 0.05, 0.05, 0.1).finished();
constexpr double prior_weight = 0.002;
double prior_of(const Alternative& alternative) {
  return prior_weight * alternative.cwiseQuotient(usual_size).squaredNorm();
}

Pose pose_of(const Alternative& alternative) {
  Pose pose = Pose::Identity();
  pose.linear() = rotation_of(alternative.head<3>()).toRotationMatrix();
  pose.translation().head<2>() = alternative.segment<2>(3);
  return pose;
}

// Position of an edge by the alternative, with the lens distortion at the stored position.
Eigen::Vector2d moved_pixel(const DepthEdge& edge, const EdgeFrame& frame, const Pose& pose,
                            double inverse_focal_factor) {
  const Eigen::Vector3d direction =
      pose.linear() * Eigen::Vector2d(inverse_focal_factor * edge.ray).homogeneous() +
      edge.inverse_depth * pose.translation();
  return edge.pixel + frame.focal_px.cwiseProduct(direction.hnormalized() - edge.ray);
}

// Near 1 for strong edges, near 0 for weak texture and noise.
cv::Mat1f response_of(const cv::Mat1f& gray, bool along_rows) {
  cv::Mat1f gradient;
  cv::Sobel(gray, gradient, CV_32F, along_rows ? 1 : 0, along_rows ? 0 : 1, 3, 0.125);
  gradient = cv::abs(gradient);
  cv::Mat1f mean;
  cv::boxFilter(gradient, mean, CV_32F, {31, 31});
  mean += gradient + 2.0F;
  cv::Mat1f response;
  cv::divide(gradient, mean, response);
  return response;
}

cv::Mat1f gray_of(const ColorImage& color, cv::Size size) {
  cv::Mat1f gray(color.height, color.width);
  for (int y = 0; y < color.height; ++y)
    for (int x = 0; x < color.width; ++x) {
      const Color& rgb = color.at(x, y);
      gray(y, x) = static_cast<float>(rgb[0] + 2 * rgb[1] + rgb[2]) / 4.0F;
    }
  cv::Mat1f reduced;
  cv::resize(gray, reduced, size, 0, 0, cv::INTER_AREA);
  return reduced;
}

// Returns true if a surface ends at the pixel: on one side, beyond pixels without depth, the depth
// is larger by a jump; on the opposite side, the surface continues.
bool is_edge(const DepthImage& depth, int x, int y, int dx, int dy) {
  const auto depth_at = [&](int column, int row) {
    return column < 0 || row < 0 || column >= depth.width || row >= depth.height
               ? 0.0F
               : depth.at(column, row);
  };
  const float near = depth.at(x, y);
  if (!(near > 0.0F) || !(std::abs(depth_at(x - dx, y - dy) - near) < max_step * near))
    return false;
  int gap = 1;
  while (gap < max_shadow_px && !(depth_at(x + gap * dx, y + gap * dy) > 0.0F)) ++gap;
  return depth_at(x + gap * dx, y + gap * dy) > (1.0F + min_jump) * near;
}

std::vector<DepthEdge> edges_of(const CameraView& view, bool along_rows, double reduction) {
  const Camera& camera = view.depth_camera;
  std::vector<DepthEdge> edges;
  for (int y = 0; y < view.depth.height; ++y)
    for (int x = 0; x < view.depth.width; ++x)
      for (const int sign : {-1, 1}) {
        if (!is_edge(view.depth, x, y, along_rows ? sign : 0, along_rows ? 0 : sign)) continue;
        const Eigen::Vector2d pixel(x, y);
        edges.push_back({((pixel.array() + 0.5) / reduction - 0.5).matrix(),
                         {(x - camera.cx) / camera.fx, (y - camera.cy) / camera.fy},
                         1.0 / static_cast<double>(view.depth.at(x, y))});
      }
  const std::size_t step = (edges.size() + max_edges - 1) / max_edges;
  if (step <= 1) return edges;
  std::vector<DepthEdge> kept;
  for (std::size_t n = 0; n < edges.size(); n += step) kept.push_back(edges[n]);
  return kept;
}

std::optional<EdgeFrame> read_edges(const ScanSource& scan, int node) {
  const std::vector<CameraView> views = camera_views(scan.read_frame(node));
  if (views.size() != 1 || views.front().color.empty() || views.front().depth.empty())
    return std::nullopt;
  const CameraView& view = views.front();
  EdgeFrame frame;
  frame.reduction = std::ceil(static_cast<double>(view.depth.width) / max_width_px);
  frame.focal_px = Eigen::Vector2d(view.depth_camera.fx, view.depth_camera.fy) / frame.reduction;
  const cv::Mat1f gray =
      gray_of(view.color, {static_cast<int>(view.depth.width / frame.reduction),
                           static_cast<int>(view.depth.height / frame.reduction)});
  for (const bool along_rows : {true, false}) {
    frame.response[along_rows ? 0 : 1] = response_of(gray, along_rows);
    frame.edges[along_rows ? 0 : 1] = edges_of(view, along_rows, frame.reduction);
  }
  return frame;
}

// Mean response at the edges of some frames.
class EdgeScore {
 public:
  // Uses every `stride`-th edge, and blurred images.
  EdgeScore(std::vector<const EdgeFrame*> frames, double blur_px, std::size_t stride)
      : frames_(std::move(frames)), stride_(stride), blurred_(frames_.size()) {
    parallel_each(frames_.size(), [&](std::size_t f) {
      for (const std::size_t k : {0U, 1U})
        cv::GaussianBlur(frames_[f]->response[k], blurred_[f][k], {0, 0}, blur_px, blur_px);
    });
  }

  // Sum of responses and number of edges of a frame that are inside of the image.
  std::pair<double, double> of_frame(std::size_t f, const Alternative& alternative) const {
    const EdgeFrame& frame = *frames_[f];
    const Pose pose = pose_of(alternative);
    const double inverse_factor = std::exp(-alternative[5]);
    std::pair<double, double> sums{0.0, 0.0};
    for (const std::size_t k : {0U, 1U}) {
      const cv::Mat1f& response = blurred_[f][k];
      for (std::size_t n = 0; n < frame.edges[k].size(); n += stride_) {
        const Eigen::Vector2d pixel = moved_pixel(frame.edges[k][n], frame, pose, inverse_factor);
        const auto x = static_cast<int>(std::lround(pixel.x()));
        const auto y = static_cast<int>(std::lround(pixel.y()));
        if (x < 0 || y < 0 || x >= response.cols || y >= response.rows) continue;
        sums.first += static_cast<double>(response(y, x));
        sums.second += 1.0;
      }
    }
    return sums;
  }

  double mean(const Alternative& alternative) const {
    std::vector<std::pair<double, double>> sums(frames_.size());
    parallel_each(frames_.size(), [&](std::size_t f) { sums[f] = of_frame(f, alternative); });
    double sum = 0.0;
    double count = 0.0;
    for (const auto& [of_frame, edges] : sums) {
      sum += of_frame;
      count += edges;
    }
    return count > 0.0 ? sum / count : 0.0;
  }
  double with_prior(const Alternative& alternative) const {
    return mean(alternative) - prior_of(alternative);
  }

  // Means at shifts of the image from -coarse_steps to coarse_steps in x and y, row by row.
  std::vector<double> shifted_means(double focal_factor) const {
    std::vector<double> sums(coarse_side * coarse_side);
    std::vector<double> counts(sums.size());
    for (std::size_t f = 0; f < frames_.size(); ++f)
      for (const std::size_t k : {0U, 1U})
        for (std::size_t n = 0; n < frames_[f]->edges[k].size(); n += stride_)
          add_shifts(blurred_[f][k],
                     moved_pixel(frames_[f]->edges[k][n], *frames_[f], Pose::Identity(),
                                 1.0 / focal_factor),
                     sums, counts);
    for (std::size_t n = 0; n < sums.size(); ++n) sums[n] /= std::max(1.0, counts[n]);
    return sums;
  }

 private:
  static void add_shifts(const cv::Mat1f& response, const Eigen::Vector2d& pixel,
                         std::vector<double>& sums, std::vector<double>& counts) {
    const auto x = static_cast<int>(std::lround(pixel.x()));
    const auto y = static_cast<int>(std::lround(pixel.y()));
    std::size_t n = 0;
    for (int row = -coarse_steps; row <= coarse_steps; ++row)
      for (int column = -coarse_steps; column <= coarse_steps; ++column, ++n) {
        const int u = x + column * coarse_px;
        const int v = y + row * coarse_px;
        if (u < 0 || v < 0 || u >= response.cols || v >= response.rows) continue;
        sums[n] += static_cast<double>(response(v, u));
        counts[n] += 1.0;
      }
  }

  std::vector<const EdgeFrame*> frames_;
  std::size_t stride_;
  std::vector<std::array<cv::Mat1f, 2>> blurred_;
};

// Steps of an alternative that move edges by about a pixel.
Alternative pixel_steps(const std::vector<const EdgeFrame*>& frames) {
  double inverse_depth = 0.0;
  double radius = 0.0;
  double count = 0.0;
  for (const EdgeFrame* frame : frames)
    for (const auto& edges : frame->edges)
      for (const DepthEdge& edge : edges) {
        inverse_depth += edge.inverse_depth;
        radius += edge.ray.norm();
        count += 1.0;
      }
  const double turn = 1.0 / frames.front()->focal_px.x();
  const double about_axis = turn * count / std::max(radius, 1e-3 * count);
  const double shift = turn * count / inverse_depth;
  return (Alternative() << turn, turn, about_axis, shift, shift, about_axis).finished();
}

// Compass search.
Alternative climb(const EdgeScore& score, Alternative best, const Alternative& pixel,
                  double first_px, double last_px) {
  double highest = score.with_prior(best);
  for (double step = first_px; step >= last_px; step *= 0.5)
    for (bool better = true; better;) {
      better = false;
      for (int k = 0; k < best.size(); ++k)
        for (const double sign : {-1.0, 1.0}) {
          Alternative next = best;
          next[k] += sign * step * pixel[k];
          const double value = score.with_prior(next);
          if (value <= highest) continue;
          highest = value;
          best = next;
          better = true;
        }
    }
  return best;
}

// The best of a grid of shifts of the image and of focal factors, as turns. Responses of `edges`
// are added up image by image.
Alternative coarse_search(const EdgeScore& score, const Alternative& pixel) {
  std::array<std::vector<double>, coarse_factors.size()> means;
  parallel_each(coarse_factors.size(),
                [&](std::size_t k) { means[k] = score.shifted_means(coarse_factors[k]); });
  Alternative best = Alternative::Zero();
  double highest = -1.0;
  for (std::size_t k = 0; k < means.size(); ++k)
    for (std::size_t n = 0; n < means[k].size(); ++n) {
      Alternative next = Alternative::Zero();
      next[0] = -coarse_px * (static_cast<int>(n) / coarse_side - coarse_steps) * pixel[0];
      next[1] = coarse_px * (static_cast<int>(n) % coarse_side - coarse_steps) * pixel[1];
      next[5] = std::log(coarse_factors[k]);
      const double value = means[k][n] - prior_of(next);
      if (value <= highest) continue;
      highest = value;
      best = next;
    }
  return best;
}

// Aligns by every `stride`-th edge.
Alternative roughly_aligned(const std::vector<const EdgeFrame*>& frames, std::size_t stride) {
  const Alternative pixel = pixel_steps(frames);
  const EdgeScore score(frames, rough_blur_px, stride);
  return climb(score, coarse_search(score, pixel), pixel, 4.0, 1.0);
}

Alternative align(const std::vector<const EdgeFrame*>& frames) {
  return climb(EdgeScore(frames, fine_blur_px, 1), roughly_aligned(frames, 2), pixel_steps(frames),
               1.0, 0.25);
}

// RMS distance of the edges by two alternatives, pixels of depth.
double distance_px(const std::vector<const EdgeFrame*>& frames, const Alternative& a,
                   const Alternative& b) {
  double squares = 0.0;
  double count = 0.0;
  for (const EdgeFrame* frame : frames)
    for (const auto& edges : frame->edges)
      for (const DepthEdge& edge : edges) {
        const Eigen::Vector2d off = moved_pixel(edge, *frame, pose_of(a), std::exp(-a[5])) -
                                    moved_pixel(edge, *frame, pose_of(b), std::exp(-b[5]));
        squares += frame->reduction * frame->reduction * off.squaredNorm();
        count += 1.0;
      }
  return count > 0.0 ? std::sqrt(squares / count) : 0.0;
}

std::vector<EdgeFrame> read_frames(const ScanSource& scan) {
  const std::vector<GraphNode>& nodes = scan.graph().nodes;
  const std::size_t count = std::min(max_frames, nodes.size());
  std::vector<std::optional<EdgeFrame>> read(count);
  parallel_each(count, [&](std::size_t n) {
    try {
      read[n] = read_edges(scan, nodes[n * nodes.size() / count].id);
    } catch (const Error& error) {
      if (error.kind() != ErrorKind::bad_input) throw;
    }
  });
  std::vector<EdgeFrame> frames;
  for (std::optional<EdgeFrame>& frame : read)
    if (frame) frames.push_back(std::move(*frame));
  return frames;
}

// Gains of the frames of each half in mean response by the alternative of the other half.
std::vector<double> held_out_gains(const std::array<std::vector<const EdgeFrame*>, 2>& halves,
                                   const std::array<Alternative, 2>& by_half) {
  std::vector<double> gains;
  for (const std::size_t half : {0U, 1U}) {
    const std::vector<const EdgeFrame*>& others = halves[1 - half];
    const EdgeScore score(others, fine_blur_px, 1);
    for (std::size_t f = 0; f < others.size(); ++f) {
      const auto [before, edges_before] = score.of_frame(f, Alternative::Zero());
      const auto [after, edges_after] = score.of_frame(f, by_half[half]);
      if (edges_before > 0.0 && edges_after > 0.0)
        gains.push_back(after / edges_after - before / edges_before);
    }
  }
  return gains;
}

// Mean in standard errors.
double significance_of(const std::vector<double>& gains) {
  const auto count = static_cast<double>(gains.size());
  double mean = 0.0;
  for (const double gain : gains) mean += gain / count;
  double squares = 0.0;
  for (const double gain : gains) squares += (gain - mean) * (gain - mean);
  return squares > 0.0 ? mean * count / std::sqrt(squares) : 0.0;
}

double min_displacement_px(const std::vector<const EdgeFrame*>& frames) {
  return std::max(min_displacement_rad * frames.front()->reduction * frames.front()->focal_px.x(),
                  smallest_displacement_px);
}

}  // namespace

bool EdgeAgreement::is_displaced() const {
  return significance > min_significance && displacement_px > min_displacement_px &&
         displacement_px > min_uncertainties * uncertainty_px;
}

bool EdgeAgreement::is_scaled() const {
  return is_displaced() && std::abs(focal_factor - 1.0) > max_focal_error;
}

std::string EdgeAgreement::sentence() const {
  if (!is_displaced()) return {};
  const double turn_deg =
      rotation_vector_of(color_from_depth.linear()).norm() * 180.0 / std::numbers::pi;
  const std::string found =
      "depth is not registered to color: depth edges are " + to_fixed_text(displacement_px, 0) +
      " +- " + to_fixed_text(uncertainty_px, 0) + " px from image edges, as if the depth camera ";
  if (is_scaled())
    return found + "had " + to_fixed_text(focal_factor, 2) + " times the stored focal length";
  return found + "were displaced by " +
         to_fixed_text(1e3 * color_from_depth.translation().norm(), 0) + " mm and " +
         to_fixed_text(turn_deg, 1) + " deg";
}

EdgeAgreement check_edge_agreement(const ScanSource& scan) {
  const std::vector<EdgeFrame> frames = read_frames(scan);
  EdgeAgreement found;
  found.frames = frames.size();
  std::array<std::vector<const EdgeFrame*>, 2> halves;
  std::vector<const EdgeFrame*> all;
  for (const EdgeFrame& frame : frames) {
    found.edges += frame.edges[0].size() + frame.edges[1].size();
    halves[all.size() % 2].push_back(&frame);
    all.push_back(&frame);
  }
  if (frames.size() < min_frames || found.edges < min_edges) return found;
  found.min_displacement_px = min_displacement_px(all);
  Alternative best = roughly_aligned(all, found.edges / quick_edges + 1);
  if (distance_px(all, best, Alternative::Zero()) > quick_fraction * found.min_displacement_px) {
    const std::array<Alternative, 2> by_half = {align(halves[0]), align(halves[1])};
    found.significance = significance_of(held_out_gains(halves, by_half));
    found.uncertainty_px = distance_px(all, by_half[0], by_half[1]);
    best = align(all);
  }
  const EdgeScore score(all, fine_blur_px, 1);
  found.stored = score.mean(Alternative::Zero());
  found.aligned = score.mean(best);
  found.displacement_px = distance_px(all, best, Alternative::Zero());
  found.color_from_depth = pose_of(best);
  found.focal_factor = std::exp(best[5]);
  return found;
}

}  // namespace libmap
