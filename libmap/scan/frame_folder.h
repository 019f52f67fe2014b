// Reads a scan that is stored as a folder of plain files: the layout of the TUM RGB-D benchmark
// (Sturm et al. 2012), or the more complete layout that FrameFolderWriter writes (nodes.csv).
//
//   scan.yaml               keys of FrameFolderOptions (below); optional
//   associations.txt        lines "stamp color stamp depth", or depth before color; if missing:
//   rgb.txt, depth.txt      lines "stamp file"; rgb.txt is optional
//   calibration.yaml        the camera (camera_io.h); FrameFolderOptions::calibration
//   groundtruth.txt         true poses as lines of TUM; or poses_ground_truth.tum; optional
//   poses.tum               odometry as lines of TUM; or poses_odometry.tum; optional
//   poses_stored.tum        optimized poses as lines of TUM; optional
//   links.g2o               links between nodes (edges; vertices are ignored); optional
//   nodes.csv               instead of associations.txt: a table with the columns node, session,
//                           weight, stamp_s, label, color, depth, right, calibration, baseline_m,
//                           velocity, gps. Files are relative to the folder. Calibrations of a node
//                           are separated by spaces: one per camera, or left and right camera of
//                           each stereo pair with one baseline_m per pair.
//   color/ depth/ right/ calibration/  files that nodes.csv names
//
// Without nodes.csv, color and depth images are paired by stamp; nodes are numbered from 1 in the
// order of time and have the stamp of the depth image. Poses are assigned by node id if all poses
// of a file have one. Otherwise, a node's pose is interpolated between the poses before and after
// its stamp if both are within pairing_tolerance_s; if only one of them is, it is the node's pose.
#pragma once

#include <filesystem>
#include <map>
#include <memory>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "libmap/core/parameters.h"
#include "libmap/scan/scan_source.h"

namespace libmap {

// Names of the files and folders above.
namespace frame_folder_files {

inline constexpr const char* options = "scan.yaml";
inline constexpr const char* nodes = "nodes.csv";
inline constexpr const char* associations = "associations.txt";
inline constexpr const char* color_list = "rgb.txt";
inline constexpr const char* depth_list = "depth.txt";
inline constexpr const char* odometry = "poses_odometry.tum";
inline constexpr const char* plain_odometry = "poses.tum";
inline constexpr const char* stored = "poses_stored.tum";
inline constexpr const char* truth = "poses_ground_truth.tum";
inline constexpr const char* plain_truth = "groundtruth.txt";
inline constexpr const char* links = "links.g2o";
inline constexpr const char* color_folder = "color";
inline constexpr const char* depth_folder = "depth";
inline constexpr const char* right_folder = "right";
inline constexpr const char* calibration_folder = "calibration";

}  // namespace frame_folder_files

// Frame of the poses in a file: the camera's optical frame, or the robot's base.
enum class PoseFrame { camera, base };
std::vector<std::pair<std::string, PoseFrame>> pose_frame_names();

// The defaults are for folders of the TUM benchmark.
struct FrameFolderOptions {
  double depth_unit_m = 0.0002;                  // > 0: meters per unit of the 16-bit depth images
  std::string calibration = "calibration.yaml";  // file of the color camera, relative to the folder
  // Camera file of a separate depth camera, whose local_transform is base_from_depth; depth is then
  // registered to color on reading. Empty: the stored depth is registered to color.
  std::string depth_calibration{};
  PoseFrame pose_frame = PoseFrame::camera;  // frame of the poses in the files
  double pairing_tolerance_s = 0.02;         // >= 0: maximum difference between paired stamps
};
void bind(ParameterTable& table, FrameFolderOptions& options);

class FrameFolder : public ScanSource {
 public:
  // Keys in scan.yaml override `defaults`. Throws Error if the folder, the list of images or a
  // camera file is missing, or a file is invalid.
  explicit FrameFolder(const std::filesystem::path& path, const FrameFolderOptions& defaults = {});

  const std::filesystem::path& path() const override { return path_; }
  const PoseGraph& graph() const override { return graph_; }
  std::string image_name(int node) const override;                       // as in ScanSource
  RgbdFrame read_frame(int node, FrameParts parts = {}) const override;  // as in ScanSource

  const FrameFolderOptions& options() const { return options_; }  // `defaults` and scan.yaml
  // Images without a partner, pose files of which no pose matches a node, and ignored links.
  const std::vector<std::string>& warnings() const override { return warnings_; }

 private:
  // File names in the folder; empty for missing images.
  struct Files {
    std::string color{};
    std::string depth{};
    std::string right{};
    double depth_stamp_offset_s = 0.0;   // RgbdFrame::depth_stamp_offset_s
    std::vector<std::size_t> cameras{};  // indices; stereo pairs: left, right, left, ...
    std::vector<double> baselines_m{};   // baselines of stereo pairs; else empty
  };
  struct Listing;

  std::filesystem::path calibration_file(const std::string& name) const;
  std::size_t add_camera(const std::string& name);
  void read_nodes();
  void read_images();
  void add_images(const Listing& color, const Listing& depth);
  void read_poses();
  void read_links();
  Pose to_base_pose(const GraphNode& node, const Pose& pose) const;

  std::filesystem::path path_;
  FrameFolderOptions options_;
  PoseGraph graph_;
  std::vector<Camera> cameras_;
  std::optional<Camera> depth_camera_;
  std::map<std::string, std::size_t> camera_of_name_;
  std::map<int, Files> files_;  // by node
  std::vector<std::string> warnings_;
};

// Opens a folder as a scan; `defaults` apply to keys that scan.yaml does not set. Throws as the
// constructor of FrameFolder does.
std::unique_ptr<ScanSource> open_frame_folder(const std::filesystem::path& path,
                                              const FrameFolderOptions& defaults = {});

}  // namespace libmap
