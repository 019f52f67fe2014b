// Names of the files in a folder of frames (frame_folder.h).
#pragma once

namespace libmap::frame_folder_files {

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

}  // namespace libmap::frame_folder_files
