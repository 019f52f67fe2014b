#include "tools/support/info_tiles.h"

#include <Eigen/Geometry>

#include "libmap/core/error.h"
#include "libmap/core/parallel.h"
#include "tools/support/map_tiles.h"

namespace graspmap_tools {

namespace {

using Json = nlohmann::ordered_json;

Json numbers(const Eigen::Vector3d& v) { return Json::array({v.x(), v.y(), v.z()}); }

// Reads every tile; the ones that cannot be used, in their order.
std::vector<std::string> find_faults(const MapTiles& tiles, libmap::Progress& progress) {
  const std::size_t count = tiles.index().tiles.size();
  progress.begin("verify", count);
  std::vector<std::string> reasons(count);
  libmap::parallel_for(count, 1, [&](std::size_t begin, std::size_t end) {
    for (std::size_t n = begin; n < end; ++n) {
      try {
        tiles.load_checked(n);
      } catch (const libmap::Error& error) {
        reasons[n] = error.what();
      }
      progress.advance(1);
    }
  });
  progress.end();
  std::vector<std::string> faults;
  for (const std::string& reason : reasons)
    if (!reason.empty()) faults.push_back(reason);
  return faults;
}

}  // namespace

TilesInfo tiles_info(const std::string& store, bool verify, libmap::Progress& progress) {
  const MapTiles tiles(store);
  const libgtd::TileStoreIndex& index = tiles.index();
  Eigen::AlignedBox3d box;
  std::uint64_t bytes = 0;
  std::uint64_t border = 0;
  std::uint64_t graspable = 0;
  for (std::size_t n = 0; n < index.tiles.size(); ++n) {
    box.extend(tiles.box(n));
    bytes += index.tiles[n].bytes;
    border += index.tiles[n].border_voxels;
    graspable += index.tiles[n].graspable_voxels;
  }
  TilesInfo info;
  info.json = {{"kind", "graspability map in tiles"},
               {"points", index.voxels()},
               {"border_voxels", border},
               {"graspable_voxels", graspable},
               {"bounds_m", {{"min", numbers(box.min())}, {"max", numbers(box.max())}}},
               {"tiles",
                {{"count", index.tiles.size()},
                 {"width_m", index.tile_voxels * index.lattice.voxel_size_m},
                 {"bytes", bytes}}},
               {"lattice",
                {{"voxel_size_m", index.lattice.voxel_size_m},
                 {"origin_m", numbers(index.lattice.origin_m)}}}};
  if (verify) {
    info.faults = find_faults(tiles, progress);
    info.json["broken_tiles"] = info.faults;
  }
  return info;
}

}  // namespace graspmap_tools
