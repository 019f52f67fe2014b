#include "libmap/scan/rig_io.h"

#include <yaml-cpp/yaml.h>

#include <cmath>
#include <optional>
#include <set>
#include <sstream>

#include "libmap/core/error.h"
#include "libmap/core/file_output.h"
#include "libmap/core/text.h"
#include "libmap/core/yaml_document.h"
#include "libmap/image/camera_io.h"

namespace libmap {

namespace {

namespace fs = std::filesystem;

constexpr std::size_t max_cameras = 256;

const std::vector<std::string> limit_keys = {"depth_scale_m", "near_m", "far_m"};
const std::vector<std::string> camera_keys = split_list(
    "name,calibration,camera_name,image_width,image_height,camera_matrix,fisheye_model,"
    "distortion_model,distortion_coefficients,rectification_matrix,projection_matrix,"
    "local_transform,robot_from_camera,position_m,roll_pitch_yaw_deg,depth_scale_m,near_m,far_m");

double rig_number(const YAML::Node& node, const std::string& field) {
  if (!node.IsScalar()) throw Error("not a single number", {.field = field});
  const std::optional<double> value = parse_double(node.Scalar());
  if (!value)
    throw Error("not a number", {.field = field, .value = node.Scalar(), .bound = "a number"});
  return *value;
}

std::vector<double> numbers_of(const YAML::Node& node, const std::string& field,
                               std::size_t count) {
  if (!node.IsSequence() || node.size() != count)
    throw Error("not a list of " + std::to_string(count) + " numbers", {.field = field});
  std::vector<double> numbers;
  for (const YAML::Node& entry : node) {
    numbers.push_back(rig_number(entry, field));
    if (!std::isfinite(numbers.back())) throw Error("not finite", {.field = field});
  }
  return numbers;
}

void read_limits(const YAML::Node& map, RigCamera& camera) {
  if (map["depth_scale_m"])
    camera.depth_scale_m = rig_number(map["depth_scale_m"], "depth_scale_m");
  if (map["near_m"]) camera.near_m = rig_number(map["near_m"], "near_m");
  if (map["far_m"]) camera.far_m = rig_number(map["far_m"], "far_m");
}

Camera intrinsics_of(const YAML::Node& map, const fs::path& folder) {
  if (!map["calibration"]) return camera_from_yaml(map).camera;
  if (!map["calibration"].IsScalar()) throw Error("not a file name", {.field = "calibration"});
  for (const char* key : {"image_width", "image_height", "camera_matrix", "distortion_model",
                          "distortion_coefficients"})
    if (map[key])
      throw Error("is given beside a calibration file that contains it", {.field = key});
  return read_camera(folder / map["calibration"].Scalar()).camera;
}

void read_pose(const YAML::Node& map, Camera& camera) {
  const YAML::Node position = map["position_m"];
  const YAML::Node angles = map["roll_pitch_yaw_deg"];
  if (map["robot_from_camera"]) {
    if (position || angles)
      throw Error("is given beside position_m or roll_pitch_yaw_deg",
                  {.field = "robot_from_camera"});
    camera.base_from_camera = pose_from_yaml(map["robot_from_camera"], "robot_from_camera");
    return;
  }
  if (!position && !angles) {
    if (!map["calibration"] && !map["local_transform"])
      throw Error("is missing", {.field = "robot_from_camera"});
    return;
  }
  const std::vector<double> p =
      position ? numbers_of(position, "position_m", 3) : std::vector<double>(3, 0.0);
  const std::vector<double> a =
      angles ? numbers_of(angles, "roll_pitch_yaw_deg", 3) : std::vector<double>(3, 0.0);
  camera.base_from_camera =
      make_pose_from_rpy({p[0], p[1], p[2]}, {a[0], a[1], a[2]}) * optical_to_body_rotation();
}

RigCamera camera_of(const YAML::Node& map, const RigCamera& defaults, const fs::path& folder) {
  if (!map.IsMap()) throw Error("a camera is a map of keys and values");
  check_keys(map, camera_keys);
  RigCamera camera = defaults;
  if (!map["name"] || !map["name"].IsScalar()) throw Error("is missing", {.field = "name"});
  camera.name = map["name"].Scalar();
  camera.camera = intrinsics_of(map, folder);
  read_pose(map, camera.camera);
  read_limits(map, camera);
  return camera;
}

Error at_camera(const Error& error, std::size_t index, const YAML::Node& map) {
  std::string place = "cameras[" + std::to_string(index) + "]";
  if (map.IsMap() && map["name"] && map["name"].IsScalar())
    place += " (" + map["name"].Scalar() + ")";
  return error.in_field(place, ".");
}

CameraRig rig_of(const YAML::Node& root, const fs::path& folder) {
  if (!root.IsMap()) throw Error("a rig is a map with the key 'cameras'");
  std::vector<std::string> known = limit_keys;
  known.emplace_back("cameras");
  check_keys(root, known);
  if (!root["cameras"]) throw Error("is missing", {.field = "cameras"});
  if (!root["cameras"].IsSequence()) throw Error("not a list", {.field = "cameras"});
  RigCamera defaults;
  read_limits(root, defaults);
  CameraRig rig;
  for (const YAML::Node& map : root["cameras"]) {
    try {
      if (rig.cameras.size() == max_cameras) throw Error("more than 256 cameras");
      rig.cameras.push_back(camera_of(map, defaults, folder));
    } catch (const Error& error) {
      throw at_camera(error, rig.cameras.size(), map);
    }
  }
  rig.check();
  return rig;
}

void check_camera(const RigCamera& camera) {
  const auto refuse = [&](const std::string& field, double value, const std::string& bound) {
    throw Error("out of range",
                {.field = camera.name + ": " + field, .value = to_text(value), .bound = bound});
  };
  const std::string& name = camera.name;
  if (name.empty() || name == "." || name == ".." || name.find('/') != std::string::npos ||
      name.find('\0') != std::string::npos)
    throw Error("cannot name a folder",
                {.field = "name", .value = name, .bound = "a name without '/'"});
  if (!(camera.depth_scale_m > 0) || !std::isfinite(camera.depth_scale_m))
    refuse("depth_scale_m", camera.depth_scale_m, "> 0");
  if (!(camera.near_m >= 0) || !std::isfinite(camera.near_m))
    refuse("near_m", camera.near_m, ">= 0");
  if (!(camera.far_m > camera.near_m))
    refuse("far_m", camera.far_m, "> near_m, " + to_text(camera.near_m));
  camera.camera.check();
}

std::string number_text(double value) {
  return std::isinf(value) ? (value > 0 ? ".inf" : "-.inf") : to_text(value);
}

// The camera file's lines without its head, as an entry of the list.
std::string camera_entry(const RigCamera& camera) {
  std::istringstream lines(to_yaml(CameraFile{camera.name, camera.camera}));
  std::string text;
  for (std::string line; std::getline(lines, line);) {
    if (line.starts_with("%YAML") || line == "---") continue;
    if (line.starts_with("camera_name: "))
      text += "  - name: " + line.substr(std::string("camera_name: ").size()) + "\n";
    else if (line.starts_with("local_transform: "))
      text += "    robot_from_camera: !!opencv-matrix\n";
    else
      text += "    " + line + "\n";
  }
  text += "    depth_scale_m: " + number_text(camera.depth_scale_m) + "\n";
  text += "    near_m: " + number_text(camera.near_m) + "\n";
  return text + "    far_m: " + number_text(camera.far_m) + "\n";
}

}  // namespace

void CameraRig::check() const {
  if (cameras.empty()) throw Error("a rig needs a camera", {.field = "cameras"});
  std::set<std::string> names;
  for (const RigCamera& camera : cameras) {
    check_camera(camera);
    if (!names.insert(camera.name).second)
      throw Error("two cameras have this name", {.field = "name", .value = camera.name});
  }
}

CameraRig parse_rig(const std::string& text, const std::string& file) {
  CameraRig rig;
  read_yaml(text, file,
            [&](const YAML::Node& root) { rig = rig_of(root, fs::path(file).parent_path()); });
  return rig;
}

CameraRig read_rig(const fs::path& path) {
  return parse_rig(read_whole_file(path, max_yaml_bytes), path.string());
}

std::string to_yaml(const CameraRig& rig) {
  std::string text = "%YAML:1.0\n---\ncameras:\n";
  for (const RigCamera& camera : rig.cameras) text += camera_entry(camera);
  return text;
}

}  // namespace libmap
