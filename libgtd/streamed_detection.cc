#include "libgtd/streamed_detection.h"

#include <algorithm>
#include <map>
#include <utility>

#include "libgtd/tile_detection.h"
#include "libmap/core/error.h"
#include "libmap/core/text.h"
#include "libmap/geometry/normal_sides.h"

namespace libgtd {

namespace {

using libmap::PointCloud;

constexpr std::size_t max_stored_tiles = std::size_t{1} << 20U;
// Limit for tiles with few points, because each tile in progress takes some memory.
constexpr std::size_t max_tiles_at_once = std::size_t{1} << 14U;

TileBounds cut(const TileBounds& a, const TileBounds& b) {
  return {std::max(a.i_begin, b.i_begin), std::min(a.i_end, b.i_end),
          std::max(a.j_begin, b.j_begin), std::min(a.j_end, b.j_end)};
}

bool is_empty(const TileBounds& columns) {
  return columns.i_begin >= columns.i_end || columns.j_begin >= columns.j_end;
}

// Neighboring tiles that are processed at once.
struct Block {
  std::vector<TileNumber> tiles;
  TileBounds columns;  // around all tiles, clipped to the box of the terrain
};

class StreamedDetection {
 public:
  StreamedDetection(const TerrainFrame& frame, const libmap::PointTileStore& points,
                    const DetectionOptions& options, const StreamingOptions& streaming)
      : frame_(frame),
        points_(points),
        scenario_(options.scenario),
        max_points_(std::max<std::size_t>(streaming.max_points, 1)),
        mask_(make_gripper_mask(gripper_of(options), mask_options(scenario_))),
        tile_voxels_(tile_voxels(scenario_)),
        halo_(halo_voxels(mask_, scenario_)) {}

  // Like libgtd::require_dense, on a sample of at most 256 tiles spread over the wanted ones.
  void require_dense(const std::vector<TileNumber>& wanted) const {
    constexpr std::size_t max_tiles = 256, max_points = 1'000'000;
    std::size_t isolated = 0, voxels = 0;
    std::vector<Eigen::Vector3d> points;
    const std::size_t step = wanted.size() / max_tiles + 1;
    for (std::size_t n = 0; n < wanted.size() && points.size() < max_points; n += step) {
      const PointsRectangle rectangle = points_for(columns_of_tile(wanted[n]), frame_, 0);
      const std::size_t count = points_.count_in(rectangle.low, rectangle.high);
      if (count == 0 || count > max_points_) continue;
      const PointCloud cloud = points_.points_in(rectangle.low, rectangle.high);
      const VoxelGrid grid = voxelize(cloud.positions, scenario_.voxel_size_m);
      isolated += count_isolated(grid.voxels);
      voxels += grid.voxels.size();
      points.insert(points.end(), cloud.positions.begin(), cloud.positions.end());
    }
    libgtd::require_dense(isolated, voxels, scenario_.voxel_size_m, points);
  }

  // Halves a set of tiles until each part has at most max_points_ points.
  void run(std::vector<TileNumber> tiles,
           const std::function<void(std::vector<StreamedTile>)>& visit,
           libmap::Progress& progress) {
    const Block block = block_of(std::move(tiles));
    if (block.tiles.size() > 1 &&
        (block.tiles.size() > max_tiles_at_once || !is_small(block.columns))) {
      auto [first, second] = halves(block);
      run(std::move(first), visit, progress);
      run(std::move(second), visit, progress);
      return;
    }
    std::map<TileNumber, StreamedTile> results;
    for (const TileNumber& tile : block.tiles) results[tile].number = tile;
    detect_columns(block.columns, block.tiles, results);
    std::vector<StreamedTile> done;
    for (auto& [number, tile] : results) {
      const auto is_before = [](const MapVoxel& a, const MapVoxel& b) { return a.voxel < b.voxel; };
      // The parts of a tile are appended one after another.
      if (!std::is_sorted(tile.voxels.begin(), tile.voxels.end(), is_before))
        std::sort(tile.voxels.begin(), tile.voxels.end(), is_before);
      done.push_back(std::move(tile));
    }
    const std::size_t count = done.size();
    visit(std::move(done));
    progress.advance(count);
  }

 private:
  TileBounds columns_of_tile(const TileNumber& tile) const {
    const TileBounds box{frame_.min.i, frame_.max.i + 1, frame_.min.j, frame_.max.j + 1};
    return cut(columns_of(tile, tile_voxels_), box);
  }

  Block block_of(std::vector<TileNumber> tiles) const {
    Block block{.tiles = std::move(tiles), .columns = {}};
    block.columns = columns_of_tile(block.tiles.front());
    for (const TileNumber& tile : block.tiles) {
      const TileBounds one = columns_of_tile(tile);
      block.columns = {
          std::min(block.columns.i_begin, one.i_begin), std::max(block.columns.i_end, one.i_end),
          std::min(block.columns.j_begin, one.j_begin), std::max(block.columns.j_end, one.j_end)};
    }
    return block;
  }

  bool is_small(const TileBounds& columns) const {
    const PointsRectangle rectangle = points_for(columns, frame_, halo_);
    return points_.count_in(rectangle.low, rectangle.high) <= max_points_;
  }

  // Splits between tiles, across the longer side.
  static std::pair<std::vector<TileNumber>, std::vector<TileNumber>> halves(const Block& block) {
    const auto by_i = [](const TileNumber& tile) { return tile.i; };
    const auto by_j = [](const TileNumber& tile) { return tile.j; };
    const auto cut_by = [&](const auto& of) {
      const auto [least, most] = std::minmax_element(
          block.tiles.begin(), block.tiles.end(),
          [&](const TileNumber& a, const TileNumber& b) { return of(a) < of(b); });
      const int middle = of(*least) + (of(*most) - of(*least)) / 2;
      std::pair<std::vector<TileNumber>, std::vector<TileNumber>> parts;
      for (const TileNumber& tile : block.tiles)
        (of(tile) <= middle ? parts.first : parts.second).push_back(tile);
      return parts;
    };
    const TileBounds& columns = block.columns;
    const bool is_high = columns.i_end - columns.i_begin > columns.j_end - columns.j_begin;
    auto parts = is_high ? cut_by(by_i) : cut_by(by_j);
    if (parts.second.empty()) parts = is_high ? cut_by(by_j) : cut_by(by_i);
    return parts;
  }

  // Also halves a rectangle with too many points, while it is wider than its halo.
  void detect_columns(const TileBounds& columns, const std::vector<TileNumber>& tiles,
                      std::map<TileNumber, StreamedTile>& results) const {
    const int height = columns.i_end - columns.i_begin;
    const int width = columns.j_end - columns.j_begin;
    const int longer = std::max(height, width);
    if (longer > std::max(halo_, 1) && !is_small(columns)) {
      TileBounds first = columns;
      TileBounds second = columns;
      if (height >= width)
        first.i_end = second.i_begin = columns.i_begin + height / 2;
      else
        first.j_end = second.j_begin = columns.j_begin + width / 2;
      detect_columns(first, tiles, results);
      detect_columns(second, tiles, results);
      return;
    }
    std::vector<TileBounds> parts;
    for (const TileNumber& tile : tiles) {
      const TileBounds part = cut(columns_of_tile(tile), columns);
      if (!is_empty(part)) parts.push_back(part);
    }
    const PointsRectangle rectangle = points_for(columns, frame_, halo_);
    const PointCloud cloud = points_.points_in(rectangle.low, rectangle.high);
    VoxelGrid grid = voxelize(cloud.positions, scenario_.voxel_size_m);
    grid.min = frame_.min;
    grid.max = frame_.max;
    const TileDetectionResult found =
        detect_tiles({cloud, cloud, grid}, mask_, parts, CurvatureExtent::points_near_tiles,
                     tile_detection_options(mask_, scenario_));
    for (const MapVoxel& voxel : found.voxels)
      results.at(tile_of(voxel.voxel, tile_voxels_)).voxels.push_back(voxel);
    for (const TileBounds& part : parts)
      visit_rows(grid, part, [&](std::size_t first, std::size_t last) {
        results.at(tile_of(grid.voxels[first], tile_voxels_)).occupied_voxels += last - first;
      });
  }

  const TerrainFrame& frame_;
  const libmap::PointTileStore& points_;
  const Scenario& scenario_;
  std::size_t max_points_;
  GripperMask mask_;
  int tile_voxels_;
  int halo_;
};

}  // namespace

bool TerrainFrame::drops_normals() const {
  return plane && plane->opposing_normals > libmap::max_opposing_fraction;
}

void require_streamable(const DetectionOptions& options) {
  const Method method = options.scenario.method;
  if (follows_thesis(method))
    throw libmap::Error("needs the whole cloud in memory; use one output file, -o MAP.pcd",
                        {.field = "method", .value = name_of(method)});
  if (options.scenario.interpolation)
    throw libmap::Error("needs the whole cloud in memory; use one output file, -o MAP.pcd",
                        {.field = "interpolation", .value = "true"});
  if (options.scenario.evaluates_obstacles())
    throw libmap::Error("needs the whole map in memory; use one output file, -o MAP.pcd",
                        {.field = "obstacle_height_m",
                         .value = libmap::to_text(options.scenario.obstacle_height_m)});
}

TerrainFrame frame_terrain(const libmap::PointStream& points, const DetectionOptions& options) {
  TerrainFrame frame;
  if (options.plane == PlaneSource::fit)
    frame.plane = fit_regression_plane(points, {.method = plane_method(options.scenario.method),
                                                .up = options.up,
                                                .max_tilt_deg = options.max_tilt_deg});
  std::optional<libmap::Bounds3d> box;
  const auto positions = libmap::PointStream::Need::positions;
  points.for_each_block(positions, [&](const PointCloud& block) {
    if (block.empty()) return;
    const libmap::Bounds3d part = libmap::bounds_of(to_terrain(block, frame).positions);
    if (!box) box = part;
    box->min = box->min.cwiseMin(part.min);
    box->max = box->max.cwiseMax(part.max);
  });
  if (!box) throw libmap::no_elements("points of the cloud");
  const VoxelGrid corners = voxelize({box->min, box->max}, options.scenario.voxel_size_m);
  frame.lattice = corners.lattice;
  frame.min = corners.min;
  frame.max = corners.max;
  return frame;
}

PointCloud to_terrain(const PointCloud& block, const TerrainFrame& frame) {
  if (!frame.plane) return block;
  PointCloud terrain = transform_to_terrain(block, *frame.plane, PlaneMethod::corrected);
  if (frame.drops_normals()) terrain.normals.clear();
  return terrain;
}

std::vector<TileNumber> tiles_of(const TerrainFrame& frame, int tile_voxels,
                                 const libmap::TileShare& share) {
  VoxelGrid box;
  box.lattice = frame.lattice;
  box.min = frame.min;
  box.max = frame.max;
  box.voxels = {frame.min, frame.max};
  std::vector<TileNumber> numbers;
  const std::vector<TileBounds> all = make_tiles(box, tile_voxels);
  // A tile is a line of a journal, and a file if it has voxels.
  if (all.size() > max_stored_tiles)
    throw libmap::Error("too small: the tile store would have " + std::to_string(all.size()) +
                            " tiles, more than " + std::to_string(max_stored_tiles),
                        {.field = "tile_size_m",
                         .value = libmap::to_text(tile_voxels * frame.lattice.voxel_size_m)});
  const std::vector<TileBounds> tiles = share_of(all, share);
  numbers.reserve(tiles.size());
  for (const TileBounds& tile : tiles)
    numbers.push_back(tile_of({tile.i_begin, tile.j_begin, 0}, tile_voxels));
  return numbers;
}

PointsRectangle points_for(const TileBounds& columns, const TerrainFrame& frame, int halo_voxels) {
  // One more voxel as margin for rounding.
  const double margin = 1.0 + halo_voxels;
  const double size = frame.lattice.voxel_size_m;
  const Eigen::Vector2d origin = frame.lattice.origin_m.head<2>();
  return {origin + size * Eigen::Vector2d(columns.i_begin - margin, columns.j_begin - margin),
          origin + size * Eigen::Vector2d(columns.i_end + margin, columns.j_end + margin)};
}

void detect_streamed(const TerrainFrame& frame, const libmap::PointTileStore& points,
                     const std::vector<TileNumber>& wanted, const DetectionOptions& options,
                     const std::function<void(std::vector<StreamedTile>)>& visit,
                     libmap::Progress& progress, const StreamingOptions& streaming) {
  require_streamable(options);
  if (wanted.empty()) return;
  StreamedDetection detection(frame, points, options, streaming);
  detection.require_dense(wanted);
  progress.begin("tiles", wanted.size());
  detection.run(wanted, visit, progress);
  progress.end();
}

}  // namespace libgtd
