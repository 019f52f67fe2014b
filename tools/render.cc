// graspmap render: draws clouds, meshes and maps.
#include <Eigen/Geometry>
#include <limits>
#include <variant>
#include "libgtd/grasp/trial_scene.h"
#include "libgtd/score/graspability_map.h"
#include "libgtd/score/map_downsampling.h"
#include "libmap/camera/image_codec.h"
#include "libmap/core/parallel.h"
#include "libmap/core/parameters.h"
#include "libmap/core/table.h"
#include "libmap/io/cloud_io.h"
#include "libmap/io/mesh_io.h"
#include "libmap/texture/textured_mesh_io.h"
#include "libmap/tiles/xy_tile.h"
#include "libmap/view/image_grid.h"
#include "libmap/view/scene_view.h"
#include "tools/support/command_line.h"
#include "tools/support/map_frame.h"
#include "tools/support/map_tiles.h"
#include "tools/support/option_values.h"

using namespace graspmap_tools;

namespace {

// Horizontal frame of a map in the image. terrain: the terrain frame. input: rotated about z and
// shifted horizontally, so that x and y are those of the scored cloud; heights are those of the
// terrain frame. automatic: terrain for one file, input for several.
enum class MapHeading { automatic, terrain, input };

// One file as a scene, with markers at listed locations.
struct SceneFileOptions {
  std::string points;  // CSV of marked locations; empty: none
  std::string label = "auto";
  std::string verdict;
  std::string zero_plane = "auto";
  PointFrame points_frame = PointFrame::automatic;
  std::string box;  // shown rectangle of the x-y plane
  std::uint64_t max_points = 1'000'000;
  libmap::SceneLayer layer;  // its shape is that of the file
  MapHeading heading = MapHeading::automatic;
};

struct SceneFile {
  libmap::Scene scene;
  int columns_per_point = 0;  // side of the squares that became one point of a tile store; else 0
};

libmap::Verdict verdict_of(const libmap::Table& table, std::size_t row, std::size_t column) {
  const std::string& cell = table.rows[row][column];
  if (libmap::trim(cell).empty()) return libmap::Verdict::none;
  const auto verdict = libmap::parse_bool(cell);
  if (!verdict)
    throw libmap::Error("not a verdict", {.file = table.file,
                                          .field = "row " + std::to_string(row + 1) + ", column '" +
                                                   table.columns[column] + "'",
                                          .value = "'" + cell + "'",
                                          .bound = "1, 0 or empty"});
  return *verdict ? libmap::Verdict::pass : libmap::Verdict::fail;
}

// Reads markers in the frame of the list.
std::vector<libmap::Marker> read_markers(const SceneFileOptions& options) {
  const libmap::Table table = libmap::read_csv(options.points);
  const std::vector<Eigen::Vector3d> positions = positions_of(table);
  const std::size_t label =
      options.label == "auto" || options.label == "none" ? 0 : table.column(options.label);
  const std::string& first = table.columns.front();
  const bool nameless = first == "x" || first == "y" || first == "z";
  const bool labeled = options.label != "none" && !(options.label == "auto" && nameless);
  std::vector<libmap::Marker> markers;
  for (std::size_t row = 0; row < positions.size(); ++row) {
    libmap::Marker& marker = markers.emplace_back();
    marker.position = positions[row];
    if (labeled) marker.label = table.rows[row][label];
    if (!options.verdict.empty())
      marker.verdict = verdict_of(table, row, table.column(options.verdict));
  }
  return markers;
}

double zero_plane_of(const SceneFileOptions& options, const libmap::Manifest* manifest) {
  constexpr double none = -std::numeric_limits<double>::infinity();
  if (options.zero_plane == "none") return none;
  if (options.zero_plane != "auto") {
    const auto height = libmap::parse_double(options.zero_plane);
    if (height) return *height;
    throw libmap::Error(
        "not a height",
        {.field = "--zero-plane", .value = options.zero_plane, .bound = "auto, none or a number"});
  }
  if (manifest == nullptr) return none;
  return libmap::number_of(manifest->find_parameter("zero_plane_m")).value_or(none);
}

// Rotation about z and horizontal shift that align the input's x axis and origin horizontally.
libmap::Pose turned_back(const libmap::Pose& terrain_from_input) {
  const Eigen::Vector3d x_axis = terrain_from_input.linear().col(0);
  const Eigen::Vector3d origin = terrain_from_input.translation();
  libmap::Pose pose = libmap::Pose::Identity();
  pose.rotate(Eigen::AngleAxisd(-std::atan2(x_axis.y(), x_axis.x()), Eigen::Vector3d::UnitZ()));
  pose.translate(Eigen::Vector3d(-origin.x(), -origin.y(), 0.0));
  return pose;
}

// A tile that the window shows, and the share of its area in the window.
struct SeenTile {
  std::size_t tile = 0;
  double fraction = 1.0;
};

std::vector<SeenTile> seen_tiles(const MapTiles& tiles,
                                 const std::optional<Eigen::AlignedBox2d>& box) {
  std::vector<SeenTile> seen;
  for (std::size_t n = 0; n < tiles.index().tiles.size(); ++n) {
    if (!box) {
      seen.push_back({n, 1.0});
      continue;
    }
    const double half = 0.5 * tiles.index().lattice.voxel_size_m;
    const Eigen::AlignedBox3d around = tiles.box(n);
    const Eigen::AlignedBox2d plan(around.min().head<2>().array() - half,
                                   around.max().head<2>().array() + half);
    const Eigen::AlignedBox2d common = plan.intersection(*box);
    if (!common.isEmpty()) seen.push_back({n, common.volume() / plan.volume()});
  }
  return seen;
}

int columns_per_point(const MapTiles& tiles, const std::vector<SeenTile>& seen,
                      std::uint64_t max_points) {
  double points = 0.0;
  for (const SeenTile& one : seen)
    points += one.fraction * static_cast<double>(tiles.index().tiles[one.tile].voxels);
  const double columns = std::ceil(std::sqrt(points / static_cast<double>(max_points)));
  // Limited, because the counts are read from the index; no map has more than 2^40 points.
  return columns >= 1.0 ? static_cast<int>(std::min(columns, 0x1p20)) : 1;
}

// Parses "X0,Y0,X1,Y1" in meters; returns nullopt for an empty text. Throws Error naming --box.
std::optional<Eigen::AlignedBox2d> parse_rectangle(const std::string& text) {
  if (text.empty()) return std::nullopt;
  const auto n = split_numbers(text, 4);
  if (n && (*n)[0] < (*n)[2] && (*n)[1] < (*n)[3])
    return Eigen::AlignedBox2d(Eigen::Vector2d(n->data()), Eigen::Vector2d(n->data() + 2));
  throw libmap::Error(
      "not a rectangle",
      {.field = "--box", .value = text, .bound = "X0,Y0,X1,Y1 with X0 < X1 and Y0 < Y1"});
}

// Returns the points in the box in the x-y plane of the cloud's frame.
libmap::PointCloud points_in_box(const libmap::PointCloud& cloud, const Eigen::AlignedBox2d& box) {
  std::vector<std::size_t> inside;
  for (std::size_t n = 0; n < cloud.size(); ++n)
    if (box.contains(cloud.positions[n].head<2>())) inside.push_back(n);
  return libmap::select_points(cloud, inside);
}

struct MapWindow {
  libmap::PointCloud cloud;
  int columns_per_point = 1;  // width of the squares of columns that became one point
};

// Loads the tiles that the box touches, a few at a time. If they have more than about `max_points`
// points, squares of columns become one point each (downsample_map). Throws Error if the box is
// empty.
MapWindow read_window(const MapTiles& tiles, const std::optional<Eigen::AlignedBox2d>& box,
                      std::uint64_t max_points) {
  const std::vector<SeenTile> seen = seen_tiles(tiles, box);
  MapWindow window;
  window.columns_per_point = columns_per_point(tiles, seen, max_points);
  std::vector<libmap::PointCloud> parts(seen.size());
  libmap::parallel_each(seen.size(), [&](std::size_t n) {
    parts[n] = tiles.load(seen[n].tile);
    if (box) parts[n] = points_in_box(parts[n], *box);
    if (window.columns_per_point > 1)
      parts[n] = libgtd::downsample_map(parts[n], window.columns_per_point);
  });
  if (!parts.empty()) window.cloud = libgtd::merge_map_clouds(parts);
  if (window.cloud.empty())
    throw libmap::Error("the box contains no part of the map", {.field = "--box"});
  if (window.columns_per_point > 1) {
    window.cloud = libgtd::downsample_map(window.cloud, window.columns_per_point);
    libgtd::snap_to_square_centers(tiles.index(), window.columns_per_point, window.cloud);
  }
  return window;
}

// Returns the files of a folder of textured tiles; empty for any other path.
std::vector<std::filesystem::path> models_in(const std::string& file) {
  std::vector<std::filesystem::path> models;
  for (const std::string& name : libmap::tile_file_names(file))
    if (libmap::format_of(name) == ".glb") models.push_back(std::filesystem::path(file) / name);
  std::sort(models.begin(), models.end());
  return models;
}

SceneFile scene_of(const std::string& file, const SceneFileOptions& options, Run& run) {
  SceneFile read;
  libmap::Scene& scene = read.scene;
  libmap::SceneLayer layer = options.layer;
  const auto box = parse_rectangle(options.box);
  if (is_tile_store(file)) {
    MapWindow window = read_window(MapTiles(file), box, options.max_points);
    read.columns_per_point = window.columns_per_point;
    layer.shape = std::move(window.cloud);
  } else if (libmap::is_textured_format(file)) {
    layer.shape = libmap::read_textured_mesh(file);
  } else if (const std::vector<std::filesystem::path> models = models_in(file); !models.empty()) {
    for (const std::filesystem::path& model : models) {
      if (model != models.front()) scene.layers.push_back(std::move(layer));
      layer = options.layer;
      layer.shape = libmap::read_textured_mesh(model);
    }
  } else if (libmap::file_kind(file) == libmap::FileKind::mesh) {
    layer.shape = libmap::read_mesh(file).mesh;
  } else {
    layer.shape = libmap::read_cloud(file).cloud;
  }
  if (auto* cloud = std::get_if<libmap::PointCloud>(&layer.shape); box && cloud != nullptr)
    *cloud = points_in_box(*cloud, *box);
  else if (box)
    throw libmap::Error("can only be used for a cloud or a map", {.file = file, .field = "--box"});
  if (const auto* cloud = std::get_if<libmap::PointCloud>(&layer.shape);
      cloud != nullptr && cloud->empty())
    throw libmap::Error("there is nothing to draw: no point is finite, or none is in the --box",
                        {.file = file});
  const auto manifest = libmap::read_manifest_of(file);
  if (const auto* mesh = std::get_if<libmap::TriangleMesh>(&layer.shape))
    for (const libgtd::ScenePartStyle& part : libgtd::shown_parts(*mesh))
      layer.coloring.own_legend.entries.push_back({part.color, part.text});
  layer.coloring.zero_plane_m = zero_plane_of(options, manifest ? &*manifest : nullptr);
  if (manifest && !layer.coloring.load_n)
    layer.coloring.load_n = libmap::number_of(manifest->find_parameter("load_n"));
  scene.layers.push_back(std::move(layer));
  const libmap::Pose* terrain_from_input = terrain_from_input_of(manifest);
  if (terrain_from_input != nullptr) {
    if (manifest->frame == "input") scene.terrain_from_scene = *terrain_from_input;
    if (options.heading == MapHeading::input)
      scene.terrain_from_scene = turned_back(*terrain_from_input) * scene.terrain_from_scene;
  }
  if (!options.points.empty()) {
    scene.markers = read_markers(options);
    const PointFrame frame = frame_of_points(options.points, options.points_frame, file, run);
    const libmap::Pose scene_from_points = map_from_points(file, frame, run);
    for (libmap::Marker& marker : scene.markers)
      marker.position = scene_from_points * marker.position;
  }
  return read;
}

// Options of marked locations only.
void bind_points(libmap::ParameterTable& table, SceneFileOptions& options) {
  table.add("label", options.label,
            "column of names of marked locations; auto: first column, unless it is x, y or z; "
            "none: no names");
  table.add("verdict", options.verdict,
            "column that colors the marked locations; 1: green; 0: red; empty: neutral color");
  table.add("points_frame", options.points_frame, listed_point_frame_names(),
            "frame of marked locations; input: frame of the scored cloud; terrain: frame of "
            "scoring; map: frame before `graspmap crop`; auto: from their manifest, else input");
}

// Binds all options except `points`, which is a separate option.
void bind(libmap::ParameterTable& table, SceneFileOptions& options) {
  bind(table, options.layer);
  table.add("zero_plane", options.zero_plane,
            "height in the terrain frame below which ground is white, m; auto: from the map's "
            "manifest; none: no limit");
  table.add("box", options.box,
            "shown rectangle of a cloud or map: X0,Y0,X1,Y1 in the frame of the file, m");
  table.add("max_points", options.max_points, libmap::Range{1'000.0, 1e9},
            "approximate maximum number of drawn points of a tile store; more are downsampled");
  bind_points(table, options);
  table.add("heading", options.heading,
            {{"auto", MapHeading::automatic},
             {"terrain", MapHeading::terrain},
             {"input", MapHeading::input}},
            "axes to which a map's image is parallel; terrain: frame of scoring; input: frame of "
            "the scored cloud; auto: terrain for one file, input for several");
}

// Reads a cloud, mesh, graspability map or tile store. Throws Error naming the file.
SceneFile read_scene(const std::string& file, const SceneFileOptions& options, Run& run) {
  if (options.points.empty()) reject_changed(options, bind_points, "requires --points");
  try {
    return scene_of(file, options, run);
  } catch (const libmap::Error& error) {
    throw error.kind() == libmap::ErrorKind::bad_input ? error.in_file(file) : error;
  }
}

// Path of a scene file in manifests: for a tile store its index.
std::filesystem::path scene_input(const std::string& file) {
  return is_tile_store(file) ? store_index_path(file) : std::filesystem::path(file);
}

struct RenderOptions {
  std::vector<std::string> files;
  std::string output;
  std::string camera_position;
  std::string camera_target;
  SceneFileOptions scene;
  libmap::SceneViewOptions view;
  // Texts on a page of several files, separated by '|'.
  std::string captions;
  std::string column_titles;
  std::string row_titles;
  libmap::ImageGridOptions sheet;
};

// Options of an image of one file.
void bind_one(libmap::ParameterTable& table, RenderOptions& options) {
  libmap::bind_single(table, options.view);
  table.add("camera_position", options.camera_position,
            "with --view camera: position of the camera X,Y,Z in the frame of the points, m");
  table.add("camera_target", options.camera_target, "camera target X,Y,Z for --view camera, m");
}

// Options of a page of several files.
void bind_page(libmap::ParameterTable& table, RenderOptions& options) {
  libmap::ImageGridOptions& sheet = options.sheet;
  table.add("columns", sheet.columns, libmap::Range{0, 1000},
            "number of columns on a page of several files; 0: for an approximately square page");
  table.add("cell_width_px", sheet.cell_width_px, libmap::Range{16, 16384},
            "width of each image cell on a page of several files, pixels");
  table.add("cell_height_px", sheet.cell_height_px, libmap::Range{0, 16384},
            "height of each image cell on a page of several files, pixels; 0: by the content");
  table.add("captions", options.captions,
            "for several files: texts below the cells, separated by |; default: the files' names "
            "without extension");
  table.add("column_titles", options.column_titles,
            "for several files: titles of the columns, separated by |");
  table.add("row_titles", options.row_titles,
            "for several files: titles of the rows, separated by |");
  table.add("shared_view", sheet.shared_view,
            {{"sheet", libmap::SharedView::sheet}, {"row", libmap::SharedView::row}},
            "maps that have equal scale and extent on a page of several files; sheet: all; row: "
            "maps of each row");
}

void bind(libmap::ParameterTable& table, RenderOptions& options) {
  bind(table, options.view);
  bind(table, options.scene);
  bind_one(table, options);
  bind_page(table, options);
}

libmap::ColorImage draw_one(RenderOptions& options, Run& run) {
  const std::string& file = options.files.front();
  if (options.view.view == libmap::Viewpoint::camera) {
    options.view.camera.position = parse_vector(options.camera_position, "--camera-position");
    options.view.camera.focal_point = parse_vector(options.camera_target, "--camera-target");
  }
  if (options.scene.heading == MapHeading::automatic) options.scene.heading = MapHeading::terrain;
  SceneFile shown;
  libmap::ColorImage image;
  try {
    shown = run.timed("read", [&] { return read_scene(file, options.scene, run); });
    image = run.timed("render",
                      [&] { return libmap::render_scene(std::move(shown.scene), options.view); });
  } catch (const libmap::Error& error) {
    throw error.kind() == libmap::ErrorKind::bad_input ? error.in_file(file) : error;
  }
  if (shown.columns_per_point > 0)
    run.add_results({{"columns_per_point", shown.columns_per_point}});
  if (shown.columns_per_point > 1)
    run.info("one point is drawn per {0} x {0} columns of voxels; --box shows a part in full",
             shown.columns_per_point);
  return image;
}

libmap::ColorImage read_image(const std::string& file) {
  constexpr std::uint64_t max_file_bytes = std::uint64_t{1} << 30;
  return in_file(file, [&] {
    return libmap::decode_color(libmap::read_whole_file(file, max_file_bytes),
                                libmap::max_decoded_pixels);
  });
}

std::vector<libmap::SheetCell> read_cells(const RenderOptions& options, Run& run) {
  const std::vector<std::string> captions =
      split_texts(options.captions, options.files.size(), "more captions than files", "--captions");
  std::vector<libmap::SheetCell> cells;
  for (const std::string& file : options.files) {
    libmap::SheetCell& cell = cells.emplace_back();
    cell.caption = cells.size() <= captions.size() ? captions[cells.size() - 1]
                                                   : std::filesystem::path(file).stem().string();
    cell.view = options.view.view;
    if (libmap::format_of(file) == ".png")
      cell.image = read_image(file);
    else
      cell.scene = [&options, &run, file] { return read_scene(file, options.scene, run).scene; };
  }
  return cells;
}

libmap::ColorImage draw_several(RenderOptions& options, Run& run) {
  if (options.view.view == libmap::Viewpoint::camera)
    throw libmap::Error("applies only to a single file", {.field = "--view", .value = "camera"});
  reject_changed(options, bind_one, "applies only to a single file");
  // Maps of one cloud have the same orientation in the image.
  if (options.scene.heading == MapHeading::automatic) options.scene.heading = MapHeading::input;
  options.sheet.column_titles = split_texts(options.column_titles);
  options.sheet.row_titles = split_texts(options.row_titles);
  options.sheet.title = options.view.title;
  options.sheet.scale_bar = options.view.scale_bar;
  options.sheet.background = options.view.background;
  const std::vector<libmap::SheetCell> cells = read_cells(options, run);
  libmap::ColorImage image =
      run.timed("draw", [&] { return libmap::draw_sheet(cells, options.sheet); });
  run.add_results({{"cells", cells.size()}});
  run.info("{} cells, {} x {} pixels", cells.size(), image.width, image.height);
  return image;
}

void render(RenderOptions& options, Run& run) {
  if (libmap::format_of(options.output) != ".png")
    throw libmap::Error("images are written as .png", {.file = options.output});
  for (std::string& file : options.files) file = without_trailing_slash(file);
  std::vector<std::string> inputs = options.files;
  inputs.push_back(options.scene.points);
  run.claim_output(options.output, inputs);
  // A page has several files, or one file with an option of pages, such as a caption.
  const bool several = options.files.size() > 1 || libmap::changed_key(options, bind_page);
  const libmap::ColorImage image = several ? draw_several(options, run) : draw_one(options, run);
  for (const std::string& file : options.files) run.add_input(scene_input(file));
  if (!options.scene.points.empty()) run.add_input(options.scene.points);
  run.write_text(options.output, libmap::to_png(image));
}

}  // namespace

int main(int argc, char** argv) {
  RenderOptions options;
  Command command("render");
  command.inputs("FILE", options.files,
                 "cloud, mesh, graspability map or tile store (.tiles); several files, also images "
                 "(.png), are drawn side by side with one legend");
  command.output(options.output, "image (.png)");
  command.option("--points", "POINTS.csv", options.scene.points,
                 "locations to mark: CSV with the columns x, y, z in meters");
  bind(command.parameters(), options);
  return command.run(argc, argv, [&](Run& run) { render(options, run); });
}
