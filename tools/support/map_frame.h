// Points that a user lists, carried into the frame of a map.
#pragma once

#include <Eigen/Core>

#include "libmap/core/pose.h"
#include "libmap/core/table.h"
#include "tools/support/run.h"

namespace graspmap_tools {

// Which frame listed points are in: that of the cloud that was scored, the terrain frame, or that
// of the map that `graspmap crop` made the site from or in which a simulated robot stood.
enum class PointFrame { input, terrain, map, automatic };
// Without `automatic`, for what comes from no file.
using PointFrameNames = std::vector<std::pair<std::string, PointFrame>>;
PointFrameNames point_frame_names();
// With it: as the manifest beside the file of points says, else `input`.
PointFrameNames listed_point_frame_names();

// The frame of the points in the file `points`: `asked`, unless that is automatic. The run's
// parameter points_frame becomes what was found. Throws Error if the points lie in the terrain
// frame of another map than `map`.
PointFrame frame_of_points(const std::string& points, PointFrame asked, const std::string& map,
                           Run& run);

// The columns x, y, z, in meters. Throws Error naming the file, the row and the column, and for a
// table without rows.
std::vector<Eigen::Vector3d> positions_of(const libmap::Table& table);

// The transform of what was scored; nullptr if the manifest has none.
inline constexpr const char* terrain_from_input_name = "terrain_from_input";
const libmap::Pose* terrain_from_input_of(const std::optional<libmap::Manifest>& manifest);

// The name of the transform that `crop` and `simulate cameras` make and that others carry on. It
// always leads from the map as it was before the first of them.
inline constexpr const char* site_from_map_name = "site_from_map";

// From the map before it was cropped, or in which a simulated robot stood, to the points in `file`,
// as the file's manifest says; nothing if it says nothing.
std::optional<libmap::Pose> site_from_map_of(const std::string& file);
std::optional<libmap::Pose> site_from_map_of(const libmap::Manifest& manifest);

// The name of the transform of what lies in the frame of a scan's true poses, or was made from
// that.
inline constexpr const char* truth_from_poses_name = "ground_truth_from_poses";

// Whether `file`, or what it was made from, lies in the frame of true poses, as its manifest says.
bool is_from_true_frame(const std::string& file);

// For an output in the frame of `input`: its manifest gets the input's site_from_map,
// ground_truth_from_poses and georeference, those that it has.
void carry_transforms(const std::string& input, Run& run);
// The same and the frame's name.
void carry_frame(const std::string& input, Run& run);
// For a map made of a map: frame, transforms, and the parameters and results that the run's
// manifest does not have itself, such as its zero plane, lattice and method.
void carry_facts(const libmap::Manifest& source, Run& run);
// One of them alone; a DEM (.tif) is a georeference itself.
void carry_truth_transform(const std::string& input, Run& run);
void carry_georeference(const std::string& input, Run& run);

// For an output in the terrain frame of `map`: its manifest gets the map's terrain_from_input.
void carry_terrain_transform(const std::string& map, Run& run);

// From the frame of listed points to that of the points in `map`, as its manifest says; the
// identity, with a warning, if it has none. Throws Error if points are in the frame of a map that
// was not cropped.
libmap::Pose map_from_points(const std::string& map, PointFrame points_frame, Run& run);

// From the cloud that was scored to the points of a map, and from these to its terrain frame, as
// the map's manifest says; the identity if it says nothing.
libmap::Pose map_from_input(const std::optional<libmap::Manifest>& manifest);
libmap::Pose terrain_from_map(const std::optional<libmap::Manifest>& manifest);

// The outside of the regression plane in the frame of a map's points, as the map's manifest says;
// the z axis if it says nothing.
Eigen::Vector3d up_of_map(const std::optional<libmap::Manifest>& manifest);

}  // namespace graspmap_tools
