// Cameras for views of a scene (top, oblique, ...), and projection of points into the image.
#pragma once

#include <Eigen/Core>
#include <string>
#include <utility>
#include <vector>

namespace libmap {

// top:     orthographic along -z; x to the right, y up.
// front:   orthographic along +y; x to the right, z up.
// side:    orthographic along -x; y to the right, z up.
// oblique: perspective from the front, left and above.
// camera:  perspective from a given position.
enum class Viewpoint { top, oblique, front, side, camera };
std::vector<std::pair<std::string, Viewpoint>> viewpoint_names();

// A rectangle in pixels; left and top edge are relative to the image's top left corner.
struct PixelRect {
  double left = 0.0;
  double top = 0.0;
  double width = 0.0;
  double height = 0.0;

  double right() const { return left + width; }
  double bottom() const { return top + height; }
  bool contains(const Eigen::Vector2d& pixel) const {
    return pixel.x() >= left && pixel.x() <= right() && pixel.y() >= top && pixel.y() <= bottom();
  }
  bool overlaps(const PixelRect& other) const {
    return left < other.right() && other.left < right() && top < other.bottom() &&
           other.top < bottom();
  }
};

// Pose of Viewpoint::camera in the frame of the points. `up` need not be orthogonal to the view.
struct CameraPlacement {
  Eigen::Vector3d position{-2.0, -4.0, 3.0};  // m
  Eigen::Vector3d focal_point = Eigen::Vector3d::Zero();
  Eigen::Vector3d up = Eigen::Vector3d::UnitZ();
  double field_of_view_deg = 30.0;  // vertical, > 0 and < 180
};

struct SceneCamera {
  Eigen::Vector3d position = Eigen::Vector3d::Zero();  // in the frame of the points, m
  Eigen::Vector3d right = Eigen::Vector3d::UnitX();    // unit vector, like `up` and `forward`
  Eigen::Vector3d up = Eigen::Vector3d::UnitY();
  Eigen::Vector3d forward = -Eigen::Vector3d::UnitZ();
  bool perspective = false;  // false: orthographic
  double scale_px = 1.0;     // orthographic: pixels per meter; perspective: focal length in pixels
  PixelRect plot;            // part of the image that shows the scene, centered on the optical axis

  // Depth along `forward`, m; negative behind the camera.
  double depth_of(const Eigen::Vector3d& point) const { return (point - position).dot(forward); }
  double pixels_per_m(double depth_m) const { return perspective ? scale_px / depth_m : scale_px; }
  // Pixel relative to the image's top left corner. In perspective, the depth must be positive.
  Eigen::Vector2d pixel_of(const Eigen::Vector3d& point) const;
};

// Returns the camera whose `plot` contains all `points` (at least one, all finite) with a radius of
// `radius_m` and a border of a twentieth of the plot on each side. Viewpoint::camera has the pose
// of `placement` instead, and throws Error if its position and focal point coincide, its `up` is
// parallel to the view, or its field of view is out of range.
SceneCamera fit_camera(Viewpoint view, const CameraPlacement& placement,
                       const std::vector<Eigen::Vector3d>& points, double radius_m,
                       const PixelRect& plot);

}  // namespace libmap
