// Graspability maps, whole and in tiles.
#include "libgtd/evaluate/expected_map.h"
#include "libgtd/evaluate/lookup.h"
#include "libgtd/evaluate/voxel_map.h"
#include "libgtd/score/graspability_map.h"
#include "libgtd/score/map_downsampling.h"
#include "libgtd/score/tile_store_io.h"
#include "libmap/io/cloud_io.h"
#include "libmap/report/map_view.h"
#include "tests/fuzz/scratch_file.h"
#include "tests/fuzz/target_support.h"
#include "tests/libgtd/evaluate/map_test_support.h"

namespace graspmap_fuzz {

namespace {

namespace fs = std::filesystem;

libmap::PointCloud small_map() {
  libmap::PointCloud map = graspmap_test::map_cloud(
      graspmap_test::floor_voxels(3, 4), [](const libgtd::Voxel& voxel) { return 0.3 * voxel.j; });
  map.add_field("slope_deg", libmap::ScalarType::float32).values.assign(map.size(), 70.0);
  return map;
}

libgtd::TileStoreIndex small_index() {
  libgtd::TileStoreIndex index;
  index.key = std::string(64, 'a');
  index.lattice.voxel_size_m = graspmap_test::test_voxel_m;
  index.tile_voxels = 100;
  index.max = {120, 50, 9};
  index.manifest = small_manifest();
  for (const int number : {0, 1}) {
    libgtd::StoredTile tile;
    tile.number = {number, 0};
    tile.min = {100 * number, 0, 0};
    tile.max = {100 * number + 20, 50, 9};
    tile.voxels = tile.occupied_voxels = 7;
    tile.file = libgtd::tile_file_of(tile.number);
    tile.bytes = 1;
    tile.sha256 = std::string(64, 'b');
    index.tiles.push_back(tile);
  }
  return index;
}

// Any tile that is asked for holds `map`.
void look_up_all(const libgtd::TileStoreIndex& index, const libmap::PointCloud& map) {
  for (const auto& [name, mode] : libgtd::lookup_mode_names())
    libgtd::look_up_tiles(index, [&](std::size_t) { return map; },
                          {{0.0, 0.0, 0.0}, {1.0, 2.0, 0.1}}, {.mode = mode});
}

// A map, or a tile of one.
bool run_map(std::string_view bytes) {
  static const ScratchFile file("map.pcd");
  file.write(bytes);
  return accepts([&] {
    libmap::PointCloud map = libmap::read_cloud(file.path()).cloud;
    accepts([&] { libgtd::voxel_map_of(map); });
    accepts([&] { libgtd::voxel_map_of(map, libgtd::map_info(small_manifest())); });
    accepts([&] { libgtd::look_up(map, {{0.0, 0.0, 0.0}}); });
    accepts([&] { libgtd::evaluate_expected_map(map, {{{"a", {}, {}, 0.02, true, ""}}}, 0.8); });
    accepts([&] { libgtd::merge_map_clouds({map}); });
    accepts([&] { look_up_all(small_index(), map); });
    accepts([&] { libgtd::voxel_downsample_map(map, 1 << 20); });
    accepts([&] { libmap::make_map_view(map, {}); });
    libgtd::restore_positions(small_index(), map);
  });
}

Seeds map_seeds() {
  Seeds seeds;
  for (const auto encoding : {libmap::FileEncoding::ascii, libmap::FileEncoding::binary})
    seeds.push_back(written("map.pcd", [&](const fs::path& path) {
      libmap::write_cloud(path, small_map(), {.encoding = encoding});
    }));
  return seeds;
}

bool run_tile_index(std::string_view bytes) {
  static const ScratchFile file("store.tiles/index.json");
  file.write(bytes);
  return accepts([&] {
    const libgtd::TileStoreIndex index = libgtd::read_tile_store(file.path().parent_path());
    index.voxels();
    for (const libgtd::StoredTile& tile : index.tiles)
      libgtd::columns_of(tile.number, index.tile_voxels);
    look_up_all(index, small_map());
  });
}

Seeds tile_index_seeds() {
  return {written("seed.tiles/index.json", [](const fs::path& path) {
    libgtd::MapTileStore(path.parent_path()).write_index(small_index());
  })};
}

// The plan of a store that is not finished, and a journal.
bool run_tile_progress(std::string_view bytes) {
  static const ScratchFile plan("unfinished.tiles/progress/plan.json");
  static const ScratchFile journal("unfinished.tiles/progress/1_of_1.jsonl");
  const fs::path store = plan.path().parent_path().parent_path();
  fs::remove(store / "index.json");
  plan.write(take_file(bytes));
  journal.write(bytes);
  accepts([&] { libgtd::read_tile_store(store); });
  return accepts([&] {
    const libgtd::MapTileStore unfinished(store);
    const auto read = unfinished.plan();
    if (read) unfinished.complete(*read);
    libgtd::finish_tile_store(store);
  });
}

Seeds tile_progress_seeds() {
  libgtd::TilePlan plan;
  plan.index = small_index();
  plan.key = plan.index.key;
  plan.kept = {plan.index.tiles.front()};
  plan.has_plane = true;
  plan.terrain = {{.input = small_manifest().inputs.front(), .points = 5, .box = {}}};
  const std::string text = written("progress/plan.json", [&](const fs::path& path) {
    libgtd::MapTileStore(path.parent_path().parent_path()).set_plan(plan);
  });
  const std::string line = written("progress/1_of_1.jsonl", [&](const fs::path& path) {
    libmap::TileJournal journal(path.parent_path().parent_path(), {});
    libgtd::add_tiles({plan.index.tiles.back()}, plan.key, journal);
  });
  return {text + '\f' + line};
}

}  // namespace

std::vector<FuzzTarget> map_targets() {
  return {
      {"map", "graspability maps and their tiles", run_map, map_seeds},
      {"tile_index", "indices of tile stores", run_tile_index, tile_index_seeds},
      {"tile_progress", "plans and journals of unfinished tile stores", run_tile_progress,
       tile_progress_seeds},
  };
}

}  // namespace graspmap_fuzz
