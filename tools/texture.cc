// graspmap texture: textures a mesh with the images of its scan.
#include <malloc.h>

#include "libmap/io/mesh_io.h"
#include "libmap/scan/scan_source.h"
#include "libmap/texture/texture_model.h"
#include "libmap/texture/textured_mesh_io.h"
#include "libmap/tiles/eigen_json.h"
#include "tools/support/command_line.h"
#include "tools/support/map_frame.h"
#include "tools/support/results.h"
#include "tools/support/scan_poses.h"
#include "tools/support/tile_folder.h"

// JSON of the exposure, which shares and resumed runs read bit for bit.
namespace libmap {

NLOHMANN_DEFINE_TYPE_NON_INTRUSIVE(TextureExposure, gains, vignetting, observations,
                                   log_color_deviation_before, log_color_deviation)

}  // namespace libmap

using namespace graspmap_tools;

namespace {

namespace fs = std::filesystem;

constexpr const char* model_extension = ".glb";  // of tiles

// Frame of the mesh: by its manifest, that of the poses, or of the true poses.
enum class MeshFrame { automatic, poses, ground_truth };

struct TextureCommandOptions {
  std::string mesh;
  std::string output;
  std::string scan;
  PosesOption poses;
  CalibrationOption calibration;
  MeshFrame frame = MeshFrame::automatic;
  double margin_m = 2.0;
  std::string tile = whole_share;
  libmap::TextureOptions texture;
  libmap::TexturedMeshWriteOptions writing;
};

void bind(libmap::ParameterTable& table, TextureCommandOptions& options) {
  table.add("frame", options.frame,
            {{"auto", MeshFrame::automatic},
             {"poses", MeshFrame::poses},
             {"ground-truth", MeshFrame::ground_truth}},
            "frame of the mesh; poses: frame of the poses; ground-truth: frame of true poses, to "
            "which the poses are aligned; auto: from the mesh's manifest, else poses");
  libmap::bind(table, options.texture);
  table.add("margin_m", options.margin_m, libmap::not_negative,
            "for an output folder: maximum distance of occluding surfaces from a tile, m");
  table.add("image_format", options.writing.image_format,
            {{"png", libmap::ImageFormat::png}, {"jpeg", libmap::ImageFormat::jpeg}},
            "format of the texture pages; png: lossless; jpeg: lossy");
  table.add("jpeg_quality", options.writing.jpeg_quality, {1.0, 100.0},
            "JPEG quality of texture pages");
}

bool in_true_frame(const TextureCommandOptions& options) {
  if (options.frame != MeshFrame::automatic) return options.frame == MeshFrame::ground_truth;
  return is_from_true_frame(options.mesh);
}

std::unique_ptr<libmap::ScanSource> scan_of(const TextureCommandOptions& options, Run& run) {
  return open_scan(options.scan, options.texture.strict, run,
                   known_camera(options.calibration, options.scan, options.poses, run));
}

libmap::Trajectory poses_of(TextureCommandOptions& options, const libmap::ScanSource& scan,
                            Run& run) {
  libmap::Trajectory poses = find_poses(scan, options.poses, options.texture.strict, run);
  libmap::Pose mesh_from_poses = libmap::Pose::Identity();
  const bool truth = in_true_frame(options);
  if (truth) mesh_from_poses = truth_from_poses(scan, poses, options.poses, run);
  run.manifest().frame = truth ? "ground truth" : "poses";
  if (const auto site_from_map = site_from_map_of(options.mesh)) {
    mesh_from_poses = *site_from_map * mesh_from_poses;
    run.manifest().frame = "site";
    run.manifest().transforms.emplace_back(site_from_map_name, *site_from_map);
    run.info("poses are transformed to the site's frame");
  }
  for (libmap::TrajectoryPose& pose : poses)
    pose.world_from_base = mesh_from_poses * pose.world_from_base;
  return poses;
}

libmap::TextureResult textured(const TextureCommandOptions& options, const libmap::ScanSource& scan,
                               const libmap::Trajectory& poses, Run& run) {
  const libmap::TriangleMesh mesh =
      run.timed("read", [&] { return libmap::read_mesh(options.mesh).mesh; });
  return in_file(options.mesh, [&] {
    return libmap::texture_mesh(mesh, scan, poses, options.texture, run.progress());
  });
}

void say_result(const libmap::TextureReport& result, Run& run) {
  const std::size_t triangles = result.seen_triangles + result.unseen_triangles;
  for (const auto& [node, fault] : result.skipped)
    run.warn(std::string("skipped: ") + fault.what());
  run.add_timings(result.timings_s);
  run.info(
      "{} images, {} charts on {} page{}, texels of {:.1f} mm; {} of {} triangles ({:.3f} m2) are "
      "not visible and gray",
      result.photos, result.charts, result.pages, result.pages == 1 ? "" : "s",
      1e3 * result.texel_size_m(), result.unseen_triangles, triangles, result.unseen_m2);
  // Rocks hide fewer triangles. A larger share indicates a wrong frame or other poses.
  if (5 * result.unseen_triangles > triangles)
    run.warn("more than 20 % of the triangles are visible in no image; check --frame and --poses");
  if (result.split_charts > 0)
    run.info("{} charts larger than a page were cut", result.split_charts);
  if (result.shrunk_charts > 0)
    run.warn("{} triangles larger than a page have fewer texels", result.shrunk_charts);
  if (result.atlas_scale < 1.0)
    run.warn("texels are {:.2f} times as large as requested, to limit the number of pages",
             1.0 / result.atlas_scale);
}

// Removes pages of an earlier run that this run did not write.
void remove_old_pages(const std::vector<fs::path>& old_pages,
                      const std::vector<libmap::ModelFile>& files) {
  for (const fs::path& page : old_pages) {
    const bool is_new = std::any_of(files.begin(), files.end(), [&](const libmap::ModelFile& file) {
      return file.path == page;
    });
    std::error_code ignored;
    if (!is_new) fs::remove(page, ignored);
  }
}

// Texture pages that an earlier run of this command wrote with its model.
std::vector<fs::path> pages_of_earlier_run(const fs::path& output) {
  std::vector<fs::path> pages;
  const auto manifest = libmap::read_manifest_of(output);
  if (!manifest || manifest->command != "texture" || !fs::exists(output)) return pages;
  const auto* number = std::get_if<std::int64_t>(manifest->find_result("pages"));
  const auto* name = std::get_if<std::string>(manifest->find_parameter("image_format"));
  if (number == nullptr || name == nullptr || output.extension() == ".glb") return pages;
  const auto image_format = *name == "png" ? libmap::ImageFormat::png : libmap::ImageFormat::jpeg;
  for (std::int64_t page = 0; page < std::min<std::int64_t>(*number, 100000); ++page)
    pages.push_back(
        libmap::texture_page_path(output, static_cast<std::size_t>(page), image_format));
  return pages;
}

std::vector<std::string> inputs_of(const TextureCommandOptions& options) {
  std::vector<std::string> inputs = scan_inputs(options.scan, options.poses);
  inputs.push_back(options.mesh);
  inputs.push_back(options.calibration.source);
  return inputs;
}

void add_inputs(const TextureCommandOptions& options, Run& run) {
  run.add_input(options.mesh);
  if (fs::is_regular_file(options.scan)) run.add_input(options.scan);
}

void report(const libmap::TextureReport& result, Run& run) {
  run.add_results(libmap::described(result));
  say_result(result, run);
}

void texture(TextureCommandOptions options, Run& run) {
  libmap::require_textured_format(options.output);
  if (!fs::is_directory(options.mesh)) libmap::require_mesh_format(options.mesh);
  run.claim_output(options.output, inputs_of(options));
  run.require_own_companions(options.output,
                             libmap::additional_model_files(options.output, options.writing));
  const auto scan = scan_of(options, run);
  const libmap::Trajectory poses = poses_of(options, *scan, run);
  const libmap::TextureResult result = textured(options, *scan, poses, run);
  add_inputs(options, run);
  report(result, run);
  const std::vector<fs::path> old_pages = pages_of_earlier_run(options.output);
  const std::vector<libmap::ModelFile> files =
      libmap::textured_mesh_files(options.output, result.model, options.writing);
  Run::Files writers;
  for (const libmap::ModelFile& file : files) writers.emplace_back(file.path, file.write);
  run.write_outputs(options.output, writers);
  if (!run.options().dry_run) remove_old_pages(old_pages, files);
}

std::vector<std::string> stems_of(const std::vector<fs::path>& tiles) {
  std::vector<std::string> stems;
  for (const fs::path& tile : tiles) stems.push_back(tile.stem().string());
  const auto twice = std::adjacent_find(stems.begin(), stems.end());
  if (twice != stems.end())
    throw libmap::Error(
        "two tiles have this name",
        {.file = tiles.front().parent_path().string(), .field = "name", .value = *twice});
  return stems;
}

// Makes and writes the models of the tiles one by one.
void make_models(const TextureCommandOptions& options, const libmap::ScanSource& scan,
                 const libmap::Trajectory& poses, const std::vector<fs::path>& tiles,
                 TileFolder& output, Run& run) {
  // Large arrays are returned to the system after each tile, because the heap would fragment.
  mallopt(M_MMAP_THRESHOLD, 1 << 20);
  const std::vector<std::string> names = stems_of(tiles);
  libmap::MeshTileIndex index(tiles);
  libmap::TileTexturing texturing(index, options.margin_m, scan, poses, options.texture,
                                  run.progress());
  const TileFolder::TileData found =
      output.begin([&] { return TileFolder::TileData(texturing.find_exposure()); });
  if (found.is_null()) return;  // --dry-run
  const auto exposure = found.get<libmap::TextureExposure>();
  const auto make = [&](std::size_t n, const fs::path& to) {
    const libmap::TileTexturing::Tile tile = texturing.make(n, exposure);
    libmap::textured_mesh_files(to, tile.model, options.writing).front().write(to);
    return tile_json_of(tile.counts);
  };
  const auto finish = [&](const fs::path& folder) {
    libmap::TextureReport whole = texturing.report();
    whole.exposure = exposure;
    for (const std::string& name : names) {
      libmap::merge_into<libmap::TextureCounts>(
          whole, result_of<libmap::TextureCounts>(output.tile_data(name)));
      TileFolder::link_file(output.file(name, model_extension), folder / (name + model_extension));
    }
    libmap::require_seen(whole);
    report(whole, run);
    run.add_results({{"tiles", names.size()}});
  };
  output.make({names, model_extension, make, finish});
}

void texture_tiles(TextureCommandOptions options, Run& run) {
  const std::vector<fs::path> tiles = libmap::mesh_tiles(options.mesh);
  const std::vector<std::string> names = tile_folder_names(options.output, tiles, model_extension);
  const auto scan = scan_of(options, run);
  const libmap::Trajectory poses = poses_of(options, *scan, run);
  add_inputs(options, run);
  TileFolder output(options.output, names, inputs_of(options), libmap::parse_share(options.tile),
                    run);
  if (output.is_complete()) return;
  in_file(options.mesh, [&] { make_models(options, *scan, poses, tiles, output, run); });
}

}  // namespace

int main(int argc, char** argv) {
  TextureCommandOptions options;
  Command command("texture");
  command.input("MESH", options.mesh,
                "mesh of the scanned surface (.ply, .obj, ...), or a folder of its tiles");
  command.output(
      options.output,
      std::string("textured mesh (.glb; .obj: with STEM.mtl and one image per page, STEM_0.png "
                  "...)") +
          or_tile_folder);
  command.option("--scan", "SCAN", options.scan,
                 "scan with the images: an RTAB-Map database, or a folder of images", true);
  add_share_option(command, options.tile);
  add_poses_option(command, options.poses);
  add_calibration_option(command, options.calibration);
  bind(command.parameters(), options);
  return command.run(argc, argv, [&](Run& run) {
    if (is_tile_folder(options.output)) return texture_tiles(options, run);
    require_folder_of_share(options.output, options.tile);
    texture(options, run);
  });
}
