#include "libmap/scan/frame_folder.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <functional>
#include <initializer_list>
#include <numeric>
#include <optional>
#include <system_error>

#include "libmap/camera/camera_io.h"
#include "libmap/camera/depth_codec.h"
#include "libmap/camera/depth_correction.h"
#include "libmap/camera/image_codec.h"
#include "libmap/core/error.h"
#include "libmap/core/file_output.h"
#include "libmap/core/table.h"
#include "libmap/core/text.h"
#include "libmap/core/text_lines.h"
#include "libmap/poses/stamp_pairing.h"
#include "libmap/poses/trajectory_text.h"

namespace libmap {

namespace fs = std::filesystem;
namespace files = frame_folder_files;

namespace {

constexpr double millimeter_m = 0.001;

std::string cell_of(const Table& table, std::size_t row, const char* column) {
  const std::optional<std::size_t> index = table.find_column(column);
  return index ? std::string(trim(table.rows[row][*index])) : std::string();
}

Error wrong_cell(const std::string& reason, const Table& table, std::size_t row, const char* column,
                 std::string bound = {}) {
  return Error(reason, {.file = table.file,
                        .field = "row " + std::to_string(row + 1) + ", column " + column,
                        .value = cell_of(table, row, column),
                        .bound = std::move(bound)});
}

int integer_in(const Table& table, std::size_t row, const char* column, int missing) {
  const std::string cell = cell_of(table, row, column);
  if (cell.empty()) return missing;
  const std::optional<int> value = parse_int(cell);
  if (!value) throw wrong_cell("invalid", table, row, column, "a whole number of 32 bits");
  return *value;
}

// Parses numbers separated by spaces.
std::vector<double> numbers_in(const Table& table, std::size_t row, const char* column) {
  const std::string cell = cell_of(table, row, column);
  std::vector<double> numbers;
  for (const TextLine& line : split_lines(cell)) {
    for (const std::string_view word : line.words) {
      const std::optional<double> value = parse_double(word);
      if (!value || !std::isfinite(*value)) throw wrong_cell("not a number", table, row, column);
      numbers.push_back(*value);
    }
  }
  return numbers;
}

std::optional<std::array<double, 6>> six_in(const Table& table, std::size_t row,
                                            const char* column) {
  const std::vector<double> numbers = numbers_in(table, row, column);
  if (numbers.empty()) return std::nullopt;
  if (numbers.size() != 6) throw wrong_cell("not a list of six numbers", table, row, column);
  std::array<double, 6> six{};
  std::copy(numbers.begin(), numbers.end(), six.begin());
  return six;
}

GraphNode node_in(const Table& table, std::size_t row) {
  GraphNode node;
  node.id = integer_in(table, row, "node", 0);
  if (node.id <= 0) throw wrong_cell("not a node number", table, row, "node", "> 0");
  node.session = integer_in(table, row, "session", 0);
  node.weight = integer_in(table, row, "weight", 0);
  node.stamp_s = table.optional_number(row, table.column("stamp_s")).value_or(0.0);
  if (!std::isfinite(node.stamp_s))
    throw wrong_cell("not a finite number of seconds", table, row, "stamp_s");
  node.label = cell_of(table, row, "label");
  node.velocity = six_in(table, row, "velocity");
  if (const auto gps = six_in(table, row, "gps")) {
    const auto& [stamp, longitude, latitude, altitude, error, bearing] = *gps;
    node.gps = GpsFix{stamp, longitude, latitude, altitude, error, bearing};
  }
  return node;
}

std::vector<std::string> split_names(const std::string& cell) {
  std::vector<std::string> names;
  for (const TextLine& line : split_lines(cell))
    for (const std::string_view word : line.words) names.emplace_back(word);
  return names;
}

// True if the file is a depth image, which has one channel of 16 bits.
bool is_depth_image(const fs::path& file) {
  const std::optional<ImageInfo> info = read_image_info(read_whole_file(file));
  return info && info->channels == 1 && info->bits == 16;
}

// Interpolates the rotation spherically, and the position linearly.
Pose between(const Pose& a, const Pose& b, double fraction) {
  return make_pose((1.0 - fraction) * a.translation() + fraction * b.translation(),
                   Eigen::Quaterniond(a.linear()).slerp(fraction, Eigen::Quaterniond(b.linear())));
}

// Returns the pose at a stamp; nullopt if none is near. `trajectory` is sorted by stamp.
std::optional<Pose> pose_at(const Trajectory& trajectory, double stamp_s, double tolerance_s) {
  const auto after = std::lower_bound(
      trajectory.begin(), trajectory.end(), stamp_s,
      [](const TrajectoryPose& pose, double value) { return pose.stamp_s < value; });
  const bool has_after = after != trajectory.end() && after->stamp_s - stamp_s <= tolerance_s;
  const bool has_before =
      after != trajectory.begin() && stamp_s - (after - 1)->stamp_s <= tolerance_s;
  if (has_after && (after->stamp_s == stamp_s || !has_before)) return after->world_from_base;
  if (!has_before) return std::nullopt;
  const TrajectoryPose& before = *(after - 1);
  if (!has_after) return before.world_from_base;
  const double fraction = (stamp_s - before.stamp_s) / (after->stamp_s - before.stamp_s);
  return between(before.world_from_base, after->world_from_base, fraction);
}

DepthImage read_depth(const std::string& bytes, double depth_unit_m) {
  const MillimeterImage units = decode_gray16(bytes);
  if (depth_unit_m == millimeter_m) return to_meters(units);
  DepthImage depth(units.width, units.height);
  std::transform(units.pixels.begin(), units.pixels.end(), depth.pixels.begin(),
                 [&](std::uint16_t value) {
                   return value == no_depth_mm ? 0.0F : static_cast<float>(value * depth_unit_m);
                 });
  return depth;
}

// Registers depth to the color camera, at the size of the depth image.
void register_to_color(RgbdFrame& frame, const Camera& depth_camera) {
  if (frame.cameras.size() != 1 || !frame.stereo.empty())
    throw Error("depth_calibration requires a single camera that is not part of a stereo pair",
                {.field = "number of cameras", .value = std::to_string(frame.cameras.size())});
  if (frame.depth.width != depth_camera.width || frame.depth.height != depth_camera.height)
    throw Error("differs from the image size of depth_calibration",
                {.field = "size of the depth image",
                 .value = size_text(frame.depth.width, frame.depth.height),
                 .bound = size_text(depth_camera.width, depth_camera.height)});
  RgbdFrame only_depth;
  only_depth.cameras = frame.cameras;
  only_depth.depth = std::move(frame.depth);
  const Camera target = camera_views(only_depth).front().depth_camera;
  frame.depth = register_depth(only_depth.depth, depth_camera, target,
                               target.base_from_camera.inverse() * depth_camera.base_from_camera);
}

// Throws Error if the aspect ratios of depth and color differ; registered depth has color's view.
void require_aspect_of_color(const RgbdFrame& frame) {
  constexpr double max_difference = 0.03;
  double width = frame.color.width;
  double height = frame.color.height;
  if (frame.color.empty()) {
    width = 0.0;
    for (const Camera& camera : frame.cameras) {
      width += camera.width;
      height = camera.height;
    }
  }
  const double ratio = frame.depth.width * height / (frame.depth.height * width);
  if (width > 0.0 && std::abs(std::log(ratio)) > max_difference)
    throw Error(
        "the aspect ratio differs from that of the color image; if the depth image is not rotated "
        "but from a separate camera, set depth_calibration in " +
            std::string(frame_folder_files::options),
        {.field = "size of the depth image",
         .value = size_text(frame.depth.width, frame.depth.height),
         .bound =
             "proportional to " + size_text(static_cast<int>(width), static_cast<int>(height))});
}

std::string count_of(std::size_t count, const std::string& what) {
  return std::to_string(count) + " " + what + (count == 1 ? "" : "s");
}

}  // namespace

// Images with their stamps.
struct FrameFolder::Listing {
  std::vector<double> stamps;
  std::vector<std::string> names;

  void add(const TextLine& line, std::size_t first, const std::string& file) {
    if (line.words.size() < first + 2)
      throw wrong_columns("needs stamp and file", line, file, ">= " + std::to_string(first + 2));
    stamps.push_back(numbers_of(line, first, 1, file).front());
    names.emplace_back(line.words[first + 1]);
  }

  static Listing read(const fs::path& path) {
    Listing listing;
    const std::string text = read_whole_file(path);
    for (const TextLine& line : split_lines(text))
      if (!is_comment(line)) listing.add(line, 0, path.string());
    return listing;
  }
};

FrameFolder::FrameFolder(const fs::path& path, const FrameFolderOptions& defaults)
    : path_(path), options_(defaults) {
  if (!fs::is_directory(path)) throw Error("no such folder", {.file = path.string()});
  if (fs::exists(path / files::options)) {
    ParameterTable table;
    bind(table, options_);
    const fs::path file = path / files::options;
    set_from_yaml(table, read_whole_file(file), file.string());
  }
  if (!options_.depth_calibration.empty())
    depth_camera_ = read_camera(calibration_file(options_.depth_calibration)).camera;
  if (fs::exists(path / files::nodes))
    read_nodes();
  else
    read_images();
  read_poses();
  read_links();
}

std::size_t FrameFolder::add_camera(const std::string& name) {
  const auto known = camera_of_name_.find(name);
  if (known != camera_of_name_.end()) return known->second;
  cameras_.push_back(read_camera(calibration_file(name)).camera);
  camera_of_name_.emplace(name, cameras_.size() - 1);
  return cameras_.size() - 1;
}

void FrameFolder::read_nodes() {
  const Table table = read_csv(path_ / files::nodes);
  table.column("node");
  for (std::size_t row = 0; row < table.rows.size(); ++row) {
    GraphNode node = node_in(table, row);
    Files of_node;
    of_node.color = cell_of(table, row, "color");
    of_node.depth = cell_of(table, row, "depth");
    of_node.right = cell_of(table, row, "right");
    of_node.baselines_m = numbers_in(table, row, "baseline_m");
    for (const std::string& name : split_names(cell_of(table, row, "calibration")))
      of_node.cameras.push_back(add_camera(name));
    if (!of_node.baselines_m.empty() && of_node.cameras.size() != 2 * of_node.baselines_m.size())
      throw wrong_cell("not two camera files per baseline", table, row, "calibration");
    if (!files_.emplace(node.id, std::move(of_node)).second)
      throw wrong_cell("another row has the same node number", table, row, "node");
    graph_.nodes.push_back(std::move(node));
  }
  std::sort(graph_.nodes.begin(), graph_.nodes.end(),
            [](const GraphNode& a, const GraphNode& b) { return a.id < b.id; });
}

void FrameFolder::read_images() {
  const fs::path associations = path_ / files::associations;
  const fs::path depth_list = path_ / files::depth_list;
  Listing first;
  Listing second;
  if (fs::exists(associations)) {
    const std::string text = read_whole_file(associations);
    for (const TextLine& line : split_lines(text)) {
      if (is_comment(line)) continue;
      first.add(line, 0, associations.string());
      second.add(line, 2, associations.string());
    }
    // Files with both orders of the columns exist.
    bool depth_first = false;
    for (std::size_t i = 0; i < first.names.size(); ++i) {
      std::error_code code;
      if (!fs::is_regular_file(path_ / first.names[i], code)) continue;
      depth_first = is_depth_image(path_ / first.names[i]);
      break;
    }
    add_images(depth_first ? second : first, depth_first ? first : second);
  } else if (fs::exists(depth_list)) {
    if (fs::exists(path_ / files::color_list)) first = Listing::read(path_ / files::color_list);
    add_images(first, Listing::read(depth_list));
  } else {
    throw Error("is not a scan: a folder of frames needs " + std::string(files::associations) +
                    ", or " + files::color_list + " and " + files::depth_list,
                {.file = path_.string()});
  }
}

namespace {

// Medians of neighboring time differences. Arrival stamps jitter by several milliseconds, but the
// phase of two free-running cameras drifts slowly.
std::vector<double> smoothed_differences(const std::vector<double>& stamps,
                                         const std::vector<double>& differences) {
  constexpr double window_s = 1.5;
  constexpr double jitter_s = 0.01;
  std::vector<double> smoothed = differences;
  std::vector<std::size_t> order(stamps.size());
  std::iota(order.begin(), order.end(), std::size_t{0});
  std::stable_sort(order.begin(), order.end(),
                   [&](std::size_t a, std::size_t b) { return stamps[a] < stamps[b]; });
  std::size_t first = 0;
  for (const std::size_t own : order) {
    while (stamps[order[first]] < stamps[own] - window_s) ++first;
    std::vector<double> near;
    for (std::size_t n = first; n < order.size() && stamps[order[n]] <= stamps[own] + window_s; ++n)
      if (std::abs(differences[order[n]] - differences[own]) <= jitter_s)
        near.push_back(differences[order[n]]);
    const auto middle = near.begin() + static_cast<std::ptrdiff_t>(near.size() / 2);
    std::nth_element(near.begin(), middle, near.end());
    smoothed[own] = *middle;
  }
  return smoothed;
}

}  // namespace

void FrameFolder::add_images(const Listing& color, const Listing& depth) {
  if (depth.names.empty()) throw Error("no depth image is listed", {.file = path_.string()});
  std::vector<std::string> color_of_depth(depth.names.size());
  const auto pairs = pair_by_stamp(color.stamps, depth.stamps, options_.pairing_tolerance_s);
  std::vector<double> paired_stamps;
  std::vector<double> differences;
  for (const auto& [i, j] : pairs) {
    color_of_depth[j] = color.names[i];
    paired_stamps.push_back(depth.stamps[j]);
    differences.push_back(depth.stamps[j] - color.stamps[i]);
  }
  differences = smoothed_differences(paired_stamps, differences);
  std::vector<double> later_s(depth.names.size(), 0.0);
  for (std::size_t n = 0; n < pairs.size(); ++n) later_s[pairs[n].second] = differences[n];
  std::vector<std::size_t> order;
  for (std::size_t j = 0; j < depth.names.size(); ++j)
    if (color.names.empty() || !color_of_depth[j].empty()) order.push_back(j);
  const std::string tolerance = to_text(options_.pairing_tolerance_s) + " s";
  if (order.empty())
    throw Error("no color image is within " + tolerance +
                    " of a depth image; check the stamps or increase pairing_tolerance_s",
                {.file = path_.string()});
  if (order.size() < depth.names.size())
    warnings_.push_back("skipped " + count_of(depth.names.size() - order.size(), "depth image") +
                        " without a color image within " + tolerance);
  if (pairs.size() < color.names.size())
    warnings_.push_back("skipped " + count_of(color.names.size() - pairs.size(), "color image") +
                        " without a depth image within " + tolerance);
  std::stable_sort(order.begin(), order.end(),
                   [&](std::size_t a, std::size_t b) { return depth.stamps[a] < depth.stamps[b]; });
  const std::size_t camera = add_camera(options_.calibration);
  for (const std::size_t j : order) {
    GraphNode node;
    node.id = static_cast<int>(graph_.nodes.size()) + 1;
    node.stamp_s = depth.stamps[j];
    graph_.nodes.push_back(node);
    Files of_node;
    of_node.color = color_of_depth[j];
    of_node.depth = depth.names[j];
    of_node.depth_stamp_offset_s = later_s[j];
    of_node.cameras = {camera};
    files_.emplace(node.id, std::move(of_node));
  }
}

Pose FrameFolder::to_base_pose(const GraphNode& node, const Pose& pose) const {
  if (options_.pose_frame == PoseFrame::base) return pose;
  const Files& of_node = files_.at(node.id);
  if (of_node.cameras.empty()) return pose * optical_to_body_rotation().inverse();
  return pose * cameras_[of_node.cameras.front()].base_from_camera.inverse();
}

void FrameFolder::read_poses() {
  const auto read = [&](std::initializer_list<const char*> names,
                        const std::function<void(GraphNode&, const Pose&)>& use) {
    for (const char* name : names) {
      const fs::path file = path_ / name;
      if (!fs::exists(file)) continue;
      Trajectory trajectory = parse_tum(read_whole_file(file), file.string());
      std::stable_sort(trajectory.begin(), trajectory.end(),
                       [](const auto& a, const auto& b) { return a.stamp_s < b.stamp_s; });
      const bool have_nodes = std::all_of(trajectory.begin(), trajectory.end(),
                                          [](const auto& pose) { return pose.node > 0; });
      std::map<int, const Pose*> pose_of_node;
      for (const TrajectoryPose& pose : trajectory)
        pose_of_node.emplace(pose.node, &pose.world_from_base);
      std::size_t found = 0;
      for (GraphNode& node : graph_.nodes) {
        std::optional<Pose> pose;
        if (!have_nodes)
          pose = pose_at(trajectory, node.stamp_s, options_.pairing_tolerance_s);
        else if (const auto entry = pose_of_node.find(node.id); entry != pose_of_node.end())
          pose = *entry->second;
        if (!pose) continue;
        use(node, to_base_pose(node, *pose));
        ++found;
      }
      if (found == 0) warnings_.push_back(std::string(name) + ": no pose matches a node");
      return;
    }
  };
  read({files::odometry, files::plain_odometry},
       [](GraphNode& node, const Pose& pose) { node.odometry_from_base = pose; });
  read({files::truth, files::plain_truth},
       [](GraphNode& node, const Pose& pose) { node.truth_from_base = pose; });
  read({files::stored}, [this](GraphNode& node, const Pose& pose) {
    graph_.optimized_map_from_base.emplace(node.id, pose);
  });
}

void FrameFolder::read_links() {
  const fs::path file = path_ / files::links;
  if (!fs::exists(file)) return;
  if (options_.pose_frame != PoseFrame::base) {
    warnings_.push_back(std::string(files::links) +
                        ": ignored, because links connect base poses and pose_frame is camera");
    return;
  }
  std::size_t dangling = 0;
  std::size_t to_itself = 0;
  for (PoseLink& link : parse_g2o(read_whole_file(file), file.string()).links) {
    const bool is_landmark = link.to < 0;
    if (graph_.find_node(link.from) == nullptr ||
        (!is_landmark && graph_.find_node(link.to) == nullptr))
      ++dangling;
    else if (link.from == link.to && !is_absolute(link))
      ++to_itself;
    else
      graph_.links.push_back(std::move(link));
  }
  if (dangling > 0)
    warnings_.push_back(std::string(files::links) + ": ignored " + count_of(dangling, "link") +
                        " to or from nodes that do not exist");
  if (to_itself > 0)
    warnings_.push_back(std::string(files::links) + ": ignored " + count_of(to_itself, "link") +
                        " from a node to itself");
}

std::string FrameFolder::image_name(int node) const {
  const auto files = files_.find(node);
  return files == files_.end() ? std::string() : fs::path(files->second.color).filename().string();
}

RgbdFrame FrameFolder::read_frame(int node, FrameParts parts) const {
  const auto entry = files_.find(node);
  if (entry == files_.end())
    throw Error("the scan has no node with this id",
                {.file = path_.string(), .field = "node", .value = std::to_string(node)});
  const Files& of_node = entry->second;
  RgbdFrame frame;
  frame.node = node;
  frame.stamp_s = graph_.find_node(node)->stamp_s;
  frame.depth_stamp_offset_s = of_node.depth_stamp_offset_s;
  const auto read = [&](const std::string& name, const char* part, const auto& decode) {
    if (name.empty()) return;
    const std::string field = "node " + std::to_string(node) + ": " + part;
    const fs::path file = path_ / name;
    in_file(file, [&] { in_field(field, [&] { decode(read_whole_file(file)); }); });
  };
  if (parts.color)
    read(of_node.color, "color",
         [&](const std::string& bytes) { frame.color = decode_color(bytes); });
  if (parts.depth) {
    read(of_node.depth, "depth",
         [&](const std::string& bytes) { frame.depth = read_depth(bytes, options_.depth_unit_m); });
    read(of_node.right, "right",
         [&](const std::string& bytes) { frame.right = decode_gray(bytes); });
  }
  for (std::size_t i = 0; i < of_node.baselines_m.size(); ++i) {
    StereoCamera stereo{.left = cameras_[of_node.cameras[2 * i]],
                        .right = cameras_[of_node.cameras[2 * i + 1]],
                        .baseline_m = of_node.baselines_m[i]};
    stereo.right_from_left.translation().x() = -stereo.baseline_m;
    frame.cameras.push_back(stereo.left);
    frame.stereo.push_back(std::move(stereo));
  }
  if (frame.stereo.empty())
    for (const std::size_t camera : of_node.cameras) frame.cameras.push_back(cameras_[camera]);
  if (!frame.depth.empty())
    in_file(path_ / of_node.depth, [&] {
      in_field("node " + std::to_string(node) + ": depth", [&] {
        if (depth_camera_)
          register_to_color(frame, *depth_camera_);
        else
          require_aspect_of_color(frame);
      });
    });
  return frame;
}

std::unique_ptr<ScanSource> open_frame_folder(const fs::path& path,
                                              const FrameFolderOptions& defaults) {
  return std::make_unique<FrameFolder>(path, defaults);
}

}  // namespace libmap
