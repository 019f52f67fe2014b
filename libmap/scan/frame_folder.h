// Reader of a scan stored as a folder of plain files, in the layout of the TUM RGB-D benchmark
// (Sturm et al. 2012) or the complete layout of FrameFolderWriter.
//
//   scan.yaml               keys of FrameFolderOptions; optional
//   associations.txt        lines "stamp color stamp depth", or depth before color; if missing:
//   rgb.txt, depth.txt      lines "stamp file"; rgb.txt is optional
//   calibration.yaml        the camera (camera_io.h)
//   groundtruth.txt         true poses as TUM lines; or poses_ground_truth.tum
//   poses.tum               odometry as TUM lines; or poses_odometry.tum
//   poses_stored.tum        optimized poses as TUM lines
//   links.g2o               links between nodes; the file's vertices are not used
//   nodes.csv               instead of associations.txt: node, session, weight, stamp_s, label,
//                           color, depth, right, calibration, baseline_m, velocity, gps. Files are
//                           relative to the folder. A node's calibrations are separated by spaces:
//                           one per camera, or left and right of each pair with one baseline_m.
//   color/ depth/ right/ calibration/
//
// Without nodes.csv, color and depth are paired by stamp; nodes are numbered from 1 in the order of
// time and have the stamp of the depth image. Poses are assigned by node if all poses of a file
// have one, else by stamp: interpolated if a pose before and one after the stamp are both within
// pairing_tolerance_s, else the only pose within this tolerance.
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

// Names of these files and folders.
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

// The defaults describe folders of the TUM benchmark. Camera files are relative to the folder.
struct FrameFolderOptions {
  double depth_unit_m = 0.0002;                  // > 0: meters per unit of the 16-bit depth images
  std::string calibration = "calibration.yaml";  // camera file of the color camera
  // Camera file of a separate depth camera, in which local_transform is base_from_depth; depth is
  // then registered to color on reading. Empty: depth is already registered.
  std::string depth_calibration{};
  PoseFrame pose_frame = PoseFrame::camera;  // frame of the poses in the files
  double pairing_tolerance_s = 0.02;         // >= 0: maximum difference of paired stamps
};
void bind(ParameterTable& table, FrameFolderOptions& options);

class FrameFolder : public ScanSource {
 public:
  // scan.yaml overrides `defaults`. Throws Error if the folder, the list of images or a camera file
  // is missing, or a file is invalid.
  explicit FrameFolder(const std::filesystem::path& path, const FrameFolderOptions& defaults = {});

  const std::filesystem::path& path() const override { return path_; }
  const PoseGraph& graph() const override { return graph_; }
  std::string image_name(int node) const override;
  RgbdFrame read_frame(int node, FrameParts parts = {}) const override;

  const FrameFolderOptions& options() const { return options_; }
  // Reports unpaired images, pose files in which no pose matches a node, and ignored links.
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
