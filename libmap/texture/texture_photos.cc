#include "libmap/texture/texture_photos.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>

#include "libmap/camera/color_image.h"
#include "libmap/core/error.h"
#include "libmap/core/median.h"
#include "libmap/core/parallel.h"

namespace libmap {

namespace {

// Number of frames in memory. Independent of the number of threads, as results must be.
constexpr std::size_t frames_in_flight = 8;
// Maximum magnification of a lens relative to a pinhole.
constexpr double max_distortion = 2.0;
constexpr std::size_t cells_per_chunk = 4096;

std::size_t bytes_of(const ColorImage& image) { return image.pixels.size() * sizeof(Color); }

// Maximum radius of (x/z, y/z) in the image, with a margin of 10 %.
double largest_ray(const Camera& camera) {
  double largest = 0.0;
  for (int side = 0; side < 8; ++side) {
    const double x = side % 3 == 0 ? 0.0 : side % 3 == 1 ? camera.width / 2.0 : camera.width;
    const double y = side < 3 ? 0.0 : side < 6 ? camera.height : camera.height / 2.0;
    const auto ray = pixel_to_ray(camera, Eigen::Vector2d(x, y));
    if (!ray) return std::numeric_limits<double>::infinity();
    largest = std::max(largest, ray->norm());
  }
  return 1.1 * largest;
}

Error no_photographs(const std::vector<std::pair<int, Error>>& skipped, std::size_t poses) {
  if (poses == 0) return Error("no frame has a pose, so there are no photographs for the texture");
  return Error("no usable photograph in " + std::to_string(poses) + " frames; the first frame: " +
               (skipped.empty() ? "no camera" : skipped.front().second.what()));
}

}  // namespace

PhotoProjector::PhotoProjector(const Camera& camera, const Pose& world_from_camera)
    : camera_(camera),
      camera_from_world_(world_from_camera.linear().transpose()),
      position_(world_from_camera.translation()),
      distorted_(camera.is_distorted()),
      max_ray_(largest_ray(camera)) {}

Eigen::Vector3d PhotoProjector::project(const Eigen::Vector3d& point_in_world) const {
  const Eigen::Vector3d p = camera_from_world_ * (point_in_world - position_);
  if (!(p.z() > 1e-9)) return Eigen::Vector3d::Zero();
  const Eigen::Vector2d ray(p.x() / p.z(), p.y() / p.z());
  if (!distorted_)
    return {camera_.fx * ray.x() + camera_.cx, camera_.fy * ray.y() + camera_.cy, p.z()};
  // The distortion polynomial is not valid beyond this radius.
  if (ray.norm() > max_ray_) return Eigen::Vector3d::Zero();
  const Eigen::Vector2d pixel = distort_to_pixel(camera_, ray);
  return {pixel.x(), pixel.y(), p.z()};
}

double PhotoProjector::max_pixels(const Eigen::Vector3d& center, double radius_m,
                                  double length_m) const {
  const Eigen::Vector3d p = camera_from_world_ * (center - position_);
  if (p.z() + radius_m <= 0.0) return 0.0;
  const double nearest = p.norm() - radius_m;
  if (!std::isfinite(max_ray_) || nearest <= 0.0) return std::numeric_limits<double>::infinity();
  // Distance from the cone around the optical axis that contains all rays of the image.
  const double stretch = 1.0 + max_ray_ * max_ray_;
  if ((p.head<2>().norm() - max_ray_ * p.z()) / std::sqrt(stretch) > radius_m) return 0.0;
  // The magnification of a pinhole is largest in radial direction: f / cos^2.
  return max_distortion * std::max(camera_.fx, camera_.fy) * stretch * length_m / nearest;
}

void OccluderCells::begin(const PhotoProjector& projector) {
  if (side_px_ == 0) return;
  const Camera& camera = projector.camera();
  width_px_ = static_cast<float>(camera.width);
  height_px_ = static_cast<float>(camera.height);
  columns_ = (camera.width - 1) / side_px_ + 1;
  rows_ = (camera.height - 1) / side_px_ + 1;
  const auto count = static_cast<std::size_t>(columns_) * static_cast<std::size_t>(rows_);
  z_.assign(count, std::numeric_limits<float>::infinity());
  rays_.resize(count);
  parallel_for(count, cells_per_chunk, [&](std::size_t begin, std::size_t end) {
    const auto columns = static_cast<std::size_t>(columns_);
    for (std::size_t i = begin; i < end; ++i) {
      const Eigen::Vector2d cell(static_cast<double>(i % columns),
                                 static_cast<double>(i / columns));
      const auto ray = pixel_to_ray(camera, (side_px_ * cell).array() + (side_px_ - 1) / 2.0);
      rays_[i] = ray ? projector.to_world(ray->homogeneous()) : Eigen::Vector3d::Zero();
    }
  });
}

void OccluderCells::add(float x, float y, float z) {
  if (side_px_ == 0 || !(z > 0.0F) || !(x > -0.5F) || !(y > -0.5F)) return;
  if (!(x < width_px_ - 0.5F) || !(y < height_px_ - 0.5F)) return;
  float& nearest = z_[index(cell_of(x), cell_of(y))];
  nearest = std::min(nearest, z);
}

bool OccluderCells::has_any_above(float x, float y, const Eigen::Vector3d& normal, double height_m,
                                  double gap_m) const {
  if (side_px_ == 0) return false;
  const int middle_column = cell_of(x);
  const int middle_row = cell_of(y);
  for (int row = std::max(0, middle_row - 1); row <= std::min(rows_ - 1, middle_row + 1); ++row)
    for (int column = std::max(0, middle_column - 1);
         column <= std::min(columns_ - 1, middle_column + 1); ++column) {
      const std::size_t i = index(column, row);
      if (!std::isfinite(z_[i])) continue;
      // Both terms are negative below the camera.
      if (normal.dot(rays_[i]) * static_cast<double>(z_[i]) - height_m > gap_m) return true;
    }
  return false;
}

Eigen::Vector3f sample_bicubic(const ColorImage& image, double x, double y) {
  const double cx = std::clamp(x, 0.0, image.width - 1.0);
  const double cy = std::clamp(y, 0.0, image.height - 1.0);
  const int column = static_cast<int>(cx);
  const int row = static_cast<int>(cy);
  const auto weights = [](float t) {
    const float t2 = t * t;
    const float t3 = t2 * t;
    return std::array<float, 4>{0.5F * (-t3 + 2.0F * t2 - t), 0.5F * (3.0F * t3 - 5.0F * t2 + 2.0F),
                                0.5F * (-3.0F * t3 + 4.0F * t2 + t), 0.5F * (t3 - t2)};
  };
  const std::array<float, 4> across = weights(static_cast<float>(cx - column));
  const std::array<float, 4> down = weights(static_cast<float>(cy - row));
  Eigen::Vector3f color = Eigen::Vector3f::Zero();
  for (int j = 0; j < 4; ++j) {
    Eigen::Vector3f line = Eigen::Vector3f::Zero();
    const int y_pixel = std::clamp(row - 1 + j, 0, image.height - 1);
    for (int i = 0; i < 4; ++i) {
      const Color& pixel = image.at(std::clamp(column - 1 + i, 0, image.width - 1), y_pixel);
      line += across[static_cast<std::size_t>(i)] * Eigen::Vector3f(pixel[0], pixel[1], pixel[2]);
    }
    color += down[static_cast<std::size_t>(j)] * line;
  }
  return color.cwiseMax(0.0F).cwiseMin(255.0F);
}

struct TexturePhotos::Frame {
  std::vector<TexturePhoto> photos{};
  std::vector<ColorImage> images{};
  std::optional<Error> fault{};  // nullopt: usable
};

TexturePhotos::Frame TexturePhotos::read_frame(const TrajectoryPose& pose) const {
  Frame frame;
  const std::string name = "node " + std::to_string(pose.node);
  try {
    if (!pose.world_from_base.matrix().allFinite())
      throw Error("pose is not finite", {.field = name});
    const RgbdFrame read = scan_.read_frame(pose.node, {.color = true, .depth = false});
    if (read.cameras.empty()) throw Error("no calibration", {.field = name});
    if (read.color.empty()) throw Error("no color image", {.field = name});
    std::vector<CameraView> views = camera_views(read);
    for (std::size_t i = 0; i < views.size(); ++i) {
      views[i].color_camera.check();
      frame.photos.push_back(
          {pose.node, i,
           PhotoProjector(views[i].color_camera,
                          pose.world_from_base * views[i].color_camera.base_from_camera),
           image_sharpness(views[i].color)});
      frame.images.push_back(std::move(views[i].color));
    }
  } catch (const Error& error) {
    frame = {};
    frame.fault = error;
  }
  return frame;
}

TexturePhotos::TexturePhotos(const ScanSource& scan, const Trajectory& world_from_base, bool strict,
                             Progress& progress, std::size_t max_kept_bytes)
    : scan_(scan), max_kept_bytes_(max_kept_bytes) {
  Trajectory poses = world_from_base;
  std::stable_sort(
      poses.begin(), poses.end(),
      [](const TrajectoryPose& a, const TrajectoryPose& b) { return a.node < b.node; });
  progress.begin("photographs", poses.size());
  std::vector<Frame> batch;
  for (std::size_t first = 0; first < poses.size(); first += batch.size()) {
    batch = std::vector<Frame>(std::min(frames_in_flight, poses.size() - first));
    parallel_each(batch.size(), [&](std::size_t i) { batch[i] = read_frame(poses[first + i]); });
    for (std::size_t i = 0; i < batch.size(); ++i) {
      Frame& frame = batch[i];
      if (frame.fault) {
        if (strict) throw frame.fault->in_file(scan.path().string());
        skipped_.emplace_back(poses[first + i].node, *frame.fault);
      }
      for (std::size_t k = 0; k < frame.photos.size(); ++k) {
        photos_.push_back(std::move(frame.photos[k]));
        images_.emplace_back();
        keep(photos_.size() - 1, std::make_shared<ColorImage>(std::move(frame.images[k])));
      }
    }
    progress.advance(batch.size());
  }
  progress.end();
  if (photos_.empty()) throw no_photographs(skipped_, poses.size()).in_file(scan.path().string());

  std::vector<double> all;
  for (const TexturePhoto& photo : photos_) all.push_back(photo.sharpness);
  const double middle = median(std::move(all));
  for (TexturePhoto& photo : photos_)
    photo.sharpness = middle > 0.0 ? photo.sharpness / middle : 1.0;
}

void TexturePhotos::keep(std::size_t photo, std::shared_ptr<const ColorImage> image) const {
  const std::scoped_lock lock(mutex_);
  if (images_[photo]) return;
  kept_bytes_ += bytes_of(*image);
  images_[photo] = std::move(image);
  order_.push_back(photo);
  while (kept_bytes_ > max_kept_bytes_ && order_.size() > 1) {
    kept_bytes_ -= bytes_of(*images_[order_.front()]);
    images_[order_.front()].reset();
    order_.pop_front();
  }
}

void TexturePhotos::evict_images() const {
  const std::scoped_lock lock(mutex_);
  for (const std::size_t photo : order_) images_[photo].reset();
  order_.clear();
  kept_bytes_ = 0;
}

std::shared_ptr<const ColorImage> TexturePhotos::image(std::size_t photo) const {
  {
    const std::scoped_lock lock(mutex_);
    if (images_[photo]) return images_[photo];
  }
  const TexturePhoto& source = photos_[photo];
  std::vector<CameraView> views =
      camera_views(scan_.read_frame(source.node, {.color = true, .depth = false}));
  auto image = std::make_shared<const ColorImage>(std::move(views[source.camera].color));
  keep(photo, image);
  return image;
}

}  // namespace libmap
