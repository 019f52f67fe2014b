// The photographs of a scan as a texture's source: where each was taken, how sharp it is, and its
// pixels when they are needed. Private to libmap/texture.
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

// Points of the world in a photograph.
class PhotoProjector {
 public:
  // Of a picture that `camera` took from `world_from_camera`.
  PhotoProjector(const Camera& camera, const Pose& world_from_camera);

  const Camera& camera() const { return camera_; }
  const Eigen::Vector3d& position() const { return position_; }  // of the camera, world frame
  Eigen::Vector3d to_world(const Eigen::Vector3d& direction_in_camera) const {
    return camera_from_world_.transpose() * direction_in_camera;
  }

  // Column and row, and z in meters; z is 0 where the camera cannot see such a direction. The pixel
  // may lie outside the image.
  Eigen::Vector3d project(const Eigen::Vector3d& point_in_world) const;

  // No length of so many meters within the ball takes more pixels in the photograph, if its lens
  // nowhere enlarges more than twice what a pinhole does; 0 only where it shows no part of the
  // ball.
  double max_pixels(const Eigen::Vector3d& center, double radius_m, double length_m) const;

 private:
  Camera camera_;
  Eigen::Matrix3d camera_from_world_;
  Eigen::Vector3d position_;
  bool distorted_ = false;
  double max_ray_ = 0.0;  // no x/z, y/z radius of the image is larger; infinite if not known
};

// One camera of one frame.
struct TexturePhoto {
  int node = 0;
  std::size_t camera = 0;  // of the frame's cameras
  PhotoProjector projector;
  double sharpness = 1.0;  // relative to the median photograph
};

// The nearest depths in small squares of a photograph.
class OccluderCells {
 public:
  // Squares of so many pixels; 0: nothing is ever found.
  explicit OccluderCells(int side_px) : side_px_(side_px) {}

  // Forgets the photograph before.
  void begin(const PhotoProjector& projector);
  // A point of a surface by its pixel and z, m, in the camera's frame; none if z is not positive or
  // the pixel is outside.
  void add(float x, float y, float z);
  // Whether something in the square of the pixel or in the eight around it is more than `gap_m`
  // above the plane: normal . (point - camera) = height_m in the world's axes, the normal toward
  // the camera. The pixel must be inside the photograph.
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
  std::vector<float> z_;               // the least of the points in each square
  std::vector<Eigen::Vector3d> rays_;  // through its middle, z = 1, world's axes; zero: none
};

// As bilinear_color(), but bicubic: Keys 1981, a = -1/2.
Eigen::Vector3f sample_bicubic(const ColorImage& image, double x, double y);

class TexturePhotos {
 public:
  // Reads each frame of `world_from_base` once, by ascending node. Frames without color, with a
  // pose that is not finite or that cannot be decoded are skipped and listed; with `strict` they
  // are an Error. Throws Error if no photograph is left. `scan` must outlive this. So many bytes of
  // images are kept at most.
  TexturePhotos(const ScanSource& scan, const Trajectory& world_from_base, bool strict,
                Progress& progress, std::size_t max_kept_bytes);

  std::size_t size() const { return photos_.size(); }
  const TexturePhoto& operator[](std::size_t photo) const { return photos_[photo]; }
  const std::vector<std::pair<int, Error>>& skipped() const { return skipped_; }

  // Decoded anew where memory did not allow to keep it. May be called from several threads.
  std::shared_ptr<const ColorImage> image(std::size_t photo) const;
  // Frees the images that are kept.
  void forget_images() const;

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
  mutable std::list<std::size_t> order_;  // of the images that are kept, the oldest first
  mutable std::size_t kept_bytes_ = 0;
};

}  // namespace libmap
