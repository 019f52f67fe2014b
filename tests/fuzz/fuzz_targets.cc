#include "tests/fuzz/fuzz_targets.h"

#include <algorithm>
#include <memory>
#include <stdexcept>

#include "libgtd/gripper/gripper_io.h"
#include "libgtd/score/scenario.h"
#include "libgtd/score/tile_store_io.h"
#include "libmap/cloud/cloud_io.h"
#include "libmap/core/error.h"
#include "libmap/core/manifest.h"
#include "libmap/core/table.h"
#include "libmap/mesh/mesh_io.h"
#include "libmap/mesh/textured_mesh_io.h"
#include "libmap/poses/trajectory_io.h"
#include "libmap/scan/calibration_codec.h"
#include "libmap/scan/camera_io.h"
#include "libmap/scan/colmap_io.h"
#include "libmap/scan/depth_codec.h"
#include "libmap/scan/frame_folder.h"
#include "libmap/scan/image_codec.h"
#include "libmap/scan/laser_scan.h"
#include "libmap/scan/matrix_codec.h"
#include "libmap/scan/rig_io.h"
#include "libmap/scan/rtabmap_reader.h"
#include "libmap/scan/scan_verification.h"
#include "libmap/simulate/primitive_scene_io.h"
#include "libmap/simulate/rock_site_io.h"
#include "tests/fuzz/scratch_file.h"
#include "tests/fuzz/stored_blobs.h"

namespace graspmap_fuzz {

namespace {

constexpr const char* file_name = "bytes";

// Whether `read` came to its end.
template <typename Read>
bool accepts(const Read& read) {
  try {
    read();
    return true;
  } catch (const libmap::Error&) {
    return false;
  }
}

// Calls all of them; whether one came to its end.
template <typename... Reads>
bool any_accepts(const Reads&... reads) {
  bool any = false;
  ((any = accepts(reads) || any), ...);
  return any;
}

// The first byte chooses among `count` formats that share a target.
std::size_t take_choice(std::string_view& bytes, std::size_t count) {
  if (bytes.empty()) return 0;
  const auto choice = static_cast<unsigned char>(bytes.front());
  bytes.remove_prefix(1);
  return choice % count;
}

bool run_calibration(std::string_view bytes) {
  return accepts([&] {
    const libmap::Calibration calibration = libmap::decode_calibration(bytes);
    libmap::encode_calibration(calibration);
    libmap::cameras_of(calibration, 512, 424);
    libmap::stereo_cameras_of(calibration, 512, 424);
  });
}

bool run_depth(std::string_view bytes) {
  accepts([&] { libmap::read_depth_info(bytes); });
  return accepts([&] { libmap::to_millimetres(libmap::decode_depth(bytes)); });
}

bool run_image(std::string_view bytes) {
  accepts([&] { libmap::read_image_info(bytes); });
  return any_accepts([&] { libmap::decode_color(bytes); }, [&] { libmap::decode_gray(bytes); },
                     [&] { libmap::decode_gray16(bytes); }, [&] { libmap::decode_rgba(bytes); });
}

bool run_matrix(std::string_view bytes) {
  return any_accepts([&] { libmap::decode_matrix(bytes); },
                     [&] { libmap::decode_compressed_text(bytes); });
}

// The first byte is the length of the description, which stands before the points.
bool run_laser_scan(std::string_view bytes) {
  const std::size_t length = take_choice(bytes, 256);
  const std::string_view info = bytes.substr(0, length);
  bytes.remove_prefix(info.size());
  return accepts([&] { libmap::decode_laser_scan(bytes, info); });
}

bool read_database(const std::filesystem::path& path) {
  return accepts([&] {
    const libmap::RtabmapDatabase database(path);
    accepts([&] { database.parameters(); });
    accepts([&] { database.stored_map(); });
    accepts([&] { database.each_content([](const libmap::NodeContent&) {}); });
    for (const auto& node : database.graph().nodes) {
      accepts([&, id = node.id] { database.read_frame(id); });
      accepts([&, id = node.id] { database.features(id); });
      accepts([&, id = node.id] { database.laser_scan(id); });
    }
    libmap::verify_scan(database);
  });
}

bool run_database(std::string_view bytes) {
  static const ScratchFile file("database.db");
  file.write(bytes);
  return read_database(file.path());
}

bool run_database_blob(std::string_view bytes) {
  static const StoredBlobs blobs;
  const std::size_t place = take_choice(bytes, blobs.places());
  return read_database(blobs.database_with(place, bytes));
}

template <const char* const& extension>
bool run_cloud(std::string_view bytes) {
  static const ScratchFile file(std::string("cloud") + extension);
  file.write(bytes);
  accepts([&] { libmap::read_cloud_info(file.path()); });
  return accepts([&] { libmap::read_cloud(file.path()); });
}

template <const char* const& extension>
bool run_mesh(std::string_view bytes) {
  static const ScratchFile file(std::string("mesh") + extension);
  file.write(bytes);
  if (libmap::is_textured_format(file.path()))
    accepts([&] { libmap::read_textured_mesh(file.path()); });
  return accepts([&] { libmap::read_mesh(file.path()); });
}

constexpr const char* pcd = ".pcd";
constexpr const char* ply = ".ply";
constexpr const char* vtp = ".vtp";
constexpr const char* csv = ".csv";
constexpr const char* obj = ".obj";
constexpr const char* off = ".off";
constexpr const char* stl = ".stl";
constexpr const char* glb = ".glb";

bool run_ply(std::string_view bytes) {
  const bool cloud = run_cloud<ply>(bytes);
  const bool mesh = run_mesh<ply>(bytes);
  return cloud || mesh;
}

bool run_poses(std::string_view bytes) {
  static const std::vector<libmap::TrajectoryFormat> formats = [] {
    std::vector<libmap::TrajectoryFormat> all;
    for (const auto& [name, format] : libmap::trajectory_format_names()) all.push_back(format);
    return all;
  }();
  static const ScratchFile file("poses.txt");
  const libmap::TrajectoryFormat format = formats[take_choice(bytes, formats.size())];
  file.write(bytes);
  return accepts([&] { libmap::read_trajectory(file.path(), format); });
}

bool run_colmap(std::string_view bytes) {
  const std::size_t choice = take_choice(bytes, 3);
  return accepts([&] {
    if (choice == 0) {
      for (const auto& entry : libmap::parse_colmap_cameras(bytes, file_name))
        libmap::to_camera(entry.second);
    } else if (choice == 1) {
      libmap::parse_colmap_images(bytes, file_name);
    } else {
      libmap::parse_colmap_points(bytes, file_name);
    }
  });
}

bool run_yaml(std::string_view bytes) {
  const std::size_t choice = take_choice(bytes, 6);
  const std::string text(bytes);
  return accepts([&] {
    switch (choice) {
      case 0:
        libgtd::parse_gripper(text, file_name);
        break;
      case 1: {
        libgtd::Scenario scenario;
        libmap::ParameterTable table;
        libgtd::bind(table, scenario);
        libmap::set_from_yaml(table, text, file_name);
        scenario.check();
        break;
      }
      case 2:
        libmap::parse_rig(text, file_name);
        break;
      case 3:
        libmap::parse_camera(text, file_name);
        break;
      case 4:
        libmap::parse_scene(text, file_name);
        break;
      default:
        libmap::parse_site(text, file_name);
    }
  });
}

bool run_table(std::string_view bytes) {
  return accepts([&] { libmap::to_csv(libmap::parse_csv(bytes, file_name)); });
}

bool run_manifest(std::string_view bytes) {
  return accepts([&] { libmap::to_json(libmap::parse_manifest(std::string(bytes), file_name)); });
}

bool run_tile_index(std::string_view bytes) {
  static const ScratchFile file("store.tiles/index.json");
  file.write(bytes);
  return accepts([&] { libgtd::read_tile_store(file.path().parent_path()); });
}

// The lists of a folder's images and poses, form feeds between them.
bool run_frame_list(std::string_view bytes) {
  static const ScratchFile calibration("frames/calibration.yaml");
  static const ScratchFile colors("frames/rgb.txt");
  static const ScratchFile depths("frames/depth.txt");
  static const ScratchFile poses("frames/groundtruth.txt");
  static const bool has_calibration = [] {
    libmap::CameraFile camera;
    camera.camera.width = camera.camera.height = 8;
    camera.camera.fx = camera.camera.fy = 8.0;
    calibration.write(libmap::to_yaml(camera));
    return true;
  }();
  static_cast<void>(has_calibration);
  for (const ScratchFile* file : {&colors, &depths, &poses}) {
    const std::size_t end = std::min(bytes.find('\f'), bytes.size());
    file->write(bytes.substr(0, end));
    bytes.remove_prefix(std::min(end + 1, bytes.size()));
  }
  return accepts([&] {
    const libmap::FrameFolder folder(colors.path().parent_path());
    for (const auto& node : folder.graph().nodes)
      accepts([&, id = node.id] { folder.read_frame(id); });
  });
}

}  // namespace

const std::vector<FuzzTarget>& fuzz_targets() {
  static const std::vector<FuzzTarget> targets = {
      {"calibration", "calibration blobs", run_calibration},
      {"cloud_csv", "clouds as CSV", run_cloud<csv>},
      {"colmap", "COLMAP's text models", run_colmap},
      {"database", "scan databases as a whole", run_database},
      {"database_blob", "any blob of a scan database", run_database_blob},
      {"depth", "depth images: RVL, PNG, float PNG", run_depth},
      {"frame_list", "lists of a folder of images", run_frame_list},
      {"glb", "GLB models", run_mesh<glb>},
      {"image", "colour and grey images", run_image},
      {"laser_scan", "laser scans", run_laser_scan},
      {"manifest", "manifests", run_manifest},
      {"matrix", "compressed matrices and texts", run_matrix},
      {"obj", "OBJ meshes", run_mesh<obj>},
      {"off", "OFF meshes", run_mesh<off>},
      {"pcd", "PCD clouds", run_cloud<pcd>},
      {"ply", "PLY clouds and meshes", run_ply},
      {"poses", "TUM, KITTI, g2o, TORO and other files of poses", run_poses},
      {"stl", "STL meshes", run_mesh<stl>},
      {"table", "CSV tables", run_table},
      {"tile_index", "indices of tile stores", run_tile_index},
      {"vtp", "VTP clouds", run_cloud<vtp>},
      {"yaml", "grippers, scenarios, rigs, cameras, scenes and sites", run_yaml},
  };
  return targets;
}

const FuzzTarget& fuzz_target(std::string_view name) {
  const auto& targets = fuzz_targets();
  const auto found = std::find_if(targets.begin(), targets.end(),
                                  [&](const FuzzTarget& target) { return name == target.name; });
  if (found == targets.end()) throw std::out_of_range("no fuzz target " + std::string(name));
  return *found;
}

}  // namespace graspmap_fuzz
