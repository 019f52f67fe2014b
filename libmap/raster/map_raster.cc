#include "libmap/raster/map_raster.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>

#include "libmap/core/error.h"
#include "libmap/core/memory_budget.h"
#include "libmap/core/text.h"
#include "libmap/raster/raster_module.h"

namespace libmap {

namespace {

constexpr double no_height = -std::numeric_limits<double>::infinity();

std::string unit_of(const std::string& name) {
  constexpr std::array<std::pair<const char*, const char*>, 3> units{
      {{"_m", "m"}, {"_deg", "deg"}, {"_n", "N"}}};
  for (const auto& [ending, unit] : units)
    if (name.ends_with(ending)) return unit;
  return {};
}

bool is_lattice_index(const std::string& name) { return name == "i" || name == "j" || name == "k"; }

class Rasterizer {
 public:
  explicit Rasterizer(const RasterGrid& grid) : grid_(grid) {}

  // Returns column and row from the grid's corner; rows increase northward.
  Eigen::Matrix<std::int64_t, 2, 1> cell_of(const Eigen::Vector3d& in_frame) const {
    const Eigen::Vector2d& u = grid_.column_axis;
    const Eigen::Vector2d from_corner = in_frame.head<2>() - grid_.corner_m;
    const Eigen::Vector2d pixels =
        Eigen::Vector2d(u.dot(from_corner), northward().dot(from_corner)) / grid_.pixel_size_m;
    if (!(pixels.cwiseAbs().maxCoeff() < 0x1p40))
      throw Error("too small for the extent of the points",
                  {.field = "pixel_size_m", .value = to_text(grid_.pixel_size_m)});
    return pixels.array().floor().cast<std::int64_t>();
  }

  void extend(const PointCloud& part) {
    if (part.empty()) return;
    if (!has_points_) {
      for (const ScalarField& field : part.fields)
        if (!is_lattice_index(field.name))
          raster_.bands.push_back({field.name, unit_of(field.name), {}});
      min_ = max_ = cell_of(grid_.frame_from_points * part.positions.front());
      has_points_ = true;
    }
    for (const Eigen::Vector3d& position : part.positions) {
      const auto cell = cell_of(grid_.frame_from_points * position);
      min_ = min_.cwiseMin(cell);
      max_ = max_.cwiseMax(cell);
    }
  }

  void allocate() {
    if (!has_points_) throw no_elements("points of the input");
    raster_.columns = max_.x() - min_.x() + 1;
    raster_.rows = max_.y() - min_.y() + 1;
    const double pixels = static_cast<double>(raster_.columns) * static_cast<double>(raster_.rows);
    const double bytes = pixels * (8.0 + 4.0 * static_cast<double>(raster_.bands.size()));
    if (bytes > 0.5 * static_cast<double>(machine_memory()) || raster_.columns > 0x7fffffff ||
        raster_.rows > 0x7fffffff)
      throw Error("the raster of " + std::to_string(raster_.columns) + " x " +
                      std::to_string(raster_.rows) +
                      " pixels is too large for the machine's memory or for GeoTIFF; use a larger "
                      "pixel size",
                  {.field = "pixel_size_m", .value = to_text(grid_.pixel_size_m)});
    raster_.heights_m.assign(static_cast<std::size_t>(pixels), no_height);
    for (RasterBand& band : raster_.bands)
      band.values.assign(static_cast<std::size_t>(pixels), std::numeric_limits<float>::quiet_NaN());
    const Eigen::Vector2d& u = grid_.column_axis;
    const Eigen::Vector2d v = northward();
    raster_.frame_from_pixel << grid_.pixel_size_m * u, -grid_.pixel_size_m * v,
        grid_.corner_m + grid_.pixel_size_m * (static_cast<double>(min_.x()) * u +
                                               static_cast<double>(max_.y() + 1) * v);
  }

  void add(const PointCloud& part) {
    std::vector<const ScalarField*> fields;
    for (const RasterBand& band : raster_.bands) fields.push_back(part.find_field(band.name));
    for (std::size_t n = 0; n < part.size(); ++n) {
      const Eigen::Vector3d in_frame = grid_.frame_from_points * part.positions[n];
      const auto cell = cell_of(in_frame);
      const auto pixel =
          static_cast<std::size_t>((max_.y() - cell.y()) * raster_.columns + cell.x() - min_.x());
      if (!(in_frame.z() > raster_.heights_m[pixel])) continue;
      raster_.heights_m[pixel] = in_frame.z();
      for (std::size_t band = 0; band < fields.size(); ++band)
        if (fields[band] != nullptr)
          raster_.bands[band].values[pixel] = static_cast<float>(fields[band]->values[n]);
    }
  }

  MapRaster finish() {
    for (double& height : raster_.heights_m)
      if (height == no_height) height = std::numeric_limits<double>::quiet_NaN();
    return std::move(raster_);
  }

 private:
  Eigen::Vector2d northward() const { return {-grid_.column_axis.y(), grid_.column_axis.x()}; }

  RasterGrid grid_;
  MapRaster raster_;
  bool has_points_ = false;
  Eigen::Matrix<std::int64_t, 2, 1> min_ = {0, 0};
  Eigen::Matrix<std::int64_t, 2, 1> max_ = {0, 0};
};

}  // namespace

MapRaster make_map_raster(const CloudParts& parts, const RasterGrid& grid) {
  Rasterizer rasterizer(grid);
  parts([&](const PointCloud& part) { rasterizer.extend(part); });
  rasterizer.allocate();
  parts([&](const PointCloud& part) { rasterizer.add(part); });
  return rasterizer.finish();
}

void write_map_raster(const std::filesystem::path& path, const MapRaster& raster) {
  in_file(path, [&] { raster_module().write_raster(path, raster); });
}

}  // namespace libmap
