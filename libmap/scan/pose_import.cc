#include "libmap/scan/pose_import.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <map>
#include <optional>
#include <set>
#include <utility>

#include "libmap/core/error.h"
#include "libmap/core/text.h"
#include "libmap/poses/stamp_pairing.h"

namespace libmap {

namespace fs = std::filesystem;

namespace {

// Pose of a camera in the file's units.
struct CameraPose {
  int node = 0;
  double stamp_s = 0.0;
  std::size_t camera = 0;
  Pose world_from_camera = Pose::Identity();
  Pose base_from_camera = Pose::Identity();
};

// Parts of an image's name that identify its node.
struct ImageName {
  std::string file;
  std::string stem;
};

ImageName split_name(const std::string& name) {
  std::string file = name.substr(name.find_last_of("/\\") + 1);
  const std::size_t point = file.find_last_of('.');
  // The digits after the last point of a stamp are decimals, not an extension.
  const bool has_extension =
      point != std::string::npos && file.find_first_not_of("0123456789", point + 1) != file.npos;
  std::string stem = has_extension ? file.substr(0, point) : file;
  return {std::move(file), std::move(stem)};
}

// Parses node and camera of "12", "000012", "000012_1".
std::optional<std::pair<int, std::size_t>> node_in_name(const std::string& stem,
                                                        const PoseGraph& graph) {
  const std::size_t bar = stem.find('_');
  const auto is_number = [](const std::string& text) {
    return !text.empty() && text.find_first_not_of("0123456789") == std::string::npos;
  };
  const std::string number = stem.substr(0, bar);
  const std::string camera = bar == std::string::npos ? "0" : stem.substr(bar + 1);
  if (graph.nodes.empty() || !is_number(number) || !is_number(camera)) return std::nullopt;
  const auto node = parse_integer(number);
  const auto index = parse_integer(camera);
  if (!node || !index || *node > graph.nodes.back().id || !graph.find_node(static_cast<int>(*node)))
    return std::nullopt;
  return std::pair{static_cast<int>(*node), static_cast<std::size_t>(*index)};
}

using NodeCameras = std::vector<std::pair<std::size_t, std::pair<int, std::size_t>>>;

// Returns the node and camera of images, by index of the image.
NodeCameras cameras_of_images(const std::vector<ImagePose>& images, const ScanSource& scan) {
  const PoseGraph& graph = scan.graph();
  std::map<std::string, int> node_of_file;
  for (const GraphNode& node : graph.nodes)
    if (const std::string name = scan.image_name(node.id); !name.empty())
      node_of_file.emplace(name, node.id);
  NodeCameras found;
  std::vector<std::size_t> stamped;
  std::vector<double> stamps;
  for (std::size_t i = 0; i < images.size(); ++i) {
    const ImageName name = split_name(images[i].image);
    if (const auto entry = node_of_file.find(name.file); entry != node_of_file.end()) {
      found.push_back({i, {entry->second, 0}});
    } else if (const auto node = node_in_name(name.stem, graph)) {
      found.push_back({i, *node});
    } else if (const auto stamp = parse_double(name.stem); stamp && std::isfinite(*stamp)) {
      stamped.push_back(i);
      stamps.push_back(*stamp);
    }
  }
  std::vector<double> node_stamps;
  for (const GraphNode& node : graph.nodes) node_stamps.push_back(node.stamp_s);
  for (const auto& [i, j] : pair_by_stamp(stamps, node_stamps, pairing_tolerance_s))
    found.push_back({stamped[i], {graph.nodes[j].id, 0}});
  return found;
}

Pose base_from_camera(const ScanSource& scan, int node, std::size_t camera) {
  const std::vector<Camera> cameras =
      scan.read_frame(node, {.color = false, .depth = false}).cameras;
  if (camera >= cameras.size())
    throw Error("no such camera", {.file = scan.path().string(),
                                   .field = "camera of node " + std::to_string(node),
                                   .value = std::to_string(camera),
                                   .bound = "< " + std::to_string(cameras.size())});
  return cameras[camera].base_from_camera;
}

// Adds a pose if its camera exists; otherwise, appends a warning.
void add_camera(const ScanSource& scan, CameraPose pose, std::vector<CameraPose>& poses,
                std::vector<std::string>& warnings) {
  try {
    pose.base_from_camera = base_from_camera(scan, pose.node, pose.camera);
    poses.push_back(pose);
  } catch (const Error& error) {
    warnings.push_back(std::string(error.what()) + "; the pose is dropped");
  }
}

std::vector<CameraPose> poses_of_images(const std::vector<ImagePose>& images,
                                        const ScanSource& scan,
                                        std::vector<std::string>& warnings) {
  std::vector<CameraPose> poses;
  std::map<std::pair<int, std::size_t>, std::string> known;
  for (const auto& [index, node_camera] : cameras_of_images(images, scan)) {
    const auto& [node, camera] = node_camera;
    const auto [earlier, is_new] = known.emplace(node_camera, images[index].image);
    if (!is_new)
      throw Error(earlier->second + " is of the same camera",
                  {.field = "image of node " + std::to_string(node), .value = images[index].image});
    add_camera(
        scan,
        {node, scan.graph().find_node(node)->stamp_s, camera, images[index].world_from_camera},
        poses, warnings);
  }
  if (known.empty())
    throw Error("no image name matches a node of the scan",
                {.field = "first image",
                 .value = images.front().image,
                 .bound = "the scan's file name, a node number or a stamp"});
  return poses;
}

std::vector<CameraPose> poses_of_nodes(const NodeTrajectory& trajectory, const ScanSource& scan,
                                       PoseFrame frame, std::vector<std::string>& warnings) {
  std::vector<CameraPose> poses;
  for (const TrajectoryPose& pose : trajectory.poses) {
    const CameraPose given = {pose.node, pose.stamp_s, 0, pose.world_from_base};
    if (frame == PoseFrame::camera)
      add_camera(scan, given, poses, warnings);
    else
      poses.push_back(given);
  }
  return poses;
}

// Returns the scan's poses by node: odometry of the longest session (metric; each session has its
// own frame), else stored poses.
std::map<int, Pose> own_poses(const PoseGraph& graph) {
  std::map<int, std::map<int, Pose>> sessions;
  for (const TrajectoryPose& pose : trajectory_of(graph, PoseSource::odometry))
    sessions[graph.find_node(pose.node)->session].emplace(pose.node, pose.world_from_base);
  std::map<int, Pose> poses;
  for (auto& [session, of_session] : sessions)
    if (of_session.size() > poses.size()) poses = std::move(of_session);
  if (!poses.empty()) return poses;
  for (const TrajectoryPose& pose : trajectory_of(graph, PoseSource::optimized))
    poses.emplace(pose.node, pose.world_from_base);
  return poses;
}

double fitting_scale(const std::vector<CameraPose>& poses, const std::map<int, Pose>& own) {
  std::vector<Eigen::Vector3d> given;
  std::vector<Eigen::Vector3d> wanted;
  for (const CameraPose& pose : poses) {
    const auto known_pose = own.find(pose.node);
    if (known_pose == own.end()) continue;
    given.push_back(pose.world_from_camera.translation());
    wanted.push_back((known_pose->second * pose.base_from_camera).translation());
  }
  const auto matrix_of = [](const std::vector<Eigen::Vector3d>& points) {
    Eigen::Matrix3Xd matrix(3, static_cast<Eigen::Index>(points.size()));
    for (std::size_t i = 0; i < points.size(); ++i)
      matrix.col(static_cast<Eigen::Index>(i)) = points[i];
    return matrix;
  };
  double scale = 0.0;
  if (given.size() >= 3) {
    const Eigen::Matrix4d similarity = align_points(matrix_of(given), matrix_of(wanted), true);
    scale = std::cbrt(similarity.topLeftCorner<3, 3>().determinant());
  }
  if (given.size() < 3)
    throw Error("too few to determine the scale; set poses_scale",
                {.field = "number of poses that the scan also has",
                 .value = std::to_string(given.size()),
                 .bound = ">= 3"});
  if (!(scale > 0.0) || !std::isfinite(scale))
    throw Error(
        "the positions of the given poses and of the scan's poses do not determine the scale, for "
        "example because they coincide; set poses_scale");
  return scale;
}

Pose mean_of(const std::vector<Pose>& poses) {
  if (poses.size() == 1) return poses.front();
  Eigen::Matrix3d rotations = Eigen::Matrix3d::Zero();
  Eigen::Vector3d translations = Eigen::Vector3d::Zero();
  for (const Pose& pose : poses) {
    rotations += pose.linear();
    translations += pose.translation();
  }
  Pose mean = Pose::Identity();
  mean.linear() = nearest_rotation(rotations);
  mean.translation() = translations / static_cast<double>(poses.size());
  return mean;
}

void bind_to_nodes(const std::vector<CameraPose>& cameras, ImportedPoses& result) {
  std::map<int, std::vector<Pose>> poses;
  std::map<int, double> stamps;
  for (const CameraPose& camera : cameras) {
    Pose world_from_camera = camera.world_from_camera;
    world_from_camera.translation() *= result.scale;
    poses[camera.node].push_back(world_from_camera * camera.base_from_camera.inverse());
    stamps.emplace(camera.node, camera.stamp_s);
  }
  for (const auto& [node, candidates] : poses) {
    const Pose mean = mean_of(candidates);
    for (const Pose& pose : candidates)
      result.max_rig_deviation_m =
          std::max(result.max_rig_deviation_m, (pose.translation() - mean.translation()).norm());
    result.trajectory.poses.push_back({node, stamps.at(node), mean});
  }
}

// Compares the motion between neighbors with the scan's poses and adds warnings.
void check_motion(const std::map<int, Pose>& own, ImportedPoses& result) {
  constexpr std::size_t fewest_steps = 5;
  constexpr double largest_ratio = 1.5;
  constexpr double smallest_turn_rad = 0.05;  // per step; axes of smaller rotations are noise
  constexpr double degrees = 180.0 / M_PI;
  double length_m = 0.0;
  double own_length_m = 0.0;
  double turn_rad = 0.0;
  double difference_rad = 0.0;
  std::size_t steps = 0;
  const Trajectory& poses = result.trajectory.poses;
  for (std::size_t i = 1; i < poses.size(); ++i) {
    const auto from = own.find(poses[i - 1].node);
    const auto to = own.find(poses[i].node);
    if (from == own.end() || to == own.end()) continue;
    const Pose step = poses[i - 1].world_from_base.inverse() * poses[i].world_from_base;
    const Pose own_step = from->second.inverse() * to->second;
    length_m += step.translation().norm();
    own_length_m += own_step.translation().norm();
    turn_rad += Eigen::AngleAxisd(own_step.linear()).angle();
    difference_rad += Eigen::AngleAxisd(own_step.linear().transpose() * step.linear()).angle();
    ++steps;
  }
  if (steps < fewest_steps) return;
  const auto mean = [&](double sum) { return sum / static_cast<double>(steps); };
  if (length_m > largest_ratio * own_length_m || own_length_m > largest_ratio * length_m)
    result.warnings.push_back("the mean distance between successive poses is " +
                              to_fixed_text(1e3 * mean(length_m), 0) + " mm, but " +
                              to_fixed_text(1e3 * mean(own_length_m), 0) +
                              " mm in the scan; check the unit (poses_scale)");
  if (mean(turn_rad) > smallest_turn_rad && difference_rad > 0.5 * turn_rad)
    result.warnings.push_back("rotations between successive poses differ from those in the scan, " +
                              to_fixed_text(degrees * mean(turn_rad), 1) + " deg on average, by " +
                              to_fixed_text(degrees * mean(difference_rad), 1) +
                              " deg; check the axes (poses_format, poses_of)");
}

}  // namespace

Pose with_quaternion_order(const Pose& read, QuaternionOrder order) {
  if (order == QuaternionOrder::xyzw) return read;
  const Eigen::Quaterniond q(read.linear());
  Pose pose = read;
  pose.linear() = Eigen::Quaterniond(q.x(), q.y(), q.z(), q.w()).toRotationMatrix();
  return pose;
}

void bind(ParameterTable& table, PoseImportOptions& options) {
  table.add("poses_format", options.format, trajectory_format_names(),
            "format of the pose file; auto: by extension, else by content; tum-motion-capture and "
            "kitti-optical: RTAB-Map's export formats 1 and 2 with special axes");
  table.add("poses_quaternion", options.quaternion,
            {{"xyzw", QuaternionOrder::xyzw}, {"wxyz", QuaternionOrder::wxyz}},
            "order of the components of quaternions in the pose file, for TUM and g2o");
  table.add("poses_of", options.frame, pose_frame_names(),
            "frame of the poses in the pose file; base: robot's base; camera: optical frame of "
            "the first camera, always used for COLMAP, nerfstudio and Open3D");
  table.add("poses_scale", options.scale, not_negative,
            "meters per unit of the positions in the pose file (COLMAP's unit is arbitrary); 0: "
            "from the best fit to the scan's odometry");
}

ImportedPoses import_poses(const fs::path& path, const ScanSource& scan,
                           const PoseImportOptions& options) {
  TrajectoryFile file = read_trajectory(path, options.format);
  for (TrajectoryPose& pose : file.poses)
    pose.world_from_base = with_quaternion_order(pose.world_from_base, options.quaternion);
  return in_file(path, [&] {
    ImportedPoses result;
    std::vector<CameraPose> cameras;
    if (file.images.empty()) {
      const NodeTrajectory assigned = assign_nodes(file.poses, scan.graph());
      const PoseFrame frame = file.of_cameras ? PoseFrame::camera : options.frame;
      cameras = poses_of_nodes(assigned, scan, frame, result.warnings);
      result.poses_in_file = file.poses.size();
    } else {
      cameras = poses_of_images(file.images, scan, result.warnings);
      result.poses_in_file = file.images.size();
    }
    result.trajectory.unmatched = result.poses_in_file - cameras.size();
    const std::map<int, Pose> own = own_poses(scan.graph());
    result.scale = options.scale > 0.0 ? options.scale : fitting_scale(cameras, own);
    bind_to_nodes(cameras, result);
    check_motion(own, result);
    return result;
  });
}

}  // namespace libmap
