// Reads and writes sparse models in COLMAP's text format (Schoenberger and Frahm 2016): a folder
// with cameras.txt, images.txt and points3D.txt (https://colmap.github.io/format.html).
// Numbers are written with the fewest digits that parse to the same number.
//
// In COLMAP, the center of the first pixel has u = 0.5, in this project 0. The scale and the axes
// of COLMAP's world are arbitrary.
#pragma once

#include <cstdint>
#include <filesystem>
#include <map>
#include <string>
#include <string_view>
#include <vector>

#include "libmap/core/camera.h"
#include "libmap/core/point_cloud.h"

namespace libmap {

inline constexpr double colmap_pixel_offset = 0.5;  // pixel in COLMAP minus pixel in this project

// A line of cameras.txt: "CAMERA_ID MODEL WIDTH HEIGHT PARAMS[]".
struct ColmapCamera {
  std::string model{};  // "PINHOLE", "OPENCV", ...
  int width = 0;        // pixels
  int height = 0;
  std::vector<double> parameters{};  // of the model, in COLMAP's order and pixel coordinates
};

// Returns a PINHOLE, OPENCV, FULL_OPENCV or OPENCV_FISHEYE camera. Throws Error for thin prism
// distortion, which COLMAP does not have, and as Camera::check does.
ColmapCamera to_colmap(const Camera& camera);

// A feature of an image, which can be the observation of a 3D point.
struct ColmapObservation {
  Eigen::Vector2d pixel = Eigen::Vector2d::Zero();  // in COLMAP's pixel coordinates
  std::int64_t point = -1;                          // POINT3D_ID; -1: no point
};

// Two lines of images.txt: "IMAGE_ID QW QX QY QZ TX TY TZ CAMERA_ID NAME" and the features.
struct ColmapImage {
  int camera = 0;                             // CAMERA_ID
  std::string name{};                         // relative to the folder of the images
  Pose camera_from_world = Pose::Identity();  // optical frame: z forward, x right, y down
  std::vector<ColmapObservation> observations{};
};

// Observation of a 3D point in an image.
struct ColmapTrackElement {
  int image = 0;                // IMAGE_ID
  std::size_t observation = 0;  // index in ColmapImage::observations
};

// A line of points3D.txt: "POINT3D_ID X Y Z R G B ERROR TRACK[]".
struct ColmapPoint {
  Eigen::Vector3d position = Eigen::Vector3d::Zero();  // in COLMAP's world
  Color color{};
  double error_px = -1.0;  // mean reprojection error; -1: unknown
  std::vector<ColmapTrackElement> track{};
};

struct ColmapModel {
  std::map<int, ColmapCamera> cameras{};         // by CAMERA_ID
  std::map<int, ColmapImage> images{};           // by IMAGE_ID
  std::map<std::int64_t, ColmapPoint> points{};  // by POINT3D_ID
};

// Parses the content of images.txt; returns the images by IMAGE_ID. Throws Error naming `file` and
// line for missing columns, invalid numbers, quaternions not of unit length and duplicate ids.
std::map<int, ColmapImage> parse_colmap_images(std::string_view text, const std::string& file);
// Return the content of cameras.txt, images.txt and points3D.txt.
std::string to_colmap_cameras(const ColmapModel& model);
std::string to_colmap_images(const ColmapModel& model);
std::string to_colmap_points(const ColmapModel& model);

// Returns the folder with images.txt: `path`, `path`/sparse or `path`/sparse/0, as COLMAP's tools
// create it. Throws Error if no folder contains the file or the model is binary.
std::filesystem::path find_colmap_model(const std::filesystem::path& path);

// Writes the three files into `folder`, which must exist. Throws Error (failed).
void write_colmap_model(const std::filesystem::path& folder, const ColmapModel& model);

}  // namespace libmap
