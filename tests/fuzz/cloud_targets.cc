// Files of clouds, read whole and in pieces.
#include "libmap/io/cloud_io.h"
#include "libmap/io/cloud_tiles.h"
#include "libmap/io/mesh_io.h"
#include "tests/fuzz/scratch_file.h"
#include "tests/fuzz/target_support.h"

namespace graspmap_fuzz {

namespace {

namespace fs = std::filesystem;

constexpr const char* pcd = ".pcd";
constexpr const char* ply = ".ply";
constexpr const char* csv = ".csv";

template <const char* const& extension>
bool run_cloud(std::string_view bytes) {
  static const ScratchFile file(std::string("cloud") + extension);
  file.write(bytes);
  accepts([&] { libmap::read_cloud_info(file.path()); });
  accepts([&] { libmap::read_tile_info(file.path()); });
  accepts([&] { libmap::read_tiles({file.path()}); });
  return accepts([&] { libmap::read_cloud(file.path()); });
}

// A mesh or a cloud.
template <const char* const& extension>
bool run_cloud_or_mesh(std::string_view bytes) {
  static const ScratchFile file(std::string("mesh") + extension);
  const bool cloud = run_cloud<extension>(bytes);
  file.write(bytes);
  const bool mesh = accepts([&] { libmap::read_mesh(file.path()); });
  return cloud || mesh;
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

template <const char* const& extension>
Seeds cloud_seeds() {
  Seeds seeds;
  for (const auto encoding : {libmap::FileEncoding::ascii, libmap::FileEncoding::binary,
                              libmap::FileEncoding::binary_compressed}) {
    libmap::GeometryWriteOptions options;
    options.encoding = encoding;
    try {
      seeds.push_back(written(std::string("cloud") + extension, [&](const fs::path& path) {
        libmap::write_cloud(path, small_cloud(), options);
      }));
    } catch (const libmap::Error&) {
      // A format without that encoding.
    }
  }
  return seeds;
}

template <const char* const& extension>
Seeds cloud_and_mesh_seeds() {
  Seeds seeds = cloud_seeds<extension>();
  libmap::TriangleMesh mesh;
  mesh.vertices = {{0, 0, 0}, {1, 0, 0}, {0, 1, 0}, {0, 0, 1}};
  mesh.triangles = {{0, 2, 1}, {0, 1, 3}, {1, 2, 3}, {0, 3, 2}};
  mesh.face_fields = {{"part", libmap::ScalarType::int32, {1, 2, 3, 4}}};
  for (const auto encoding : {libmap::FileEncoding::ascii, libmap::FileEncoding::binary})
    for (const bool big_endian : {false, true})
      seeds.push_back(written(std::string("mesh") + extension, [&](const fs::path& path) {
        libmap::write_mesh(path, mesh, {encoding, big_endian});
      }));
  return seeds;
}

}  // namespace

std::vector<FuzzTarget> cloud_targets() {
  return {
      {"cloud_csv", "clouds as CSV", run_cloud<csv>, cloud_seeds<csv>},
      {"pcd", "PCD clouds", run_cloud<pcd>, cloud_seeds<pcd>},
      {"ply", "PLY clouds and meshes", run_cloud_or_mesh<ply>, cloud_and_mesh_seeds<ply>},
  };
}

}  // namespace graspmap_fuzz
