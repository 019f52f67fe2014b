#include "libmap/scan/frame_folder_writer.h"

#include <algorithm>
#include <array>
#include <set>
#include <utility>

#include "libmap/camera/camera_io.h"
#include "libmap/camera/depth_codec.h"
#include "libmap/camera/image_codec.h"
#include "libmap/core/error.h"
#include "libmap/core/file_output.h"
#include "libmap/core/table.h"
#include "libmap/core/text.h"
#include "libmap/poses/trajectory_text.h"
#include "libmap/scan/frame_folder.h"
#include "libmap/scan/image_export.h"

namespace libmap {

namespace fs = std::filesystem;
namespace files = frame_folder_files;

namespace {

std::string join(const std::string& words, const std::string& word) {
  return words.empty() ? word : words + " " + word;
}

std::string join(const std::array<double, 6>& numbers) {
  std::string text;
  for (const double number : numbers) text = join(text, to_text(number));
  return text;
}

void make_folder(const fs::path& folder) {
  std::error_code code;
  fs::create_directory(folder, code);
  if (code)
    throw Error("the folder cannot be created: " + code.message(), {.file = folder.string()},
                ErrorKind::failed);
}

// True if stamps identify the poses of a trajectory. Nodes without a pose must be too far in time
// from the poses of other nodes to be assigned one.
bool stamps_identify_nodes(const PoseGraph& graph, const Trajectory& trajectory) {
  const double pairing_tolerance_s = FrameFolderOptions().pairing_tolerance_s;
  std::set<double> stamps;
  for (const GraphNode& node : graph.nodes) stamps.insert(node.stamp_s);
  if (stamps.size() != graph.nodes.size()) return false;
  if (trajectory.size() == graph.nodes.size()) return true;
  const auto near = [&](double a, double b) { return b - a <= 2.0 * pairing_tolerance_s; };
  return std::adjacent_find(stamps.begin(), stamps.end(), near) == stamps.end();
}

}  // namespace

std::vector<std::string> frame_folder_names() {
  return {files::options,
          files::nodes,
          files::associations,
          files::odometry,
          files::stored,
          files::truth,
          files::links,
          files::color_folder,
          files::depth_folder,
          files::right_folder,
          files::calibration_folder};
}

FrameFolderWriter::FrameFolderWriter(fs::path folder) : folder_(std::move(folder)) {
  for (const char* name : {files::color_folder, files::depth_folder, files::calibration_folder})
    make_folder(folder_ / name);
}

std::string FrameFolderWriter::write_image(const char* folder, int node, const std::string& bytes) {
  const ImageFormat format = image_format(bytes).value_or(ImageFormat::png);
  std::string name = std::string(folder) + "/" + image_file_name(node, 0, file_extension(format));
  write_text(folder_ / name, bytes);
  return name;
}

std::string FrameFolderWriter::write_camera(const Camera& camera) {
  // Nodes with equal cameras share a file.
  const std::string key = to_yaml({.camera = camera});
  const auto known = cameras_.find(key);
  if (known != cameras_.end()) return known->second;
  const std::string stem = "camera_" + std::to_string(cameras_.size() + 1);
  std::string name = std::string(files::calibration_folder) + "/" + stem + ".yaml";
  write_text(folder_ / name, to_yaml({.name = stem, .camera = camera}));
  cameras_.emplace(key, name);
  return name;
}

void FrameFolderWriter::add_frame(const RgbdFrame& frame, const StoredImages& stored) {
  Files of_node;
  if (!frame.color.empty() || !stored.color.empty()) {
    of_node.color = write_image(files::color_folder, frame.node,
                                stored.color.empty() ? encode_png(frame.color) : stored.color);
    ++counts_.color_images;
  }
  if (!frame.depth.empty() || !stored.depth.empty()) {
    of_node.depth =
        write_image(files::depth_folder, frame.node,
                    stored.depth.empty() ? encode_png(to_millimeters(frame.depth)) : stored.depth);
    ++counts_.depth_images;
  }
  if (!frame.right.empty() || !stored.right.empty()) {
    if (counts_.right_images == 0) make_folder(folder_ / files::right_folder);
    of_node.right = write_image(files::right_folder, frame.node,
                                stored.right.empty() ? encode_png(frame.right) : stored.right);
    ++counts_.right_images;
  }
  // In stereo pairs, these are the left cameras.
  if (frame.stereo.empty())
    for (const Camera& camera : frame.cameras)
      of_node.calibrations = join(of_node.calibrations, write_camera(camera));
  for (const StereoCamera& pair : frame.stereo) {
    of_node.calibrations = join(of_node.calibrations, write_camera(pair.left));
    of_node.calibrations = join(of_node.calibrations, write_camera(pair.right));
    of_node.baselines_m = join(of_node.baselines_m, to_text(pair.baseline_m));
  }
  files_[frame.node] = std::move(of_node);
}

void FrameFolderWriter::write_nodes(const PoseGraph& graph) const {
  Table table;
  table.columns = {"node",  "session", "weight",      "stamp_s",    "label",    "color",
                   "depth", "right",   "calibration", "baseline_m", "velocity", "gps"};
  for (const GraphNode& node : graph.nodes) {
    const auto entry = files_.find(node.id);
    const Files of_node = entry == files_.end() ? Files() : entry->second;
    std::string gps;
    if (node.gps)
      gps = join({node.gps->stamp_s, node.gps->longitude_deg, node.gps->latitude_deg,
                  node.gps->altitude_m, node.gps->error_m, node.gps->bearing_deg});
    table.rows.push_back({std::to_string(node.id), std::to_string(node.session),
                          std::to_string(node.weight), to_text(node.stamp_s), node.label,
                          of_node.color, of_node.depth, of_node.right, of_node.calibrations,
                          of_node.baselines_m, node.velocity ? join(*node.velocity) : "", gps});
  }
  write_text(folder_ / files::nodes, to_csv(table));
}

std::size_t FrameFolderWriter::write_associations(const PoseGraph& graph) const {
  std::string text = "# stamp color stamp depth\n";
  std::size_t count = 0;
  for (const GraphNode& node : graph.nodes) {
    const auto entry = files_.find(node.id);
    if (entry == files_.end() || entry->second.color.empty() || entry->second.depth.empty())
      continue;
    const std::string stamp = stamp_text(node.stamp_s);
    for (const std::string& word : {stamp, entry->second.color, stamp}) (text += word) += ' ';
    (text += entry->second.depth) += '\n';
    ++count;
  }
  write_text(folder_ / files::associations, text);
  return count;
}

void FrameFolderWriter::write_poses(const PoseGraph& graph) const {
  const std::pair<PoseSource, const char*> sources[] = {{PoseSource::odometry, files::odometry},
                                                        {PoseSource::optimized, files::stored},
                                                        {PoseSource::ground_truth, files::truth}};
  for (const auto& [source, name] : sources) {
    const Trajectory trajectory = trajectory_of(graph, source);
    if (trajectory.empty()) continue;
    const bool with_nodes = !stamps_identify_nodes(graph, trajectory);
    write_text(folder_ / name, to_tum(trajectory, with_nodes));
  }
  Trajectory vertices = trajectory_of(graph, PoseSource::optimized);
  if (vertices.empty()) vertices = trajectory_of(graph, PoseSource::odometry);
  write_text(folder_ / files::links, to_g2o(vertices, graph.links));
}

FrameFolderCounts FrameFolderWriter::finish(const PoseGraph& graph) {
  write_nodes(graph);
  counts_.associations = write_associations(graph);
  write_poses(graph);
  FrameFolderOptions options;
  options.depth_unit_m = 0.001;
  options.pose_frame = PoseFrame::base;
  // For readers that support associations.txt only.
  if (!cameras_.empty())
    options.calibration = std::string(files::calibration_folder) + "/camera_1.yaml";
  ParameterTable table;
  bind(table, options);
  write_text(folder_ / files::options, to_yaml(table));
  counts_.calibrations = cameras_.size();
  return counts_;
}

}  // namespace libmap
