// Depth fusion against the true mesh, and against the cloud that RTAB-Map's export makes of the
// same frames: every pixel to 4 m, the mean of each 1 cm voxel of a frame, all frames' points
// together. Then the surfaces made of the fused clouds, sampled evenly. Prints a table in Markdown.
#include <fmt/format.h>

#include <algorithm>
#include <chrono>
#include <filesystem>
#include <iostream>
#include <map>
#include <optional>
#include <string>
#include <tuple>
#include <vector>

#include "libmap/core/error.h"
#include "libmap/fusion/depth_fusion.h"
#include "libmap/fusion/depth_projection.h"
#include "libmap/io/mesh_io.h"
#include "libmap/mesh/ray_caster.h"
#include "libmap/mesh/surface_distance.h"
#include "libmap/poses/trajectory_error.h"
#include "libmap/scan/scan_source.h"
#include "libmap/surface/mesh_cleaning.h"
#include "libmap/surface/surface_reconstruction.h"

namespace {

using libmap::Pose;
using libmap::PoseSource;
using Points = std::vector<Eigen::Vector3d>;

constexpr double voxel_size_m = 0.01;
constexpr double max_depth_m = 4.0;
constexpr double half_site_m = 1.5;
constexpr double samples_per_m2 = 20000;

// The mean of each voxel of the lattice, in the lattice's order.
Points voxel_means(const Points& points) {
  std::map<std::tuple<int, int, int>, std::pair<Eigen::Vector3d, double>> sums;
  for (const Eigen::Vector3d& point : points) {
    const Eigen::Vector3i cell = (point / voxel_size_m).array().floor().cast<int>();
    auto& [sum, count] =
        sums.try_emplace({cell.x(), cell.y(), cell.z()}, Eigen::Vector3d::Zero(), 0.0)
            .first->second;
    sum += point;
    count += 1;
  }
  Points means;
  means.reserve(sums.size());
  for (const auto& [cell, sum] : sums) means.push_back(sum.first / sum.second);
  return means;
}

// Every measurement up to the greatest depth, in the camera's optical frame.
Points back_project(const libmap::DepthImage& depth, const libmap::Camera& camera,
                    double max_depth) {
  const std::vector<Eigen::Vector2d> rays = ray_table(camera);
  Points points;
  for (std::size_t n = 0; n < rays.size(); ++n) {
    const auto z = static_cast<double>(depth.pixels[n]);
    if (z >= 0.01 && z <= max_depth && rays[n].allFinite())
      points.emplace_back(rays[n].x() * z, rays[n].y() * z, z);
  }
  return points;
}

struct Baselines {
  Points each_frame;  // as RTAB-Map's export
  Points all_frames;  // one lattice for all of them
};

Baselines make_baselines(const libmap::ScanSource& scan, const libmap::Trajectory& poses) {
  Baselines made;
  Points all;
  for (const libmap::TrajectoryPose& pose : poses) {
    const libmap::RgbdFrame frame = scan.read_frame(pose.node, {.color = false, .depth = true});
    for (const libmap::CameraView& view : camera_views(frame)) {
      const Pose world_from_camera = pose.world_from_base * view.depth_camera.base_from_camera;
      const Points measured = back_project(view.depth, view.depth_camera, max_depth_m);
      for (const Eigen::Vector3d& point : voxel_means(measured))
        made.each_frame.push_back(world_from_camera * point);
      for (const Eigen::Vector3d& point : measured) all.push_back(world_from_camera * point);
    }
  }
  made.all_frames = voxel_means(all);
  return made;
}

// The mesh lies in the frame of the true poses turned by -90 degrees about z.
Pose mesh_from_truth() { return libmap::make_pose_from_rpy({0, 0, 0}, {0, 0, -90}); }

// Evenly spread samples of the cleaned surface with cells as wide as the voxels.
Points surface_of(const libmap::PointCloud& cloud) {
  libmap::SurfaceReconstructionOptions options;
  options.cell_size_m = voxel_size_m;
  const libmap::TriangleMesh mesh =
      libmap::clean_mesh(libmap::reconstruct_surface(cloud, options).mesh).mesh;
  Points points;
  for (const libmap::SurfacePoint& sample : libmap::sample_surface(mesh, samples_per_m2, 1))
    points.push_back(sample.position);
  return points;
}

struct Truth {
  libmap::TriangleMesh mesh;
  Points seen;  // of its surface, by the true cameras
};

// Returns true if a camera sees the sample: in the image, near enough, nothing of the mesh before
// it.
bool sees(const libmap::Camera& camera, const Pose& mesh_from_camera,
          const libmap::RayCaster& caster, const Eigen::Vector3d& sample) {
  constexpr double sight_margin =
      2e-3;  // of the way to the sample: what is met nearer is before it
  const Eigen::Vector3d in_camera = mesh_from_camera.inverse() * sample;
  if (in_camera.z() > max_depth_m) return false;
  const auto pixel = project_point(camera, in_camera);
  if (!pixel || !(pixel->x() >= -0.5 && pixel->y() >= -0.5) ||
      !(pixel->x() <= camera.width - 0.5 && pixel->y() <= camera.height - 0.5))
    return false;
  const Eigen::Vector3d eye = mesh_from_camera.translation();
  return !caster.cast(eye, sample - eye, 0.0, 1.0 - sight_margin);
}

void find_seen(Truth& truth, const libmap::ScanSource& scan) {
  std::vector<std::pair<libmap::Camera, Pose>> cameras;
  for (const auto& pose : trajectory_of(scan.graph(), PoseSource::ground_truth)) {
    const libmap::RgbdFrame frame = scan.read_frame(pose.node, {.color = false, .depth = true});
    for (const libmap::CameraView& view : camera_views(frame))
      cameras.emplace_back(view.depth_camera, mesh_from_truth() * pose.world_from_base *
                                                  view.depth_camera.base_from_camera);
  }
  const libmap::RayCaster caster(truth.mesh);
  for (const libmap::SurfacePoint& sample : sample_surface(truth.mesh, samples_per_m2, 1))
    if (std::any_of(cameras.begin(), cameras.end(), [&](const auto& camera) {
          return sees(camera.first, camera.second, caster, sample.position);
        }))
      truth.seen.push_back(sample.position);
}

bool is_inside_site(const Eigen::Vector3d& point) {
  return point.head<2>().cwiseAbs().maxCoeff() <= half_site_m;
}

void print_row(const std::string& scan, const std::string& poses, const std::string& name,
               const Points& cloud, const Pose& mesh_from_cloud, const Truth& truth,
               std::optional<double> seconds = std::nullopt) {
  Points moved;
  Points inside;
  for (const Eigen::Vector3d& point : cloud) {
    moved.push_back(mesh_from_cloud * point);
    if (is_inside_site(moved.back())) inside.push_back(moved.back());
  }
  const auto statistics = libmap::distance_statistics(distances_to_surface(inside, truth.mesh));
  const std::vector<bool> flags = libmap::covered(truth.seen, moved, voxel_size_m);
  std::vector<bool> flags_inside;
  for (std::size_t n = 0; n < flags.size(); ++n)
    if (is_inside_site(truth.seen[n])) flags_inside.push_back(flags[n]);
  std::cout << fmt::format(
      "| {} | {} | {} | {} | {:.2f} | {:.2f} | {:.2f} | {:.2f} | {:.2f} | {} |\n", scan, poses,
      name, cloud.size(), 1e3 * statistics.rmse_m, 1e3 * statistics.median_m,
      1e3 * statistics.p95_m, 1e2 * libmap::fraction_of(flags),
      1e2 * libmap::fraction_of(flags_inside), seconds ? fmt::format("{:.2f}", *seconds) : "");
  std::cout.flush();
}

void run(const std::filesystem::path& folder) {
  Truth truth;
  truth.mesh = libmap::read_mesh(folder / "site_ground_truth_mesh.ply").mesh;
  std::cout << "| scan | poses | cloud | points | RMSE mm | median mm | 95 % mm | covered % | "
               "covered inside % | s |\n|---|---|---|---|---|---|---|---|---|---|\n";
  for (const std::string name : {"site_full", "site_drift"}) {
    const auto scan = libmap::open_scan(folder / (name + ".db"));
    const auto true_poses = trajectory_of(scan->graph(), PoseSource::ground_truth);
    truth.seen.clear();
    find_seen(truth, *scan);
    for (const PoseSource source :
         {PoseSource::ground_truth, PoseSource::optimized, PoseSource::odometry}) {
      const libmap::Trajectory poses = trajectory_of(scan->graph(), source);
      // By the poses that a cloud was made with.
      const auto mesh_from = [&](const libmap::Trajectory& used) {
        if (source == PoseSource::ground_truth) return mesh_from_truth();
        return Pose(mesh_from_truth() *
                    absolute_trajectory_error(used, true_poses).truth_from_estimate);
      };
      const Pose mesh_from_given = mesh_from(poses);
      const std::string poses_name = to_text(source);
      const Baselines baselines = make_baselines(*scan, poses);
      print_row(name, poses_name, "voxel means of each frame (RTAB-Map)", baselines.each_frame,
                mesh_from_given, truth);
      print_row(name, poses_name, "voxel means of all frames", baselines.all_frames,
                mesh_from_given, truth);
      const auto start = std::chrono::steady_clock::now();
      const libmap::DepthFusionResult fused = fuse_depth(*scan, poses);
      const std::chrono::duration<double> taken = std::chrono::steady_clock::now() - start;
      const Pose mesh_from_fused = mesh_from(fused.poses);
      print_row(name, poses_name, "fuse_depth", fused.cloud.positions, mesh_from_fused, truth,
                taken.count());
      const auto meshing = std::chrono::steady_clock::now();
      const Points surface = surface_of(fused.cloud);
      const std::chrono::duration<double> meshed = std::chrono::steady_clock::now() - meshing;
      print_row(name, poses_name, "surface of it", surface, mesh_from_fused, truth, meshed.count());
    }
  }
}

}  // namespace

int main(int argc, char** argv) {
  if (argc != 2) {
    std::cerr << "usage: fusion_accuracy FOLDER, which contains site_full.db, site_drift.db and "
                 "site_ground_truth_mesh.ply\n";
    return 2;
  }
  try {
    run(argv[1]);
  } catch (const libmap::Error& error) {
    std::cerr << "fusion_accuracy: error: " << error.what() << "\n";
    return 3;
  }
  return 0;
}
