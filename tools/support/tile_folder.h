// Outputs that are folders of tiles. The tiles are made in a tile store beside the folder, by one
// run or in shares (libmap/tiles/tile_store_io.h):
//
//   FOLDER.progress/tiles/TILE.*    file of a finished tile; none if it is empty
//   FOLDER.progress/progress/...    plan, with what all tiles need, and journals with facts on
//   tiles
//
// When all are done the folder appears as a whole, and the store is removed.
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

// Part of an output's help.
inline constexpr const char* or_tile_folder = ", or a folder of pieces (no extension)";

// Whether the output is a folder of tiles: its name has no extension.
inline bool is_tile_folder(const std::string& output) {
  return std::filesystem::path(without_trailing_slash(output)).extension().empty();
}

// The names that the folder may contain: tiles of an earlier run, and those to come.
inline std::vector<std::string> tile_folder_names(
    const std::string& output, const std::vector<std::filesystem::path>& tiles = {},
    const std::string& extension = {}) {
  std::vector<std::string> names = libmap::tile_file_names(output);
  for (const std::filesystem::path& tile : tiles) names.push_back(tile.stem().string() + extension);
  return names;
}

// --tile K/N: the share of the tiles that a run makes.
inline constexpr const char* whole_share = "1/1";
void add_share_option(Command& command, std::string& share);
// Throws Error if a share is asked for and the output is one file.
void require_folder_of_share(const std::string& output, const std::string& share);

class TileFolder {
 public:
  using Facts = nlohmann::json;

  // Claims the folder `output`, unless other runs make other shares of it; `names` and `inputs` as
  // for Run::claim_output_tree. The manifest of `run` must have its parameters and inputs. Throws
  // Error for a share with --force, which removes all tiles, and for a share of other parameters or
  // inputs than the shares before.
  TileFolder(const std::string& output, const std::vector<std::string>& names,
             const std::vector<std::string>& inputs, const libmap::TileShare& share, Run& run);

  // Whether shares of the same parameters and inputs have already completed the folder; says so.
  bool is_complete() const;

  // Begins the run. The share that begins first finds what all tiles need, while the others wait;
  // null with --dry-run. Tiles of other parameters or inputs are removed; if shares are made, or
  // another process works on them, they are an Error instead. Throws what `find` throws.
  Facts begin(const std::function<Facts()>& find = [] { return Facts::object(); });

  struct Work {
    std::vector<std::string> tiles;  // of all shares: names without an extension
    std::string extension;           // of their files
    // Writes the n-th tile to `to`, unless it is empty, and returns facts on it: an object.
    std::function<Facts(std::size_t n, const std::filesystem::path& to)> make;
    // Fills the output with the finished tiles.
    std::function<void(const std::filesystem::path& folder)> finish;
  };
  // Begins the run if begin() has not, makes the missing tiles of the share, and the folder if then
  // all tiles are done; else says how many are. With --dry-run nothing is made. Throws Error
  // (failed) if another process works on this share.
  void make(const Work& work);

  // Of a finished tile, in Work::finish.
  Facts facts(const std::string& tile) const;
  std::filesystem::path file(const std::string& tile, const std::string& extension) const {
    return store_.tiles() / (tile + extension);
  }
  // The file of a tile once more at `to`: a link where the file system has them, else a copy.
  static void link_file(const std::filesystem::path& file, const std::filesystem::path& to);

 private:
  template <typename Step>
  void resumable(const Step& step);
  std::optional<Facts> earlier_plan() const;
  void agree_on_plan(const std::function<Facts()>& find);
  void find_done();
  bool is_done(const std::string& tile) const;
  bool is_put_together() const;
  void make_missing(const Work& work);
  void put_together(const Work& work);
  void remove_store() const;

  std::string output_;
  std::vector<std::string> names_;
  std::vector<std::string> inputs_;
  libmap::TileShare share_;
  Run& run_;
  std::string key_;
  libmap::TileStore store_;
  Facts common_;
  std::optional<libmap::TileJournal> journal_;
  std::map<std::string, libmap::TileStore::Line> done_;  // by the tiles' names in JSON
};

}  // namespace graspmap_tools
