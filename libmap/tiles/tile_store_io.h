// Tile store on disk: a folder with one file per tile and journals of finished tiles. A killed run
// can be resumed, and several runs can compute shares of the tiles at the same time.
//
//   STORE/tiles/*               the file of each tile that is not empty
//   STORE/progress/plan.json    common data of all runs, with a key of parameters and inputs
//   STORE/progress/K_of_N.jsonl journal of share K/N: one line per finished tile
//   STORE/progress/lock         locked while a run makes the plan or completes the store
//
// A tile is finished if a journal line with the plan's key lists it; the tile's file is then
// complete. Truncated lines of a killed run are ignored.
#pragma once

#include <cstddef>
#include <filesystem>
#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "libmap/core/manifest.h"
#include "libmap/core/output_lock.h"
#include "libmap/tiles/tile_share.h"

namespace libmap {

// Returns the plan's key: the SHA-256 of version, parameters and input hashes of the manifest.
std::string key_of(const Manifest& manifest);

// Journal of one share, locked by one process at a time.
class TileJournal {
 public:
  // Opens and locks the journal. Throws Error (failed) if another process works on this share.
  TileJournal(const std::filesystem::path& store, const TileShare& share);
  ~TileJournal();
  TileJournal(TileJournal&& other) noexcept;
  TileJournal& operator=(TileJournal&&) = delete;
  // Appends and syncs lines of JSON, one per tile whose file is complete. Throws Error (failed).
  void add(const std::vector<std::string>& lines);

 private:
  std::filesystem::path path_;
  FileLock lock_;
  int file_ = -1;
};

// Access of one run to a tile store on disk.
class TileStore {
 public:
  // Does not access the disk.
  explicit TileStore(std::filesystem::path folder);

  // Paths of the folder and of its content. index.json exists only in finished stores.
  const std::filesystem::path& folder() const { return folder_; }
  std::filesystem::path tiles() const { return folder_ / "tiles"; }
  std::filesystem::path index_path() const { return folder_ / "index.json"; }
  std::filesystem::path plan_path() const { return progress() / "plan.json"; }

  // Begins the run of a share: creates missing folders, calls check_plan() while the store is
  // locked, and locks the journal. Throws Error if the folder is not a tile store, and as
  // check_plan() and TileJournal do. After an error, a new folder is removed again.
  TileJournal begin(const TileShare& share, const std::function<void()>& check_plan) const;
  void open() const;  // only creates missing folders; throws Error if `folder` is no tile store

  // Returns the plan as text, or nullopt if there is none.
  std::optional<std::string> plan_text() const;
  void write_plan(const std::string& text) const;  // atomically

  // Position of a line in a journal file.
  struct Line {
    std::filesystem::path journal;
    std::size_t begin = 0;  // offset of the first byte
  };
  // Calls visit(text, line) for each line of all journals. Throws Error (failed) on a read error.
  void each_line(const std::function<void(const std::string& text, const Line& line)>& visit) const;
  static std::string read_line(const Line& line);  // throws Error (failed)

  // Locks the store (progress/lock). Waits until the lock is free.
  FileLock lock() const;
  // Throws Error (failed) if a process works on a share. Call it while you hold lock().
  void require_idle() const;
  // Removes plan, journals, tiles and index. Call it while you hold lock().
  void clear() const;
  // Removes the folder if it contains no plan and no tiles.
  void remove_if_bare() const;

 private:
  std::filesystem::path progress() const { return folder_ / "progress"; }
  std::vector<std::filesystem::path> journals() const;

  std::filesystem::path folder_;
};

}  // namespace libmap
