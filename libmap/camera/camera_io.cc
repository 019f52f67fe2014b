#include "libmap/camera/camera_io.h"

#include <yaml-cpp/yaml.h>

#include <Eigen/Geometry>
#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <optional>
#include <sstream>
#include <vector>

#include "libmap/core/error.h"
#include "libmap/core/file_output.h"
#include "libmap/core/text.h"
#include "libmap/core/yaml_document.h"

namespace libmap {

namespace {

constexpr double max_image_side = 65536;
constexpr std::size_t max_camera_numbers = 64;
constexpr std::size_t max_motion_numbers = 7'000'000;
constexpr double max_timing_s = 10.0;

[[noreturn]] void refuse(const std::string& field, const std::string& value,
                         const std::string& reason, const std::string& bound) {
  throw Error(reason, {.field = field, .value = value, .bound = bound});
}

double number_of(const YAML::Node& node, const std::string& field) {
  if (!node.IsScalar()) throw Error("not a single number", {.field = field});
  const std::optional<double> value = parse_double(node.Scalar());
  if (!value) refuse(field, node.Scalar(), "not a number", "a finite number");
  if (!std::isfinite(*value)) refuse(field, node.Scalar(), "not finite", "a finite number");
  return *value;
}

int side_of(const YAML::Node& root, const std::string& field) {
  const YAML::Node node = root[field];
  if (!node) throw Error("is missing", {.field = field});
  const double value = number_of(node, field);
  if (value != std::floor(value) || value < 1 || value > max_image_side)
    refuse(field, node.Scalar(), "not a size in pixels", ">= 1 and <= 65536");
  return static_cast<int>(value);
}

void append_numbers(const YAML::Node& list, const std::string& field, int depth,
                    std::size_t max_numbers, std::vector<double>& numbers) {
  if (!list.IsSequence()) throw Error("not a list of numbers", {.field = field});
  for (const YAML::Node& entry : list) {
    if (entry.IsSequence() && depth < 1)
      append_numbers(entry, field, depth + 1, max_numbers, numbers);  // row by row
    else
      numbers.push_back(number_of(entry, field));
    if (numbers.size() > max_numbers)
      throw Error("has too many numbers for a camera", {.field = field});
  }
}

// Reads a matrix {rows, cols, data}, or a list of numbers.
std::vector<double> matrix_of(const YAML::Node& node, const std::string& field,
                              std::size_t max_numbers = max_camera_numbers) {
  std::vector<double> numbers;
  if (!node.IsMap()) {
    append_numbers(node, field, 0, max_numbers, numbers);
    return numbers;
  }
  if (!node["data"]) throw Error("is missing", {.field = field + ".data"});
  if (!node["data"].IsNull())
    append_numbers(node["data"], field + ".data", 0, max_numbers, numbers);
  if (node["rows"] && node["cols"]) {
    const double promised =
        number_of(node["rows"], field + ".rows") * number_of(node["cols"], field + ".cols");
    if (promised != static_cast<double>(numbers.size()))
      refuse(field + ".data", std::to_string(numbers.size()) + " numbers",
             "differs from rows x cols", to_text(promised) + " numbers");
  }
  return numbers;
}

void read_matrix(const YAML::Node& root, Camera& camera) {
  const std::string field = "camera_matrix";
  if (!root[field]) throw Error("is missing", {.field = field});
  const std::vector<double> k = matrix_of(root[field], field);
  if (k.size() != 9) refuse(field, std::to_string(k.size()) + " numbers", "wrong size", "3 x 3");
  if (k[1] != 0) refuse("skew of " + field, to_text(k[1]), "not supported", "0");
  if (k[3] != 0 || k[6] != 0 || k[7] != 0 || k[8] != 1)
    throw Error("not a camera matrix: must be fx 0 cx, 0 fy cy, 0 0 1", {.field = field});
  camera.fx = k[0];
  camera.cx = k[2];
  camera.fy = k[4];
  camera.cy = k[5];
}

bool is_fisheye(const YAML::Node& root) {
  const YAML::Node flag = root["fisheye_model"];
  return flag && flag.IsScalar() && parse_bool(flag.Scalar()).value_or(false);
}

void read_distortion(const YAML::Node& root, Camera& camera) {
  const std::string model_field = "distortion_model";
  const std::string field = "distortion_coefficients";
  std::string model = is_fisheye(root) ? "equidistant" : "";
  if (root[model_field]) {
    if (!root[model_field].IsScalar()) throw Error("not a name", {.field = model_field});
    model = root[model_field].Scalar();
  }
  const std::vector<std::string> known = {"plumb_bob", "rational_polynomial", "equidistant",
                                          "fisheye", "none"};
  if (!model.empty() && std::find(known.begin(), known.end(), model) == known.end())
    refuse(model_field, model, "unknown model" + did_you_mean(model, known),
           "one of plumb_bob rational_polynomial equidistant fisheye none");
  std::vector<double> terms;
  if (root[field]) terms = matrix_of(root[field], field);
  const bool all_zero = std::all_of(terms.begin(), terms.end(), [](double k) { return k == 0; });
  if (all_zero && model != "equidistant" && model != "fisheye") return;
  if (model == "none")
    throw Error("contradicts distortion_model none; remove one of them", {.field = field});
  if (model == "equidistant" || model == "fisheye") {
    camera.distortion_model = DistortionModel::equidistant;
    if (terms.size() == 6 && terms[2] == 0 && terms[3] == 0)
      terms.erase(terms.begin() + 2, terms.begin() + 4);
    if (terms.empty()) terms.assign(4, 0.0);
  } else {
    camera.distortion_model = DistortionModel::radial_tangential;
    // The last two of OpenCV's 14 terms describe a tilted sensor.
    if (terms.size() == 14 && terms[12] == 0 && terms[13] == 0) terms.resize(12);
  }
  camera.distortion = terms;
}

std::vector<double> sized_matrix(const YAML::Node& root, const std::string& field,
                                 std::size_t size) {
  if (!root[field]) throw Error("is missing", {.field = field});
  std::vector<double> numbers = matrix_of(root[field], field);
  if (numbers.size() != size)
    refuse(field, std::to_string(numbers.size()) + " numbers", "wrong size",
           std::to_string(size) + " numbers");
  return numbers;
}

DepthCorrection depth_correction_of(const YAML::Node& root) {
  DepthCorrection depth;
  if (root["depth_scale"]) depth.scale = number_of(root["depth_scale"], "depth_scale");
  if (!root["depth_correction"]) {
    depth.check();
    return depth;
  }
  depth.spline_m = matrix_of(root["depth_correction"], "depth_correction");
  const std::vector<double> range = sized_matrix(root, "depth_correction_range", 2);
  depth.first_m = range[0];
  depth.step_m = range[1];
  const std::vector<double> radial =
      sized_matrix(root, "depth_correction_radial", depth.radial.size());
  std::copy(radial.begin(), radial.end(), depth.radial.begin());
  depth.check();
  return depth;
}

void read_timing(const YAML::Node& root, CameraFile& file) {
  if (root["camera_timing"]) {
    const std::vector<double> timing = sized_matrix(root, "camera_timing", 2);
    for (const double seconds : timing)
      if (!(std::abs(seconds) <= max_timing_s))
        refuse("camera_timing", to_text(seconds), "not a time within a frame", "-10 to 10 s");
    file.depth_delay_s = timing[0];
    file.rolling_shutter_s = timing[1];
  }
  if (!root["frame_motions"]) return;
  const std::vector<double> numbers =
      matrix_of(root["frame_motions"], "frame_motions", max_motion_numbers);
  if (numbers.size() % 7 != 0)
    refuse("frame_motions", std::to_string(numbers.size()) + " numbers", "wrong size",
           "7 per frame");
  for (std::size_t n = 0; n < numbers.size(); n += 7)
    file.motions.push_back({numbers[n],
                            {numbers[n + 1], numbers[n + 2], numbers[n + 3]},
                            {numbers[n + 4], numbers[n + 5], numbers[n + 6]}});
  const auto by_stamp = [](const FrameMotion& a, const FrameMotion& b) {
    return a.stamp_s < b.stamp_s;
  };
  if (!std::is_sorted(file.motions.begin(), file.motions.end(), by_stamp))
    throw Error("the stamps are not in ascending order", {.field = "frame_motions"});
}

void read_findings(const YAML::Node& root, CameraFile& file) {
  const YAML::Node list = root["findings"];
  if (!list) return;
  if (!list.IsSequence()) throw Error("not a list of sentences", {.field = "findings"});
  for (const YAML::Node& sentence : list) {
    if (!sentence.IsScalar()) throw Error("not a list of sentences", {.field = "findings"});
    file.findings.push_back(sentence.Scalar());
  }
}

// Block style, because cv::FileStorage does not accept a flow map after a tag.
std::string matrix_text(const std::string& key, int rows, int cols,
                        const std::vector<double>& numbers) {
  std::string text = key + ": !!opencv-matrix\n  rows: " + std::to_string(rows) +
                     "\n  cols: " + std::to_string(cols) + "\n  dt: d\n  data: [";
  for (std::size_t n = 0; n < numbers.size(); ++n)
    text += (n == 0 ? "" : ", ") + to_text(numbers[n]);
  return text + "]\n";
}

std::string pose_text(const std::string& key, const Pose& pose) {
  std::vector<double> numbers;
  for (int row = 0; row < 3; ++row)
    for (int column = 0; column < 4; ++column) numbers.push_back(pose.matrix()(row, column));
  return matrix_text(key, 3, 4, numbers);
}

std::string model_name(const Camera& camera) {
  if (camera.distortion_model == DistortionModel::equidistant) return "equidistant";
  return camera.distortion_model == DistortionModel::radial_tangential &&
                 camera.distortion.size() > 5
             ? "rational_polynomial"
             : "plumb_bob";
}

std::string quoted(const std::string& text) {
  std::string inside;
  for (const char c : text) {
    if (c == '"' || c == '\\') inside += '\\';
    inside += c == '\n' || c == '\r' || c == '\t' ? ' ' : c;
  }
  return "\"" + inside + "\"";
}

}  // namespace

Pose CameraFile::color_from_depth_at(double stamp_s, double depth_stamp_offset_s) const {
  const double delay_s = depth_delay_s + depth_stamp_offset_s;
  const auto motion = std::lower_bound(
      motions.begin(), motions.end(), stamp_s,
      [](const FrameMotion& frame, double stamp) { return frame.stamp_s < stamp; });
  if (delay_s == 0.0 || motion == motions.end() || motion->stamp_s != stamp_s)
    return color_from_depth;
  const Eigen::Vector3d turn = delay_s * motion->turn_rate;
  Pose base_motion = Pose::Identity();
  base_motion.translation() = delay_s * motion->velocity;
  if (turn.norm() > 0.0)
    base_motion.linear() = Eigen::AngleAxisd(turn.norm(), turn.normalized()).toRotationMatrix();
  return camera.base_from_camera.inverse() * base_motion * camera.base_from_camera *
         color_from_depth;
}

Pose pose_from_yaml(const YAML::Node& node, const std::string& field) {
  const std::vector<double> m = matrix_of(node, field);
  if (m.size() != 12 && m.size() != 16)
    refuse(field, std::to_string(m.size()) + " numbers", "wrong size", "3 x 4 or 4 x 4");
  Pose pose = Pose::Identity();
  for (int row = 0; row < 3; ++row)
    for (int column = 0; column < 4; ++column)
      pose.matrix()(row, column) =
          m[4 * static_cast<std::size_t>(row) + static_cast<std::size_t>(column)];
  const Eigen::Matrix3d written = pose.linear();
  const Eigen::Matrix3d rotation = nearest_rotation(written);
  const double deviation = (rotation - written).cwiseAbs().maxCoeff();
  if (!(deviation <= 1e-3))
    refuse(field + ", rotation error", to_text(deviation), "the 3 x 3 part is not a rotation",
           "<= 0.001");
  // Exact rotations are not modified.
  if (deviation > 1e-9) pose.linear() = rotation;
  return pose;
}

CameraFile camera_from_yaml(const YAML::Node& root) {
  if (!root.IsMap()) throw Error("not a YAML mapping; a camera file is required");
  CameraFile file;
  if (root["camera_name"] && root["camera_name"].IsScalar())
    file.name = root["camera_name"].Scalar();
  file.camera.width = side_of(root, "image_width");
  file.camera.height = side_of(root, "image_height");
  read_matrix(root, file.camera);
  read_distortion(root, file.camera);
  if (root["local_transform"])
    file.camera.base_from_camera = pose_from_yaml(root["local_transform"], "local_transform");
  file.camera.check();
  file.depth = depth_correction_of(root);
  if (root["depth_registration"])
    file.color_from_depth = pose_from_yaml(root["depth_registration"], "depth_registration");
  read_timing(root, file);
  read_findings(root, file);
  return file;
}

CameraFile parse_camera(const std::string& text, const std::string& file) {
  CameraFile camera;
  read_yaml(text, file, [&](const YAML::Node& root) { camera = camera_from_yaml(root); });
  return camera;
}

CameraFile read_camera(const std::filesystem::path& path) {
  return parse_camera(read_whole_file(path, max_yaml_bytes), path.string());
}

std::string to_yaml(const CameraFile& file, const std::string& comment) {
  const Camera& camera = file.camera;
  std::string text = "%YAML:1.0\n---\n";
  std::istringstream lines(comment);
  for (std::string line; std::getline(lines, line);) text += "# " + line + "\n";
  if (!file.name.empty()) text += "camera_name: " + quoted(file.name) + "\n";
  text += "image_width: " + std::to_string(camera.width) + "\n";
  text += "image_height: " + std::to_string(camera.height) + "\n";
  text += matrix_text("camera_matrix", 3, 3,
                      {camera.fx, 0, camera.cx, 0, camera.fy, camera.cy, 0, 0, 1});
  text += "distortion_model: " + model_name(camera) + "\n";
  std::vector<double> terms = camera.distortion;
  if (camera.distortion_model == DistortionModel::none) terms.assign(5, 0.0);
  text += matrix_text("distortion_coefficients", 1, static_cast<int>(terms.size()), terms);
  text += pose_text("local_transform", camera.base_from_camera);
  if (!file.color_from_depth.matrix().isIdentity(0.0))
    text += pose_text("depth_registration", file.color_from_depth);
  if (file.depth.scale != 1.0) text += "depth_scale: " + to_text(file.depth.scale) + "\n";
  if (const DepthCorrection& depth = file.depth; !depth.spline_m.empty())
    text +=
        matrix_text("depth_correction", 1, static_cast<int>(depth.spline_m.size()),
                    depth.spline_m) +
        matrix_text("depth_correction_range", 1, 2, {depth.first_m, depth.step_m}) +
        matrix_text("depth_correction_radial", 1, 3, {depth.radial.begin(), depth.radial.end()});
  if (file.depth_delay_s != 0.0 || file.rolling_shutter_s != 0.0)
    text += matrix_text("camera_timing", 1, 2, {file.depth_delay_s, file.rolling_shutter_s});
  if (!file.findings.empty()) {
    text += "findings:\n";
    for (const std::string& sentence : file.findings) text += "  - " + quoted(sentence) + "\n";
  }
  if (file.motions.empty()) return text;
  std::vector<double> numbers;
  for (const FrameMotion& frame : file.motions) {
    numbers.push_back(frame.stamp_s);
    numbers.insert(numbers.end(), frame.velocity.begin(), frame.velocity.end());
    numbers.insert(numbers.end(), frame.turn_rate.begin(), frame.turn_rate.end());
  }
  return text + matrix_text("frame_motions", static_cast<int>(file.motions.size()), 7, numbers);
}

}  // namespace libmap
