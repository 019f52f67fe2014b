// graspmap mask: writes a gripper's mask as text, cloud or image.
#include <array>
#include <set>

#include "libgtd/gripper/gripper_io.h"
#include "libgtd/gripper/gripper_mask.h"
#include "libmap/core/data_folder.h"
#include "libmap/io/cloud_io.h"
#include "libmap/view/image_grid.h"
#include "libmap/view/scene_view.h"
#include "tools/support/command_line.h"

using namespace graspmap_tools;

namespace {

using libgtd::GripperMask;

struct MaskOptions {
  std::string output;
  std::string gripper = "scar-e";
  std::vector<std::pair<std::string, std::string>> overrides;
  libgtd::GripperMaskOptions mask;
  libmap::Viewpoint view = libmap::Viewpoint::oblique;
  bool sections = false;
  int section_layer = 0;
  int cell_width_px = 640;  // of a section
};

// Options of sections only.
void bind_sections(libmap::ParameterTable& table, MaskOptions& options) {
  table.add("section_layer", options.section_layer, {0, 1e6},
            "with --sections: layer that the second horizontal section shows; 0: lowest");
  table.add("cell_width_px", options.cell_width_px, {64, 5000}, "image width of a section, pixels");
}

void bind(libmap::ParameterTable& table, MaskOptions& options) {
  table.add("gripper", options.gripper,
            "gripper whose mask is written: scar-e, hubrobo, limbero, or a gripper file");
  table.add_overrides("gripper", options.overrides);
  table.add("method", options.mask.method, libgtd::method_names(),
            "scoring method that uses the mask, as in score --method");
  table.add("voxel_size_m", options.mask.voxel_size_m, libmap::positive,
            "edge length of the voxels, m");
  table.add("extra_void_layers", options.mask.extra_void_layers, {0, 10000},
            "number of layers (H_add) added on top of the mask, in which ground lowers the score");
  table.add("view", options.view, libmap::viewpoint_names(), "viewpoint, as in render --view");
  table.add("sections", options.sections, "draw three sections through the mask instead of a view");
  bind_sections(table, options);
}

std::string title_of(const GripperMask& mask, const MaskOptions& options) {
  return fmt::format("{} mask, {}, {} mm", options.gripper, name_of(mask.method),
                     libmap::to_text(static_cast<float>(mask.voxel_size_m * 1000.0)));
}

// Kind of a voxel in a section; voxels that are not counted affect neither SSV nor GSV.
enum class MaskVoxel { solid, void_space, solid_not_counted, void_not_counted, pivot };

struct KindLook {
  MaskVoxel kind;
  libmap::Color color;
  const char* text;
};

constexpr std::array<KindLook, 5> looks{
    {{MaskVoxel::solid, {0, 114, 178}, "solid"},
     {MaskVoxel::void_space, {205, 211, 218}, "void"},
     {MaskVoxel::solid_not_counted, {150, 200, 226}, "solid, not counted"},
     {MaskVoxel::void_not_counted, {252, 240, 214}, "void, not counted"},
     {MaskVoxel::pivot, {213, 94, 0}, "pivot"}}};

MaskVoxel kind_of(const GripperMask& mask, const Eigen::Vector3i& at) {
  const int x = at.x(), y = at.y(), z = at.z();
  if (x == mask.pivot_xy && y == mask.pivot_xy && z == mask.pivot_z) return MaskVoxel::pivot;
  if (mask.is_counted(x, y, z))
    return mask.is_solid(x, y, z) ? MaskVoxel::solid : MaskVoxel::void_space;
  return mask.is_solid(x, y, z) ? MaskVoxel::solid_not_counted : MaskVoxel::void_not_counted;
}

constexpr double square_share = 0.94;  // drawn share of a voxel's side, which leaves lines between
constexpr double offset_share = 0.1;   // distance of dimension lines, as a share of the mask's side

// Index of a voxel by its two coordinates in a section.
using CellOfPixel = std::function<Eigen::Vector3i(int, int)>;

Eigen::Vector3d center_of(const GripperMask& mask, const Eigen::Vector3i& voxel) {
  return mask.voxel_size_m *
         (voxel - Eigen::Vector3i(mask.pivot_xy, mask.pivot_xy, mask.pivot_z)).cast<double>();
}

libmap::Scene scene_of(const GripperMask& mask, const CellOfPixel& cell_of_pixel, int width,
                       int height) {
  libmap::Scene scene;
  for (const KindLook& look : looks) {
    libmap::PointCloud cloud;
    for (int u = 0; u < width; ++u)
      for (int v = 0; v < height; ++v) {
        const Eigen::Vector3i at = cell_of_pixel(u, v);
        if (kind_of(mask, at) == look.kind) cloud.positions.push_back(center_of(mask, at));
      }
    if (cloud.empty()) continue;
    libmap::SceneLayer layer;
    layer.coloring.mode = libmap::ColorMode::single;
    layer.coloring.color =
        fmt::format("#{:02x}{:02x}{:02x}", look.color[0], look.color[1], look.color[2]);
    layer.shape = std::move(cloud);
    layer.point_shape = libmap::PointShape::square;
    layer.shading = libmap::Shading::none;
    layer.point_size_m = square_share * mask.voxel_size_m;
    scene.layers.push_back(std::move(layer));
  }
  return scene;
}

// Dimension line over `count` voxels from `first` in a direction of the section, with an offset.
libmap::DimensionLine measure(const GripperMask& mask, const Eigen::Vector3i& first,
                              const Eigen::Vector3i& along, int count, const Eigen::Vector3d& aside,
                              const std::string& name) {
  const Eigen::Vector3d start =
      center_of(mask, first) - 0.5 * mask.voxel_size_m * along.cast<double>() + aside;
  const double length_m = count * mask.voxel_size_m;
  return {start, start + length_m * along.cast<double>(),
          fmt::format("{}{}{:.4g} mm", name, name.empty() ? "" : " ", 1000.0 * length_m)};
}

// Returns the first index and the number of voxels along x, in layer z, that are connected to the
// voxel at the pivot's x and y and like it are solid or void.
std::pair<int, int> run_through_axis(const GripperMask& mask, int z) {
  const int y = mask.pivot_xy;
  const bool solid = mask.is_solid(mask.pivot_xy, y, z);
  int first = mask.pivot_xy;
  int last = first;
  while (first > 0 && mask.is_solid(first - 1, y, z) == solid) --first;
  while (last + 1 < mask.side && mask.is_solid(last + 1, y, z) == solid) ++last;
  return {first, last - first + 1};
}

libmap::SheetCell cell_of(std::string caption, libmap::Scene scene, libmap::Viewpoint view) {
  libmap::SheetCell cell;
  cell.caption = std::move(caption);
  cell.scene = [scene = std::move(scene)] { return scene; };
  cell.view = view;
  return cell;
}

libmap::SheetCell vertical(const GripperMask& mask) {
  const int y = mask.pivot_xy;
  libmap::Scene scene = scene_of(
      mask, [y](int x, int z) { return Eigen::Vector3i(x, y, z); }, mask.side, mask.layers);
  const double aside = (offset_share * mask.side + 0.5) * mask.voxel_size_m;
  const Eigen::Vector3i x_axis = Eigen::Vector3i::UnitX();
  const Eigen::Vector3i z_axis = Eigen::Vector3i::UnitZ();
  scene.dimension_lines.push_back(
      measure(mask, {0, y, 0}, x_axis, mask.side, -aside * Eigen::Vector3d::UnitZ(), ""));
  const Eigen::Vector3d right = aside * Eigen::Vector3d::UnitX();
  scene.dimension_lines.push_back(
      measure(mask, {mask.side - 1, y, 0}, z_axis, mask.solid_layers, right, ""));
  if (mask.layers > mask.solid_layers)
    scene.dimension_lines.push_back(measure(mask, {mask.side - 1, y, mask.solid_layers}, z_axis,
                                            mask.layers - mask.solid_layers, right, "+"));
  // A line without length is not drawn, but reserves space for the texts of vertical lines.
  const Eigen::Vector3d corner = center_of(mask, {mask.side - 1, y, 0}) + 3.0 * right;
  scene.dimension_lines.push_back({corner, corner, ""});
  return cell_of("x-z through the pivot", std::move(scene), libmap::Viewpoint::front);
}

libmap::SheetCell horizontal(const GripperMask& mask, int z, const std::string& name) {
  libmap::Scene scene = scene_of(
      mask, [z](int x, int y) { return Eigen::Vector3i(x, y, z); }, mask.side, mask.side);
  const double aside = (offset_share * mask.side + 0.5) * mask.voxel_size_m;
  const Eigen::Vector3i x_axis = Eigen::Vector3i::UnitX();
  const auto [first, count] = run_through_axis(mask, z);
  scene.dimension_lines.push_back(
      measure(mask, {first, 0, z}, x_axis, count, -aside * Eigen::Vector3d::UnitY(),
              mask.is_solid(mask.pivot_xy, mask.pivot_xy, z) ? "solid" : "void"));
  return cell_of(fmt::format("x-y, {} (z = {:+.4g} mm)", name,
                             1000.0 * mask.voxel_size_m * (z - mask.pivot_z)),
                 std::move(scene), libmap::Viewpoint::top);
}

// Three sections of the mask like those of the thesis (figures 3-11 and 5-1): the vertical section
// through the pivot (x to the right, z up), and horizontal sections of the top solid layer and of
// `lower_layer` (x to the right, y up). Each voxel is a square at its position relative to the
// pivot; dimensions are in millimeters.
std::vector<libmap::SheetCell> mask_sections(const GripperMask& mask, int lower_layer) {
  if (lower_layer < 0 || lower_layer >= mask.layers)
    throw libmap::Error("the mask has no such layer",
                        {.field = "section_layer",
                         .value = std::to_string(lower_layer),
                         .bound = ">= 0 and <= " + std::to_string(mask.layers - 1)});
  return {vertical(mask), horizontal(mask, mask.solid_layers - 1, "top solid layer"),
          horizontal(mask, lower_layer,
                     lower_layer == 0 ? "lowest layer" : fmt::format("layer {}", lower_layer))};
}

libmap::Legend mask_legend(const GripperMask& mask) {
  libmap::Legend legend;
  legend.title = "voxels";
  std::set<MaskVoxel> kinds;
  for (int x = 0; x < mask.side; ++x)
    for (int y = 0; y < mask.side; ++y)
      for (int z = 0; z < mask.layers; ++z) kinds.insert(kind_of(mask, {x, y, z}));
  for (const KindLook& look : looks)
    if (kinds.contains(look.kind)) legend.entries.push_back({look.color, look.text});
  return legend;
}

std::string to_sections(const GripperMask& mask, const MaskOptions& options) {
  libmap::ImageGridOptions sheet;
  sheet.columns = 3;
  sheet.cell_width_px = options.cell_width_px;
  sheet.title = fmt::format("{}: {} x {} x {} voxels", title_of(mask, options), mask.side,
                            mask.side, mask.layers);
  sheet.background = "white";
  sheet.legends = {mask_legend(mask)};
  return libmap::to_png(libmap::draw_sheet(mask_sections(mask, options.section_layer), sheet));
}

std::string to_image(const GripperMask& mask, const MaskOptions& options) {
  if (options.sections) return to_sections(mask, options);
  libmap::SceneLayer layer;
  layer.shape = to_cloud(mask);
  layer.coloring.mode = libmap::ColorMode::field;
  layer.coloring.field = "layer";
  layer.point_shape = libmap::PointShape::cube;
  layer.point_size_m = mask.voxel_size_m;
  libmap::SceneViewOptions view;
  view.view = options.view;
  view.title = title_of(mask, options);
  libmap::Scene scene;
  scene.layers.push_back(layer);
  return libmap::to_png(libmap::render_scene(std::move(scene), view));
}

void mask(const MaskOptions& options, Run& run) {
  const std::string extension = std::filesystem::path(options.output).extension().string();
  if (extension != ".txt" && extension != ".png") libmap::require_cloud_format(options.output);
  if (options.sections && extension != ".png")
    throw libmap::Error("sections are drawn as .png", {.file = options.output});
  if (!options.sections) reject_changed(options, bind_sections, "requires --sections");
  if (options.view != MaskOptions{}.view && (options.sections || extension != ".png"))
    throw libmap::Error("applies only to an image (.png) without --sections", {.field = "--view"});
  run.claim_output(options.output);
  const auto file = libmap::find_data_file("grippers", options.gripper);
  const libgtd::Gripper gripper = libgtd::read_gripper(file, options.overrides);
  const GripperMask made = libgtd::make_gripper_mask(gripper, options.mask);
  for (const auto& input : libgtd::gripper_files(file)) run.add_input(input);
  run.manifest().frame = "mask";
  run.add_results({{"side_voxels", made.side}, {"layers", made.layers}});
  run.write_output(options.output, [&](const auto& temporary) {
    if (extension == ".txt")
      libmap::write_text(temporary, to_text(made));
    else if (extension == ".png")
      libmap::write_text(temporary, to_image(made, options));
    else
      libmap::write_cloud(temporary, to_cloud(made));
  });
  run.info("{} x {} x {} voxels", made.side, made.side, made.layers);
}

}  // namespace

int main(int argc, char** argv) {
  MaskOptions options;
  Command command("mask");
  command.output(options.output,
                 "mask: text (.txt), cloud of solid voxels (.vtp .pcd .ply .csv) or image (.png)");
  bind(command.parameters(), options);
  return command.run(argc, argv, [&](Run& run) { mask(options, run); });
}
