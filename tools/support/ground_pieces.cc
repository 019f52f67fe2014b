#include "tools/support/ground_pieces.h"

#include <algorithm>
#include <limits>
#include <utility>

#include "libgtd/grasp/finger_closing.h"
#include "libmap/mesh/mesh_io.h"

namespace graspmap_tools {

namespace {

constexpr std::size_t kept_pieces = 3;
// More than offset, tilt and blur of a pose move a gripper, whose size counts twice.
constexpr double extra_margin_m = 0.2;

}  // namespace

GroundPieces::Kept::Kept(std::size_t of, libmap::TriangleMesh around, const GroundPieces& pieces)
    : Piece{.mesh = std::move(around),
            .ground = pieces.make_ground_(mesh),
            .from_above = {mesh, pieces.gripper_, {.start_height_m = pieces.start_height_m_}}},
      number(of) {}

GroundPieces::GroundPieces(const std::string& mesh, const libgtd::Gripper& gripper,
                           double start_height_m, MakeGround make_ground)
    : gripper_(gripper),
      start_height_m_(start_height_m),
      make_ground_(std::move(make_ground)),
      files_(libmap::mesh_pieces(mesh)) {
  const libgtd::FingerGeometry finger = libgtd::finger_geometry(gripper);
  margin_m_ = 2.0 * finger.tip(finger.opening_rad, finger.curl_rad).x() + extra_margin_m;
  if (files_.size() > 1) index_.emplace(files_);
}

std::size_t GroundPieces::piece_at(const Eigen::Vector3d& place) const {
  if (!index_) return 0;
  const Eigen::Vector2d point = place.head<2>();
  std::size_t best = 0;
  std::pair least(std::numeric_limits<double>::infinity(), 0.0);
  for (std::size_t n = 0; n < index_->size(); ++n) {
    const Eigen::AlignedBox2d& box = index_->box(n);
    const std::pair distance(box.squaredExteriorDistance(point),
                             (box.center() - point).squaredNorm());
    if (!(distance < least)) continue;
    best = n;
    least = distance;
  }
  return best;
}

const GroundPieces::Piece& GroundPieces::piece(std::size_t number) {
  const auto found = std::find_if(kept_.begin(), kept_.end(),
                                  [&](const Kept& one) { return one.number == number; });
  if (found != kept_.end()) {
    kept_.splice(kept_.begin(), kept_, found);
    return kept_.front();
  }
  if (kept_.size() == kept_pieces) kept_.pop_back();
  kept_.emplace_front(
      number,
      index_ ? index_->with_margin(number, margin_m_).mesh : libmap::read_mesh(files_.front()).mesh,
      *this);
  return kept_.front();
}

}  // namespace graspmap_tools
