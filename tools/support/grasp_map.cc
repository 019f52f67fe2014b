#include "tools/support/grasp_map.h"

#include <algorithm>
#include <array>
#include <cstddef>
#include <limits>
#include <map>
#include <utility>

#include "libgtd/evaluate/voxel_map.h"
#include "libgtd/grasp/finger_closing.h"
#include "libgtd/score/tile_store_io.h"
#include "libgtd/streamed_detection.h"
#include "libgtd/terrain/voxel_grid.h"
#include "libmap/core/parallel.h"
#include "libmap/io/cloud_io.h"
#include "libmap/io/mesh_io.h"
#include "tools/support/map_frame.h"
#include "tools/support/map_tiles.h"

namespace graspmap_tools {

namespace fs = std::filesystem;

namespace {

using libgtd::StoredTile;
using libgtd::TileNumber;

constexpr std::size_t kept_tiles = 3;
// Margin for offset, tilt and uncertainty of a pose, in addition to twice the gripper's size.
constexpr double extra_margin_m = 0.2;

constexpr std::size_t field_count = 9;
using Values = std::array<double, field_count>;  // fields of one voxel, in order of grasp_fields
constexpr Values no_candidate = {0.0, 0.0, 0.0, 0.0, 0.0, 0.0, -1.0, 0.0, 0.0};

Values values_of(const libgtd::LocationResult& result) {
  return {result.hold_probability,
          result.force_n[1],
          result.force_range_n[0],
          result.force_range_n[1],
          result.trial_spread,
          result.parameter_spread,
          result.has_force ? static_cast<double>(result.limiting_direction) : -1.0,
          result.unseen,
          static_cast<double>(result.trials)};
}

// Progress of a tile whose locations count as steps of the whole map.
class StepsOfTile : public libmap::Progress {
 public:
  explicit StepsOfTile(libmap::Progress& whole) : whole_(whole) {}
  void begin(std::string_view /*stage*/, std::size_t /*total*/) override {}
  void advance(std::size_t steps) override { whole_.advance(steps); }
  void end() override {}

 private:
  libmap::Progress& whole_;
};

// A map in tiles: those of a tile store, or parts of one file.
class TiledMap {
 public:
  explicit TiledMap(const std::string& file) {
    if (is_tile_store(file)) {
      store_.emplace(file);
      index_ = store_->index();
    } else {
      in_file(file, [&] { cut(file); });
    }
  }

  const libgtd::TileStoreIndex& index() const { return index_; }
  bool has_manifest() const { return has_manifest_; }

  // Returns the points of a tile, given by its position in index().tiles.
  libmap::PointCloud load(std::size_t tile) const {
    return store_ ? store_->load_checked(tile)
                  : libmap::select_points(cloud_, points_.at(index_.tiles[tile].number));
  }

 private:
  void cut(const std::string& file) {
    cloud_ = libmap::read_cloud(file).cloud;
    if (cloud_.empty()) throw libmap::no_elements("points of the map");
    const auto manifest = libmap::read_manifest_of(file);
    has_manifest_ = manifest.has_value();
    const libmap::Manifest known = manifest.value_or(libmap::Manifest{});
    if (const auto index = index_of(known))
      index_ = *index;
    else
      index_.lattice = libgtd::voxel_map_of(cloud_, libgtd::map_info(known)).lattice;
    index_.manifest = known;
    constexpr double tile_m = 0.5;
    index_.tile_voxels = std::max(1, static_cast<int>(tile_m / index_.lattice.voxel_size_m));
    const std::vector<libgtd::Voxel> voxels = libgtd::VoxelFields(cloud_).all();
    index_.min = index_.max = voxels.front();
    for (std::size_t n = 0; n < voxels.size(); ++n) {
      points_[libgtd::tile_of(voxels[n], index_.tile_voxels)].push_back(n);
      extend(voxels[n], index_.min, index_.max);
    }
    for (const auto& [number, points] : points_) {
      StoredTile& tile = index_.tiles.emplace_back();
      tile.number = number;
      tile.voxels = tile.occupied_voxels = points.size();
      tile.min = tile.max = voxels[points.front()];
      for (const std::size_t n : points) {
        extend(voxels[n], tile.min, tile.max);
        tile.border_voxels += is_set("border", n) ? 1 : 0;
        tile.graspable_voxels += is_set("graspable", n) ? 1 : 0;
      }
    }
  }

  bool is_set(const char* flag, std::size_t n) const {
    const libmap::ScalarField* field = cloud_.find_field(flag);
    return field != nullptr && field->values[n] == 1.0;
  }

  libgtd::TileStoreIndex index_;
  bool has_manifest_ = true;
  std::optional<MapTiles> store_;
  libmap::PointCloud cloud_;
  std::map<TileNumber, std::vector<std::size_t>> points_;  // indices in cloud_
};

class MapGrasping {
 public:
  MapGrasping(const GraspMapInput& input, GroundTiles& ground, const libgtd::Gripper& gripper,
              const libgtd::GraspOptions& options, Run& run)
      : input_(input),
        gripper_(gripper),
        options_(options),
        run_(run),
        map_(input.map_file),
        ground_(ground),
        mesh_from_map_(map_from_input(map_.index().manifest).inverse()),
        store_(is_store() ? input.output : input.output + ".progress") {
    copy_missing_entries(map_.index().manifest, run);
    in_file(input.map_file, [&] { require_usable(); });
    if (!map_.has_manifest())
      run.warn(input.map_file +
               ": has no manifest; the map is assumed to be in the frame of the mesh");
  }

  void grasp() {
    if (run_.options().dry_run) return;
    std::optional<libmap::TileJournal> journal =
        store_.begin(input_.share, [this] { check_plan(); });
    const std::vector<TileNumber> missing = store_.missing(
        plan_, libgtd::tiles_of(
                   {.plane = {}, .lattice = {}, .min = plan_.index.min, .max = plan_.index.max},
                   plan_.index.tile_voxels, input_.share));
    run_.timed("grasp", [&] { test(missing, *journal); });
    journal.reset();
    finish(missing.size());
  }

 private:
  bool is_store() const { return libgtd::is_tile_store_name(input_.output); }

  void require_usable() const {
    const std::vector<StoredTile>& tiles = map_.index().tiles;
    std::size_t voxels = 0;
    std::size_t on_mesh = 0;
    for (std::size_t n = 0; n < tiles.size(); ++n) {
      const libmap::PointCloud points = map_.load(n);
      if (points.find_field("grasp_trials") != nullptr)
        throw libmap::Error("the map already has this field", {.field = "grasp_trials"});
      voxels += points.size();
      for (const auto& [mesh_tile, members] : by_mesh_tile(points))
        for (const std::size_t voxel : members)
          on_mesh +=
              ground_.mesh_tile(mesh_tile)
                      .ground
                      .distance(mesh_from_map_ * points.positions[voxel], options_.max_distance_m)
                      .has_value()
                  ? 1
                  : 0;
    }
    if (on_mesh == 0)
      throw libmap::Error("no voxel is within " + libmap::to_text(options_.max_distance_m) +
                          " m of the mesh; check the frames of map and mesh");
    if (2 * on_mesh < voxels)
      run_.warn("only {} of {} voxels are within {} m of the mesh; check the frames", on_mesh,
                voxels, options_.max_distance_m);
  }

  // Resumes the store's plan if it is of the same mesh, map and parameters, else writes a new one.
  // The caller must have locked the store.
  void check_plan() {
    const bool is_forced = run_.options().force && is_store();
    const auto earlier = is_forced ? std::nullopt : store_.plan();
    plan_.index = map_.index();
    plan_.index.tiles.clear();
    plan_.index.manifest = run_.manifest();
    plan_.index.manifest.timings_s.clear();
    plan_.index.manifest.threads = 0;
    // The map's frame is stored only in its manifest, which is not hashed.
    plan_.key = libmap::sha256_of(libmap::key_of(run_.manifest()) + input_.parameters_hash +
                                  libmap::to_text(mesh_from_map_.matrix().sum()));
    if (earlier && earlier->key == plan_.key) return;
    if (earlier && is_store())
      throw libmap::Error(
          "contains tiles of another mesh, map or gripper or of other parameters; use --force to "
          "replace them",
          {.file = input_.output});
    if (!earlier && !is_forced) require_no_index(store_);
    store_.require_idle();
    store_.clear();
    store_.set_plan(plan_);
  }

  void test(const std::vector<TileNumber>& missing, libmap::TileJournal& journal) {
    const std::vector<StoredTile>& tiles = map_.index().tiles;
    const auto find = [&](const TileNumber& number) { return map_.index().find(number); };
    std::size_t voxels = 0;
    for (const TileNumber& number : missing)
      if (const StoredTile* tile = find(number)) voxels += tile->voxels;
    run_.progress().begin("grasp", voxels);
    StepsOfTile steps(run_.progress());
    for (const TileNumber& number : missing) {
      StoredTile stored;
      stored.number = number;
      if (const StoredTile* tile = find(number)) {
        stored = *tile;
        write_tile(store_.folder(),
                   tested(map_.load(static_cast<std::size_t>(tile - tiles.data())), steps), stored);
      }
      libgtd::add_tiles({stored}, plan_.key, journal);
    }
    run_.progress().end();
  }

  // Indices of the points on each tile of the ground.
  std::map<std::size_t, std::vector<std::size_t>> by_mesh_tile(
      const libmap::PointCloud& points) const {
    std::map<std::size_t, std::vector<std::size_t>> members;
    for (std::size_t n = 0; n < points.size(); ++n)
      members[ground_.tile_at(mesh_from_map_ * points.positions[n])].push_back(n);
    return members;
  }

  // Returns one entry per member: its position if it is a candidate, else nullopt.
  std::vector<std::optional<Eigen::Vector3d>> candidates_of(
      const GroundTiles::MeshTile& mesh_tile, const libmap::PointCloud& points,
      const std::vector<std::size_t>& members) const {
    std::vector<std::optional<Eigen::Vector3d>> candidates(members.size());
    constexpr std::size_t grain = 256;
    libmap::parallel_each(members.size(), grain, [&](std::size_t n) {
      const Eigen::Vector3d position = mesh_from_map_ * points.positions[members[n]];
      // The filter is valid only for approach from above.
      if (options_.approach == libgtd::ApproachDirection::up &&
          !mesh_tile.from_above.may_hold(position))
        return;
      if (mesh_tile.ground.distance(position, options_.max_distance_m)) candidates[n] = position;
    });
    return candidates;
  }

  libmap::PointCloud tested(libmap::PointCloud points, libmap::Progress& steps) const {
    std::array<std::vector<double>*, field_count> fields{};
    points.fields.reserve(points.fields.size() + field_count);
    for (std::size_t field = 0; field < field_count; ++field)
      fields[field] = &points.add_field(grasp_fields()[field], libmap::ScalarType::float32).values;
    for (const auto& [number, members] : by_mesh_tile(points)) {
      const GroundTiles::MeshTile& mesh_tile = ground_.mesh_tile(number);
      const auto candidates = candidates_of(mesh_tile, points, members);
      std::vector<Eigen::Vector3d> positions;
      for (const auto& candidate : candidates)
        if (candidate) positions.push_back(*candidate);
      steps.advance(members.size() - positions.size());
      const auto results =
          libgtd::test_grasps(mesh_tile.ground, gripper_, positions, options_, steps);
      auto next = results.begin();
      for (std::size_t n = 0; n < members.size(); ++n) {
        const Values values = candidates[n] ? values_of(*next++) : no_candidate;
        for (std::size_t field = 0; field < field_count; ++field)
          (*fields[field])[members[n]] = values[field];
      }
    }
    return points;
  }

  // The last share writes the index or the map in one file.
  void finish(std::size_t tested) {
    std::optional<libmap::FileLock> lock = store_.lock();
    const libgtd::MapTileStore::Completion completion = store_.complete(plan_);
    if (!completion.index) {
      run_.info("{} tiles tested; {} of {} are complete", tested, completion.done,
                completion.tiles);
      return;
    }
    if (is_store()) {
      store_.write_index(*completion.index, run_.manifest());
      run_.info("{} of {} tiles tested; all are complete", tested, completion.tiles);
      return;
    }
    const MapTiles tiles(store_.folder(), *completion.index);
    note_results(tiles);
    run_.write_output(input_.output, [&](const fs::path& temporary) {
      write_merged(tiles, input_.output, temporary, {}, run_);
    });
    store_.clear();
    lock.reset();
    store_.remove_if_bare();
  }

  void note_results(const MapTiles& tiles) {
    std::int64_t candidates = 0;
    std::int64_t holding = 0;
    double trials = 0.0;
    for (std::size_t tile = 0; tile < tiles.index().tiles.size(); ++tile) {
      const libmap::PointCloud points = tiles.load(tile);
      const std::vector<double>& probability = libgtd::values_of(points, "hold_probability");
      const std::vector<double>& made = libgtd::values_of(points, "grasp_trials");
      for (std::size_t n = 0; n < points.size(); ++n) {
        candidates += made[n] > 0.0 ? 1 : 0;
        holding += probability[n] >= 0.5 ? 1 : 0;
        trials += made[n];
      }
    }
    const double mean = candidates == 0 ? 0.0 : trials / static_cast<double>(candidates);
    run_.add_results({{"grasp_voxels", tiles.index().voxels()},
                      {"grasp_candidates", candidates},
                      {"grasp_holding", holding},
                      {"grasp_mean_trials", mean}});
    run_.info("{} of {} voxels hold; {} were tested, with {:.1f} trials each", holding,
              tiles.index().voxels(), candidates, mean);
  }

  const GraspMapInput& input_;
  const libgtd::Gripper& gripper_;
  const libgtd::GraspOptions& options_;
  Run& run_;
  TiledMap map_;
  GroundTiles& ground_;
  libmap::Pose mesh_from_map_;
  libgtd::MapTileStore store_;
  libgtd::TilePlan plan_;
};

}  // namespace

GroundTiles::Kept::Kept(std::size_t of, libmap::TriangleMesh around,
                        const GroundTiles& ground_tiles)
    : MeshTile{.mesh = std::move(around),
               .ground = ground_tiles.make_ground_(mesh),
               .from_above = {mesh,
                              ground_tiles.gripper_,
                              {.start_height_m = ground_tiles.start_height_m_}}},
      number(of) {}

GroundTiles::GroundTiles(const std::string& mesh, const libgtd::Gripper& gripper,
                         double start_height_m, MakeGround make_ground)
    : gripper_(gripper),
      start_height_m_(start_height_m),
      make_ground_(std::move(make_ground)),
      files_(libmap::mesh_tiles(mesh)) {
  const libgtd::FingerGeometry finger = libgtd::finger_geometry(gripper);
  margin_m_ = 2.0 * finger.tip(finger.opening_rad, finger.curl_rad).x() + extra_margin_m;
  if (files_.size() > 1) index_.emplace(files_);
}

std::size_t GroundTiles::tile_at(const Eigen::Vector3d& position) const {
  if (!index_) return 0;
  const Eigen::Vector2d point = position.head<2>();
  std::size_t best = 0;
  std::pair least(std::numeric_limits<double>::infinity(), 0.0);
  for (std::size_t n = 0; n < index_->size(); ++n) {
    const Eigen::AlignedBox2d& box = index_->box(n);
    const std::pair distance(box.squaredExteriorDistance(point),
                             (box.center() - point).squaredNorm());
    if (!(distance < least)) continue;
    best = n;
    least = distance;
  }
  return best;
}

const GroundTiles::MeshTile& GroundTiles::mesh_tile(std::size_t number) {
  const auto found = std::find_if(kept_.begin(), kept_.end(),
                                  [&](const Kept& one) { return one.number == number; });
  if (found != kept_.end()) {
    kept_.splice(kept_.begin(), kept_, found);
    return kept_.front();
  }
  if (kept_.size() == kept_tiles) kept_.pop_back();
  kept_.emplace_front(
      number,
      index_ ? index_->with_margin(number, margin_m_).mesh : libmap::read_mesh(files_.front()).mesh,
      *this);
  return kept_.front();
}

const std::vector<std::string>& grasp_fields() {
  static const std::vector<std::string> names = {
      "hold_probability",     "holding_force_n", "holding_force_low_n",
      "holding_force_high_n", "trial_spread",    "parameter_spread",
      "limiting_direction",   "grasp_unseen",    "grasp_trials"};
  return names;
}

void require_map_output(const GraspMapInput& input, Run& run) {
  if (!libgtd::is_tile_store_name(input.output)) {
    if (input.share.count > 1)
      throw libmap::Error("can only be used if the output is a tile store, MAP.tiles",
                          {.file = input.output, .field = "--tile"});
    libmap::require_cloud_format(input.output);
    run.claim_output(input.output, {input.mesh_file, input.map_file});
    return;
  }
  if (fs::exists(input.output) && fs::exists(input.map_file) &&
      fs::equivalent(input.output, input.map_file))
    throw libmap::Error("is the input; choose another output name", {.file = input.output});
  if (run.options().force && input.share.count > 1)
    throw libmap::Error("deletes the tiles of all shares and cannot be combined with --tile",
                        {.field = "--force"});
}

void grasp_map(const GraspMapInput& input, GroundTiles& ground, const libgtd::Gripper& gripper,
               const libgtd::GraspOptions& options, Run& run) {
  MapGrasping(input, ground, gripper, options, run).grasp();
}

}  // namespace graspmap_tools
