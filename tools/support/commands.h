// Names and summaries of the commands, for `graspmap --help`, each command's --help, completion,
// man pages and the manual's table.
#pragma once

#include <string_view>

namespace graspmap_tools {

struct CommandEntry {
  std::string_view group;
  std::string_view name;
  std::string_view summary;
};

constexpr CommandEntry commands[] = {
    {"Scan", "simulate", "simulate terrains, sites, scans and depth images with ground truth"},
    {"Scan", "calibrate", "calibrate a camera from images of a chessboard"},
    {"Scan", "refine", "refine the poses of a scan: loop closures, pose graph, bundle adjustment"},
    {"Scan", "fuse", "fuse the depth images of a scan or a camera rig into one cloud"},
    {"Surface", "mesh", "reconstruct a surface from a cloud"},
    {"Surface", "texture", "texture a mesh with the images of its scan"},
    {"Surface", "crop", "level a cloud or mesh and crop it to the test site"},
    {"Surface", "resample", "sample a surface evenly (Poisson disk)"},
    {"Surface", "compare", "measure distances between surfaces, or height errors along site edges"},
    {"Map", "mask", "write the voxel mask of a gripper as text, cloud or image"},
    {"Map", "score", "compute the graspability map of a terrain, tile by tile"},
    {"Map", "analyze", "analyze a map, compare it with another, or tabulate several maps"},
    {"Map", "footholds", "list the best footholds of a map for a step planner"},
    {"Field test", "grasp", "test a gripper's hold at listed locations of a mesh, by simulation"},
    {"Field test", "lookup", "look up a map's values at listed locations"},
    {"Field test", "evaluate",
     "evaluate looked-up scores against a field test: ROC, AUC, accuracy"},
    {"Pictures and files", "render", "draw clouds, meshes and maps, one or several side by side"},
    {"Pictures and files", "report", "write one HTML report of a whole run"},
    {"Pictures and files", "info", "describe a scan, camera, cloud, mesh, map, tile store or bag"},
    {"Pictures and files", "convert",
     "convert scans, poses, clouds, meshes, maps and ROS bags; merge tiles"},
};

// Returns the command's summary; empty for an unknown name.
constexpr std::string_view summary_of(std::string_view name) {
  for (const CommandEntry& command : commands)
    if (command.name == name) return command.summary;
  return {};
}

}  // namespace graspmap_tools
