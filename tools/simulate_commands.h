// The commands `graspmap simulate WHAT`, one file each; argv begins at WHAT.
#pragma once

namespace graspmap_tools {

int simulate_scene(int argc, char** argv);

}  // namespace graspmap_tools
