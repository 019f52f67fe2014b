#include "libgtd/score/tile_progress_io.h"

#include <fcntl.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <fstream>
#include <sstream>
#include <utility>

#include "libgtd/score/tile_store_json.h"
#include "libmap/core/error.h"
#include "libmap/core/file_output.h"
#include "libmap/core/json_input.h"

namespace libgtd {

namespace fs = std::filesystem;

namespace {

constexpr const char* plan_format = "graspmap tile store progress";
constexpr int plan_version = 1;
constexpr std::uint64_t max_file_bytes = std::uint64_t{1} << 33;

fs::path plan_path(const fs::path& store) { return store / "progress" / "plan.json"; }

fs::path journal_path(const fs::path& store, const TileShare& share) {
  return store / "progress" /
         (std::to_string(share.number) + "_of_" + std::to_string(share.count) + ".jsonl");
}

Json json_of_piece(const TerrainPiece& piece) {
  Json json;
  json["path"] = piece.input.path;
  json["sha256"] = piece.input.sha256;
  json["bytes"] = piece.input.bytes;
  json["modified_ns"] = piece.modified_ns;
  json["points"] = piece.points;
  json["dropped_points"] = piece.dropped_points;
  json["min"] = json_of(piece.box.min);
  json["max"] = json_of(piece.box.max);
  return json;
}

TerrainPiece piece_from(const Json& json) {
  TerrainPiece piece;
  piece.input.path = json.at("path").get<std::string>();
  piece.input.sha256 = json.at("sha256").get<std::string>();
  piece.input.bytes = libmap::integer_at<std::uint64_t>(json, "bytes");
  piece.modified_ns = libmap::integer_at<std::int64_t>(json, "modified_ns");
  piece.points = libmap::integer_at<std::uint64_t>(json, "points");
  piece.dropped_points = libmap::integer_at<std::uint64_t>(json, "dropped_points");
  piece.box.min = vector_from(json.at("min"));
  piece.box.max = vector_from(json.at("max"));
  if (piece.points > 0 && !(piece.box.min.array() <= piece.box.max.array()).all())
    throw libmap::Error("is no box",
                        {.field = "min and max of piece " + piece.input.path,
                         .value = Json(json.at("min")).dump() + ", " + Json(json.at("max")).dump(),
                         .bound = "min <= max"});
  return piece;
}

TilePlan plan_from(const Json& json, const std::string& file) {
  if (json.at("format") != plan_format || json.at("version") != plan_version)
    throw libmap::Error("is not of this format and version",
                        {.field = "format and version",
                         .value = json.at("format").dump() + ", " + json.at("version").dump(),
                         .bound = Json(plan_format).dump() + ", " + std::to_string(plan_version)});
  TilePlan plan;
  plan.index = index_from(json.at("index"), file);
  plan.key = plan.index.key;
  plan.has_plane = json.contains("plane_centroid_m");
  if (plan.has_plane) plan.centroid = vector_from(json.at("plane_centroid_m"));
  for (const Json& piece : json.at("pieces")) plan.pieces.push_back(piece_from(piece));
  plan.kept = std::exchange(plan.index.tiles, {});
  return plan;
}

// The lines of a journal that are whole and of this key.
void read_journal(const fs::path& path, const TilePlan& plan,
                  std::map<TileNumber, StoredTile>& done) {
  std::istringstream lines(libmap::read_whole_file(path, max_file_bytes));
  for (std::string line; std::getline(lines, line);) {
    try {
      const auto json = libmap::parse_json<Json>(line);
      if (json.at("key") != plan.key) continue;
      const StoredTile tile = tile_from(json, plan.index);
      done[tile.number] = tile;
    } catch (const nlohmann::json::exception&) {
      continue;
    } catch (const libmap::Error&) {
      continue;
    }
  }
}

void append_whole(int file, const std::string& text, const fs::path& path) {
  std::size_t done = 0;
  while (done < text.size()) {
    const ssize_t written = write(file, text.data() + done, text.size() - done);
    if (written < 0 && errno == EINTR) continue;
    if (written <= 0) throw libmap::system_failure(path, "cannot be written", errno);
    done += static_cast<std::size_t>(written);
  }
  if (fsync(file) != 0) throw libmap::system_failure(path, "cannot be synced", errno);
}

// Not so where a killed run left a line half written.
bool ends_in_a_line(const fs::path& path) {
  std::ifstream file(path, std::ios::binary | std::ios::ate);
  if (file.tellg() <= 0) return true;
  file.seekg(-1, std::ios::end);
  return file.get() == '\n';
}

void make_folder(const fs::path& folder) {
  std::error_code code;
  fs::create_directories(folder, code);
  if (code) throw libmap::system_failure(folder, "cannot be made", code.value());
}

std::size_t count_tiles(const TileStoreIndex& index) {
  const TileNumber first = tile_of(index.min, index.tile_voxels);
  const TileNumber last = tile_of(index.max, index.tile_voxels);
  return static_cast<std::size_t>(1 + last.i - first.i) *
         static_cast<std::size_t>(1 + last.j - first.j);
}

// Of all tiles, those without a scored voxel too. What is known of the whole map stays.
void add_totals(const std::map<TileNumber, StoredTile>& tiles, TileStoreIndex& index) {
  std::uint64_t occupied = 0, border = 0, graspable = 0;
  for (const auto& [number, tile] : tiles) {
    occupied += tile.occupied_voxels;
    border += tile.border_voxels;
    graspable += tile.graspable_voxels;
  }
  auto& results = index.manifest.results;
  const auto add = [&](const char* name, std::uint64_t count) {
    if (index.manifest.find_result(name) == nullptr)
      results.emplace_back(name, static_cast<std::int64_t>(count));
  };
  add("occupied_voxels", occupied);
  add("scored_voxels", index.voxels());
  add("border_voxels", border);
  add("graspable_voxels", graspable);
}

}  // namespace

std::string key_of(const libmap::Manifest& manifest) {
  libmap::Manifest bare;
  bare.version = manifest.version;
  bare.parameters = manifest.parameters;
  std::string text = libmap::to_json(bare);
  for (const libmap::ManifestInput& input : manifest.inputs) text += input.sha256 + "\n";
  return libmap::sha256_of(text);
}

TileProgress::TileProgress(fs::path store) : store_(std::move(store)) {
  if (!store_.has_filename()) store_ = store_.parent_path();
}

void TileProgress::open() const {
  if (fs::exists(store_) && !fs::is_directory(store_))
    throw libmap::Error("is a file, not a tile store", {.file = store_.string()});
  if (fs::exists(store_) && !fs::is_empty(store_) && !fs::exists(store_ / "progress") &&
      !fs::exists(store_ / "index.json"))
    throw libmap::Error("is not empty and is no tile store", {.file = store_.string()});
  for (const fs::path& folder : {store_, store_ / "progress", store_ / "tiles"})
    make_folder(folder);
}

std::optional<TilePlan> TileProgress::plan() const {
  const fs::path path = plan_path(store_);
  if (!fs::exists(path)) return std::nullopt;
  const std::string text = libmap::read_whole_file(path, max_file_bytes);
  return read_json(text, path.string(), "plan of a tile store",
                   [&](const Json& json) { return plan_from(json, path.string()); });
}

void TileProgress::set_plan(const TilePlan& plan) const {
  TileStoreIndex index = plan.index;
  index.key = plan.key;
  index.tiles = plan.kept;
  Json json;
  json["format"] = plan_format;
  json["version"] = plan_version;
  if (plan.has_plane) json["plane_centroid_m"] = json_of(plan.centroid);
  json["pieces"] = Json::array();
  for (const TerrainPiece& piece : plan.pieces) json["pieces"].push_back(json_of_piece(piece));
  json["index"] = json_of(index);
  libmap::write_whole_file(plan_path(store_), json.dump(1) + "\n");
}

void TileProgress::remove_if_bare() const {
  if (fs::exists(plan_path(store_))) return;
  // Each only if it is empty by then.
  std::error_code ignored;
  fs::remove(store_ / "progress" / "lock", ignored);
  for (const fs::path& folder : {store_ / "progress", store_ / "tiles", store_})
    fs::remove(folder, ignored);
}

void TileProgress::clear() const {
  // What says that tiles are done goes first.
  fs::remove(store_ / "index.json");
  fs::remove(plan_path(store_));
  for (const fs::path& path : journals()) fs::remove(path);
  fs::remove_all(store_ / "tiles");
  make_folder(store_ / "tiles");
}

libmap::FileLock TileProgress::lock() const {
  return libmap::FileLock(store_ / "progress" / "lock");
}

void TileProgress::require_idle() const {
  for (const fs::path& path : journals())
    if (!libmap::FileLock::try_lock(path))
      throw libmap::Error("another process is writing it", {.file = store_.string()},
                          libmap::ErrorKind::failed);
}

std::vector<fs::path> TileProgress::journals() const {
  std::vector<fs::path> paths;
  for (const fs::directory_entry& entry : fs::directory_iterator(store_ / "progress"))
    if (entry.path().extension() == ".jsonl") paths.push_back(entry.path());
  std::sort(paths.begin(), paths.end());
  return paths;
}

std::map<TileNumber, StoredTile> TileProgress::done(const TilePlan& plan) const {
  std::map<TileNumber, StoredTile> done;
  for (const StoredTile& tile : plan.kept) done[tile.number] = tile;
  for (const fs::path& path : journals()) read_journal(path, plan, done);
  return done;
}

TileProgress::Completion TileProgress::complete(const TilePlan& plan) const {
  const std::map<TileNumber, StoredTile> tiles = done(plan);
  Completion completion{
      .index = std::nullopt, .done = tiles.size(), .tiles = count_tiles(plan.index)};
  if (completion.done < completion.tiles) return completion;
  completion.index = plan.index;
  completion.index->key = plan.key;
  for (const auto& [number, tile] : tiles)
    if (tile.voxels > 0) completion.index->tiles.push_back(tile);
  add_totals(tiles, *completion.index);
  return completion;
}

void TileProgress::write_index(const TileStoreIndex& index,
                               const libmap::Manifest& manifest) const {
  // The manifest goes first, as beside any output.
  libmap::write_whole_file(libmap::manifest_path(store_), libmap::to_json(manifest));
  libmap::write_whole_file(store_ / "index.json", json_of(index).dump(1) + "\n");
}

void TileProgress::remove_index() const { fs::remove(store_ / "index.json"); }

TileJournal::TileJournal(const fs::path& store, const TileShare& share, std::string key)
    : path_(journal_path(store, share)), key_(std::move(key)) {
  lock_ = libmap::FileLock::try_lock(path_);
  if (!lock_)
    throw libmap::Error("another process works on share " + std::to_string(share.number) + "/" +
                            std::to_string(share.count),
                        {.file = store.string()}, libmap::ErrorKind::failed);
  file_ = open(path_.c_str(), O_WRONLY | O_APPEND | O_CLOEXEC);
  if (file_ < 0) throw libmap::system_failure(path_, "cannot be written", errno);
  if (!ends_in_a_line(path_)) append_whole(file_, "\n", path_);
}

TileJournal::~TileJournal() {
  if (file_ >= 0) close(file_);
}

void TileJournal::add(const std::vector<StoredTile>& tiles) {
  std::string lines;
  for (const StoredTile& tile : tiles) {
    Json json = json_of(tile);
    json["key"] = key_;
    lines += json.dump() + "\n";
  }
  append_whole(file_, lines, path_);
}

}  // namespace libgtd
