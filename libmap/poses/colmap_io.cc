#include "libmap/poses/colmap_io.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <optional>

#include "libmap/core/error.h"
#include "libmap/core/file_output.h"
#include "libmap/core/text.h"
#include "libmap/core/text_lines.h"

namespace libmap {

namespace fs = std::filesystem;

namespace {

// Returns the line from word `first` to its end: names can contain spaces and commas.
std::string rest_of(const TextLine& line, std::size_t first) {
  return std::string(trim(
      line.text.substr(static_cast<std::size_t>(line.words[first].data() - line.text.data()))));
}

std::vector<ColmapObservation> observations_of(const TextLine& line, const std::string& file) {
  if (line.words.size() % 3 != 0)
    throw wrong_columns("not a line of features", line, file, "X Y POINT3D_ID per feature");
  std::vector<ColmapObservation> observations;
  observations.reserve(line.words.size() / 3);
  for (std::size_t word = 0; word < line.words.size(); word += 3) {
    const std::vector<double> pixel = numbers_of(line, word, 2, file);
    observations.push_back({{pixel[0], pixel[1]}, large_integer_of(line, word + 2, file)});
  }
  return observations;
}

std::string pose_to_text(const Pose& pose) {
  const Eigen::Quaterniond q = quaternion_of(pose);
  const Eigen::Vector3d t = pose.translation();
  return to_words({q.w(), q.x(), q.y(), q.z(), t.x(), t.y(), t.z()});
}

bool is_model(const fs::path& folder, const char* ending) {
  std::error_code ignored;
  return fs::is_regular_file(folder / (std::string("images") + ending), ignored);
}

}  // namespace

ColmapCamera to_colmap(const Camera& camera) {
  camera.check();
  ColmapCamera result{.model = "PINHOLE", .width = camera.width, .height = camera.height};
  result.parameters = {camera.fx, camera.fy, camera.cx + colmap_pixel_offset,
                       camera.cy + colmap_pixel_offset};
  if (!camera.is_distorted()) return result;
  std::vector<double> terms = camera.distortion;
  if (camera.distortion_model == DistortionModel::equidistant) {
    result.model = "OPENCV_FISHEYE";
  } else {
    while (!terms.empty() && terms.back() == 0.0) terms.pop_back();
    if (terms.size() > 8)
      throw Error(
          "COLMAP has no equivalent camera model",
          {.field = "distortion by thin prisms", .value = to_text(terms.back()), .bound = "none"});
    result.model = terms.size() > 4 ? "FULL_OPENCV" : "OPENCV";
    terms.resize(terms.size() > 4 ? 8 : 4, 0.0);
  }
  result.parameters.insert(result.parameters.end(), terms.begin(), terms.end());
  return result;
}

std::map<int, ColmapImage> parse_colmap_images(std::string_view text, const std::string& file) {
  constexpr std::size_t columns = 10;
  std::map<int, ColmapImage> images;
  const std::vector<TextLine> lines = split_lines(text);
  for (std::size_t i = 0; i < lines.size(); ++i) {
    const TextLine& line = lines[i];
    if (is_comment(line)) continue;
    if (line.words.size() < columns)
      throw wrong_columns("not an image", line, file,
                          "IMAGE_ID QW QX QY QZ TX TY TZ CAMERA_ID NAME");
    const int id = integer_of(line, 0, file);
    const std::vector<double> n = numbers_of(line, 1, 7, file);
    ColmapImage image;
    image.camera_from_world = pose_of(line, Eigen::Vector3d(n[4], n[5], n[6]),
                                      Eigen::Quaterniond(n[0], n[1], n[2], n[3]), file);
    image.camera = integer_of(line, 8, file);
    image.name = rest_of(line, 9);
    // The next line contains the features; it is empty if there are none.
    if (i + 1 < lines.size() && lines[i + 1].number == line.number + 1)
      image.observations = observations_of(lines[++i], file);
    if (!images.emplace(id, std::move(image)).second)
      throw duplicate(line, "image " + std::to_string(id), file);
  }
  return images;
}

std::string to_colmap_cameras(const ColmapModel& model) {
  std::string text = "# CAMERA_ID MODEL WIDTH HEIGHT PARAMS[]\n# Number of cameras: " +
                     std::to_string(model.cameras.size()) + "\n";
  for (const auto& [id, camera] : model.cameras) {
    text += std::to_string(id) + " " + camera.model + " " + std::to_string(camera.width) + " " +
            std::to_string(camera.height);
    for (const double parameter : camera.parameters) text += " " + to_text(parameter);
    text += "\n";
  }
  return text;
}

std::string to_colmap_images(const ColmapModel& model) {
  std::string text =
      "# IMAGE_ID QW QX QY QZ TX TY TZ CAMERA_ID NAME\n# POINTS2D[] as X Y POINT3D_ID\n"
      "# Number of images: " +
      std::to_string(model.images.size()) + "\n";
  for (const auto& [id, image] : model.images) {
    text += std::to_string(id) + pose_to_text(image.camera_from_world) + " " +
            std::to_string(image.camera) + " " + image.name + "\n";
    bool first = true;
    for (const ColmapObservation& feature : image.observations) {
      text += (first ? "" : " ") + to_text(feature.pixel.x()) + " " + to_text(feature.pixel.y()) +
              " " + std::to_string(feature.point);
      first = false;
    }
    text += "\n";
  }
  return text;
}

std::string to_colmap_points(const ColmapModel& model) {
  std::string text =
      "# POINT3D_ID X Y Z R G B ERROR TRACK[] as IMAGE_ID POINT2D_IDX\n# Number of points: " +
      std::to_string(model.points.size()) + "\n";
  for (const auto& [id, point] : model.points) {
    text +=
        std::to_string(id) + to_words({point.position.x(), point.position.y(), point.position.z()});
    for (const std::uint8_t channel : point.color) text += " " + std::to_string(channel);
    text += " " + to_text(point.error_px);
    for (const ColmapTrackElement& element : point.track)
      text += " " + std::to_string(element.image) + " " + std::to_string(element.observation);
    text += "\n";
  }
  return text;
}

fs::path find_colmap_model(const fs::path& path) {
  const std::array<fs::path, 3> candidates = {path, path / "sparse", path / "sparse" / "0"};
  for (const fs::path& candidate : candidates)
    if (is_model(candidate, ".txt")) return candidate;
  for (const fs::path& candidate : candidates)
    if (is_model(candidate, ".bin"))
      throw Error(
          "is a binary COLMAP model; convert it with 'colmap model_converter --output_type TXT'",
          {.file = candidate.string()});
  throw Error("contains no COLMAP model: there is no images.txt or sparse/images.txt",
              {.file = path.string()});
}

void write_colmap_model(const fs::path& folder, const ColmapModel& model) {
  write_text(folder / "cameras.txt", to_colmap_cameras(model));
  write_text(folder / "images.txt", to_colmap_images(model));
  write_text(folder / "points3D.txt", to_colmap_points(model));
}

}  // namespace libmap
