#include "libmap/raster/dem_reader.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "libmap/core/error.h"
#include "libmap/core/file_output.h"
#include "libmap/core/guarded_arrays.h"
#include "libmap/core/manifest.h"
#include "libmap/core/memory_budget.h"
#include "libmap/core/text.h"
#include "libmap/raster/raster_module.h"

namespace libmap {

namespace fs = std::filesystem;

namespace {

// A block of 2^24 pixels as GDAL and we hold it, its mask, and GDAL's tables.
constexpr std::uint64_t max_data_bytes = std::uint64_t{3} << 29;
constexpr const char* broken = "is broken: GDAL crashed on it";

enum class Parcel : std::uint8_t { info, block, end };

// The numbers of DemInfo.
struct InfoNumbers {
  std::int64_t columns = 0;
  std::int64_t rows = 0;
  double unit_m = 1.0;
  double origin_m[3] = {};
  double local_from_pixel[6] = {};
};
struct Window {
  std::int64_t column = 0;
  std::int64_t row = 0;
  std::int64_t columns = 0;
  std::int64_t rows = 0;
};

void send_info(const GuardedProcess::Write& write, const DemInfo& info) {
  InfoNumbers numbers{
      .columns = info.columns, .rows = info.rows, .unit_m = info.georeference.unit_m};
  Eigen::Map<Eigen::Vector3d>(numbers.origin_m) = info.georeference.origin_m;
  Eigen::Map<Eigen::Matrix<double, 2, 3>>(numbers.local_from_pixel) = info.local_from_pixel;
  send_value(write, numbers);
  send_array(write, info.georeference.crs_wkt);
  send_array(write, info.band_type);
}

DemInfo receive_info(GuardedProcess& process) {
  InfoNumbers numbers;
  DemInfo info;
  receive_value(process, broken, numbers);
  receive_array(process, broken, info.georeference.crs_wkt);
  receive_array(process, broken, info.band_type);
  info.columns = numbers.columns;
  info.rows = numbers.rows;
  info.georeference.unit_m = numbers.unit_m;
  info.georeference.origin_m = Eigen::Vector3d(numbers.origin_m);
  info.local_from_pixel = Eigen::Map<Eigen::Matrix<double, 2, 3>>(numbers.local_from_pixel);
  return info;
}

// What the process does: an Error or none before each parcel.
void serve(const fs::path& path, const std::optional<Georeference>& frame,
           const GuardedProcess::Write& write) {
  const auto announce = [&](Parcel parcel) {
    send_error(write, nullptr);
    send_value(write, parcel);
  };
  try {
    raster_module().read_dem(
        path, frame,
        [&](const DemInfo& info) {
          announce(Parcel::info);
          send_info(write, info);
        },
        [&](const DemBlock& block) {
          announce(Parcel::block);
          send_value(write, Window{block.column, block.row, block.columns, block.rows});
          send_array(write, block.heights_m);
        });
    announce(Parcel::end);
  } catch (const Error& error) {
    send_error(write, &error);
  }
}

}  // namespace

class DemReader::Process {
 public:
  Process(fs::path path, const std::optional<Georeference>& frame)
      : path_(std::move(path)), process_(max_data_bytes, [&](const GuardedProcess::Write& write) {
          serve(path_, frame, write);
        }) {
    in_file([&] {
      receive_parcel();
      info_ = receive_info(process_);
    });
  }

  const DemInfo& info() const { return info_; }

  bool next(DemBlock& block) {
    bool is_block = false;
    in_file([&] {
      is_block = receive_parcel() == Parcel::block;
      if (!is_block) return;
      Window window;
      receive_value(process_, broken, window);
      block.column = window.column;
      block.row = window.row;
      block.columns = window.columns;
      block.rows = window.rows;
      receive_array(process_, broken, block.heights_m);
    });
    return is_block;
  }

 private:
  Parcel receive_parcel() {
    receive_error(process_, broken);
    Parcel parcel = Parcel::end;
    receive_value(process_, broken, parcel);
    return parcel;
  }

  template <typename Step>
  void in_file(const Step& step) {
    try {
      step();
    } catch (const Error& error) {
      throw error.in_file(path_.string());
    }
  }

  fs::path path_;
  GuardedProcess process_;
  DemInfo info_;
};

DemReader::DemReader(const fs::path& path, const std::optional<Georeference>& frame) {
  require_readable_file(path);
  raster_module();  // here: loaded once for all files, and what is missing is no fault of theirs
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
  const Eigen::Vector2d place = info.local_from_pixel * center;
  return {place.x(), place.y(), block.heights_m[pixel]};
}

PointCloud read_dem_cloud(const fs::path& path) {
  DemReader reader(path);
  if (reader.info().pixels() > machine_memory() / (2 * sizeof(Eigen::Vector3d)))
    throw Error(
        "its points take more than half of the machine's memory; a tile store (score -o "
        "MAP.tiles) reads it in blocks",
        {.file = path.string(),
         .field = "pixels",
         .value = std::to_string(reader.info().pixels())});
  PointCloud cloud;
  DemBlock block;
  while (reader.next(block))
    for (std::size_t n = 0; n < block.heights_m.size(); ++n)
      if (!std::isnan(block.heights_m[n]))
        cloud.positions.push_back(point_of(reader.info(), block, n));
  return cloud;
}

std::optional<Georeference> read_georeference(const fs::path& path) {
  if (is_dem_path(path)) return DemReader(path).info().georeference;
  if (fs::is_directory(path)) {
    fs::path first;
    for (const fs::directory_entry& entry : fs::directory_iterator(path))
      if (is_dem_path(entry.path()) && (first.empty() || entry.path() < first))
        first = entry.path();
    if (!first.empty()) return DemReader(first).info().georeference;
  }
  const auto manifest = read_manifest_of(path.has_filename() ? path : path.parent_path());
  return manifest ? manifest->georeference : std::nullopt;
}

}  // namespace libmap
