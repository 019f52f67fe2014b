#include "tools/support/store_filling.h"

#include <filesystem>

#include "libgtd/score/tile_store_io.h"
#include "libmap/cloud/cloud_io.h"
#include "libmap/core/error.h"
#include "libmap/core/file_output.h"
#include "libmap/core/manifest.h"
#include "libmap/core/parallel.h"
#include "libmap/core/text.h"

namespace graspmap_tools {

libgtd::TileShare parse_share(const std::string& text) {
  const std::size_t slash = text.find('/');
  const auto number = libmap::parse_integer(text.substr(0, slash));
  const auto count =
      slash == std::string::npos ? std::nullopt : libmap::parse_integer(text.substr(slash + 1));
  if (!number || !count || *count < 1 || *number < 1 || *number > *count || *count > 1000000)
    throw libmap::Error("no such share of the tiles",
                        {.field = "--tile", .value = text, .bound = "K/N with 1 <= K <= N"});
  return {static_cast<int>(*number), static_cast<int>(*count)};
}

std::vector<libgtd::TileNumber> missing_tiles(const libgtd::TileProgress& progress,
                                              const libgtd::TilePlan& plan,
                                              const std::vector<libgtd::TileNumber>& tiles) {
  const auto done = progress.done(plan);
  std::vector<std::uint8_t> is_there(tiles.size(), 0);
  libmap::parallel_for(tiles.size(), 16, [&](std::size_t begin, std::size_t end) {
    for (std::size_t n = begin; n < end; ++n) {
      const auto found = done.find(tiles[n]);
      if (found == done.end()) continue;
      try {
        if (found->second.voxels > 0) libgtd::checked_tile_path(progress.store(), found->second);
        is_there[n] = 1;
      } catch (const libmap::Error&) {
        continue;
      }
    }
  });
  std::vector<libgtd::TileNumber> missing;
  for (std::size_t n = 0; n < tiles.size(); ++n)
    if (is_there[n] == 0) missing.push_back(tiles[n]);
  return missing;
}

void write_tile(const libgtd::TileProgress& progress, const libmap::PointCloud& points,
                libgtd::StoredTile& tile) {
  if (points.empty()) return;
  tile.file = libgtd::tile_file_of(tile.number);
  libmap::OutputFile file(progress.store() / tile.file);
  libmap::write_named(
      file.temporary_path(), file.final_path(),
      [&](const std::filesystem::path& temporary) { libmap::write_cloud(temporary, points); });
  tile.bytes = std::filesystem::file_size(file.temporary_path());
  tile.sha256 = libmap::sha256_of_file(file.temporary_path());
  file.commit();
}

}  // namespace graspmap_tools
