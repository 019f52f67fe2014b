// Scans: databases, their blobs, folders of images, and what else gives poses.
#include <set>

#include "libmap/camera/calibration_codec.h"
#include "libmap/camera/camera_io.h"
#include "libmap/camera/depth_codec.h"
#include "libmap/camera/image_codec.h"
#include "libmap/camera/matrix_codec.h"
#include "libmap/core/file_output.h"
#include "libmap/poses/colmap_io.h"
#include "libmap/poses/trajectory_io.h"
#include "libmap/poses/trajectory_text.h"
#include "libmap/scan/frame_folder.h"
#include "libmap/scan/rig_io.h"
#include "libmap/scan/rtabmap_reader.h"
#include "libmap/scan/scan_verification.h"
#include "tests/fuzz/scratch_file.h"
#include "tests/fuzz/stored_blobs.h"
#include "tests/fuzz/target_support.h"
#include "tests/libmap/scan/sample_database.h"

namespace graspmap_fuzz {

namespace {

namespace fs = std::filesystem;

bool run_calibration(std::string_view bytes) {
  return accepts([&] {
    const libmap::Calibration calibration = libmap::decode_calibration(bytes);
    libmap::encode_calibration(calibration);
    libmap::cameras_of(calibration, 512, 424);
    libmap::stereo_cameras_of(calibration, 512, 424);
  });
}

Seeds calibration_seeds() {
  Seeds seeds;
  for (const graspmap_test::SchemaVersion version : graspmap_test::schema_versions())
    seeds.push_back(graspmap_test::sample_calibration(version));
  return seeds;
}

bool run_depth(std::string_view bytes) {
  accepts([&] { libmap::read_depth_info(bytes); });
  return accepts([&] { libmap::to_millimeters(libmap::decode_depth(bytes)); });
}

Seeds depth_seeds() {
  const auto depth = graspmap_test::sample_depth(1);
  return {libmap::encode_rvl(depth), libmap::encode_png(depth),
          libmap::encode_float_png(libmap::to_meters(depth))};
}

bool run_image(std::string_view bytes) {
  accepts([&] { libmap::read_image_info(bytes); });
  return any_accepts([&] { libmap::decode_color(bytes); }, [&] { libmap::decode_gray(bytes); },
                     [&] { libmap::decode_gray16(bytes); }, [&] { libmap::decode_rgba(bytes); });
}

Seeds image_seeds() {
  const auto color = graspmap_test::sample_color(1);
  return {libmap::encode_png(color), libmap::encode_jpeg(color),
          libmap::encode_png(graspmap_test::sample_depth(1))};
}

bool run_matrix(std::string_view bytes) {
  return any_accepts([&] { libmap::decode_matrix(bytes); },
                     [&] { libmap::decode_compressed_text(bytes); });
}

std::string sample_matrix() {
  return libmap::encode_matrix({1, 2, 3, libmap::MatrixElement::float32,
                                graspmap_test::bytes_of(std::vector<float>{1, 2, 3, 4, 5, 6})});
}

Seeds matrix_seeds() {
  return {sample_matrix(), libmap::encode_matrix({1, 8, 1, libmap::MatrixElement::int8,
                                                  std::string("a text\n\0", 8)})};
}

// The first byte is the length of the description, which stands before the points.
bool run_laser_scan(std::string_view bytes) {
  const std::size_t length = take_choice(bytes, 256);
  const std::string_view info = bytes.substr(0, length);
  bytes.remove_prefix(info.size());
  return accepts([&] { libmap::check_laser_scan(bytes, info); });
}

Seeds laser_scan_seeds() {
  const std::string info =
      graspmap_test::bytes_of(std::vector<float>{5, 0.1F, 10, -1, 1, 0.5F, 2}) +
      graspmap_test::pose_bytes(libmap::Pose::Identity());
  return {with_choice(info.size(), info + sample_matrix())};
}

bool read_database(const fs::path& path) {
  return accepts([&] {
    const libmap::RtabmapDatabase database(path);
    accepts([&] { database.parameters(); });
    accepts([&] { database.stored_map(); });
    accepts([&] { database.word_count(); });
    accepts([&] { database.feature_count(); });
    accepts([&] { database.each_content([](const libmap::NodeContent&) {}); });
    for (const auto& node : database.graph().nodes) {
      accepts([&, id = node.id] { database.read_frame(id); });
    }
    libmap::verify_scan(database);
  });
}

bool run_database(std::string_view bytes) {
  static const ScratchFile file("database.db");
  file.write(bytes);
  return read_database(file.path());
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

bool run_database_blob(std::string_view bytes) {
  static const StoredBlobs blobs;
  const std::size_t place = take_choice(bytes, blobs.places());
  return read_database(blobs.database_with(place, bytes));
}

Seeds database_blob_seeds() {
  const StoredBlobs blobs;
  Seeds seeds;
  for (std::size_t place = 0; place < blobs.places(); ++place)
    seeds.push_back(with_choice(place, blobs.blob(place)));
  return seeds;
}

libmap::CameraFile small_camera() {
  libmap::CameraFile camera;
  camera.camera.width = 32;
  camera.camera.height = 24;
  camera.camera.fx = camera.camera.fy = 30.0;
  return camera;
}

// Opens the folder and reads all frames. It holds a camera and an image of either kind.
bool read_frames(const fs::path& path) {
  static std::set<fs::path> prepared;
  if (prepared.insert(path).second) {
    libmap::write_text(path / "calibration.yaml", libmap::to_yaml(small_camera()));
    libmap::write_text(path / "c.png", libmap::encode_png(graspmap_test::sample_color(1)));
    libmap::write_text(path / "g.png",
                       libmap::encode_png(libmap::Image<std::uint8_t>(32, 24, 100)));
    libmap::write_text(path / "d.png", libmap::encode_png(graspmap_test::sample_depth(1)));
  }
  return accepts([&] {
    const libmap::FrameFolder folder(path);
    for (const auto& node : folder.graph().nodes)
      accepts([&, id = node.id] { folder.read_frame(id); });
    libmap::verify_scan(folder);
  });
}

// The lists of a folder's images and poses.
bool run_frame_list(std::string_view bytes) {
  static const ScratchFile colors("frames/rgb.txt");
  static const ScratchFile depths("frames/depth.txt");
  static const ScratchFile poses("frames/groundtruth.txt");
  for (const ScratchFile* file : {&colors, &depths, &poses}) file->write(take_file(bytes));
  return read_frames(colors.path().parent_path());
}

Seeds frame_list_seeds() {
  return {
      "# stamp file\n1.0 c.png\n2.0 c.png\n\f"
      "1.0 d.png\n2.01 d.png\n\f"
      "1.0 0 0 0 0 0 0 1\n2.0 0.5 0 0 0 0 0 1\n"};
}

// Both columns in one list, where neither is known to be the depth.
bool run_frame_pairs(std::string_view bytes) {
  static const ScratchFile file("pairs/associations.txt");
  file.write(bytes);
  return read_frames(file.path().parent_path());
}

Seeds frame_pairs_seeds() {
  return {"1.0 c.png 1.01 d.png\n2.0 c.png 2.0 d.png\n", "# depth first\n1.0 d.png 1.01 c.png\n"};
}

// The table of a folder's nodes, with its options, poses and links.
bool run_frame_table(std::string_view bytes) {
  static const ScratchFile options("table/scan.yaml");
  static const ScratchFile nodes("table/nodes.csv");
  static const ScratchFile poses("table/poses.tum");
  static const ScratchFile stored("table/poses_stored.tum");
  static const ScratchFile links("table/links.g2o");
  for (const ScratchFile* file : {&options, &nodes, &poses, &stored, &links})
    file->write(take_file(bytes));
  return read_frames(options.path().parent_path());
}

Seeds frame_table_seeds() {
  const std::string columns =
      "node,session,weight,stamp_s,label,color,depth,right,calibration,baseline_m,velocity,gps\n";
  return {"depth_unit_m: 0.001\npose_frame: base\n\f" + columns +
              "1,0,0,1.5,,c.png,d.png,,calibration.yaml,,,\n"
              "2,0,3,2.5,here,c.png,,g.png,calibration.yaml calibration.yaml,0.07,1 2 3 4 5 6,"
              "1 2 3 4 5 6\n\f"
              "# node in the last column\n1.5 0 0 0 0 0 0 1 1\n2.5 1 0 0 0 0 0 1 2\n\f"
              "1.5 0 0 0 0 0 0 1\n\f" +
              libmap::to_g2o({}, {{.from = 1, .to = 2}}),
          "pairing_tolerance_s: 0.1\n\f" + columns + "7,1,-1,,,,d.png,,,,,\n\f\f\f"};
}

// The table of a rig's images.
bool run_rig_images(std::string_view bytes) {
  static const ScratchFile file(std::string("rig/") + libmap::rig_images_file_name);
  file.write(bytes);
  return accepts([&] {
    libmap::CameraRig rig;
    rig.cameras.resize(2);
    rig.cameras[0].name = "front";
    rig.cameras[1].name = "rear";
    const auto images = libmap::list_rig_images(file.path().parent_path(), rig);
    libmap::synchronized_sets(images, rig.cameras.size(), 0.02);
    libmap::fullest_synchronized_set(images, rig.cameras.size(), 0.02);
  });
}

Seeds rig_images_seeds() {
  return {
      "camera,stamp_s,file\nfront,1.5,front/a.png\nrear,1.51,rear/a.png\n"
      "front,2,\"b,b.png\"\nrear,2.5e0,c.png\n"};
}

libmap::Trajectory small_trajectory() {
  libmap::Trajectory trajectory;
  for (int node = 1; node <= 3; ++node)
    trajectory.push_back({node, 100.25 + node, graspmap_test::sample_pose(node)});
  return trajectory;
}

// The nodes of that trajectory.
libmap::PoseGraph small_graph() {
  libmap::PoseGraph graph;
  for (const libmap::TrajectoryPose& pose : small_trajectory()) {
    graph.nodes.emplace_back();
    graph.nodes.back().id = pose.node;
    graph.nodes.back().stamp_s = pose.stamp_s;
    graph.optimized_map_from_base.emplace(pose.node, pose.world_from_base);
  }
  return graph;
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
  return accepts([&] {
    const libmap::TrajectoryFile read = libmap::read_trajectory(file.path(), format);
    libmap::assign_nodes(read.poses, small_graph());
  });
}

// Formats that are only read.
std::string foreign_poses(libmap::TrajectoryFormat format) {
  switch (format) {
    case libmap::TrajectoryFormat::open3d:
      return "0 0 1\n1 0 0 0.1\n0 1 0 0.2\n0 0 1 0.3\n0 0 0 1\n";
    case libmap::TrajectoryFormat::nerfstudio:
      return R"({"frames": [{"file_path": "images/1.png", "transform_matrix":
        [[1, 0, 0, 0.1], [0, 1, 0, 0.2], [0, 0, 1, 0.3], [0, 0, 0, 1]]}]})";
    case libmap::TrajectoryFormat::euroc:
      return "#timestamp, x, y, z, w, x, y, z\n1000000000,0.1,0.2,0.3,1,0,0,0\n";
    default:
      return {};
  }
}

Seeds pose_seeds() {
  Seeds seeds;
  const auto& formats = libmap::trajectory_format_names();
  for (std::size_t choice = 0; choice < formats.size(); ++choice) {
    const std::string foreign = foreign_poses(formats[choice].second);
    if (!foreign.empty()) {
      seeds.push_back(with_choice(choice, foreign));
      continue;
    }
    for (const std::string& text :
         {libmap::to_tum(small_trajectory()), libmap::to_kitti(small_trajectory()),
          libmap::to_g2o(small_trajectory(), {}), libmap::to_toro(small_trajectory(), {})})
      seeds.push_back(with_choice(choice, text));
  }
  return seeds;
}

bool run_colmap(std::string_view bytes) {
  return accepts([&] { libmap::parse_colmap_images(bytes, file_name); });
}

Seeds colmap_seeds() { return {"# images\n1 1 0 0 0 0.5 0 1 1 one.jpg\n10.5 20.5 7\n"}; }

}  // namespace

std::vector<FuzzTarget> scan_targets() {
  return {
      {"calibration", "calibration blobs", run_calibration, calibration_seeds},
      {"colmap", "images of COLMAP's text models", run_colmap, colmap_seeds},
      {"database", "scan databases as a whole", run_database, database_seeds},
      {"database_blob", "any blob of a scan database", run_database_blob, database_blob_seeds},
      {"depth", "depth images: RVL, PNG, float PNG", run_depth, depth_seeds},
      {"frame_list", "lists of a folder of images", run_frame_list, frame_list_seeds},
      {"frame_pairs", "lists of pairs of images", run_frame_pairs, frame_pairs_seeds},
      {"frame_table", "tables of a folder of images", run_frame_table, frame_table_seeds},
      {"image", "color and gray images", run_image, image_seeds},
      {"laser_scan", "laser scans", run_laser_scan, laser_scan_seeds},
      {"matrix", "compressed matrices and texts", run_matrix, matrix_seeds},
      {"poses", "TUM, KITTI, g2o, TORO and other files of poses", run_poses, pose_seeds},
      {"rig_images", "tables of a rig's images", run_rig_images, rig_images_seeds},
  };
}

}  // namespace graspmap_fuzz
