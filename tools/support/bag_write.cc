// graspmap convert ... -o BAG: a map and what belongs to it, or a rig's images, as a bag.
#include <variant>

#include "libgtd/shape/convexity.h"
#include "libgtd/shape/curvature.h"
#include "libmap/cloud/cloud_io.h"
#include "libmap/core/score_color.h"
#include "libmap/view/color_map.h"
#include "tools/support/convert_bag.h"
#include "tools/support/map_frame.h"

namespace graspmap_tools {

namespace {

namespace fs = std::filesystem;
using libmap::Manifest;
using libmap::PointCloud;

// A cloud's file and what its manifest says.
struct CloudFile {
  std::string path;
  PointCloud cloud;
  std::optional<Manifest> manifest;

  std::string frame() const { return manifest ? manifest->frame : std::string(); }
};

CloudFile read(const std::string& path, Run& run) {
  CloudFile file{path, libmap::read_cloud(path).cloud, libmap::read_manifest_of(path)};
  run.add_input(path);
  return file;
}

// ROS's name (REP-105) of a frame; `input` for those of the cloud that was scored.
std::string frame_id(const std::string& frame, const std::string& input) {
  if (frame == "robot") return "base_link";
  if (frame == "input") return input;
  return frame.empty() ? "map" : frame;
}

double radius_of(const std::optional<Manifest>& manifest) {
  const double* radius =
      manifest ? std::get_if<double>(manifest->find_parameter("curvature_radius_m")) : nullptr;
  return radius && *radius > 0 ? *radius : libgtd::CurvatureOptions{}.radius_m;
}

// The map with the curvatures at its voxels, colored by convexity as `render --color flags`.
PointCloud curvature_map(const CloudFile& map) {
  const libgtd::CurvatureOptions options{.radius_m = radius_of(map.manifest),
                                         .up = up_of_map(map.manifest)};
  const libgtd::CurvatureResult curvature = libgtd::estimate_curvature(map.cloud, options);
  PointCloud cloud = map.cloud;
  std::vector<double> k1;
  std::vector<double> k2;
  for (const libgtd::Curvature& point : curvature.points) {
    k1.push_back(static_cast<double>(point.k1));
    k2.push_back(static_cast<double>(point.k2));
  }
  cloud.add_field("k1", libmap::ScalarType::float32).values = k1;
  cloud.add_field("k2", libmap::ScalarType::float32).values = k2;
  if (!cloud.find_field("convex")) {
    const std::vector<std::uint8_t> convex = libgtd::find_convex(curvature, cloud.positions);
    cloud.add_field("convex", libmap::ScalarType::uint8)
        .values.assign(convex.begin(), convex.end());
  }
  const std::vector<double>& convex = cloud.find_field("convex")->values;
  cloud.colors.clear();
  for (const double one : convex)
    cloud.colors.push_back(one > 0 ? libmap::convex_color : libmap::rest_color);
  return cloud;
}

libmap::BagPlaces places_of(const CloudFile& footholds, double arrow_m) {
  const auto field = [&](const char* name) -> const std::vector<double>& {
    const libmap::ScalarField* found = footholds.cloud.find_field(name);
    if (found) return found->values;
    throw libmap::Error("no such field: are these footholds?",
                        {.file = footholds.path, .field = name});
  };
  const std::vector<double>& x = field("approach_x");
  const std::vector<double>& y = field("approach_y");
  const std::vector<double>& z = field("approach_z");
  const std::vector<double>& score = field("score");
  libmap::BagPlaces places;
  places.marker_topic = "/footholds";
  places.pose_topic = "/foothold_poses";
  places.arrow_m = arrow_m;
  for (std::size_t n = 0; n < footholds.cloud.size(); ++n) {
    const Eigen::Vector3d approach(x[n], y[n], z[n]);
    if (!approach.allFinite() || approach.norm() < 1e-9)
      throw libmap::Error(
          "is no direction",
          {.file = footholds.path, .field = fmt::format("approach of foothold {}", n + 1)});
    places.places.push_back({footholds.cloud.positions[n], approach, libmap::score_color(score[n]),
                             fmt::format("{}: {:.2f}", n + 1, score[n])});
  }
  return places;
}

// The inputs' own stamp: that of the panorama.
double stamp_of(const BagCommandOptions& options, const std::vector<const CloudFile*>& files) {
  if (const std::optional<double> stamp = bag_stamp(options)) return *stamp;
  for (const CloudFile* file : files) {
    if (file == nullptr || !file->manifest) continue;
    const double* stamp = std::get_if<double>(file->manifest->find_result("stamp_s"));
    if (stamp && *stamp >= 1e-9) return *stamp;
  }
  return libmap::BagContent{}.stamp_s;
}

// RViz shows clouds of several frames together only if it is told how they lie.
void add_transform(const CloudFile& map, const std::string& map_frame,
                   const std::string& terrain_frame, libmap::BagContent& content, Run& run) {
  if (map_frame == terrain_frame) return;
  const libmap::Pose* pose = terrain_from_input_of(map.manifest);
  if (pose && map.frame() == "terrain")
    content.transforms.push_back({map_frame, terrain_frame, *pose});
  else
    run.warn("no transform from {} to {} is known", terrain_frame, map_frame);
}

// The map seen from above: each cell has what its topmost voxel has.
libmap::BagGrid grid_of(const CloudFile& map, double cell_m) {
  libmap::BagGrid grid;
  grid.grid_map_topic = "/graspability_grid";
  grid.occupancy_topic = "/graspability_occupancy";
  grid.cell_m = cell_m;
  const std::vector<Eigen::Vector3d>& points = map.cloud.positions;
  const libmap::Bounds3d bounds = libmap::bounds_of(points);
  // Voxels have their centers in the middle of cells.
  grid.corner_m = bounds.min.head<2>().array() - cell_m / 2;
  const Eigen::Array2d cells = (bounds.max - bounds.min).head<2>().array() / cell_m + 1.5;
  constexpr double max_cells = 1 << 26;
  if (!(cells.prod() <= max_cells))
    throw libmap::Error("makes too many cells for a message", {.file = map.path,
                                                               .field = "cell_size_m",
                                                               .value = libmap::to_text(cell_m),
                                                               .bound = "<= 2^26 cells"});
  grid.columns = static_cast<std::size_t>(cells.x());
  grid.rows = static_cast<std::size_t>(cells.y());
  std::vector<std::size_t> top(grid.columns * grid.rows, points.size());
  for (std::size_t n = 0; n < points.size(); ++n) {
    const Eigen::Array2d cell = (points[n].head<2>() - grid.corner_m).array() / cell_m;
    std::size_t& held =
        top[static_cast<std::size_t>(cell.y()) * grid.columns + static_cast<std::size_t>(cell.x())];
    if (held == points.size() || points[n].z() > points[held].z()) held = n;
  }
  const auto layer = [&](const std::string& name, const auto& value) {
    grid.layers.push_back({name, std::vector<float>(top.size(), std::nanf(""))});
    for (std::size_t n = 0; n < top.size(); ++n)
      if (top[n] < points.size()) grid.layers.back().values[n] = static_cast<float>(value(top[n]));
  };
  layer("elevation", [&](std::size_t n) { return points[n].z(); });
  for (const libmap::ScalarField& field : map.cloud.fields)
    layer(field.name, [&](std::size_t n) { return field.values[n]; });
  const std::vector<double>& score = map.cloud.find_field("score")->values;
  layer("occupancy", [&](std::size_t n) { return 1.0 - std::clamp(score[n], 0.0, 1.0); });
  grid.occupancy = std::move(grid.layers.back().values);
  grid.layers.pop_back();
  return grid;
}

void add_grid(const CloudFile& map, const std::string& frame, const BagCommandOptions& options,
              libmap::BagContent& content, Run& run) {
  double cell_m = options.cell_size_m;
  if (cell_m == 0 && map.manifest) {
    const double* voxel = std::get_if<double>(map.manifest->find_parameter("voxel_size_m"));
    if (voxel) cell_m = *voxel;
  }
  if (!(cell_m > 0) || map.cloud.empty())
    return run.warn("{}: {}, so the bag has no grids", map.path,
                    map.cloud.empty() ? "no points" : "no voxel size is known (--cell-size)");
  content.grids.push_back(grid_of(map, cell_m));
  content.grids.back().frame = frame;
}

void claim_bag(const BagCommandOptions& options, const std::vector<std::string>& inputs, Run& run) {
  if (libmap::bag_format_of(options.output) == libmap::BagFormat::sqlite)
    run.claim_output_tree(options.output, libmap::names_in_bag_folder(), inputs);
  else
    run.claim_output(options.output, inputs);
}

// write(path, format) makes the bag.
template <typename Write>
void write_claimed_bag(const BagCommandOptions& options, Run& run, const Write& write) {
  const libmap::BagFormat format = libmap::bag_format_of(options.output);
  const auto write_whole = [&](const fs::path& temporary) {
    if (!temporary.empty()) write(temporary, format);
  };
  if (format == libmap::BagFormat::sqlite)
    run.write_output_tree(options.output, libmap::names_in_bag_folder(), write_whole);
  else
    run.write_output(options.output, write_whole);
}

void add_results(const libmap::BagContent& content, Run& run) {
  for (const libmap::BagCloud& cloud : content.clouds)
    run.add_results({{cloud.topic + ".points", cloud.cloud.size()}});
  for (const libmap::BagPlaces& places : content.places)
    run.add_results({{"footholds", places.places.size()}});
  for (const libmap::BagGrid& grid : content.grids)
    run.add_results(
        {{"cells_x", grid.columns}, {"cells_y", grid.rows}, {"cell_size_m", grid.cell_m}});
  run.add_results({{"stamp_s", content.stamp_s}});
}

}  // namespace

void write_map_bag(const BagCommandOptions& options, Run& run) {
  claim_bag(options, {options.input, options.terrain, options.curvature, options.footholds}, run);
  const CloudFile map = read(options.input, run);
  if (!map.cloud.find_field("score"))
    throw libmap::Error(fs::path(options.output).has_extension()
                            ? "no such field: is this a map?"
                            : "no such field: an output without an extension is a bag of ROS 2, "
                              "which is made of a map",
                        {.file = options.input, .field = "score"});
  std::optional<CloudFile> terrain;
  if (!options.terrain.empty()) terrain = read(options.terrain, run);
  std::optional<CloudFile> footholds;
  if (!options.footholds.empty()) footholds = read(options.footholds, run);

  libmap::BagContent content;
  content.stamp_s = stamp_of(options, {&map, terrain ? &*terrain : nullptr});
  const std::string terrain_frame = terrain ? frame_id(terrain->frame(), "map") : "map";
  const std::string map_frame =
      options.frame == "auto" ? frame_id(map.frame(), terrain_frame) : options.frame;
  if (terrain) {
    add_transform(map, map_frame, terrain_frame, content, run);
    content.clouds.push_back({"/merged_pcd", terrain_frame, terrain->cloud});
  }
  content.clouds.push_back({"/graspability_map", map_frame, map.cloud});
  content.clouds.push_back({"/curvature_map", map_frame,
                            options.curvature.empty()
                                ? run.timed("curvature", [&] { return curvature_map(map); })
                                : read(options.curvature, run).cloud});
  if (footholds) {
    content.places.push_back(places_of(*footholds, options.arrow_m));
    content.places.back().frame = frame_id(footholds->frame(), terrain_frame);
  }
  if (libmap::bag_format_of(options.output) != libmap::BagFormat::ros1)
    add_grid(map, map_frame, options, content, run);
  run.manifest().frame = map_frame;
  add_results(content, run);
  write_claimed_bag(options, run, [&](const fs::path& path, libmap::BagFormat format) {
    libmap::write_bag(path, format, content, options.compression);
  });
  run.say("{} clouds and {} footholds at {} s", content.clouds.size(),
          footholds ? footholds->cloud.size() : 0, libmap::to_fixed_text(content.stamp_s, 6));
}

void write_rig_folder_bag(const BagCommandOptions& options, Run& run) {
  claim_bag(options, {}, run);
  const fs::path own = fs::path(options.input) / libmap::rig_file_name;
  const libmap::CameraRig rig =
      read_named_rig(options.rig.empty() ? own.string() : options.rig, run);
  const std::vector<libmap::RigImage> images = libmap::list_rig_images(options.input, rig);
  for (const libmap::RigImage& image : images) run.add_input(image.file);
  const libmap::RigBagOptions bag{.base_frame = options.depth.base_frame == "auto"
                                                    ? libmap::RigBagOptions{}.base_frame
                                                    : options.depth.base_frame,
                                  .stamp_offset_s = options.stamp_offset_s,
                                  .compression = options.compression};
  run.manifest().frame = bag.base_frame;
  run.add_results({{"cameras", rig.cameras.size()}, {"images", images.size()}});
  write_claimed_bag(options, run, [&](const fs::path& path, libmap::BagFormat format) {
    libmap::write_rig_bag(path, format, rig, images, bag);
  });
  run.say("{} images of {} cameras", images.size(), rig.cameras.size());
}

}  // namespace graspmap_tools
