// How far the making of a tile store is, on disk, so that a run that was killed at any moment is
// taken up again, and so that several runs fill one store at the same time:
//
//   NAME.tiles/progress/plan.json     what all runs share: key, frame, pieces of the terrain, and
//                                     tiles that were there when pieces were added
//   NAME.tiles/progress/K_of_N.jsonl  one line a finished tile, by the run of share K/N
//   NAME.tiles/progress/lock          held while the plan is made and the index is written
//
// A tile is done if a line of the plan's key says so; its file is then in place. Lines that are
// not whole, as a run leaves them that is killed, do not count.
#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <filesystem>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "libgtd/score/tile_store.h"
#include "libgtd/score/tiling.h"
#include "libmap/core/output_lock.h"
#include "libmap/core/point_cloud.h"

namespace libgtd {

// A file of the terrain; with its size and time it is known again without reading it.
struct TerrainPiece {
  libmap::ManifestInput input;
  std::int64_t modified_ns = 0;
  std::uint64_t points = 0;
  std::uint64_t dropped_points = 0;
  libmap::Bounds3d box;  // in the input frame
};

struct TilePlan {
  std::string key;                                     // of parameters and inputs: key_of
  TileStoreIndex index;                                // without tiles and their counts
  Eigen::Vector3d centroid = Eigen::Vector3d::Zero();  // of the fitted plane
  bool has_plane = false;
  std::vector<TerrainPiece> pieces;
  std::vector<StoredTile> kept;  // tiles that are done already
};

// SHA-256 of the manifest's parameters and of its inputs' hashes.
std::string key_of(const libmap::Manifest& manifest);

class TileProgress {
 public:
  // `store` is NAME.tiles; nothing is read or made yet.
  explicit TileProgress(std::filesystem::path store);
  // Makes the folder and its sub-folders where they are missing. Throws Error if something else is
  // there.
  void open() const;

  // Removes the folder if it holds nothing but what open() and lock() made.
  void remove_if_bare() const;

  // Nothing if none was made yet. Throws Error naming the file if it is broken.
  std::optional<TilePlan> plan() const;
  void set_plan(const TilePlan& plan) const;
  // Removes all that a store holds; the caller holds the lock.
  void clear() const;

  // Waits for its turn.
  libmap::FileLock lock() const;

  // Throws Error (failed) if a process works on a share; the caller holds the lock.
  void require_idle() const;

  // Every tile that is done, whoever did it.
  std::map<TileNumber, StoredTile> done(const TilePlan& plan) const;

  // The index, if all tiles are done; else how many are.
  struct Completion {
    std::optional<TileStoreIndex> index;
    std::size_t done = 0;
    std::size_t tiles = 0;
  };
  Completion complete(const TilePlan& plan) const;
  // Writes the index, and a manifest beside the store.
  void write_index(const TileStoreIndex& index, const libmap::Manifest& manifest) const;
  void remove_index() const;

  const std::filesystem::path& store() const { return store_; }

 private:
  std::vector<std::filesystem::path> journals() const;

  std::filesystem::path store_;
};

// The journal of one share, held by one process at a time.
class TileJournal {
 public:
  // Throws Error (failed) if another process works on this share. Whoever may make a new plan must
  // not come between the plan and this: the caller holds the lock of both.
  TileJournal(const std::filesystem::path& store, const TileShare& share, std::string key);
  ~TileJournal();
  TileJournal(const TileJournal&) = delete;
  TileJournal& operator=(const TileJournal&) = delete;
  // After the tiles' files are in place.
  void add(const std::vector<StoredTile>& tiles);

 private:
  std::filesystem::path path_;
  std::string key_;
  std::optional<libmap::FileLock> lock_;
  int file_ = -1;
};

}  // namespace libgtd
