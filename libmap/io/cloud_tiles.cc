#include "libmap/io/cloud_tiles.h"

#include <algorithm>
#include <cmath>
#include <fstream>
#include <utility>

#include "libmap/core/error.h"
#include "libmap/core/file_output.h"
#include "libmap/io/cloud_columns.h"
#include "libmap/io/cloud_io.h"
#include "libmap/io/pcd_codec.h"
#include "libmap/io/ply_codec.h"
#include "libmap/raster/dem_reader.h"

namespace libmap {

namespace fs = std::filesystem;

namespace {

constexpr std::size_t max_block_bytes = std::size_t{1} << 22;
constexpr std::size_t max_kept_points = 4'000'000;  // of a TileIndex

void append_points(const PointCloud& from, std::size_t begin, std::size_t end, PointCloud& to) {
  const auto add = [&](const auto& source, auto& target) {
    if (source.empty()) return;
    target.insert(target.end(), source.begin() + static_cast<std::ptrdiff_t>(begin),
                  source.begin() + static_cast<std::ptrdiff_t>(end));
  };
  add(from.positions, to.positions);
  add(from.normals, to.normals);
}

// Reader of the points of one file in blocks.
class CloudBlockReader {
 public:
  // Throws Error naming the file, as read_cloud does.
  CloudBlockReader(fs::path path, const std::optional<Georeference>& georeference)
      : path_(std::move(path)) {
    require_cloud_file(path_);
    in_file(path_, [&] {
      if (is_dem_path(path_))
        open_dem(georeference);
      else if (!open_records())
        read_whole();
    });
  }

  // Properties of the file by its header; the viewpoint is cloud_from_sensor.
  bool is_empty() const { return rows_left_ == 0; }
  bool has_normals() const { return has_normals_; }
  const Pose& viewpoint() const { return viewpoint_; }
  std::size_t dropped_points() const { return dropped_; }  // so far

  // Reads the next `rows` points, or all remaining ones, and appends those with a finite position.
  // Returns false if no points remain.
  bool append(std::size_t rows, PointCloud& cloud) {
    rows = std::min(rows, rows_left_);
    if (rows == 0) return false;
    const std::size_t begin = whole_.size() - rows_left_;
    if (dem_)
      append_pixels(rows, cloud);
    else if (record_bytes_ > 0)
      append_records(rows, cloud);
    else
      append_points(whole_, begin, begin + rows, cloud);
    rows_left_ -= rows;
    return true;
  }

  // Georeference of a DEM; nullopt for other files.
  std::optional<Georeference> georeference() const {
    return dem_ ? std::optional(dem_->info().georeference) : std::nullopt;
  }

  // Skips normals from now on.
  void leave_out_normals() {
    columns_ = geometry_columns(columns_, false);
    whole_.normals.clear();
  }

 private:
  bool open_records() {
    const std::string format = format_of(path_);
    if (format != ".pcd" && format != ".ply") return false;
    file_.open(path_, std::ios::binary);
    const std::uint64_t bytes = fs::file_size(path_);
    const std::string head = read_head(path_);
    // Small buffers for small files: thousands of files are opened, each more than once.
    block_.resize(std::min<std::uint64_t>(bytes, max_block_bytes));
    const auto records = format == ".pcd" ? pcd_records(head, bytes, block_.data())
                                          : ply_records(head, bytes, block_.data());
    if (!records || records->bytes == 0 || records->bytes > block_.size()) {
      std::vector<std::byte>().swap(block_);
      return false;
    }
    columns_ = geometry_columns(records->columns, true);
    ColumnSet none;
    none.columns = records->columns;
    cloud_from_columns(none, NotFinite::drop);  // throws if x, y or z is missing
    has_normals_ = columns_.size() > 3;
    record_bytes_ = records->bytes;
    rows_left_ = records->count;
    viewpoint_ = records->viewpoint;
    file_.seekg(static_cast<std::streamoff>(records->begin));
    return true;
  }

  void open_dem(const std::optional<Georeference>& georeference) {
    dem_.emplace(path_, georeference);
    rows_left_ = dem_->info().pixels();
  }

  void append_pixels(std::size_t count, PointCloud& cloud) {
    for (; count > 0; --count, ++next_pixel_) {
      if (next_pixel_ == pixels_.heights_m.size()) {
        if (!dem_->next(pixels_)) throw Error("is truncated", {.file = path_.string()});
        next_pixel_ = 0;
      }
      if (std::isfinite(pixels_.heights_m[next_pixel_]))
        cloud.positions.push_back(point_of(dem_->info(), pixels_, next_pixel_));
      else if (std::isinf(pixels_.heights_m[next_pixel_]))
        ++dropped_;
    }
  }

  void read_whole() {
    CloudReadResult read = read_cloud(path_);
    dropped_ = read.dropped_points;
    viewpoint_ = read.cloud.viewpoint;
    has_normals_ = read.cloud.has_normals();
    whole_.positions = std::move(read.cloud.positions);
    whole_.normals = std::move(read.cloud.normals);
    rows_left_ = whole_.size();
  }

  void append_records(std::size_t rows, PointCloud& cloud) {
    while (rows > 0) {
      const std::size_t count = std::min(rows, block_.size() / record_bytes_);
      file_.read(reinterpret_cast<char*>(block_.data()),
                 static_cast<std::streamsize>(count * record_bytes_));
      if (!file_) throw Error("cannot be read", {.file = path_.string()});
      ColumnSet set;
      set.rows = count;
      set.columns = columns_;
      const CloudFromColumns read = cloud_from_columns(set, NotFinite::drop);
      dropped_ += read.dropped_points;
      append_points(read.cloud, 0, read.cloud.size(), cloud);
      rows -= count;
    }
  }

  fs::path path_;
  Pose viewpoint_ = Pose::Identity();
  bool has_normals_ = false;
  std::size_t rows_left_ = 0;
  std::size_t dropped_ = 0;
  // Records in blocks ...
  std::ifstream file_;
  std::vector<std::byte> block_;
  std::size_t record_bytes_ = 0;
  std::vector<Column> columns_;
  // ... or pixels of a DEM, including pixels without a height ...
  std::optional<DemReader> dem_;
  DemBlock pixels_;
  std::size_t next_pixel_ = 0;
  // ... or the whole file.
  PointCloud whole_;
};

}  // namespace

TileStream::TileStream(std::vector<fs::path> tiles) : tiles_(std::move(tiles)) {
  bool is_first = true;
  fs::path first;
  for (const fs::path& tile : tiles_) {
    const CloudBlockReader reader(tile, georeference_);
    if (!georeference_) georeference_ = reader.georeference();
    if (reader.is_empty()) continue;
    if (is_first) {
      first = tile;
      has_normals_ = reader.has_normals();
      viewpoint_ = reader.viewpoint();
    } else if (reader.has_normals() != has_normals_) {
      throw Error(has_normals_ ? "has no normals, but " + first.string() + " has"
                               : "has normals, but " + first.string() + " has none",
                  {.file = tile.string()});
    } else if (reader.viewpoint().matrix() != viewpoint_.matrix()) {
      viewpoint_ = Pose::Identity();
    }
    is_first = false;
  }
}

void TileStream::for_each_block(Need need, const Visit& visit) const {
  PointCloud block;
  block.viewpoint = viewpoint_;
  for (const fs::path& tile : tiles_) {
    CloudBlockReader reader(tile, georeference_);
    if (need == Need::positions) reader.leave_out_normals();
    while (reader.append(block_points - block.size(), block)) {
      if (block.size() < block_points) continue;
      visit(block);
      block.positions.clear();
      block.normals.clear();
    }
  }
  if (!block.empty()) visit(block);
}

TileInfo read_tile_info(const fs::path& tile, const std::optional<Georeference>& georeference) {
  TileInfo info;
  CloudBlockReader reader(tile, georeference);
  reader.leave_out_normals();
  PointCloud block;
  while (reader.append(PointStream::block_points, block)) {
    const Bounds3d box = bounds_of(block.positions);
    if (info.points == 0) {
      info.box = box;
    } else if (!block.empty()) {
      info.box.min = info.box.min.cwiseMin(box.min);
      info.box.max = info.box.max.cwiseMax(box.max);
    }
    info.points += block.size();
    block.positions.clear();
    block.normals.clear();
  }
  info.dropped_points = reader.dropped_points();
  return info;
}

TilesReadResult read_tiles(const std::vector<fs::path>& tiles) {
  TilesReadResult result;
  const TileStream stream(tiles);
  result.cloud.viewpoint = stream.viewpoint();
  for (const fs::path& tile : tiles) {
    CloudBlockReader reader(tile, stream.georeference());
    while (reader.append(PointStream::block_points, result.cloud)) {
    }
    result.dropped_points += reader.dropped_points();
  }
  return result;
}

TileIndex::TileIndex(std::vector<std::filesystem::path> tiles, const Visit& visit) {
  if (!tiles.empty() && is_dem_path(tiles.front())) frame_ = read_georeference(tiles.front());
  for (std::filesystem::path& path : tiles) {
    CloudReadResult read = read_cloud(path, frame_);
    dropped_ += read.dropped_points;
    const PointCloud& cloud = read.cloud;
    if (cloud.empty()) continue;
    if (tiles_.empty()) {
      has_normals_ = cloud.has_normals();
    } else if (cloud.has_normals() != has_normals_) {
      const std::string first = tiles_.front().path.string();
      throw Error(has_normals_ ? "has no normals, but " + first + " has"
                               : "has normals, but " + first + " has none",
                  {.file = path.string()});
    }
    points_ += cloud.size();
    visit(cloud);
    tiles_.push_back({std::move(path), bounds_of(cloud.positions)});
  }
}

const PointCloud& TileIndex::cloud_of(const Tile& tile) {
  const auto kept =
      std::find_if(kept_.begin(), kept_.end(), [&](const auto& one) { return one.first == &tile; });
  if (kept != kept_.end()) {
    kept_.splice(kept_.begin(), kept_, kept);
    return kept_.front().second;
  }
  kept_.emplace_front(&tile, read_cloud(tile.path, frame_).cloud);
  std::size_t points = 0;
  for (auto one = kept_.begin(); one != kept_.end();) {
    points += one->second.size();
    one = points > max_kept_points && one != kept_.begin() ? kept_.erase(one) : std::next(one);
  }
  return kept_.front().second;
}

PointCloud TileIndex::points_in(const Eigen::Vector2d& low, const Eigen::Vector2d& high) {
  PointCloud found;
  for (const Tile& tile : tiles_) {
    if ((tile.box.max.head<2>().array() < low.array()).any() ||
        (tile.box.min.head<2>().array() >= high.array()).any())
      continue;
    const PointCloud& cloud = cloud_of(tile);
    std::vector<std::size_t> inside;
    for (std::size_t n = 0; n < cloud.size(); ++n) {
      const auto position = cloud.positions[n].head<2>().array();
      if ((position >= low.array()).all() && (position < high.array()).all()) inside.push_back(n);
    }
    append_cloud(select_points(cloud, inside), found);
  }
  return found;
}

}  // namespace libmap
