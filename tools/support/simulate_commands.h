// The commands `graspmap simulate WHAT`, one file each; argv begins at WHAT.
#pragma once

namespace graspmap_tools {

int simulate_cameras(int argc, char** argv);
int simulate_scan(int argc, char** argv);
int simulate_scene(int argc, char** argv);
int simulate_site(int argc, char** argv);
int simulate_terrain(int argc, char** argv);

}  // namespace graspmap_tools
