#include "libmap/raster/dem_reader.h"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <limits>
#include <utility>

#include "libmap/core/error.h"
#include "libmap/core/file_output.h"
#include "libmap/core/manifest.h"
#include "libmap/core/memory_budget.h"
#include "libmap/core/sandboxed_process.h"
#include "libmap/core/text.h"
#include "libmap/raster/raster_module.h"

namespace libmap {

namespace fs = std::filesystem;

namespace {

// Memory for a block of 2^24 pixels in GDAL and in DemBlock, its mask, and GDAL's tables.
constexpr std::uint64_t max_data_bytes = std::uint64_t{3} << 29;

enum class Parcel : std::uint8_t { info, block, end };

void pass_info(auto& pipe, auto& info) {
  pipe.value(info.columns);
  pipe.value(info.rows);
  pipe.array(info.band_type);
  pipe.array(info.georeference.crs_wkt);
  pipe.value(info.georeference.unit_m);
  for (auto& number : info.georeference.origin_m) pipe.value(number);
  for (auto& number : info.local_from_pixel.reshaped()) pipe.value(number);
}

void pass_block(auto& pipe, auto& block) {
  pipe.value(block.column);
  pipe.value(block.row);
  pipe.value(block.columns);
  pipe.value(block.rows);
  pipe.array(block.heights_m);
}

// Work of the child process. It sends an Error, or none, before each message.
void serve(const fs::path& path, const std::optional<Georeference>& frame,
           const SandboxedProcess::Write& write) {
  SandboxWriter output(write);
  const auto announce = [&](Parcel parcel) {
    output.error(nullptr);
    output.value(parcel);
  };
  try {
    raster_module().read_dem(
        path, frame,
        [&](const DemInfo& info) {
          announce(Parcel::info);
          pass_info(output, info);
        },
        [&](const DemBlock& block) {
          announce(Parcel::block);
          pass_block(output, block);
        });
    announce(Parcel::end);
  } catch (const Error& error) {
    output.error(&error);
  }
}

}  // namespace

class DemReader::Process {
 public:
  Process(fs::path path, const std::optional<Georeference>& frame)
      : path_(std::move(path)),
        process_(max_data_bytes,
                 [&](const SandboxedProcess::Write& write) { serve(path_, frame, write); }),
        input_(process_, "is broken: GDAL crashed on it") {
    in_file(path_, [&] {
      receive_parcel();
      pass_info(input_, info_);
    });
  }

  const DemInfo& info() const { return info_; }

  bool next(DemBlock& block) {
    return in_file(path_, [&] {
      const bool is_block = receive_parcel() == Parcel::block;
      if (is_block) pass_block(input_, block);
      return is_block;
    });
  }

 private:
  Parcel receive_parcel() {
    input_.error();
    Parcel parcel = Parcel::end;
    input_.value(parcel);
    return parcel;
  }

  fs::path path_;
  SandboxedProcess process_;
  SandboxReader input_;
  DemInfo info_;
};

DemReader::DemReader(const fs::path& path, const std::optional<Georeference>& frame) {
  require_readable_file(path);
  raster_module();  // loads the module here, once, and reports a missing one without a file
  process_ = std::make_unique<Process>(path, frame);
}
DemReader::~DemReader() = default;
DemReader::DemReader(DemReader&&) noexcept = default;

const DemInfo& DemReader::info() const { return process_->info(); }
bool DemReader::next(DemBlock& block) { return process_->next(block); }

bool is_dem_path(const fs::path& path) {
  const std::string extension = lower_case(path.extension().string());
  return extension == ".tif" || extension == ".tiff";
}

Eigen::Vector3d point_of(const DemInfo& info, const DemBlock& block, std::size_t pixel) {
  const auto n = static_cast<std::int64_t>(pixel);
  const Eigen::Vector3d center(static_cast<double>(block.column + n % block.columns) + 0.5,
                               static_cast<double>(block.row + n / block.columns) + 0.5, 1.0);
  const Eigen::Vector2d position = info.local_from_pixel * center;
  return {position.x(), position.y(), block.heights_m[pixel]};
}

PointCloud read_dem_cloud(const fs::path& path, std::size_t* undeclared,
                          const std::optional<Georeference>& frame) {
  DemReader reader(path, frame);
  if (reader.info().pixels() > machine_memory() / (2 * sizeof(Eigen::Vector3d)))
    throw Error(
        "the points need more than half of the machine's memory; use a tile store (score -o "
        "MAP.tiles), which reads the file in blocks",
        {.file = path.string(),
         .field = "pixels",
         .value = std::to_string(reader.info().pixels())});
  PointCloud cloud;
  DemBlock block;
  while (reader.next(block))
    for (std::size_t n = 0; n < block.heights_m.size(); ++n)
      if (std::isfinite(block.heights_m[n]))
        cloud.positions.push_back(point_of(reader.info(), block, n));
      else if (undeclared != nullptr && std::isinf(block.heights_m[n]))
        ++*undeclared;
  return cloud;
}

std::optional<Georeference> read_georeference(const fs::path& path) {
  if (is_dem_path(path)) return DemReader(path).info().georeference;
  if (fs::is_directory(path)) {
    fs::path first;
    for (const fs::directory_entry& entry : fs::directory_iterator(path))
      if (is_dem_path(entry.path()) && entry.path().filename().string().front() != '.' &&
          (first.empty() || entry.path() < first))
        first = entry.path();
    if (!first.empty()) return DemReader(first).info().georeference;
  }
  const auto manifest = read_manifest_of(path.has_filename() ? path : path.parent_path());
  return manifest ? manifest->georeference : std::nullopt;
}

namespace {

constexpr std::uint32_t no_vertex = std::numeric_limits<std::uint32_t>::max();
// Memory of a vertex, its index and two triangles.
constexpr std::uint64_t bytes_per_pixel = sizeof(Eigen::Vector3d) + 7 * sizeof(std::uint32_t);

using Corners = std::array<std::uint32_t, 4>;  // corners of a cell

// Adds the triangles of a cell; its corners are counter-clockwise from above.
void add_cell(const Corners& corners, TriangleMesh& mesh) {
  const auto height = [&](std::size_t corner) { return mesh.vertices[corners[corner]].z(); };
  int missing = -1;
  for (int n = 0; n < 4; ++n) {
    if (corners[static_cast<std::size_t>(n)] != no_vertex) continue;
    if (missing >= 0) return;
    missing = n;
  }
  const auto add = [&](int first) {  // adds corners first to first + 2
    const auto at = [&](int n) { return corners[static_cast<std::size_t>((first + n) % 4)]; };
    mesh.triangles.push_back({at(0), at(1), at(2)});
  };
  if (missing >= 0) return add(missing + 1);
  const int begin = std::abs(height(0) - height(2)) <= std::abs(height(1) - height(3)) ? 0 : 1;
  add(begin);
  add(begin + 2);
}

}  // namespace

TriangleMesh read_dem_mesh(const std::filesystem::path& path) {
  DemReader reader(path);
  const DemInfo& info = reader.info();
  if (info.pixels() >= no_vertex || info.pixels() > machine_memory() / 2 / bytes_per_pixel)
    throw Error("too many for a mesh in memory; crop the raster (gdal_translate -srcwin)",
                {.file = path.string(), .field = "pixels", .value = std::to_string(info.pixels())});
  std::vector<double> heights_m(info.pixels(), std::numeric_limits<double>::quiet_NaN());
  DemBlock block;
  while (reader.next(block))
    for (std::size_t n = 0; n < block.heights_m.size(); ++n) {
      const auto row = block.row + static_cast<std::int64_t>(n) / block.columns;
      const auto column = block.column + static_cast<std::int64_t>(n) % block.columns;
      heights_m[static_cast<std::size_t>(row * info.columns + column)] = block.heights_m[n];
    }
  const DemBlock whole{
      .columns = info.columns, .rows = info.rows, .heights_m = std::move(heights_m)};
  TriangleMesh mesh;
  std::vector<std::uint32_t> vertex_of(info.pixels(), no_vertex);
  for (std::size_t n = 0; n < vertex_of.size(); ++n) {
    if (!std::isfinite(whole.heights_m[n])) continue;
    vertex_of[n] = static_cast<std::uint32_t>(mesh.vertices.size());
    mesh.vertices.push_back(point_of(info, whole, n));
  }
  const bool is_mirrored = info.local_from_pixel.leftCols<2>().determinant() < 0.0;
  const auto width = static_cast<std::size_t>(info.columns);
  for (std::size_t row = 0; row + 1 < static_cast<std::size_t>(info.rows); ++row)
    for (std::size_t n = row * width; n + 1 < (row + 1) * width; ++n) {
      // Rows go south if the raster is not mirrored: its determinant is negative.
      const Corners around = {vertex_of[n], vertex_of[n + width], vertex_of[n + width + 1],
                              vertex_of[n + 1]};
      add_cell(is_mirrored ? around : Corners{around[0], around[3], around[2], around[1]}, mesh);
    }
  return mesh;
}

}  // namespace libmap
