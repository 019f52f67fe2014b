#include "libmap/tiles/point_tile_store.h"

#include <algorithm>
#include <cmath>
#include <cstring>

namespace libmap {

namespace {

// Size of a record without normal: sequence number of the point, position.
constexpr std::size_t bare_record_bytes = sizeof(std::uint64_t) + sizeof(Eigen::Vector3d);

template <typename T>
char* put(char* at, const T& value) {
  std::memcpy(at, static_cast<const void*>(&value), sizeof(T));
  return at + sizeof(T);
}

template <typename T>
const char* take(const char* at, T& value) {
  std::memcpy(static_cast<void*>(&value), at, sizeof(T));
  return at + sizeof(T);
}

}  // namespace

PointTileStore::PointTileStore(const std::filesystem::path& folder,
                               const PointTileStoreOptions& options)
    : file_(folder),
      options_(options),
      record_bytes_(bare_record_bytes + (options.has_normals ? sizeof(Eigen::Vector3f) : 0)) {}

void PointTileStore::add(const PointCloud& cloud) {
  Records* records = nullptr;
  XyTile last;
  for (std::size_t n = 0; n < cloud.size(); ++n) {
    const Eigen::Vector3d& position = cloud.positions[n];
    const XyTile tile = xy_tile_at(position.head<2>(), options_.tile_m);
    if (records == nullptr || tile != last) records = &tiles_[tile];
    last = tile;
    const std::size_t at = records->buffer.size();
    records->buffer.resize(at + record_bytes_);
    char* out = put(records->buffer.data() + at, static_cast<std::uint64_t>(size_));
    out = put(out, position);
    if (options_.has_normals) put(out, cloud.normals[n]);
    ++records->count;
    ++size_;
    buffered_ += record_bytes_;
    if (buffered_ >= options_.buffer_bytes) flush();
  }
}

void PointTileStore::flush() {
  for (auto& [tile, records] : tiles_) {
    if (records.buffer.empty()) continue;
    records.written.push_back(
        {file_.append(records.buffer.data(), records.buffer.size()), records.buffer.size()});
    std::vector<char>().swap(records.buffer);  // releases the memory
  }
  buffered_ = 0;
}

void PointTileStore::read_tile(const Records& records, std::vector<char>& bytes) const {
  bytes.resize(records.count * record_bytes_);
  std::size_t done = 0;
  for (const Extent& extent : records.written) {
    file_.read(extent.begin, bytes.data() + done, extent.bytes);
    done += extent.bytes;
  }
  std::copy(records.buffer.begin(), records.buffer.end(),
            bytes.begin() + static_cast<std::ptrdiff_t>(done));
}

template <typename Visit>
void PointTileStore::for_tiles_in(const Eigen::Vector2d& low, const Eigen::Vector2d& high,
                                  const Visit& visit) const {
  const XyTile first = xy_tile_at(low, options_.tile_m);
  const XyTile last = xy_tile_at(high, options_.tile_m);
  for (auto at = tiles_.lower_bound(first); at != tiles_.end() && at->first.i <= last.i; ++at)
    if (at->first.j >= first.j && at->first.j <= last.j) visit(at->second);
}

PointCloud PointTileStore::points_in(const Eigen::Vector2d& low,
                                     const Eigen::Vector2d& high) const {
  PointCloud found;
  std::vector<std::pair<std::uint64_t, std::size_t>> order;  // sequence number, index in `found`
  std::vector<char> bytes;
  for_tiles_in(low, high, [&](const Records& records) {
    read_tile(records, bytes);
    for (const char* at = bytes.data(); at < bytes.data() + bytes.size(); at += record_bytes_) {
      std::uint64_t sequence = 0;
      Eigen::Vector3d position;
      const char* rest = take(take(at, sequence), position);
      if (!(position.x() >= low.x() && position.x() <= high.x() && position.y() >= low.y() &&
            position.y() <= high.y()))
        continue;
      order.emplace_back(sequence, found.size());
      found.positions.push_back(position);
      if (options_.has_normals) take(rest, found.normals.emplace_back());
    }
  });
  std::sort(order.begin(), order.end());
  std::vector<std::size_t> indices;
  indices.reserve(order.size());
  for (const auto& [sequence, index] : order) indices.push_back(index);
  return libmap::select_points(found, indices);
}

std::size_t PointTileStore::count_in(const Eigen::Vector2d& low,
                                     const Eigen::Vector2d& high) const {
  std::size_t count = 0;
  for_tiles_in(low, high, [&](const Records& records) { count += records.count; });
  return count;
}

}  // namespace libmap
