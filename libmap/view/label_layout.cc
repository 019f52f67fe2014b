#include "libmap/view/label_layout.h"

#include <algorithm>
#include <array>
#include <limits>

namespace libmap {
namespace {

constexpr int rings = 9;
// To the right first, then left, above, below and the corners.
constexpr std::array<std::array<double, 2>, 8> directions{{{1.0, 0.0},
                                                           {-1.0, 0.0},
                                                           {0.0, -1.0},
                                                           {0.0, 1.0},
                                                           {1.0, -1.0},
                                                           {-1.0, -1.0},
                                                           {1.0, 1.0},
                                                           {-1.0, 1.0}}};

double overlap_area(const PixelRect& a, const PixelRect& b) {
  const double width = std::min(a.right(), b.right()) - std::max(a.left, b.left);
  const double height = std::min(a.bottom(), b.bottom()) - std::max(a.top, b.top);
  return width > 0.0 && height > 0.0 ? width * height : 0.0;
}

// The box whose edge or corner toward the point is `gap` pixels away from it.
PixelRect box_beside(const LabelRequest& request, const std::array<double, 2>& direction,
                     double gap) {
  const Eigen::Vector2d toward(direction[0], direction[1]);
  const Eigen::Vector2d half(request.width_px / 2.0, request.height_px / 2.0);
  const Eigen::Vector2d middle =
      request.anchor + toward.cwiseProduct(half + Eigen::Vector2d::Constant(gap));
  return {middle.x() - half.x(), middle.y() - half.y(), request.width_px, request.height_px};
}

// Area of `box` that lies on taken boxes or points, or outside the bounds.
double covered_area(const PixelRect& box, const std::vector<PixelRect>& taken,
                    const PixelRect& bounds) {
  double area = box.width * box.height - overlap_area(box, bounds);
  for (const PixelRect& other : taken) area += overlap_area(box, other);
  return area;
}

}  // namespace

std::vector<PixelRect> place_labels(const std::vector<LabelRequest>& requests,
                                    double point_radius_px, const PixelRect& bounds) {
  std::vector<PixelRect> taken;
  taken.reserve(2 * requests.size());
  for (const LabelRequest& request : requests)
    taken.push_back({request.anchor.x() - point_radius_px, request.anchor.y() - point_radius_px,
                     2.0 * point_radius_px, 2.0 * point_radius_px});
  std::vector<PixelRect> boxes;
  for (const LabelRequest& request : requests) {
    PixelRect best;
    double least = std::numeric_limits<double>::infinity();
    for (int ring = 0; ring < rings && least > 1e-6; ++ring) {
      const double gap = point_radius_px * 1.25 + ring * 0.6 * request.height_px;
      for (const auto& direction : directions) {
        const PixelRect box = box_beside(request, direction, gap);
        const double covered = covered_area(box, taken, bounds);
        if (covered >= least) continue;
        least = covered;
        best = box;
        if (least <= 1e-6) break;
      }
    }
    boxes.push_back(best);
    taken.push_back(best);
  }
  return boxes;
}

}  // namespace libmap
