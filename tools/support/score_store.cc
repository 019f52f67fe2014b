#include "tools/support/score_store.h"

#include "libgtd/gripper/gripper_io.h"
#include "libgtd/score/tile_progress_io.h"
#include "libgtd/score/tile_store_io.h"
#include "libgtd/streamed_detection.h"
#include "libgtd/tile_detection.h"
#include "libmap/cloud/cloud_pieces.h"
#include "libmap/cloud/point_spool.h"
#include "libmap/core/parallel.h"
#include "tools/support/map_frame.h"
#include "tools/support/needed_tiles.h"
#include "tools/support/store_filling.h"

namespace graspmap_tools {

namespace fs = std::filesystem;

namespace {

using libgtd::StoredTile;
using libgtd::TerrainPiece;
using libgtd::TileNumber;
using libgtd::TilePlan;

// Third standardized moment of the heights. Rocks and holds on their ground have +0.5 to +3, the
// same upside down as much below 0; rolling ground has about 0.
constexpr double upside_down_skewness = -1.0;

std::string_view name_of(libgtd::UpSource source) {
  if (source == libgtd::UpSource::frame_z) return "frame's z axis";
  if (source == libgtd::UpSource::camera_origin) return "camera's origin";
  return to_text(source);
}

std::int64_t modified_ns(const fs::path& path) {
  return std::chrono::duration_cast<std::chrono::nanoseconds>(
             fs::last_write_time(path).time_since_epoch())
      .count();
}

// What is known of each file from an earlier run, if it is the same by name, size and time; else
// it is read.
std::vector<TerrainPiece> survey(const std::vector<fs::path>& files,
                                 const std::vector<TerrainPiece>& known,
                                 const std::optional<libmap::Georeference>& georeference) {
  std::vector<TerrainPiece> pieces(files.size());
  libmap::parallel_each(files.size(), [&](std::size_t n) {
    TerrainPiece& piece = pieces[n];
    piece.input.path = files[n].string();
    piece.input.bytes = fs::file_size(files[n]);
    piece.modified_ns = modified_ns(files[n]);
    const auto same = std::find_if(known.begin(), known.end(), [&](const TerrainPiece& one) {
      return one.input.path == piece.input.path && one.input.bytes == piece.input.bytes &&
             one.modified_ns == piece.modified_ns;
    });
    if (same != known.end()) {
      piece = *same;
      return;
    }
    piece.input.sha256 = libmap::sha256_of_file(files[n]);
    const libmap::PieceFacts facts = libmap::survey_piece(files[n], georeference);
    piece.points = facts.points;
    piece.dropped_points = facts.dropped_points;
    piece.box = facts.box;
  });
  return pieces;
}

// The spool as the detection asks for it.
class SpooledPoints : public libgtd::NearbyPoints {
 public:
  explicit SpooledPoints(const libmap::PointSpool& spool) : spool_(spool) {}
  libmap::PointCloud points_in(const Eigen::Vector2d& low,
                               const Eigen::Vector2d& high) const override {
    return spool_.points_in(low, high);
  }
  std::size_t count_in(const Eigen::Vector2d& low, const Eigen::Vector2d& high) const override {
    return spool_.count_in(low, high);
  }

 private:
  const libmap::PointSpool& spool_;
};

class StoreScoring {
 public:
  StoreScoring(const ScoreStoreOptions& options, Run& run)
      : options_(options),
        scenario_(options.detection.scenario),
        run_(run),
        progress_(options.store),
        files_(libmap::cloud_pieces(options.terrain)),
        tile_voxels_(libgtd::tile_voxels(scenario_)),
        mask_(libgtd::make_gripper_mask(
            libgtd::gripper_of(options.detection),
            {scenario_.method, scenario_.voxel_size_m, scenario_.extra_void_layers})),
        halo_(libgtd::halo_voxels(mask_, scenario_)) {
    if (fs::is_directory(options.store) && fs::is_directory(options.terrain) &&
        fs::equivalent(options.store, options.terrain))
      throw libmap::Error("is the input: the output needs another name", {.file = options.store});
  }

  void score() {
    const libmap::PieceStream stream(files_);
    if (run_.options().dry_run) return;
    const bool is_new = !fs::exists(options_.store);
    progress_.open();
    std::optional<libgtd::TileJournal> journal;
    try {
      run_.timed("plan", [&] {
        const libmap::FileLock lock = progress_.lock();
        agree_on_plan(stream);
        journal.emplace(progress_.store(), options_.detection.share, plan_.key);
      });
    } catch (...) {
      if (is_new) progress_.remove_if_bare();
      throw;
    }
    const std::vector<TileNumber> wanted = run_.timed("check", [&] {
      return missing_tiles(progress_, plan_,
                           libgtd::tiles_of(frame_, tile_voxels_, options_.detection.share));
    });
    if (!wanted.empty()) {
      libmap::PointSpool spool(progress_.store() / "progress",
                               {.square_m = square_m(), .has_normals = stream.has_normals()});
      run_.timed("sort points", [&] { fill(spool, wanted); });
      run_.timed("tiles", [&] {
        libgtd::detect_streamed(
            frame_, SpooledPoints(spool), wanted, options_.detection,
            [&](std::vector<libgtd::StreamedTile> tiles) { journal->add(write(tiles)); },
            run_.progress(), {.max_points = options_.points_at_once});
      });
    }
    finish(wanted.size());
  }

 private:
  // The plan that is there, if it is of the same parameters and inputs; else a new one. The caller
  // holds the lock.
  void agree_on_plan(const libmap::PieceStream& stream) {
    const auto earlier = run_.options().force ? std::nullopt : progress_.plan();
    if (!earlier && !run_.options().force && fs::exists(progress_.store() / "index.json"))
      throw libmap::Error(
          "is complete, but its folder `progress` is not there: --force starts again",
          {.file = options_.store});
    std::vector<TerrainPiece> pieces = survey(
        files_, earlier ? earlier->pieces : std::vector<TerrainPiece>{}, stream.georeference());
    TilePlan plan;
    plan.index.manifest = manifest_of(pieces);
    plan.key = libgtd::key_of(plan.index.manifest);
    plan.pieces = std::move(pieces);
    if (earlier && earlier->key == plan.key) {
      // The same files may lie elsewhere by now, or have another time.
      plan_ = *earlier;
      plan_.pieces = std::move(plan.pieces);
      restore_frame();
    } else {
      if (earlier) require_appendable(*earlier, plan);
      progress_.require_idle();
      make_frame(stream, plan);
      if (earlier)
        keep_tiles(*earlier, plan);
      else
        progress_.clear();
      progress_.set_plan(plan);
      plan_ = std::move(plan);
    }
    remove_stale_index();
  }

  // Parameters and inputs, and what `score` says beside any map.
  libmap::Manifest manifest_of(const std::vector<TerrainPiece>& pieces) {
    libmap::Manifest& manifest = run_.manifest();
    carry_transforms(options_.terrain, run_);
    for (const TerrainPiece& piece : pieces) manifest.inputs.push_back(piece.input);
    for (const auto& input : libgtd::gripper_files(options_.gripper_file)) run_.add_input(input);
    manifest.frame = options_.frame == libgtd::MapFrame::terrain ? "terrain" : "input";
    libmap::Manifest copy = manifest;
    copy.timings_s.clear();
    copy.threads = 0;
    return copy;
  }

  void make_frame(const libmap::PieceStream& stream, TilePlan& plan) {
    std::size_t points = 0, dropped = 0;
    for (const TerrainPiece& piece : plan.pieces) {
      points += piece.points;
      dropped += piece.dropped_points;
    }
    require_points(points, dropped, options_.terrain, run_);
    in_file(options_.terrain, [&] {
      frame_ = libgtd::frame_terrain(stream, options_.detection);
      libgtd::tiles_of(frame_, tile_voxels_);  // too many show before anything is kept
    });
    plan.has_plane = frame_.plane.has_value();
    libgtd::TileStoreIndex& index = plan.index;
    index.lattice = frame_.lattice;
    index.tile_voxels = tile_voxels_;
    index.min = frame_.min;
    index.max = frame_.max;
    libmap::Manifest& manifest = index.manifest;
    libmap::Pose terrain_from_input = libmap::Pose::Identity();
    manifest.add_results({{"lattice_origin_m", frame_.lattice.origin_m}, {"input_points", points}});
    if (frame_.plane) {
      plan.centroid = frame_.plane->centroid;
      terrain_from_input = frame_.plane->terrain_from_input;
      manifest.add_results({{"plane_rmse_m", frame_.plane->rmse_m},
                            {"up_source", to_text(frame_.plane->up_source)}});
      report_plane(*frame_.plane, options_.terrain, run_);
    }
    manifest.transforms.emplace_back("terrain_from_input", terrain_from_input);
    manifest.add_results({{"mask_side_voxels", mask_.side}, {"mask_layers", mask_.layers}});
  }

  void restore_frame() {
    require_same_tiles(plan_);
    frame_.lattice = plan_.index.lattice;
    frame_.min = plan_.index.min;
    frame_.max = plan_.index.max;
    if (!plan_.has_plane) return;
    frame_.plane = libgtd::RegressionPlane{};
    frame_.plane->centroid = plan_.centroid;
    frame_.plane->terrain_from_input = plan_.index.terrain_from_input();
  }

  void require_same_tiles(const TilePlan& earlier) const {
    const libgtd::VoxelLattice& lattice = earlier.index.lattice;
    if (earlier.index.tile_voxels != tile_voxels_ ||
        lattice.voxel_size_m != scenario_.voxel_size_m ||
        lattice.origin_m != libgtd::VoxelLattice{}.origin_m)
      throw not_of_this_terrain("tile_voxels and lattice");
  }

  // The key is right, but something else was changed.
  libmap::Error not_of_this_terrain(const std::string& field) const {
    return libmap::Error(
        "is not of this terrain and these parameters: --force starts again",
        {.file = (progress_.store() / "progress" / "plan.json").string(), .field = field});
  }

  // Throws unless `plan` is `earlier` with more pieces, and tiles far from these stay as they are.
  void require_appendable(const TilePlan& earlier, const TilePlan& plan) const {
    const auto refuse = [&](const std::string& reason) {
      throw libmap::Error(reason, {.file = options_.store});
    };
    if (earlier.index.manifest.parameters != plan.index.manifest.parameters ||
        earlier.index.manifest.version != plan.index.manifest.version)
      refuse("contains tiles of other parameters: --force starts again");
    if (earlier.index.manifest.georeference != plan.index.manifest.georeference)
      refuse("has its offset from another first piece: new pieces need names behind it");
    const auto same = [](const TerrainPiece& a, const TerrainPiece& b) {
      return a.input.sha256 == b.input.sha256;
    };
    auto at = plan.pieces.begin();
    for (const TerrainPiece& piece : earlier.pieces) {
      at = std::find_if(at, plan.pieces.end(), [&](const auto& one) { return same(one, piece); });
      if (at == plan.pieces.end())
        refuse("contains tiles of another terrain or gripper: --force starts again");
      ++at;
    }
    if (earlier.pieces.size() == plan.pieces.size())
      refuse("contains tiles of another gripper file: --force starts again");
    if (!options_.append)
      refuse(fmt::format(
          "contains tiles of {} of these {} pieces: --append adds the others, --force starts again",
          earlier.pieces.size(), plan.pieces.size()));
    if (options_.detection.plane != libgtd::PlaneSource::none)
      refuse("--append needs --plane none: with a fitted plane every new point moves all tiles");
    if (scenario_.method != libgtd::Method::corrected &&
        scenario_.method != libgtd::Method::calibrated)
      refuse(
          "--append needs --method corrected or calibrated: others leave out the terrain's border");
    require_same_tiles(earlier);
  }

  // Those that no point of a new piece can change.
  void keep_tiles(const TilePlan& earlier, TilePlan& plan) const {
    std::vector<libmap::Bounds3d> added;
    auto known = earlier.pieces.begin();
    for (const TerrainPiece& piece : plan.pieces)
      if (known != earlier.pieces.end() && piece.input.sha256 == known->input.sha256)
        ++known;
      else if (piece.points > 0)
        added.push_back(piece.box);
    for (const auto& [number, tile] : progress_.done(earlier)) {
      const libgtd::PointsRectangle places =
          libgtd::points_for(libgtd::columns_of(number, tile_voxels_), frame_, halo_);
      const bool is_touched =
          std::any_of(added.begin(), added.end(), [&](const libmap::Bounds3d& box) {
            return (box.min.head<2>().array() <= places.high.array()).all() &&
                   (box.max.head<2>().array() >= places.low.array()).all();
          });
      if (!is_touched) plan.kept.push_back(tile);
    }
  }

  void remove_stale_index() const {
    if (!fs::exists(progress_.store() / "index.json")) return;
    try {
      if (libgtd::read_tile_store(progress_.store()).key == plan_.key) return;
    } catch (const libmap::Error&) {
      // Broken: it is written again.
    }
    progress_.remove_index();
  }

  // Small against the tiles that are worked on at once, not small against their halo.
  double square_m() const {
    return std::max(1.0 + halo_, std::min<double>(tile_voxels_, 4.0 * halo_)) *
           scenario_.voxel_size_m;
  }

  // The points on which the wanted tiles depend.
  void fill(libmap::PointSpool& spool, const std::vector<TileNumber>& wanted) const {
    const NeededTiles needed(libgtd::tile_of(frame_.min, tile_voxels_),
                             libgtd::tile_of(frame_.max, tile_voxels_),
                             (halo_ + 1) / tile_voxels_ + 1, wanted);
    std::vector<fs::path> files;
    for (const TerrainPiece& piece : plan_.pieces)
      if (touches(piece, needed)) files.emplace_back(piece.input.path);
    const bool are_all = wanted.size() == libgtd::tiles_of(frame_, tile_voxels_).size();
    std::optional<TileNumber> last;
    bool is_needed = false;
    const auto all = libmap::PointStream::Need::positions_and_normals;
    libmap::PieceStream(files).for_each_block(all, [&](const libmap::PointCloud& block) {
      const libmap::PointCloud terrain = libgtd::to_terrain(block, frame_);
      require_in_frame(terrain);
      if (are_all) return spool.add(terrain);
      std::vector<std::size_t> near;
      for (std::size_t n = 0; n < terrain.size(); ++n) {
        const TileNumber tile =
            libgtd::tile_of(frame_.lattice.voxel_of(terrain.positions[n]), tile_voxels_);
        if (tile != last) is_needed = needed.hold(tile);
        last = tile;
        if (is_needed) near.push_back(n);
      }
      spool.add(libmap::select_points(terrain, near));
    });
    spool.finish();
  }

  // A voxel more, against rounding.
  void require_in_frame(const libmap::PointCloud& terrain) const {
    const Eigen::Array3d low(frame_.min.i - 1.0, frame_.min.j - 1.0, frame_.min.k - 1.0);
    const Eigen::Array3d high(frame_.max.i + 2.0, frame_.max.j + 2.0, frame_.max.k + 2.0);
    for (const Eigen::Vector3d& point : terrain.positions) {
      const Eigen::Array3d cell = frame_.lattice.cell_of(point);
      if (!(cell >= low).all() || !(cell <= high).all()) throw not_of_this_terrain("min and max");
    }
  }

  bool touches(const TerrainPiece& piece, const NeededTiles& needed) const {
    if (piece.points == 0) return false;
    libmap::PointCloud corners;
    for (int n = 0; n < 8; ++n)
      corners.positions.emplace_back((n & 1) == 0 ? piece.box.min.x() : piece.box.max.x(),
                                     (n & 2) == 0 ? piece.box.min.y() : piece.box.max.y(),
                                     (n & 4) == 0 ? piece.box.min.z() : piece.box.max.z());
    const libmap::Bounds3d box = libmap::bounds_of(libgtd::to_terrain(corners, frame_).positions);
    // A voxel more, against rounding.
    const Eigen::Vector3d margin = Eigen::Vector3d::Constant(scenario_.voxel_size_m);
    return needed.hold_any(tile_near(frame_.lattice, box.min - margin, tile_voxels_),
                           tile_near(frame_.lattice, box.max + margin, tile_voxels_));
  }

  std::vector<StoredTile> write(std::vector<libgtd::StreamedTile>& tiles) const {
    std::vector<StoredTile> stored(tiles.size());
    libmap::parallel_each(tiles.size(), [&](std::size_t n) { stored[n] = write(tiles[n]); });
    return stored;
  }

  StoredTile write(libgtd::StreamedTile& tile) const {
    StoredTile stored;
    stored.number = tile.number;
    stored.occupied_voxels = tile.occupied_voxels;
    stored.voxels = tile.voxels.size();
    if (tile.voxels.empty()) return stored;
    stored.min = stored.max = tile.voxels.front().voxel;
    for (const libgtd::MapVoxel& one : tile.voxels) {
      const libgtd::Voxel& voxel = one.voxel;
      stored.min = {std::min(stored.min.i, voxel.i), std::min(stored.min.j, voxel.j),
                    std::min(stored.min.k, voxel.k)};
      stored.max = {std::max(stored.max.i, voxel.i), std::max(stored.max.j, voxel.j),
                    std::max(stored.max.k, voxel.k)};
      stored.border_voxels += one.border ? 1 : 0;
      stored.graspable_voxels += one.graspable ? 1 : 0;
    }
    libgtd::GraspabilityMap map;
    map.lattice = frame_.lattice;
    if (frame_.plane) map.terrain_from_input = frame_.plane->terrain_from_input;
    map.zero_plane_m = scenario_.zero_plane_m;
    map.content = libgtd::content_of(scenario_);
    map.voxels = std::move(tile.voxels);
    write_tile(progress_, libgtd::to_cloud(map, options_.frame), stored);
    return stored;
  }

  // Whoever comes last writes the index.
  void finish(std::size_t scored) {
    const libmap::FileLock lock = progress_.lock();
    const libgtd::TileProgress::Completion completion = progress_.complete(plan_);
    if (!completion.index) {
      run_.say("{} tiles scored; {} of {} are there", scored, completion.done, completion.tiles);
      return;
    }
    const libgtd::TileStoreIndex& index = *completion.index;
    if (!fs::exists(progress_.store() / "index.json")) {
      libmap::Manifest manifest = index.manifest;
      manifest.timings_s = run_.manifest().timings_s;
      manifest.threads = run_.manifest().threads;
      progress_.write_index(index, manifest);
    }
    run_.say("{} of {} tiles scored, all are there: {} voxels, {} graspable", scored,
             completion.tiles, index.voxels(), index.graspable_voxels());
    if (index.voxels() == 0)
      run_.warn("the terrain is smaller than the gripper mask: nothing was scored");
  }

  const ScoreStoreOptions& options_;
  const libgtd::Scenario& scenario_;
  Run& run_;
  libgtd::TileProgress progress_;
  std::vector<fs::path> files_;
  int tile_voxels_;
  libgtd::GripperMask mask_;
  int halo_;
  TilePlan plan_;
  libgtd::TerrainFrame frame_;
};

}  // namespace

void report_plane(const libgtd::RegressionPlane& plane, const std::string& terrain, Run& run) {
  if (plane.up_source == libgtd::UpSource::direction) return;
  run.say("up from the {}", name_of(plane.up_source));
  // Of the other sources, viewpoint and normals saw the outside, and the relief agrees with itself.
  if (plane.up_source == libgtd::UpSource::frame_z && plane.relief_skewness < upside_down_skewness)
    run.warn(
        "{}: its relief hangs below the plane: if this is upside down, give --up (--up=0,0,-1 for "
        "a cloud in a camera's frame)",
        terrain);
}

void require_points(std::size_t points, std::size_t dropped, const std::string& terrain, Run& run) {
  if (points == 0)
    throw libmap::Error(dropped == 0 ? "the cloud has no points"
                                     : fmt::format("none of its {} points has a position", dropped),
                        {.file = terrain});
  if (dropped > 0) run.warn("{}: {} points without a position were dropped", terrain, dropped);
}

void score_into_store(const ScoreStoreOptions& options, Run& run) {
  libgtd::require_streamable(options.detection);
  if (run.options().force && options.detection.share.count > 1)
    throw libmap::Error("removes the tiles of all shares: use it without --tile",
                        {.field = "--force"});
  StoreScoring(options, run).score();
}

}  // namespace graspmap_tools
