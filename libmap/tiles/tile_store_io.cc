#include "libmap/tiles/tile_store_io.h"

#include <fcntl.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <fstream>
#include <utility>

#include "libmap/core/error.h"
#include "libmap/core/file_output.h"

namespace libmap {

namespace fs = std::filesystem;

namespace {

constexpr std::uint64_t max_plan_bytes = std::uint64_t{1} << 33;

void append_whole(int file, const std::string& text, const fs::path& path) {
  std::size_t done = 0;
  while (done < text.size()) {
    const ssize_t written = write(file, text.data() + done, text.size() - done);
    if (written < 0 && errno == EINTR) continue;
    if (written <= 0) throw system_failure(path, "cannot be written", errno);
    done += static_cast<std::size_t>(written);
  }
  if (fsync(file) != 0) throw system_failure(path, "cannot be synced", errno);
}

// False if a killed run left a truncated line.
bool ends_with_newline(const fs::path& path) {
  std::ifstream file(path, std::ios::binary | std::ios::ate);
  if (file.tellg() <= 0) return true;
  file.seekg(-1, std::ios::end);
  return file.get() == '\n';
}

void make_folder(const fs::path& folder) {
  std::error_code code;
  fs::create_directories(folder, code);
  if (code) throw system_failure(folder, "cannot be created", code.value());
}

FileLock lock_journal(const fs::path& journal, const fs::path& store, const TileShare& share) {
  std::optional<FileLock> lock = FileLock::try_lock(journal);
  if (!lock)
    throw Error("another process is computing share " + to_text(share), {.file = store.string()},
                ErrorKind::failed);
  return std::move(*lock);
}

}  // namespace

std::string key_of(const Manifest& manifest) {
  Manifest bare;
  bare.version = manifest.version;
  bare.parameters = manifest.parameters;
  std::string text = to_json(bare);
  for (const ManifestInput& input : manifest.inputs) text += input.sha256 + "\n";
  return sha256_of(text);
}

TileJournal::TileJournal(const fs::path& store, const TileShare& share)
    : path_(store / "progress" /
            (std::to_string(share.number) + "_of_" + std::to_string(share.count) + ".jsonl")),
      lock_(lock_journal(path_, store, share)),
      file_(open(path_.c_str(), O_WRONLY | O_APPEND | O_CLOEXEC)) {
  if (file_ < 0) throw system_failure(path_, "cannot be written", errno);
  if (!ends_with_newline(path_)) append_whole(file_, "\n", path_);
}

TileJournal::TileJournal(TileJournal&& other) noexcept
    : path_(std::move(other.path_)),
      lock_(std::move(other.lock_)),
      file_(std::exchange(other.file_, -1)) {}

TileJournal::~TileJournal() {
  if (file_ >= 0) close(file_);
}

void TileJournal::add(const std::vector<std::string>& lines) {
  std::string text;
  for (const std::string& line : lines) text += line + "\n";
  append_whole(file_, text, path_);
}

TileStore::TileStore(fs::path folder) : folder_(std::move(folder)) {
  if (!folder_.has_filename()) folder_ = folder_.parent_path();
}

void TileStore::open() const {
  if (fs::exists(folder_) && !fs::is_directory(folder_))
    throw Error("is a file, not a tile store", {.file = folder_.string()});
  if (fs::exists(folder_) && !fs::is_empty(folder_) && !fs::exists(progress()) &&
      !fs::exists(index_path()))
    throw Error("is not empty and is not a tile store; use another folder",
                {.file = folder_.string()});
  for (const fs::path& folder : {folder_, progress(), tiles()}) make_folder(folder);
}

TileJournal TileStore::begin(const TileShare& share,
                             const std::function<void()>& check_plan) const {
  const bool is_new = !fs::exists(folder_);
  open();
  try {
    const FileLock held = lock();
    check_plan();
    return {folder_, share};
  } catch (...) {
    if (is_new) remove_if_bare();
    throw;
  }
}

std::optional<std::string> TileStore::plan_text() const {
  if (!fs::exists(plan_path())) return std::nullopt;
  return read_whole_file(plan_path(), max_plan_bytes);
}

void TileStore::write_plan(const std::string& text) const { write_whole_file(plan_path(), text); }

std::vector<fs::path> TileStore::journals() const {
  std::vector<fs::path> paths;
  std::error_code ignored;  // another run can have removed the store
  for (const fs::directory_entry& entry : fs::directory_iterator(progress(), ignored))
    if (entry.path().extension() == ".jsonl") paths.push_back(entry.path());
  std::sort(paths.begin(), paths.end());
  return paths;
}

void TileStore::each_line(
    const std::function<void(const std::string& text, const Line& line)>& visit) const {
  for (const fs::path& journal : journals()) {
    std::ifstream lines(journal, std::ios::binary);
    std::size_t begin = 0;
    for (std::string text; std::getline(lines, text);) {
      visit(text, {journal, begin});
      begin += text.size() + 1;
    }
    if (lines.bad()) throw Error("cannot be read", {.file = journal.string()}, ErrorKind::failed);
  }
}

std::string TileStore::read_line(const Line& line) {
  std::ifstream lines(line.journal, std::ios::binary);
  std::string text;
  lines.seekg(static_cast<std::streamoff>(line.begin));
  if (!std::getline(lines, text))
    throw Error("cannot be read", {.file = line.journal.string()}, ErrorKind::failed);
  return text;
}

FileLock TileStore::lock() const { return FileLock(progress() / "lock"); }

void TileStore::require_idle() const {
  for (const fs::path& path : journals())
    if (!FileLock::try_lock(path))
      throw Error("another process is writing this tile store", {.file = folder_.string()},
                  ErrorKind::failed);
}

void TileStore::clear() const {
  // First the files that list tiles as done.
  fs::remove(index_path());
  fs::remove(plan_path());
  for (const fs::path& path : journals()) fs::remove(path);
  fs::remove_all(tiles());
  make_folder(tiles());
}

void TileStore::remove_if_bare() const {
  if (fs::exists(plan_path())) return;
  // fs::remove removes empty folders only.
  std::error_code ignored;
  fs::remove(progress() / "lock", ignored);
  for (const fs::path& folder : {progress(), tiles(), folder_}) fs::remove(folder, ignored);
}

}  // namespace libmap
