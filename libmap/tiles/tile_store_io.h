// A tile store on disk: a folder that is made tile by tile, so that a run that was killed at any
// moment is resumed, and so that several runs make shares of it at the same time.
//
//   STORE/tiles/*               the file of each tile that is not empty
//   STORE/progress/plan.json    what all runs share, with a key of parameters and inputs
//   STORE/progress/K_of_N.jsonl journal of share K/N: one line per finished tile
//   STORE/progress/lock         held while the plan is made and the store is completed
//
// A tile is done if a line of the plan's key lists it; its file is then in place. Truncated lines
// of a killed run are ignored.
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

// SHA-256 of the manifest's version, its parameters and its inputs' hashes.
std::string key_of(const Manifest& manifest);

// The journal of one share, held by one process at a time.
class TileJournal {
 public:
  // Throws Error (failed) if another process works on this share.
  TileJournal(const std::filesystem::path& store, const TileShare& share);
  ~TileJournal();
  TileJournal(TileJournal&& other) noexcept;
  TileJournal& operator=(TileJournal&&) = delete;
  // Lists tiles as done, whose files are in place: one line of JSON for each.
  void add(const std::vector<std::string>& lines);

 private:
  std::filesystem::path path_;
  FileLock lock_;
  int file_ = -1;
};

// A tile store, as one run sees it.
class TileStore {
 public:
  // Nothing is read or made yet.
  explicit TileStore(std::filesystem::path folder);

  // The folder, and what is in it.
  const std::filesystem::path& folder() const { return folder_; }
  std::filesystem::path tiles() const { return folder_ / "tiles"; }
  std::filesystem::path index_path() const { return folder_ / "index.json"; }  // of finished stores
  std::filesystem::path plan_path() const { return progress() / "plan.json"; }

  // Begins the run of a share: makes the folders that are missing, calls agree_on_plan() while no
  // other run can change the plan, and takes the journal. Throws Error if the folder contains
  // something else, and what agree_on_plan() throws; a new folder is then removed again.
  TileJournal begin(const TileShare& share, const std::function<void()>& agree_on_plan) const;
  void open() const;  // makes the folders alone

  // The plan as text; nothing if there is none.
  std::optional<std::string> plan_text() const;
  void write_plan(const std::string& text) const;

  // Place of a line in a journal.
  struct Line {
    std::filesystem::path journal;
    std::size_t begin = 0;
  };
  // visit(text, line) for each line of all journals.
  void each_line(const std::function<void(const std::string& text, const Line& line)>& visit) const;
  static std::string read_line(const Line& line);

  // Waits for its turn.
  FileLock lock() const;
  // Throws Error (failed) if a process works on a share. The caller holds the lock.
  void require_idle() const;
  // Removes plan, journals, tiles and index. The caller holds the lock.
  void clear() const;
  // Removes the folder if it contains no plan and no tiles.
  void remove_if_bare() const;

 private:
  std::filesystem::path progress() const { return folder_ / "progress"; }
  std::vector<std::filesystem::path> journals() const;

  std::filesystem::path folder_;
};

}  // namespace libmap
