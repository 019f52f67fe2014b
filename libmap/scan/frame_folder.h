// A scan as a folder of plain files: the layout of the TUM RGB-D benchmark (Sturm et al. 2012), and
// the one that FrameFolderWriter writes, which holds all that a scan has.
//
//   scan.yaml               FrameFolderOptions; may be missing
//   associations.txt        "stamp color stamp depth" a line, or depth before color; else
//   rgb.txt, depth.txt      "stamp file" a line, paired by time; depth.txt alone will do
//   calibration.yaml        the camera (camera_io.h)
//   groundtruth.txt         true poses as TUM lines, or poses_ground_truth.tum
//   poses.tum               odometry, or poses_odometry.tum
//   poses_stored.tum        optimized poses
//   links.g2o               links between nodes; its vertices are not used
//   nodes.csv               in place of associations.txt: node, session, weight, stamp_s, label,
//                           color, depth, right, calibration, baseline_m, velocity, gps; files
//                           relative to the folder; several calibrations with spaces between
//                           them, and as many baselines as there are stereo pairs
//   color/ depth/ right/ calibration/
//
// Without nodes.csv nodes count from 1 in the order of time and have the stamp of their depth.
// Poses belong to the node that they name or, without nodes, to the stamps: between two poses that
// lie within the tolerance they are interpolated, else the nearest within it is taken.
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

// Names of the files.
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

// What a file of poses moves: the camera's optical frame, or the base.
enum class PoseFrame { camera, base };
std::vector<std::pair<std::string, PoseFrame>> pose_frame_names();

// Defaults are those of the TUM benchmark.
struct FrameFolderOptions {
  double depth_unit_m = 0.0002;  // meters a unit of the 16-bit depth images
  std::string calibration = "calibration.yaml";
  // Of a depth camera at another place, whose images are registered to color when they are read;
  // its local_transform is base_from_depth. Empty: they are registered.
  std::string depth_calibration{};
  PoseFrame pose_frame = PoseFrame::camera;  // whose poses the files hold: the optical frame's
  double pairing_tolerance_s = 0.02;
};
void bind(ParameterTable& table, FrameFolderOptions& options);

class FrameFolder : public ScanSource {
 public:
  // scan.yaml stands over `defaults`. Throws Error: no such folder, neither of the lists of images,
  // no calibration, a list that is broken.
  explicit FrameFolder(const std::filesystem::path& path, const FrameFolderOptions& defaults = {});

  const std::filesystem::path& path() const override { return path_; }
  const PoseGraph& graph() const override { return graph_; }
  std::string image_name(int node) const override;
  RgbdFrame read_frame(int node, FrameParts parts = {}) const override;

  const FrameFolderOptions& options() const { return options_; }
  // Images without a partner, poses and links that belong to no node.
  const std::vector<std::string>& warnings() const override { return warnings_; }

 private:
  // Names in the folder; empty where there is no such image.
  struct Files {
    std::string color{};
    std::string depth{};
    std::string right{};
    double depth_later_s = 0.0;          // RgbdFrame::depth_later_s
    std::vector<std::size_t> cameras{};  // indices; of stereo pairs left, right, left, ...
    std::vector<double> baselines_m{};   // of stereo pairs; else empty
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

// The folder as a scan; `defaults` stand where it has no scan.yaml. Throws Error naming the file
// that is missing or broken.
std::unique_ptr<ScanSource> open_frame_folder(const std::filesystem::path& path,
                                              const FrameFolderOptions& defaults = {});

}  // namespace libmap
