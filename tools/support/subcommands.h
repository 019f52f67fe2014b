// Entry points of commands with several usages; comments show the usage. argv[0] is the command.
#pragma once

#include <string>

namespace graspmap_tools {

int compare_edges(int argc, char** argv);  // compare SITE --edges
int convert_bag(int argc, char** argv);    // convert BAG, and ... -o BAG
int convert_world(int argc, char** argv);  // convert SITE -o OUT.world
int convert_scan(int argc, char** argv);   // convert SCAN
int fuse_rig(int argc, char** argv);       // fuse RIG_FOLDER

// Usages of `simulate SUBCOMMAND`. argv[0] is SUBCOMMAND.
int simulate_cameras(int argc, char** argv);
int simulate_scan(int argc, char** argv);
int simulate_scene(int argc, char** argv);
int simulate_site(int argc, char** argv);
int simulate_terrain(int argc, char** argv);

// Returns true for a path that convert_world writes: a name that ends in .world.
bool is_world_path(const std::string& path);

// Returns true for a possible scan: a name *.db, or a folder that is no tile store or pose folder.
bool is_scan_path(const std::string& path);

}  // namespace graspmap_tools
