// Determines the frames of listed points and of maps, and transforms between them, from manifests.
#pragma once

#include <Eigen/Core>

#include "libmap/core/pose.h"
#include "libmap/core/table.h"
#include "tools/support/run.h"

namespace graspmap_tools {

// Frame of the points in a table of locations.
// - input: frame of the cloud that was scored.
// - terrain: terrain frame of the map.
// - map: frame of the cloud or mesh before `graspmap crop`, or of the mesh of `simulate cameras`.
// - automatic: as in the manifest of the points' file; input without a manifest.
enum class PointFrame { input, terrain, map, automatic };
// Names without `automatic`, for points that have no file.
using PointFrameNames = std::vector<std::pair<std::string, PointFrame>>;
PointFrameNames point_frame_names();
// Names with `automatic`.
PointFrameNames listed_point_frame_names();

// Returns the frame of the points in the file `points`: `asked`, or if it is automatic, the frame
// by the manifest, which is also stored in the run's parameter points_frame. Throws Error if these
// points are in the terrain frame of another map than `map`.
PointFrame frame_of_points(const std::string& points, PointFrame asked, const std::string& map,
                           Run& run);

// Returns the columns x, y, z, in meters. Throws Error naming the file, row and column of a missing
// or invalid value, and for a table without rows.
std::vector<Eigen::Vector3d> positions_of(const libmap::Table& table);

// Name of the transform from the scored cloud to the terrain frame. Its value; nullptr if missing.
inline constexpr const char* terrain_from_input_name = "terrain_from_input";
const libmap::Pose* terrain_from_input_of(const std::optional<libmap::Manifest>& manifest);

// Name of the transform that `crop` and `simulate cameras` write and later commands copy. The
// source frame is always that of the cloud or mesh before the first of these two commands.
inline constexpr const char* site_from_map_name = "site_from_map";

// Returns the transform from the frame of the cloud or mesh before `crop` or `simulate cameras` to
// the frame of the points in `file`, by the file's manifest; nullopt if the manifest has none. For
// a map in the terrain frame without site_from_map, it is the transform from the scored cloud.
std::optional<libmap::Pose> site_from_map_of(const std::string& file);
std::optional<libmap::Pose> site_from_map_of(const libmap::Manifest& manifest);

// Name of the transform to the frame of a scan's true poses.
inline constexpr const char* truth_from_poses_name = "ground_truth_from_poses";

// Returns true if, by its manifest, `file` or its input is in the frame of the scan's true poses.
bool is_from_true_frame(const std::string& file);

// Copies site_from_map, ground_truth_from_poses and georeference from the manifest of `input` to
// the run's manifest, for an output in the same frame.
void copy_transforms(const std::string& input, Run& run);
// As copy_transforms; also copies the name of the frame.
void copy_frame(const std::string& input, Run& run);
// For a map made from the map with the manifest `source`: copies frame, transforms, georeference,
// and those parameters and results that the run's manifest does not have.
void copy_missing_entries(const libmap::Manifest& source, Run& run);
// Copy only ground_truth_from_poses, or only the georeference, which a DEM (.tif) itself contains.
void copy_truth_transform(const std::string& input, Run& run);
void copy_georeference(const std::string& input, Run& run);

// Copies terrain_from_input from the map's manifest, for an output in the terrain frame of `map`.
void copy_terrain_transform(const std::string& map, Run& run);

// Returns the transform from the frame of listed points to the frame of the points in `map`, from
// the manifest of `map`; the identity and a warning if there is no manifest. Throws Error if
// `points_frame` is map and the manifest has no site_from_map.
libmap::Pose map_from_points(const std::string& map, PointFrame points_frame, Run& run);

// Return the transforms from the scored cloud to the points of a map, and from these points to the
// terrain frame, by the map's manifest; the identity if the manifest or transform is missing.
libmap::Pose map_from_input(const std::optional<libmap::Manifest>& manifest);
libmap::Pose terrain_from_map(const std::optional<libmap::Manifest>& manifest);

// Returns the upward normal of the regression plane in the frame of a map's points, from the map's
// manifest; the z axis if it has none.
Eigen::Vector3d up_of_map(const std::optional<libmap::Manifest>& manifest);

}  // namespace graspmap_tools
