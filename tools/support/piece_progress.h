// Folders of pieces that are made piece by piece, so that a run that was killed at any moment is
// resumed by the same command, and so that several runs make shares of one folder:
//
//   FOLDER.progress/KEY/PIECE.json    facts on a piece that is done
//   FOLDER.progress/KEY/PIECE.*       its file, there before its facts; none if it is empty
//   FOLDER.progress/KEY/.common.json  what all pieces need (PieceProgress::common_facts)
//   FOLDER.progress/KEY/K_of_N.lock   held by the run of share K/N
//
// KEY hashes the version, the parameters and the contents of the inputs.
#pragma once

#include <filesystem>
#include <functional>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>
#include <vector>

#include "libgtd/score/tiling.h"
#include "libmap/core/output_lock.h"
#include "tools/support/command_line.h"

namespace graspmap_tools {

// --tile K/N: the share of the pieces that a run makes.
inline constexpr const char* whole_share = "1/1";
void add_share_option(Command& command, std::string& share);
// Throws Error if a share is asked for of an output that is one file.
void require_folder_of_share(const std::string& output, const std::string& share);

class PieceProgress {
 public:
  using Facts = nlohmann::json;

  // Claims the folder `output`, unless other runs make other shares of it; `names` and `inputs` as
  // for Run::claim_output_tree. The manifest of `run` must have its parameters and inputs. Pieces
  // of an earlier run with another key are removed; where shares are made or another process works
  // on them, they are an Error instead, and so are shares with --force, which removes all pieces.
  PieceProgress(const std::string& output, const std::vector<std::string>& names,
                const std::vector<std::string>& inputs, const libgtd::TileShare& share, Run& run);

  // Whether the folder itself is there, as shares of this key have made it; says so.
  bool is_complete() const;

  struct Work {
    std::vector<std::string> pieces;  // of all shares: names without an extension
    std::string extension;            // of their files
    // Writes the n-th piece to `to`, unless it is empty, and returns facts on it.
    std::function<Facts(std::size_t n, const std::filesystem::path& to)> make;
    // Fills the output with the pieces that are done.
    std::function<void(const std::filesystem::path& folder)> finish;
  };
  // Makes the pieces of the share that are missing, and the folder if then all pieces are done;
  // else says how many are. With --dry-run nothing is made. Throws Error (failed) if another
  // process works on this share.
  void make(const Work& work);

  // What all pieces need: found once, by the share that asks first, while the others wait; with
  // --dry-run each time. Throws what `find` throws.
  Facts common_facts(const std::function<Facts()>& find);

  // Of a piece that is done. file() may not exist: the piece is empty.
  Facts facts(const std::string& piece) const;
  std::filesystem::path file(const std::string& piece, const std::string& extension) const;
  // The file of a piece once more at `to`: a link where the file system has them, else a copy.
  static void link_file(const std::filesystem::path& file, const std::filesystem::path& to);

 private:
  bool is_done(const std::string& piece) const;
  bool is_put_together() const;
  void remove_other_keys(bool all) const;
  void remove_pieces() const;
  void make_folder() const;
  void make_missing(const Work& work);
  void put_together(const Work& work);
  std::filesystem::path lock_path() const;

  std::filesystem::path output_;
  std::vector<std::string> names_;
  std::vector<std::string> inputs_;
  libgtd::TileShare share_;
  Run& run_;
  std::string key_;
  std::filesystem::path folder_;
  std::optional<libmap::FileLock> lock_;
};

}  // namespace graspmap_tools
