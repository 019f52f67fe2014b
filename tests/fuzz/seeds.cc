#include <algorithm>
#include <functional>
#include <map>

#include "libgtd/score/tile_store_json.h"
#include "libmap/cloud/cloud_io.h"
#include "libmap/core/file_output.h"
#include "libmap/core/manifest.h"
#include "libmap/mesh/mesh_io.h"
#include "libmap/poses/trajectory_io.h"
#include "libmap/scan/colmap_io.h"
#include "libmap/scan/depth_codec.h"
#include "libmap/scan/image_codec.h"
#include "libmap/scan/matrix_codec.h"
#include "libmap/scan/trajectory_text.h"
#include "tests/fuzz/fuzz_targets.h"
#include "tests/fuzz/scratch_file.h"
#include "tests/fuzz/stored_blobs.h"
#include "tests/libmap/scan/sample_database.h"
#include "tests/support/test_support.h"

namespace graspmap_fuzz {

namespace {

namespace fs = std::filesystem;
using Seeds = std::vector<std::string>;

constexpr std::uint64_t max_seed_bytes = 1U << 24U;

std::string with_choice(std::size_t choice, const std::string& bytes) {
  return std::string(1, static_cast<char>(choice)) + bytes;
}

// What `write` leaves in a file of that name.
std::string written(const std::string& name, const std::function<void(const fs::path&)>& write) {
  const ScratchFile file("seed/" + name);
  write(file.path());
  return libmap::read_whole_file(file.path(), max_seed_bytes);
}

libmap::PointCloud small_cloud() {
  libmap::PointCloud cloud;
  for (int n = 0; n < 12; ++n) {
    cloud.positions.emplace_back(0.25 * n, 0.5 * (n % 3), 0.125 * (n % 4));
    cloud.normals.emplace_back(0.0F, 0.0F, 1.0F);
    cloud.colors.push_back({200, 100, static_cast<std::uint8_t>(20 * n)});
  }
  cloud.add_field("score", libmap::ScalarType::float32);
  cloud.add_field("i", libmap::ScalarType::int32);
  return cloud;
}

Seeds cloud_seeds(const std::string& extension) {
  Seeds seeds;
  for (const auto encoding : {libmap::FileEncoding::ascii, libmap::FileEncoding::binary,
                              libmap::FileEncoding::binary_compressed}) {
    libmap::CloudWriteOptions options;
    options.encoding = encoding;
    try {
      seeds.push_back(written("cloud" + extension, [&](const fs::path& path) {
        libmap::write_cloud(path, small_cloud(), options);
      }));
    } catch (const libmap::Error&) {
      // A format without that encoding.
    }
  }
  return seeds;
}

libmap::TriangleMesh small_mesh() {
  libmap::TriangleMesh mesh;
  mesh.vertices = {{0, 0, 0}, {1, 0, 0}, {0, 1, 0}, {0, 0, 1}};
  mesh.triangles = {{0, 2, 1}, {0, 1, 3}, {1, 2, 3}, {0, 3, 2}};
  return mesh;
}

Seeds mesh_seeds(const std::string& extension) {
  return {written("mesh" + extension,
                  [&](const fs::path& path) { libmap::write_mesh(path, small_mesh()); })};
}

Seeds blob_seeds() {
  const StoredBlobs blobs;
  Seeds seeds;
  for (std::size_t place = 0; place < blobs.places(); ++place)
    seeds.push_back(with_choice(place, blobs.blob(place)));
  return seeds;
}

Seeds database_seeds() {
  Seeds seeds;
  for (const graspmap_test::SchemaVersion version : graspmap_test::schema_versions())
    seeds.push_back(written("sample.db", [&](const fs::path& path) {
      fs::remove(path);
      graspmap_test::write_sample(path, version);
    }));
  return seeds;
}

Seeds calibration_seeds() {
  Seeds seeds;
  for (const graspmap_test::SchemaVersion version : graspmap_test::schema_versions())
    seeds.push_back(graspmap_test::sample_calibration(version));
  return seeds;
}

Seeds depth_seeds() {
  const auto depth = graspmap_test::sample_depth(1);
  return {libmap::encode_rvl(depth), libmap::encode_png(depth),
          libmap::encode_float_png(libmap::to_metres(depth))};
}

Seeds image_seeds() {
  const auto color = graspmap_test::sample_color(1);
  return {libmap::encode_png(color), libmap::encode_jpeg(color),
          libmap::encode_png(graspmap_test::sample_depth(1))};
}

std::string sample_matrix() {
  return libmap::encode_matrix({1, 2, 3, libmap::MatrixElement::float32,
                                graspmap_test::bytes_of(std::vector<float>{1, 2, 3, 4, 5, 6})});
}

Seeds matrix_seeds() { return {sample_matrix(), libmap::encode_compressed_text("a text\n")}; }

Seeds laser_seeds() {
  const std::string info =
      graspmap_test::bytes_of(std::vector<float>{5, 0.1F, 10, -1, 1, 0.5F, 2}) +
      graspmap_test::pose_bytes(libmap::Pose::Identity());
  return {with_choice(info.size(), info + sample_matrix())};
}

libmap::Trajectory small_trajectory() {
  libmap::Trajectory trajectory;
  for (int node = 1; node <= 3; ++node)
    trajectory.push_back({node, 100.25 + node, graspmap_test::sample_pose(node)});
  return trajectory;
}

Seeds pose_seeds() {
  Seeds seeds;
  for (std::size_t choice = 0; choice < libmap::trajectory_format_names().size(); ++choice)
    for (const std::string& text :
         {libmap::to_tum(small_trajectory()), libmap::to_kitti(small_trajectory()),
          libmap::to_g2o(small_trajectory(), {}), libmap::to_toro(small_trajectory(), {})})
      seeds.push_back(with_choice(choice, text));
  return seeds;
}

Seeds colmap_seeds() {
  return {with_choice(0, "# cameras\n1 PINHOLE 512 424 365 365 256.5 212.5\n"),
          with_choice(1, "# images\n1 1 0 0 0 0.5 0 1 1 one.jpg\n10.5 20.5 7\n"),
          with_choice(2, "# points\n7 0.5 0.25 1 10 20 30 0.1 1 0 2 3\n")};
}

// Every file of the toolkit's own data of a kind.
void add_data(Seeds& seeds, std::size_t choice, const std::string& kind) {
  std::vector<fs::path> files;
  for (const auto& entry : fs::directory_iterator(graspmap_test::source_folder() / "data" / kind))
    files.push_back(entry.path());
  std::sort(files.begin(), files.end());
  for (const fs::path& file : files)
    seeds.push_back(with_choice(choice, libmap::read_whole_file(file, max_seed_bytes)));
}

Seeds yaml_seeds() {
  Seeds seeds;
  add_data(seeds, 0, "grippers");
  add_data(seeds, 1, "scenarios");
  add_data(seeds, 2, "rigs");
  seeds.push_back(with_choice(3,
                              "image_width: 8\nimage_height: 8\ncamera_matrix: {rows: 3, cols: 3, "
                              "data: [8, 0, 4, 0, 8, 4, 0, 0, 1]}\n"));
  add_data(seeds, 4, "scenes");
  add_data(seeds, 5, "sites");
  return seeds;
}

Seeds table_seeds() {
  Seeds seeds;
  add_data(seeds, 0, "field_test");
  for (std::string& seed : seeds) seed.erase(0, 1);
  seeds.emplace_back("a,b\n\"quoted, \"\"text\"\"\",1e-3\r\n");
  return seeds;
}

libmap::Manifest small_manifest() {
  libmap::Manifest manifest;
  manifest.command = "score";
  manifest.parameters = {{"voxel_size_m", 0.01}, {"interpolation", true}};
  manifest.inputs = {{"terrain.pcd", std::string(64, 'a'), 12}};
  manifest.frame = "terrain";
  manifest.transforms = {{"terrain_from_input", libmap::Pose::Identity()}};
  manifest.results = {{"voxels", std::int64_t{7}}};
  return manifest;
}

Seeds manifest_seeds() { return {libmap::to_json(small_manifest())}; }

Seeds tile_index_seeds() {
  libgtd::TileStoreIndex index;
  index.key = std::string(64, 'a');
  index.lattice.voxel_size_m = 0.01;
  index.tile_voxels = 100;
  index.max = {120, 50, 9};
  index.manifest = small_manifest();
  for (const int number : {0, 1}) {
    libgtd::StoredTile tile;
    tile.number = {number, 0};
    tile.min = {100 * number, 0, 0};
    tile.max = {100 * number + 20, 50, 9};
    tile.voxels = tile.occupied_voxels = 7;
    tile.file = libgtd::tile_file_of(tile.number);
    tile.bytes = 1;
    tile.sha256 = std::string(64, 'b');
    index.tiles.push_back(tile);
  }
  return {libgtd::json_of(index).dump()};
}

// Three files in one input, form feeds between.
Seeds frame_list_seeds() {
  return {
      "# stamp file\n1.0 rgb/1.png\n2.0 rgb/2.png\n\f"
      "1.0 depth/1.png\n2.01 depth/2.png\n\f"
      "1.0 0 0 0 0 0 0 1\n2.0 0.5 0 0 0 0 0 1\n"};
}

}  // namespace

void write_seeds(const FuzzTarget& target, const fs::path& folder) {
  static const std::map<std::string, std::function<Seeds()>> makers = {
      {"calibration", calibration_seeds},
      {"cloud_csv", [] { return cloud_seeds(".csv"); }},
      {"colmap", colmap_seeds},
      {"database", database_seeds},
      {"database_blob", blob_seeds},
      {"depth", depth_seeds},
      {"frame_list", frame_list_seeds},
      {"glb", [] { return mesh_seeds(".glb"); }},
      {"image", image_seeds},
      {"laser_scan", laser_seeds},
      {"manifest", manifest_seeds},
      {"matrix", matrix_seeds},
      {"obj", [] { return mesh_seeds(".obj"); }},
      {"off", [] { return mesh_seeds(".off"); }},
      {"pcd", [] { return cloud_seeds(".pcd"); }},
      {"ply",
       [] {
         Seeds seeds = cloud_seeds(".ply");
         for (const std::string& seed : mesh_seeds(".ply")) seeds.push_back(seed);
         return seeds;
       }},
      {"poses", pose_seeds},
      {"stl", [] { return mesh_seeds(".stl"); }},
      {"table", table_seeds},
      {"tile_index", tile_index_seeds},
      {"vtp", [] { return cloud_seeds(".vtp"); }},
      {"yaml", yaml_seeds},
  };
  fs::create_directories(folder);
  std::size_t number = 0;
  for (const std::string& seed : makers.at(target.name)())
    libmap::write_text(folder / ("seed_" + std::to_string(number++)), seed);
}

}  // namespace graspmap_fuzz
