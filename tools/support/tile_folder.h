// Outputs that are folders of tiles. One run, or several runs that share the tiles, make the tiles
// in a tile store beside the folder (libmap/tiles/tile_store_io.h):
//
//   FOLDER.progress/tiles/TILE.*    file of a finished tile; none for an empty tile
//   FOLDER.progress/progress/...    plan with common data, and journals with data of each tile
//
// When all tiles are complete, the folder is created at once and the store is removed.
#pragma once

#include <filesystem>
#include <functional>
#include <map>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>
#include <vector>

#include "libmap/tiles/tile_store_io.h"
#include "libmap/tiles/xy_tile.h"
#include "tools/support/command_line.h"

namespace graspmap_tools {

// End of the option text of an output that may be a folder of tiles.
inline constexpr const char* or_tile_folder = ", or a folder of tiles (no extension)";

// Returns true if the output is a folder of tiles: a name without extension.
inline bool is_tile_folder(const std::string& output) {
  return std::filesystem::path(without_trailing_slash(output)).extension().empty();
}

// Returns the file names that the folder may contain: tiles of an earlier run and of this run.
inline std::vector<std::string> tile_folder_names(
    const std::string& output, const std::vector<std::filesystem::path>& tiles = {},
    const std::string& extension = {}) {
  std::vector<std::string> names = libmap::tile_file_names(output);
  for (const std::filesystem::path& tile : tiles) names.push_back(tile.stem().string() + extension);
  return names;
}

// Value of --tile: "K/N", the share of the tiles that this run computes. "1/1" is all tiles.
inline constexpr const char* whole_share = "1/1";
void add_share_option(Command& command, std::string& share);
// Throws Error if a share is requested and the output is one file.
void require_folder_of_share(const std::string& output, const std::string& share);

class TileFolder {
 public:
  using TileData = nlohmann::json;

  // Claims the folder `output` unless the run computes one of several shares. `names` and `inputs`
  // are as in Run::claim_output_tree. The manifest of `run` must have parameters and inputs. Throws
  // Error for a share with --force, which deletes all tiles, and for a share with other parameters
  // or inputs than the earlier shares.
  TileFolder(const std::string& output, const std::vector<std::string>& names,
             const std::vector<std::string>& inputs, const libmap::TileShare& share, Run& run);

  // Returns true, with a message, if shares with equal parameters and inputs completed the folder.
  bool is_complete() const;

  // Begins the run and returns the data common to all tiles; null with --dry-run. The first share
  // computes the data by `find` while the others wait. Deletes tiles of other parameters or inputs;
  // throws Error instead if the run is one of several shares, or if another process uses the store.
  // Throws the errors of `find`.
  TileData begin(const std::function<TileData()>& find = [] { return TileData::object(); });

  struct Work {
    std::vector<std::string> tiles;  // names of the tiles of all shares, without extension
    std::string extension;           // extension of the tiles' files, e.g. ".ply"
    // Computes the n-th tile, writes it to `to` if not empty, and returns its data, a JSON object.
    std::function<TileData(std::size_t n, const std::filesystem::path& to)> make;
    // Fills the output with the finished tiles.
    std::function<void(const std::filesystem::path& folder)> finish;
  };
  // Calls begin() if it was not called, makes the missing tiles of the share, and creates the
  // folder if all tiles are complete; otherwise reports the number of tiles. With --dry-run nothing
  // is made. Throws Error (failed) if another process works on this share.
  void make(const Work& work);

  // Return the data and the file of a finished tile, for Work::finish.
  TileData tile_data(const std::string& tile) const;
  std::filesystem::path file(const std::string& tile, const std::string& extension) const {
    return store_.tiles() / (tile + extension);
  }
  // Creates a hard link `to` of a tile's file, or a copy if the file system has no hard links.
  static void link_file(const std::filesystem::path& file, const std::filesystem::path& to);

 private:
  template <typename Step>
  void resumable(const Step& step);
  std::optional<TileData> earlier_plan() const;
  void check_plan(const std::function<TileData()>& find);
  void find_done();
  bool is_done(const std::string& tile) const;
  bool is_assembled() const;
  void make_missing(const Work& work);
  void assemble(const Work& work);
  void remove_store() const;

  std::string output_;
  std::vector<std::string> names_;
  std::vector<std::string> inputs_;
  libmap::TileShare share_;
  Run& run_;
  std::string key_;
  libmap::TileStore store_;
  TileData common_;
  std::optional<libmap::TileJournal> journal_;
  std::map<std::string, libmap::TileStore::Line> done_;  // by the tile's name in JSON
};

}  // namespace graspmap_tools
