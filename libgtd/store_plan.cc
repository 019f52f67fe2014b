#include "libgtd/store_plan.h"

#include <algorithm>

#include "libgtd/tile_detection.h"
#include "libmap/core/error.h"

namespace libgtd {

namespace {

constexpr const char* opposing_normals = "opposing_normals";

// The key of the plan matches, but another part of it does not.
libmap::Error not_of_this_terrain(const std::filesystem::path& plan_file, const char* field) {
  return libmap::Error(
      "was computed for another terrain or other parameters; use --force to start again",
      {.file = plan_file.string(), .field = field});
}

bool has_tiles_of(const TilePlan& plan, const Scenario& scenario) {
  return plan.index.tile_voxels == tile_voxels(scenario) &&
         plan.index.lattice.voxel_size_m == scenario.voxel_size_m &&
         plan.index.lattice.origin_m == VoxelLattice{}.origin_m;
}

bool is_same_file(const TerrainFile& a, const TerrainFile& b) {
  return a.input.sha256 == b.input.sha256;
}

}  // namespace

StoreTiling::StoreTiling(const DetectionOptions& detection)
    : mask(make_gripper_mask(gripper_of(detection), mask_options(detection.scenario))),
      tile_voxels(libgtd::tile_voxels(detection.scenario)),
      halo_voxels(libgtd::halo_voxels(mask, detection.scenario)) {}

void set_frame(const TerrainFrame& frame, const StoreTiling& tiling, TilePlan& plan) {
  TileStoreIndex& index = plan.index;
  index.lattice = frame.lattice;
  index.tile_voxels = tiling.tile_voxels;
  index.min = frame.min;
  index.max = frame.max;
  libmap::Manifest& manifest = index.manifest;
  std::uint64_t points = 0;
  for (const TerrainFile& file : plan.terrain) points += file.points;
  const auto add = [&](const char* name, libmap::ManifestValue value) {
    manifest.results.emplace_back(name, std::move(value));
  };
  const Eigen::Vector3d& origin = frame.lattice.origin_m;
  add("lattice_origin_m", std::vector<double>{origin.x(), origin.y(), origin.z()});
  add("input_points", static_cast<std::int64_t>(points));
  plan.has_plane = frame.plane.has_value();
  libmap::Pose terrain_from_input = libmap::Pose::Identity();
  if (frame.plane) {
    plan.centroid = frame.plane->centroid;
    terrain_from_input = frame.plane->terrain_from_input;
    add("plane_rmse_m", frame.plane->rmse_m);
    add("up_source", std::string(to_text(frame.plane->up_source)));
    if (frame.plane->normals_up) add(opposing_normals, frame.plane->opposing_normals);
  }
  manifest.transforms.emplace_back("terrain_from_input", terrain_from_input);
  add("mask_side_voxels", std::int64_t{tiling.mask.side});
  add("mask_layers", std::int64_t{tiling.mask.layers});
}

TerrainFrame frame_of(const TilePlan& plan, const DetectionOptions& detection,
                      const std::filesystem::path& plan_file) {
  if (!has_tiles_of(plan, detection.scenario))
    throw not_of_this_terrain(plan_file, "tile_voxels and lattice");
  TerrainFrame frame;
  frame.lattice = plan.index.lattice;
  frame.min = plan.index.min;
  frame.max = plan.index.max;
  if (!plan.has_plane) return frame;
  frame.plane = RegressionPlane{};
  frame.plane->centroid = plan.centroid;
  frame.plane->terrain_from_input = plan.index.terrain_from_input();
  if (const auto* opposing = plan.index.manifest.find_result(opposing_normals))
    frame.plane->opposing_normals = std::get<double>(*opposing);
  return frame;
}

void require_in_frame(const libmap::PointCloud& terrain, const TerrainFrame& frame,
                      const std::filesystem::path& plan_file) {
  // One voxel of margin for rounding.
  const Eigen::Array3d low(frame.min.i - 1.0, frame.min.j - 1.0, frame.min.k - 1.0);
  const Eigen::Array3d high(frame.max.i + 2.0, frame.max.j + 2.0, frame.max.k + 2.0);
  for (const Eigen::Vector3d& point : terrain.positions) {
    const Eigen::Array3d cell = frame.lattice.cell_of(point);
    if (!(cell >= low).all() || !(cell <= high).all())
      throw not_of_this_terrain(plan_file, "min and max");
  }
}

void require_appendable(const TilePlan& earlier, const TilePlan& plan,
                        const DetectionOptions& detection, bool append, const std::string& store) {
  const auto refuse = [&](const std::string& reason) {
    throw libmap::Error(reason, {.file = store});
  };
  const libmap::Manifest& before = earlier.index.manifest;
  const libmap::Manifest& now = plan.index.manifest;
  if (before.parameters != now.parameters || before.version != now.version)
    refuse("contains tiles of other parameters or another version; use --force to start again");
  if (before.georeference != now.georeference)
    refuse("was started with another first file; names of added files must sort after its name");
  auto at = plan.terrain.begin();
  for (const TerrainFile& file : earlier.terrain) {
    at = std::find_if(at, plan.terrain.end(),
                      [&](const TerrainFile& one) { return is_same_file(one, file); });
    if (at == plan.terrain.end())
      refuse("contains tiles of another terrain or gripper; use --force to start again");
    ++at;
  }
  if (earlier.terrain.size() == plan.terrain.size())
    refuse("contains tiles of another gripper file; use --force to start again");
  if (!append)
    refuse("contains tiles of " + std::to_string(earlier.terrain.size()) + " of these " +
           std::to_string(plan.terrain.size()) +
           " files; use --append to add the others or --force to start again");
  if (detection.plane != PlaneSource::none)
    refuse("--append requires --plane none; a new point changes the fitted plane and all tiles");
  const Method method = detection.scenario.method;
  if (method != Method::corrected && method != Method::calibrated)
    refuse(
        "--append requires --method corrected or calibrated; other methods do not score the border "
        "of the terrain");
}

std::vector<StoredTile> unaffected_tiles(const std::map<TileNumber, StoredTile>& done,
                                         const TilePlan& earlier, const TilePlan& plan,
                                         const TerrainFrame& frame, const StoreTiling& tiling) {
  std::vector<libmap::Bounds3d> added;
  auto known = earlier.terrain.begin();
  for (const TerrainFile& file : plan.terrain)
    if (known != earlier.terrain.end() && is_same_file(file, *known))
      ++known;
    else if (file.points > 0)
      added.push_back(file.box);
  std::vector<StoredTile> untouched;
  for (const auto& [number, tile] : done) {
    const PointsRectangle near =
        points_for(columns_of(number, tiling.tile_voxels), frame, tiling.halo_voxels);
    const bool is_touched =
        std::any_of(added.begin(), added.end(), [&](const libmap::Bounds3d& box) {
          return (box.min.head<2>().array() <= near.high.array()).all() &&
                 (box.max.head<2>().array() >= near.low.array()).all();
        });
    if (!is_touched) untouched.push_back(tile);
  }
  return untouched;
}

PointsRectangle points_for(const std::vector<TileNumber>& tiles, const TerrainFrame& frame,
                           const StoreTiling& tiling) {
  TileBounds columns = columns_of(tiles.front(), tiling.tile_voxels);
  for (const TileNumber& tile : tiles) {
    const TileBounds one = columns_of(tile, tiling.tile_voxels);
    columns = {std::min(columns.i_begin, one.i_begin), std::max(columns.i_end, one.i_end),
               std::min(columns.j_begin, one.j_begin), std::max(columns.j_end, one.j_end)};
  }
  return points_for(columns, frame, tiling.halo_voxels);
}

bool may_intersect(const TerrainFile& file, const PointsRectangle& wanted,
                   const TerrainFrame& frame) {
  if (file.points == 0) return false;
  libmap::PointCloud corners;
  for (int n = 0; n < 8; ++n)
    corners.positions.emplace_back((n & 1) == 0 ? file.box.min.x() : file.box.max.x(),
                                   (n & 2) == 0 ? file.box.min.y() : file.box.max.y(),
                                   (n & 4) == 0 ? file.box.min.z() : file.box.max.z());
  const libmap::Bounds3d box = libmap::bounds_of(to_terrain(corners, frame).positions);
  // One voxel of margin for rounding.
  const double margin = frame.lattice.voxel_size_m;
  return (box.min.head<2>().array() - margin <= wanted.high.array()).all() &&
         (box.max.head<2>().array() + margin >= wanted.low.array()).all();
}

StoredTile stored_tile(const StreamedTile& tile) {
  StoredTile stored;
  stored.number = tile.number;
  stored.occupied_voxels = tile.occupied_voxels;
  stored.voxels = tile.voxels.size();
  if (tile.voxels.empty()) return stored;
  stored.min = stored.max = tile.voxels.front().voxel;
  for (const MapVoxel& one : tile.voxels) {
    extend(one.voxel, stored.min, stored.max);
    stored.border_voxels += one.border ? 1 : 0;
    stored.graspable_voxels += one.graspable ? 1 : 0;
  }
  return stored;
}

}  // namespace libgtd
