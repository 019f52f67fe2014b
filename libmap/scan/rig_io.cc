#include "libmap/scan/rig_io.h"

#include <yaml-cpp/yaml.h>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <numeric>
#include <optional>
#include <set>
#include <sstream>
#include <system_error>

#include "libmap/camera/camera_io.h"
#include "libmap/camera/image_codec.h"
#include "libmap/core/error.h"
#include "libmap/core/file_output.h"
#include "libmap/core/table.h"
#include "libmap/core/text.h"
#include "libmap/core/yaml_document.h"

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
  if (!node.IsScalar()) throw Error("must be a single number", {.field = field});
  const std::optional<double> value = parse_double(node.Scalar());
  if (!value) throw Error("not a number", {.field = field, .value = node.Scalar()});
  return *value;
}

std::vector<double> numbers_of(const YAML::Node& node, const std::string& field,
                               std::size_t count) {
  if (!node.IsSequence() || node.size() != count)
    throw Error("not a list of " + std::to_string(count) + " numbers", {.field = field});
  std::vector<double> numbers;
  for (const YAML::Node& entry : node) {
    numbers.push_back(rig_number(entry, field));
    if (!std::isfinite(numbers.back())) throw Error("must be finite", {.field = field});
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
      throw Error("is read from the file that 'calibration' names; remove this key",
                  {.field = key});
  return read_camera(folder / map["calibration"].Scalar()).camera;
}

void read_pose(const YAML::Node& map, Camera& camera) {
  const YAML::Node position = map["position_m"];
  const YAML::Node angles = map["roll_pitch_yaw_deg"];
  if (map["robot_from_camera"]) {
    if (position || angles)
      throw Error("cannot be combined with position_m or roll_pitch_yaw_deg",
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
  if (!map.IsMap()) throw Error("not a YAML mapping");
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
  std::string field = "cameras[" + std::to_string(index) + "]";
  if (map.IsMap() && map["name"] && map["name"].IsScalar())
    field += " (" + map["name"].Scalar() + ")";
  return error.in_field(field, ".");
}

CameraRig rig_of(const YAML::Node& root, const fs::path& folder) {
  if (!root.IsMap()) throw Error("not a YAML mapping; a rig file requires the key 'cameras'");
  std::vector<std::string> known = limit_keys;
  known.emplace_back("cameras");
  check_keys(root, known);
  if (!root["cameras"]) throw Error("is missing", {.field = "cameras"});
  if (!root["cameras"].IsSequence()) throw Error("must be a list", {.field = "cameras"});
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
    throw Error("not a valid folder name",
                {.field = "name", .value = name, .bound = "a name without '/', not '.' or '..'"});
  if (!(camera.depth_scale_m > 0) || !std::isfinite(camera.depth_scale_m))
    refuse("depth_scale_m", camera.depth_scale_m, "> 0");
  if (!(camera.near_m >= 0) || !std::isfinite(camera.near_m))
    refuse("near_m", camera.near_m, ">= 0");
  if (!(camera.far_m > camera.near_m))
    refuse("far_m", camera.far_m, "> near_m = " + to_text(camera.near_m));
  camera.camera.check();
}

std::string number_text(double value) {
  return std::isinf(value) ? (value > 0 ? ".inf" : "-.inf") : to_text(value);
}

// Returns the lines of a camera file after the YAML header, as an entry of the list `cameras`.
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
  if (cameras.empty()) throw Error("a rig needs at least one camera", {.field = "cameras"});
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

namespace {

namespace fs = std::filesystem;
using State = SynchronizedSet::Camera::State;

// File names have a resolution of microseconds.
constexpr double stamp_rounding_s = 1e-6;
constexpr std::uint16_t saturated = 65535;

double stamp_of(const std::string& text, const std::string& file, const std::string& field) {
  const std::optional<double> stamp = parse_double(text);
  if (!stamp || !std::isfinite(*stamp))
    throw Error("not a time stamp",
                {.file = file, .field = field, .value = text, .bound = "a number of seconds"});
  return *stamp;
}

bool is_png(const fs::path& path) { return lower_case(path.extension().string()) == ".png"; }

void append_folder(const fs::path& folder, std::size_t camera, std::vector<RigImage>& images) {
  std::error_code code;
  fs::directory_iterator entries(folder, code);
  if (code) throw Error("cannot be read: " + code.message(), {.file = folder.string()});
  for (const fs::directory_entry& entry : entries) {
    const fs::path& file = entry.path();
    // Hidden files belong to other programs.
    if (!is_png(file) || file.filename().string().starts_with(".")) continue;
    images.push_back({camera, stamp_of(file.stem().string(), file.string(), "name"), file});
  }
}

std::vector<RigImage> images_of_table(const fs::path& folder, const CameraRig& rig) {
  const Table table = read_csv(folder / rig_images_file_name);
  const std::size_t camera_column = table.column("camera");
  const std::size_t stamp_column = table.column("stamp_s");
  const std::size_t file_column = table.column("file");
  std::vector<std::string> names;
  for (const RigCamera& camera : rig.cameras) names.push_back(camera.name);
  std::vector<RigImage> images;
  for (std::size_t row = 0; row < table.rows.size(); ++row) {
    const std::string& name = table.rows[row][camera_column];
    const auto found = std::find(names.begin(), names.end(), name);
    if (found == names.end())
      throw Error("the rig has no camera with this name" + did_you_mean(name, names),
                  {.file = table.file, .field = "camera", .value = name});
    stamp_of(table.rows[row][stamp_column], table.file, "stamp_s");
    images.push_back({static_cast<std::size_t>(found - names.begin()),
                      table.number(row, stamp_column), folder / table.rows[row][file_column]});
  }
  return images;
}

double sum_of_offsets(const SynchronizedSet& set) {
  double sum = 0.0;
  for (const SynchronizedSet::Camera& camera : set.cameras)
    if (camera.state == State::seen) sum += std::abs(camera.offset_s);
  return sum;
}

bool is_fuller(const SynchronizedSet& set, const SynchronizedSet& best) {
  if (best.cameras.empty() || set.seen() != best.seen())
    return best.cameras.empty() || set.seen() > best.seen();
  return sum_of_offsets(set) < sum_of_offsets(best);
}

// Candidate images of each camera, ascending in time.
using ImagesByCamera = std::vector<std::vector<std::size_t>>;
ImagesByCamera by_camera(const std::vector<RigImage>& images,
                         const std::vector<std::size_t>& candidates, std::size_t camera_count) {
  ImagesByCamera result(camera_count);
  for (const std::size_t n : candidates) result.at(images[n].camera).push_back(n);
  return result;
}

std::vector<std::size_t> in_order_of_time(const std::vector<RigImage>& images) {
  std::vector<std::size_t> order(images.size());
  std::iota(order.begin(), order.end(), std::size_t{0});
  std::stable_sort(order.begin(), order.end(), [&](std::size_t a, std::size_t b) {
    return images[a].stamp_s < images[b].stamp_s;
  });
  return order;
}

// Returns the first image nearest to `stamp_s`; nullopt if there are no images.
std::optional<std::size_t> nearest_of(const std::vector<RigImage>& images,
                                      const std::vector<std::size_t>& of_camera, double stamp_s) {
  const auto first_from = [&](double stamp) {
    return std::lower_bound(of_camera.begin(), of_camera.end(), stamp,
                            [&](std::size_t n, double s) { return images[n].stamp_s < s; });
  };
  const auto offset = [&](auto image) { return std::abs(images[*image].stamp_s - stamp_s); };
  const auto after = first_from(stamp_s);
  if (after == of_camera.begin())
    return of_camera.empty() ? std::nullopt : std::optional(of_camera.front());
  const auto before = first_from(images[*std::prev(after)].stamp_s);
  return after == of_camera.end() || offset(before) <= offset(after) ? *before : *after;
}

// Returns the set of each camera's image nearest to `stamp_s` within the tolerance.
SynchronizedSet set_of(const std::vector<RigImage>& images, const ImagesByCamera& candidates,
                       double stamp_s, double reach_s) {
  SynchronizedSet set;
  set.stamp_s = stamp_s;
  set.cameras.resize(candidates.size());
  for (std::size_t camera = 0; camera < candidates.size(); ++camera) {
    const std::optional<std::size_t> n = nearest_of(images, candidates[camera], stamp_s);
    if (!n || std::abs(images[*n].stamp_s - stamp_s) > reach_s) continue;
    set.cameras[camera] = {State::seen, *n, images[*n].stamp_s - stamp_s};
  }
  return set;
}

}  // namespace

std::string rig_image_name(const std::string& camera, double stamp_s) {
  return camera + "/" + to_fixed_text(stamp_s, 6) + ".png";
}

std::vector<RigImage> list_rig_images(const fs::path& folder, const CameraRig& rig) {
  if (!fs::is_directory(folder))
    throw Error(fs::exists(folder) ? "not a folder" : "no such folder", {.file = folder.string()});
  std::vector<RigImage> images;
  if (fs::exists(folder / rig_images_file_name)) {
    images = images_of_table(folder, rig);
  } else {
    for (std::size_t n = 0; n < rig.cameras.size(); ++n) {
      std::error_code code;  // a camera's name can be invalid as a folder name
      if (fs::is_directory(folder / rig.cameras[n].name, code))
        append_folder(folder / rig.cameras[n].name, n, images);
    }
  }
  if (images.empty())
    throw Error("contains no image of any of the rig's cameras", {.file = folder.string()});
  std::sort(images.begin(), images.end(), [](const RigImage& a, const RigImage& b) {
    if (a.camera != b.camera) return a.camera < b.camera;
    if (a.stamp_s != b.stamp_s) return a.stamp_s < b.stamp_s;
    return a.file.native() < b.file.native();
  });
  return images;
}

Image<std::uint16_t> read_rig_units(const RigImage& image, const RigCamera& camera) {
  Image<std::uint16_t> units =
      in_file(image.file, [&] { return decode_gray16(read_whole_file(image.file)); });
  const Camera& calibrated = camera.camera;
  if (units.width != calibrated.width || units.height != calibrated.height)
    throw Error("does not match the calibration of " + camera.name,
                {.file = image.file.string(),
                 .field = "image size",
                 .value = size_text(units.width, units.height),
                 .bound = size_text(calibrated.width, calibrated.height)});
  return units;
}

DepthImage read_rig_depth(const RigImage& image, const RigCamera& camera) {
  const Image<std::uint16_t> units = read_rig_units(image, camera);
  DepthImage depth(units.width, units.height);
  for (std::size_t n = 0; n < units.pixels.size(); ++n) {
    if (units.pixels[n] == saturated) continue;
    depth.pixels[n] = static_cast<float>(units.pixels[n] * camera.depth_scale_m);
  }
  return depth;
}

std::size_t SynchronizedSet::seen() const {
  return static_cast<std::size_t>(std::count_if(
      cameras.begin(), cameras.end(), [](const Camera& c) { return c.state == State::seen; }));
}

SynchronizedSet synchronized_set_at(const std::vector<RigImage>& images, std::size_t camera_count,
                                    double stamp_s, double tolerance_s) {
  SynchronizedSet set;
  set.stamp_s = stamp_s;
  set.cameras.resize(camera_count);
  for (std::size_t n = 0; n < images.size(); ++n) {
    SynchronizedSet::Camera& camera = set.cameras.at(images[n].camera);
    const double offset = images[n].stamp_s - stamp_s;
    const bool nearer = std::abs(offset) < std::abs(camera.offset_s) ||
                        (std::abs(offset) == std::abs(camera.offset_s) && offset < camera.offset_s);
    if (camera.state != State::missing && !nearer) continue;
    camera.state = std::abs(offset) <= tolerance_s + stamp_rounding_s ? State::seen : State::late;
    camera.image = n;
    camera.offset_s = offset;
  }
  return set;
}

SynchronizedSet fullest_synchronized_set(const std::vector<RigImage>& images,
                                         std::size_t camera_count, double tolerance_s) {
  if (images.empty()) throw no_elements("images");
  const std::vector<std::size_t> order = in_order_of_time(images);
  const ImagesByCamera all = by_camera(images, order, camera_count);
  SynchronizedSet best;
  for (const std::size_t n : order) {
    SynchronizedSet set = set_of(images, all, images[n].stamp_s, tolerance_s + stamp_rounding_s);
    if (is_fuller(set, best)) best = std::move(set);
  }
  return synchronized_set_at(images, camera_count, best.stamp_s, tolerance_s);
}

std::vector<SynchronizedSet> synchronized_sets(const std::vector<RigImage>& images,
                                               std::size_t camera_count, double tolerance_s) {
  const std::vector<std::size_t> waiting = in_order_of_time(images);
  std::vector<bool> taken(images.size(), false);
  std::vector<SynchronizedSet> sets;
  for (std::size_t first = 0; first < waiting.size(); ++first) {
    if (taken[waiting[first]]) continue;
    const double start = images[waiting[first]].stamp_s;
    const double reach = tolerance_s + stamp_rounding_s;
    std::vector<std::size_t> near;
    for (std::size_t n = first; n < waiting.size(); ++n) {
      if (images[waiting[n]].stamp_s > start + 2 * reach) break;
      if (!taken[waiting[n]]) near.push_back(waiting[n]);
    }
    // The first image belongs to the set, even if the camera has other images near.
    ImagesByCamera candidates = by_camera(images, near, camera_count);
    candidates[images[near.front()].camera].resize(1);
    SynchronizedSet best;
    for (const std::size_t middle : near) {
      const double stamp = images[middle].stamp_s;
      if (stamp > start + reach) break;
      SynchronizedSet set = set_of(images, candidates, stamp, reach);
      if (is_fuller(set, best)) best = std::move(set);
    }
    for (const SynchronizedSet::Camera& camera : best.cameras)
      if (camera.state == State::seen) taken[camera.image] = true;
    sets.push_back(std::move(best));
  }
  return sets;
}

}  // namespace libmap
