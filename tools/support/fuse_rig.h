// `graspmap fuse FOLDER` of a camera rig: one cloud in the robot's frame.
#pragma once

namespace graspmap_tools {

int fuse_rig(int argc, char** argv);

}  // namespace graspmap_tools
