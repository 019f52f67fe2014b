// Scenes of points with ground truth for bundle adjustment.
#pragma once

#include <algorithm>
#include <cmath>
#include <map>
#include <utility>
#include <vector>

#include "libmap/optimize/bundle_adjustment.h"
#include "tests/libmap/features/synthetic_features.h"

namespace graspmap_test {

struct Scene {
  std::map<int, libmap::Pose> truth;
  std::map<int, libmap::Pose> start;
  std::vector<libmap::FrameFeatures> frames;
  std::vector<libmap::FeatureTrack> tracks;
  std::vector<libmap::GraphComponent> components;
};

inline Scene scene_of(int frames, const FeatureNoise& noise,
                      const libmap::Camera& camera = feature_camera()) {
  Scene scene;
  const auto points = random_points(150);
  scene.components = {{{}, 1}};
  for (int node = 1; node <= frames; ++node) {
    const libmap::Pose pose = libmap::moved(libmap::Pose::Identity(), random_step(0.4, 0.2));
    scene.truth[node] = pose;
    scene.start[node] = node == 1 ? pose : libmap::moved(pose, random_step(0.01, 0.01));
    scene.frames.push_back(see_points(node, pose, points, noise, camera));
    scene.components[0].nodes.push_back(node);
  }
  for (std::uint32_t n = 0; n < points.size(); ++n) {
    libmap::FeatureTrack track;
    for (std::uint32_t f = 0; f < scene.frames.size(); ++f)
      if ((n + f) % 3 != 0) track.observations.push_back({f, n});
    scene.tracks.push_back(track);
  }
  return scene;
}

inline double error_of_poses(const Scene& scene, const std::map<int, libmap::Pose>& poses) {
  double largest = 0.0;
  for (const auto& [node, pose] : scene.truth)
    largest = std::max(largest, libmap::step_between(pose, poses.at(node)).norm());
  return largest;
}

struct Way {
  std::vector<libmap::FrameFeatures> frames;
  std::map<int, libmap::Pose> truth;
  std::vector<libmap::FeatureTrack> tracks;
  std::vector<libmap::GraphComponent> components = {{{}, 1}};
};

// A rolling shutter camera that sways with up to 0.6 m/s in front of `points`. At constant speed,
// row times would not be distinguishable from positions of the points.
inline Way way_with_rows(const std::vector<Eigen::Vector3d>& points, double rolling_shutter_s,
                         int frames = 10) {
  Way way;
  const auto pose_at = [](double time_s) { return beside(0.4 * std::sin(1.5 * time_s)); };
  for (int node = 1; node <= frames; ++node) {
    const double stamp_s = 0.3 * node;
    libmap::FrameFeatures frame = see_points(node, pose_at(stamp_s), points);
    frame.stamp_s = stamp_s;
    for (std::size_t n = 0; n < points.size(); ++n)
      for (int round = 0; round < 4; ++round) {
        const double late_s =
            rolling_shutter_s * libmap::row_fraction(frame.features[n], frame.cameras[0]);
        frame.features[n] = see_points(node, pose_at(stamp_s + late_s), {points[n]}).features[0];
      }
    way.truth[node] = pose_at(stamp_s);
    way.components[0].nodes.push_back(node);
    way.frames.push_back(std::move(frame));
  }
  for (std::uint32_t n = 0; n < points.size(); ++n) {
    libmap::FeatureTrack track;
    for (std::uint32_t f = 0; f < way.frames.size(); ++f) track.observations.push_back({f, n});
    way.tracks.push_back(track);
  }
  return way;
}

}  // namespace graspmap_test
