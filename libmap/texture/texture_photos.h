// Provides camera, pose, sharpness and pixels of a scan's photographs. Private to libmap/texture.
#pragma once

#include <Eigen/Core>
#include <cstddef>
#include <list>
#include <memory>
#include <mutex>
#include <utility>
#include <vector>

#include "libmap/core/camera.h"
#include "libmap/core/error.h"
#include "libmap/core/image.h"
#include "libmap/core/pose_graph.h"
#include "libmap/core/progress.h"
#include "libmap/scan/scan_source.h"

namespace libmap {

// Projects world points into a photograph.
class PhotoProjector {
 public:
  // Projects into a photograph taken by `camera` at `world_from_camera`.
  PhotoProjector(const Camera& camera, const Pose& world_from_camera);

  const Camera& camera() const { return camera_; }
  const Eigen::Vector3d& position() const { return position_; }  // of the camera, world frame
  // Rotates a direction from the camera frame to the world frame.
  Eigen::Vector3d to_world(const Eigen::Vector3d& direction_in_camera) const {
    return camera_from_world_.transpose() * direction_in_camera;
  }

  // Returns column, row and z (m). z is 0 if the point is behind the camera or beyond the valid
  // range of the lens model. The pixel may be outside the image.
  Eigen::Vector3d project(const Eigen::Vector3d& point_in_world) const;

  // Returns an upper bound, in pixels, of the projected length of any segment of `length_m` in the
  // ball (center, radius_m): 0 only if the ball is outside the image, infinite if the camera is
  // in the ball or the field of view is unknown. Assumes that distortion at most doubles lengths.
  double max_pixels(const Eigen::Vector3d& center, double radius_m, double length_m) const;

 private:
  Camera camera_;
  Eigen::Matrix3d camera_from_world_;
  Eigen::Vector3d position_;
  bool distorted_ = false;
  double max_ray_ = 0.0;  // maximum radius of (x/z, y/z) in the image; infinite if unknown
};

// One camera of one frame.
struct TexturePhoto {
  int node = 0;
  std::size_t camera = 0;  // index among the frame's cameras
  PhotoProjector projector;
  double sharpness = 1.0;  // relative to the median of all photographs
};

// Minimum depth in each square cell of a photograph, to find triangles seen close to an occluder.
class OccluderCells {
 public:
  // Side of a cell in pixels; 0 disables the search.
  explicit OccluderCells(int side_px) : side_px_(side_px) {}

  // Clears all cells and begins a new photograph.
  void begin(const PhotoProjector& projector);
  // Adds a surface point by pixel and z (m) in the camera's frame. Ignored if z is not positive or
  // the pixel is outside the photograph.
  void add(float x, float y, float z);
  // Returns true if normal . (q - camera) > height_m + gap_m for the nearest point q of the pixel's
  // cell, or of one of its eight neighbors; q is assumed on the ray through the cell's center. The
  // plane normal . (q - camera) = height_m is that of a surface, with a normal in world axes
  // towards the camera. The pixel must be inside the photograph.
  bool has_any_above(float x, float y, const Eigen::Vector3d& normal, double height_m,
                     double gap_m) const;

 private:
  int cell_of(float x) const { return static_cast<int>((x + 0.5F) / static_cast<float>(side_px_)); }
  std::size_t index(int column, int row) const {
    return static_cast<std::size_t>(row) * static_cast<std::size_t>(columns_) +
           static_cast<std::size_t>(column);
  }

  int side_px_;
  float width_px_ = 0.0F;
  float height_px_ = 0.0F;
  int columns_ = 0;
  int rows_ = 0;
  std::vector<float> z_;               // minimum per cell
  std::vector<Eigen::Vector3d> rays_;  // through cell centers, z = 1, world axes; zero: no ray
};

// Color (0 to 255) at pixel (x, y), clamped to the image: bicubic (Keys 1981, a = -1/2).
Eigen::Vector3f sample_bicubic(const ColorImage& image, double x, double y);

class TexturePhotos {
 public:
  // Reads each frame of `world_from_base` once, by ascending node. Skips and lists frames that have
  // no color image, no calibration or a pose that is not finite, or that cannot be decoded; with
  // `strict`, throws Error for such frames. Throws Error if no photograph is left. At most
  // `max_kept_bytes` of decoded images are cached. `scan` must outlive this object.
  TexturePhotos(const ScanSource& scan, const Trajectory& world_from_base, bool strict,
                Progress& progress, std::size_t max_kept_bytes);

  std::size_t size() const { return photos_.size(); }
  const TexturePhoto& operator[](std::size_t photo) const { return photos_[photo]; }
  const std::vector<std::pair<int, Error>>& skipped() const { return skipped_; }

  // Returns the pixels, decoded again unless cached. May be called from several threads.
  std::shared_ptr<const ColorImage> image(std::size_t photo) const;
  // Clears the cache.
  void evict_images() const;

 private:
  struct Frame;
  Frame read_frame(const TrajectoryPose& pose) const;
  void keep(std::size_t photo, std::shared_ptr<const ColorImage> image) const;

  const ScanSource& scan_;
  std::size_t max_kept_bytes_ = 0;
  std::vector<TexturePhoto> photos_;
  std::vector<std::pair<int, Error>> skipped_;

  mutable std::mutex mutex_;
  mutable std::vector<std::shared_ptr<const ColorImage>> images_;
  mutable std::list<std::size_t> order_;  // cached images, oldest first
  mutable std::size_t kept_bytes_ = 0;
};

}  // namespace libmap
