#include "libmap/features/features.h"

#include <algorithm>
#include <cmath>
#include <opencv2/features2d.hpp>
#include <opencv2/imgproc.hpp>

#include "libmap/core/error.h"
#include "libmap/core/memory_budget.h"
#include "libmap/core/parallel.h"
#include "libmap/features/feature_cache.h"
#include "libmap/features/frame_calibration.h"

namespace libmap {

namespace {

constexpr std::size_t sift_bytes = 128;
constexpr std::size_t orb_bytes = 32;
constexpr double sift_scale = 512.0;  // square-rooted SIFT of unit length in bytes, as in most uses

// OpenCV's SIFT upsamples the image about its corner, not about the center of its first pixel.
// Detected positions are a quarter of a pixel too far right and down.
constexpr float sift_offset_px = 0.25F;

// Images are halved to at most 4 megapixels for detection, because SIFT doubles the image first and
// needs about 240 bytes per pixel. Larger images lose the finest octaves.
constexpr std::size_t max_detection_pixels = std::size_t{1} << 22;
constexpr std::uint64_t detection_bytes = 240;
constexpr std::uint64_t frame_bytes = 40;  // per pixel, for the planes and the gray image

// Disables OpenCV's own threads during its lifetime.
class SingleThreadedOpenCv {
 public:
  SingleThreadedOpenCv() : threads_(cv::getNumThreads()) { cv::setNumThreads(1); }
  ~SingleThreadedOpenCv() { cv::setNumThreads(threads_); }
  SingleThreadedOpenCv(const SingleThreadedOpenCv&) = delete;
  SingleThreadedOpenCv& operator=(const SingleThreadedOpenCv&) = delete;

 private:
  int threads_;
};

cv::Mat gray_of(const ColorImage& color) {
  cv::Mat gray(color.height, color.width, CV_8UC1);
  for (int y = 0; y < color.height; ++y)
    for (int x = 0; x < color.width; ++x) {
      const Color& c = color.at(x, y);
      // ITU-R BT.601.
      gray.at<std::uint8_t>(y, x) =
          static_cast<std::uint8_t>((299 * c[0] + 587 * c[1] + 114 * c[2] + 500) / 1000);
    }
  return gray;
}

void detect_in(const cv::Mat& gray, const FeatureOptions& options,
               std::vector<cv::KeyPoint>& points, cv::Mat& descriptors) {
  if (options.type == FeatureType::sift) {
    const auto sift = cv::SIFT::create(options.max_features, 3, options.min_contrast, 10, 1.6);
    sift->detectAndCompute(gray, cv::noArray(), points, descriptors);
    for (cv::KeyPoint& point : points) {
      point.pt.x -= sift_offset_px;
      point.pt.y -= sift_offset_px;
    }
  } else {
    const auto orb =
        cv::ORB::create(options.max_features, 1.2F, 8, 15, 0, 2, cv::ORB::HARRIS_SCORE, 31, 10);
    orb->detectAndCompute(gray, cv::noArray(), points, descriptors);
  }
}

struct Detection {
  std::vector<cv::KeyPoint> points;  // in pixels of the full image
  cv::Mat descriptors;
  double scale = 1.0;  // size of the full image relative to the image used for detection
};

Detection detect(const cv::Mat& gray, const FeatureOptions& options) {
  cv::Mat halved = gray;
  while (halved.total() > max_detection_pixels && halved.cols > 1 && halved.rows > 1)
    cv::resize(halved, halved, {halved.cols / 2, halved.rows / 2}, 0.0, 0.0, cv::INTER_AREA);
  Detection found;
  detect_in(halved, options, found.points, found.descriptors);
  if (halved.size() == gray.size()) return found;
  // With an odd number of rows or columns, the scale is slightly above 2.
  const float x_scale = static_cast<float>(gray.cols) / static_cast<float>(halved.cols);
  const float y_scale = static_cast<float>(gray.rows) / static_cast<float>(halved.rows);
  const float scale = std::sqrt(x_scale * y_scale);
  for (cv::KeyPoint& point : found.points) {
    point.pt.x = (point.pt.x + 0.5F) * x_scale - 0.5F;
    point.pt.y = (point.pt.y + 0.5F) * y_scale - 0.5F;
    point.size *= scale;
  }
  found.scale = static_cast<double>(scale);
  return found;
}

void append_descriptor(const cv::Mat& descriptors, int row, FrameFeatures& frame) {
  if (frame.type == FeatureType::orb) {
    const auto* bytes = descriptors.ptr<std::uint8_t>(row);
    frame.descriptors.insert(frame.descriptors.end(), bytes, bytes + orb_bytes);
    return;
  }
  const float* values = descriptors.ptr<float>(row);
  double sum = 0.0;
  for (std::size_t n = 0; n < sift_bytes; ++n) sum += static_cast<double>(values[n]);
  for (std::size_t n = 0; n < sift_bytes; ++n) {
    const double root =
        sum > 0.0 ? std::sqrt(std::max(0.0, static_cast<double>(values[n])) / sum) : 0.0;
    frame.descriptors.push_back(
        static_cast<std::uint8_t>(std::min(255.0, std::round(root * sift_scale))));
  }
}

// Intersection of a ray with the plane at the depth pixel it passes through.
struct DepthAtRay {
  double depth_m = 0.0;
  double per_pixel = 0.0;  // slope of the depth, m/px
  int support = 0;
};

DepthAtRay depth_at(const DepthPlanes& planes, const Camera& camera, const Eigen::Vector2d& ray) {
  const Eigen::Vector2d pixel = distort_to_pixel(camera, ray);
  const double x = std::round(pixel.x());
  const double y = std::round(pixel.y());
  if (!(x >= 0.0 && y >= 0.0 && x < planes.width && y < planes.height)) return {};
  const auto n = static_cast<std::size_t>(y) * static_cast<std::size_t>(planes.width) +
                 static_cast<std::size_t>(x);
  if (planes.support[n] < 4) return {};
  const auto center = pixel_to_ray(camera, Eigen::Vector2d(x, y));
  if (!center) return {};
  const Eigen::Vector3d normal = planes.normals[n].cast<double>();
  const double depth = static_cast<double>(planes.depth_m[n]);
  const double facing = normal.dot(ray.homogeneous());
  if (!(facing < 0.0)) return {};
  DepthAtRay result;
  result.depth_m = depth * normal.dot(center->homogeneous()) / facing;
  result.per_pixel = result.depth_m / std::abs(facing) *
                     std::hypot(normal.x() / camera.fx, normal.y() / camera.fy);
  result.support = planes.support[n];
  return result;
}

void check(const FeatureOptions& options) {
  check_parameters(options);
  if (!(options.planes.max_depth_m > options.planes.min_depth_m))
    throw Error("not above min_depth_m", {.field = "max_depth_m",
                                          .value = to_text(options.planes.max_depth_m),
                                          .bound = "> " + to_text(options.planes.min_depth_m)});
}

std::uint64_t bytes_to_find(const CameraView& view) {
  const std::uint64_t pixels = std::max(view.color.pixels.size(), view.depth.pixels.size());
  return frame_bytes * pixels +
         detection_bytes * std::min<std::uint64_t>(pixels, max_detection_pixels);
}

struct FoundFeatures {
  FrameFeatures frame;
  bool from_cache = false;
};

FoundFeatures features_of(const ScanSource& scan, int node, const FeatureOptions& options,
                          PixelRayCache& rays, const FeatureCache& cache, MemoryBudget& memory) {
  const RgbdFrame read = scan.read_frame(node, {.color = !options.surfaces_only, .depth = true});
  if (read.depth.empty()) throw Error("the frame has no depth image");
  FoundFeatures result;
  FrameFeatures& frame = result.frame;
  frame.node = node;
  frame.type = options.type;
  const std::vector<CameraView> views = camera_views(read);
  if (views.empty() && read.cameras.empty() && !(read.color.empty() && read.depth.empty()))
    throw Error("the frame has no calibration");
  std::string key;
  if (cache.enabled()) {
    std::vector<Camera> depth_cameras;
    depth_cameras.reserve(views.size());
    for (const CameraView& view : views) depth_cameras.push_back(view.depth_camera);
    key = feature_key(read, options);
    result.from_cache = cache.read(key, depth_cameras, frame);
  }
  for (const CameraView& view : views) {
    frame.cameras.push_back(view.color_camera);
    if (result.from_cache) continue;
    const MemoryBudget::Reservation reservation = memory.take(bytes_to_find(view));
    const DepthPlanes planes =
        fit_depth_planes(view.depth, *rays.rays_of(view.depth_camera), options.planes);
    frame.surfaces.emplace_back(planes, view.depth_camera, options.planes.noise,
                                options.surface_noise_m, options.surface_step_px);
    if (!view.color.empty()) add_features(view, planes, options, frame);
  }
  if (!result.from_cache) cache.write(key, frame);
  for (Feature& feature : frame.features)
    if (!has_plane(frame, feature)) feature.depth_noise_m = unknown_depth_m;
  frame.depth_stamp_offset_s = read.depth_stamp_offset_s;
  frame.stamp_s = read.stamp_s - read.depth_stamp_offset_s;
  return result;
}

// Cameras of the first frame that has any.
std::vector<Camera> cameras_of(const ScanSource& scan, const std::vector<int>& nodes) {
  for (const int node : nodes) {
    try {
      const RgbdFrame frame = scan.read_frame(node, {.color = false, .depth = false});
      if (!frame.cameras.empty()) return frame.cameras;
    } catch (const Error&) {
      // Reported when its images are read.
    }
  }
  return {};
}

void keep_descriptors(const std::shared_ptr<TempFile>& file, FrameFeatures& frame) {
  frame.descriptors_begin = file->append(frame.descriptors.data(), frame.descriptors.size());
  frame.descriptor_file = file;
  std::vector<std::uint8_t>().swap(frame.descriptors);
}

}  // namespace

void bind(ParameterTable& table, FeatureOptions& options) {
  table.add("features", options.type, {{"sift", FeatureType::sift}, {"orb", FeatureType::orb}},
            "type of image features; sift: SIFT; orb: ORB (binary descriptors)");
  table.add("max_features", options.max_features, {1, 100000},
            "maximum number of features per image");
  table.add("min_contrast", options.min_contrast, positive,
            "minimum contrast of a SIFT feature, for image values from 0 to 1");
  table.add("pixel_noise_px", options.pixel_noise_px, positive,
            "standard deviation of a feature's position: constant term, searched image's pixels");
  table.add("scale_noise", options.scale_noise, not_negative,
            "standard deviation of a feature's position: term proportional to its size, px/px");
  table.add("surface_noise_m", options.surface_noise_m, not_negative,
            "minimum standard deviation of a plane fitted to many depth pixels, m");
  table.add(
      "surface_step_px", options.surface_step_px, {1, 32},
      "step of the grid to which depth images are downsampled, pixels; larger for long scans");
  table.add("min_depth_m", options.planes.min_depth_m, positive, "minimum depth that is used, m");
  table.add("max_depth_m", options.planes.max_depth_m, positive, "maximum depth that is used, m");
  table.add("axial_noise_m", options.planes.noise.axial_m, positive,
            "standard deviation of depth: constant term, m");
  table.add("range_noise", options.planes.noise.axial_of_range, not_negative,
            "standard deviation of depth: term proportional to range, m per m");
  table.add("square_noise", options.planes.noise.axial_of_square, not_negative,
            "standard deviation of depth: term proportional to squared range, 1/m");
}

Eigen::Vector3d FrameFeatures::point_in_camera(std::size_t n) const {
  return static_cast<double>(features[n].depth_m) * features[n].ray.cast<double>().homogeneous();
}

Eigen::Vector3d FrameFeatures::point_in_base(std::size_t n) const {
  return cameras[features[n].camera].base_from_camera * point_in_camera(n);
}

void add_features(const CameraView& view, const DepthPlanes& planes, const FeatureOptions& options,
                  FrameFeatures& frame) {
  const Detection found = detect(gray_of(view.color), options);
  const std::vector<cv::KeyPoint>& points = found.points;
  const auto camera = static_cast<std::uint16_t>(frame.cameras.size() - 1);
  for (std::size_t n = 0; n < points.size(); ++n) {
    const auto ray = pixel_to_ray(
        view.color_camera,
        Eigen::Vector2d(static_cast<double>(points[n].pt.x), static_cast<double>(points[n].pt.y)));
    if (!ray) continue;
    const DepthAtRay depth = depth_at(planes, view.depth_camera, *ray);
    if (!(depth.depth_m > 0.0)) {
      ++frame.without_depth;
      continue;
    }
    const double pixel_noise =
        std::hypot(options.pixel_noise_px * found.scale,
                   options.scale_noise * static_cast<double>(points[n].size));
    const double axial = options.planes.noise.axial_at(depth.depth_m) /
                         std::sqrt(static_cast<double>(depth.support));
    Feature feature;
    feature.ray = ray->cast<float>();
    feature.depth_m = static_cast<float>(depth.depth_m);
    feature.depth_noise_m = static_cast<float>(
        std::sqrt(axial * axial + options.surface_noise_m * options.surface_noise_m +
                  depth.per_pixel * depth.per_pixel * pixel_noise * pixel_noise));
    feature.pixel_noise_px = static_cast<float>(pixel_noise);
    feature.camera = camera;
    frame.features.push_back(feature);
    append_descriptor(found.descriptors, static_cast<int>(n), frame);
  }
}

int surface_step(std::size_t frames, const std::vector<Camera>& cameras,
                 const FeatureOptions& options) {
  constexpr int largest = 32;
  const auto bytes_with = [&](int step_px) {
    double cells = 0.0;
    for (const Camera& camera : cameras)
      cells += std::ceil(static_cast<double>(camera.width) / step_px) *
               std::ceil(static_cast<double>(camera.height) / step_px);
    return cells * static_cast<double>(sizeof(DepthSurface::Cell)) * static_cast<double>(frames);
  };
  int step_px = options.surface_step_px;
  while (step_px < largest && bytes_with(step_px) > static_cast<double>(options.max_surface_bytes))
    ++step_px;
  return step_px;
}

FeatureResult find_features(const ScanSource& scan, const std::vector<int>& nodes,
                            const FeatureOptions& given, Progress& progress,
                            const FeatureCache* cache) {
  check(given);
  FeatureOptions options = given;
  options.surface_step_px = surface_step(nodes.size(), cameras_of(scan, nodes), given);
  const FeatureCache none;
  const SingleThreadedOpenCv single;
  std::vector<FoundFeatures> frames(nodes.size());
  std::vector<std::optional<Error>> faults(nodes.size());
  PixelRayCache rays;
  MemoryBudget memory;
  const std::shared_ptr<TempFile> file =
      cache != nullptr && nodes.size() > options.max_frames_in_memory ? cache->temp_file()
                                                                      : nullptr;
  progress.begin("features", nodes.size());
  parallel_for(nodes.size(), 1, [&](std::size_t begin, std::size_t end) {
    for (std::size_t n = begin; n < end; ++n) {
      try {
        frames[n] =
            features_of(scan, nodes[n], options, rays, cache != nullptr ? *cache : none, memory);
        if (file != nullptr) keep_descriptors(file, frames[n].frame);
      } catch (const Error& error) {
        faults[n] = error;
      }
      progress.advance(1);
    }
  });
  progress.end();
  FeatureResult result;
  for (std::size_t n = 0; n < nodes.size(); ++n) {
    if (faults[n]) {
      result.skipped.emplace_back(nodes[n], *faults[n]);
      continue;
    }
    result.from_cache += frames[n].from_cache ? 1 : 0;
    result.frames.push_back(std::move(frames[n].frame));
  }
  return result;
}

std::size_t descriptor_bytes(FeatureType type) {
  return type == FeatureType::sift ? sift_bytes : orb_bytes;
}

Eigen::MatrixXf descriptor_vectors(const FrameFeatures& frame) {
  const std::size_t bytes = descriptor_bytes(frame.type);
  const auto count = static_cast<Eigen::Index>(frame.features.size());
  std::vector<std::uint8_t> read;
  if (frame.descriptor_file != nullptr && frame.descriptors.empty()) {
    read.resize(bytes * frame.features.size());
    frame.descriptor_file->read(frame.descriptors_begin, read.data(), read.size());
  }
  const std::vector<std::uint8_t>& descriptors = read.empty() ? frame.descriptors : read;
  if (frame.type == FeatureType::sift) {
    Eigen::MatrixXf vectors =
        Eigen::Map<const Eigen::Matrix<std::uint8_t, Eigen::Dynamic, Eigen::Dynamic>>(
            descriptors.data(), static_cast<Eigen::Index>(bytes), count)
            .cast<float>();
    vectors.colwise().normalize();
    return vectors;
  }
  Eigen::MatrixXf vectors(8 * static_cast<Eigen::Index>(bytes), count);
  for (Eigen::Index n = 0; n < count; ++n)
    for (Eigen::Index bit = 0; bit < vectors.rows(); ++bit) {
      const std::uint8_t byte =
          descriptors[static_cast<std::size_t>(n) * bytes + static_cast<std::size_t>(bit / 8)];
      vectors(bit, n) = ((byte >> (bit % 8)) & 1) != 0 ? 0.0625F : -0.0625F;
    }
  return vectors;
}

}  // namespace libmap
