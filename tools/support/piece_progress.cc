#include "tools/support/piece_progress.h"

#include "libgtd/score/tile_progress_io.h"
#include "libmap/core/json_input.h"
#include "tools/support/piece_folder.h"

namespace graspmap_tools {

namespace fs = std::filesystem;

namespace {

// Digits of a key's hash that name a folder.
constexpr std::size_t key_digits = 16;
// Hidden: it is no name of a piece.
constexpr const char* common = ".common";

std::vector<fs::path> entries_of(const fs::path& folder) {
  std::vector<fs::path> paths;
  std::error_code ignored;
  for (const fs::directory_entry& entry : fs::directory_iterator(folder, ignored))
    paths.push_back(entry.path());
  return paths;
}

bool is_key(const std::string& name) {
  return name.size() == key_digits &&
         name.find_first_not_of("0123456789abcdef") == std::string::npos;
}

}  // namespace

void add_share_option(Command& command, std::string& share) {
  command.option("--tile", "K/N", share,
                 "make only share K of N of the pieces; the last share completes the folder");
}

void require_folder_of_share(const std::string& output, const std::string& share) {
  if (is_piece_folder(output)) return;
  refuse_given({{"--tile", share != whole_share}}, "is for a folder of pieces");
}

PieceProgress::PieceProgress(const std::string& output, const std::vector<std::string>& names,
                             const std::vector<std::string>& inputs, const libgtd::TileShare& share,
                             Run& run)
    : output_(without_trailing_slash(output)),
      names_(names),
      inputs_(inputs),
      share_(share),
      run_(run),
      key_(libgtd::key_of(run.manifest())) {
  folder_ = output_;
  folder_ += ".progress";
  folder_ /= key_.substr(0, key_digits);
  if (share_.count == 1) {
    run_.claim_output_tree(output_, names_, inputs_);
  } else {
    run_.check_output_tree(output_, inputs_);
    if (run_.options().force)
      throw libmap::Error("removes the pieces of all shares: use it without --tile",
                          {.field = "--force"});
  }
  if (run_.options().dry_run) return;
  remove_other_keys(run_.options().force);
}

// Of another cloud or other parameters, or all.
void PieceProgress::remove_other_keys(bool all) const {
  for (const fs::path& other : entries_of(folder_.parent_path())) {
    if (!is_key(other.filename().string()) || (other == folder_ && !all)) continue;
    if (share_.count > 1)
      throw libmap::Error(
          "contains pieces of another input or of other parameters: --force without --tile starts "
          "again",
          {.file = folder_.parent_path().string()});
    for (const fs::path& path : entries_of(other))
      if (path.extension() == ".lock" && !libmap::FileLock::try_lock(path))
        throw libmap::Error("another process is writing it", {.file = output_.string()},
                            libmap::ErrorKind::failed);
    fs::remove_all(other);
  }
}

void PieceProgress::remove_pieces() const {
  std::error_code ignored;
  fs::remove_all(folder_, ignored);
  fs::remove(folder_.parent_path(), ignored);  // if nothing else is in it
}

bool PieceProgress::is_put_together() const {
  if (share_.count == 1 || !fs::is_directory(output_)) return false;
  const auto manifest = libmap::read_manifest_of(output_);
  return manifest && libgtd::key_of(*manifest) == key_;
}

bool PieceProgress::is_complete() const {
  if (!is_put_together()) return false;
  run_.say("all pieces are there");
  return true;
}

fs::path PieceProgress::lock_path() const {
  return folder_ /
         (std::to_string(share_.number) + "_of_" + std::to_string(share_.count) + ".lock");
}

fs::path PieceProgress::file(const std::string& piece, const std::string& extension) const {
  return folder_ / (piece + extension);
}

bool PieceProgress::is_done(const std::string& piece) const {
  return fs::exists(file(piece, ".json"));
}

PieceProgress::Facts PieceProgress::common_facts(const std::function<Facts()>& find) {
  if (run_.options().dry_run) return find();
  make_folder();
  const libmap::FileLock lock(file(common, ".lock"));
  if (!is_done(common)) libmap::write_whole_file(file(common, ".json"), find().dump());
  return facts(common);
}

PieceProgress::Facts PieceProgress::facts(const std::string& piece) const {
  const fs::path path = file(piece, ".json");
  try {
    return libmap::parse_json<Facts>(libmap::read_whole_file(path));
  } catch (const nlohmann::json::exception& error) {
    throw libmap::Error(std::string("is broken: ") + error.what(), {.file = path.string()});
  }
}

void PieceProgress::make(const Work& work) {
  if (run_.options().dry_run) return;
  try {
    run_.timed("tiles", [&] { make_missing(work); });
    put_together(work);
  } catch (const libmap::Error& error) {
    // To resume it would end the same.
    if (error.kind() == libmap::ErrorKind::bad_input && share_.count == 1) remove_pieces();
    throw;
  }
}

void PieceProgress::make_folder() const {
  std::error_code code;
  fs::create_directories(folder_, code);
  if (code) throw libmap::system_failure(folder_, "cannot be made", code.value());
}

void PieceProgress::make_missing(const Work& work) {
  make_folder();
  const std::string share = std::to_string(share_.number) + "/" + std::to_string(share_.count);
  lock_ = libmap::FileLock::try_lock(lock_path());
  if (!lock_)
    throw libmap::Error("another process works on share " + share, {.file = output_.string()},
                        libmap::ErrorKind::failed);
  const auto number = static_cast<std::size_t>(share_.number);
  const auto count = static_cast<std::size_t>(share_.count);
  std::vector<std::size_t> missing;
  for (std::size_t n = work.pieces.size() * (number - 1) / count;
       n < work.pieces.size() * number / count; ++n)
    if (!is_done(work.pieces[n])) missing.push_back(n);
  run_.progress().begin("tiles", missing.size());
  for (const std::size_t n : missing) {
    libmap::OutputFile piece(file(work.pieces[n], work.extension));
    const Facts facts = work.make(n, piece.temporary_path());
    if (fs::file_size(piece.temporary_path()) > 0) piece.commit();
    libmap::write_whole_file(file(work.pieces[n], ".json"), facts.dump());
    run_.progress().advance(1);
  }
  run_.progress().end();
}

void PieceProgress::put_together(const Work& work) {
  const auto done = static_cast<std::size_t>(
      std::count_if(work.pieces.begin(), work.pieces.end(),
                    [this](const std::string& piece) { return is_done(piece); }));
  // The run of another share may have been the last as well, and have removed them since.
  if (done < work.pieces.size() && !is_put_together())
    return run_.say("{} of {} pieces are done", done, work.pieces.size());
  if (share_.count > 1) {
    try {
      run_.claim_output_tree(output_, names_, inputs_);
    } catch (const libmap::Error& error) {
      if (error.kind() != libmap::ErrorKind::failed) throw;
      return run_.say("another share puts the pieces together");
    }
  }
  if (!is_put_together()) run_.write_output_tree(output_, names_, work.finish);
  remove_pieces();
}

void PieceProgress::link_file(const fs::path& file, const fs::path& to) {
  std::error_code code;
  fs::create_hard_link(file, to, code);
  if (code) fs::copy_file(file, to);
}

}  // namespace graspmap_tools
