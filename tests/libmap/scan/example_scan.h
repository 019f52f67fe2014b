// A small scan of random content, and comparison of scans.
#pragma once

#include <filesystem>
#include <map>
#include <vector>

#include "libmap/camera/rgbd_frame.h"
#include "libmap/core/pose_graph.h"
#include "libmap/scan/rtabmap_writer.h"
#include "libmap/scan/scan_source.h"

namespace graspmap_test {

struct ExampleScan {
  libmap::PoseGraph graph{};
  std::map<int, libmap::RgbdFrame> frames{};  // by node
};

// Numbers that are exact in float32, and whole millimeters: a database preserves them.
libmap::Pose random_float_pose();
libmap::Camera example_camera(int width, int height);
libmap::ColorImage random_color(int width, int height);
libmap::DepthImage random_depth(int width, int height);  // some pixels are 0

// Nodes 1, 2, 5 and 9 in two sessions with all attributes of a node; links of several types.
ExampleScan example_scan();

void write_database(const std::filesystem::path& path, const ExampleScan& scan,
                    const libmap::RtabmapWriterOptions& options = {});

// Frames with single cameras.
void expect_same_frame(const libmap::RgbdFrame& actual, const libmap::RgbdFrame& expected,
                       double camera_tolerance = 0.0);
void expect_same_camera(const libmap::Camera& actual, const libmap::Camera& expected,
                        double tolerance = 0.0);
void expect_same_graph(const libmap::PoseGraph& actual, const libmap::PoseGraph& expected,
                       double pose_tolerance = 0.0);

}  // namespace graspmap_test
