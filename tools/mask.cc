// graspmap mask: a gripper's mask as text, cloud or picture.
#include <fmt/format.h>

#include <string>

#include "libgtd/gripper/gripper_io.h"
#include "libgtd/gripper/gripper_mask.h"
#include "libmap/cloud/cloud_io.h"
#include "libmap/core/data_folder.h"
#include "libmap/core/error.h"
#include "libmap/core/file_output.h"
#include "libmap/view/picture_sheet.h"
#include "libmap/view/scene_view.h"
#include "tools/support/command_line.h"
#include "tools/support/mask_sections.h"

namespace {

using graspmap_tools::Run;
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

void bind(libmap::ParameterTable& table, MaskOptions& options) {
  table.add("gripper", options.gripper, "scar-e, hubrobo, limbero, or a gripper file");
  table.add_overrides("gripper", options.overrides);
  table.add("method", options.mask.method, libgtd::method_names(), "whose design");
  table.add("voxel_size_m", options.mask.voxel_size_m, libmap::positive, "edge of a voxel, m");
  table.add("extra_void_layers", options.mask.extra_void_layers, {0, 10000},
            "void layers on top (H_add), voxels");
  table.add("view", options.view, libmap::viewpoint_names(), "from where a picture is taken");
  table.add("sections", options.sections, "three sections of the mask in place of a view of it");
  table.add("section_layer", options.section_layer, {0, 1e6},
            "layer of the lower horizontal section; 0 is the lowest");
  table.add("cell_width_px", options.cell_width_px, {64, 5000}, "width of a section, pixels");
}

std::string title_of(const GripperMask& mask, const MaskOptions& options) {
  return fmt::format("{} mask, {}, {} mm", options.gripper, name_of(mask.method),
                     libmap::to_text(static_cast<float>(mask.voxel_size_m * 1000.0)));
}

std::string to_sections(const GripperMask& mask, const MaskOptions& options) {
  libmap::PictureSheetOptions sheet;
  sheet.columns = 3;
  sheet.cell_width_px = options.cell_width_px;
  sheet.title = fmt::format("{}: {} x {} x {} voxels", title_of(mask, options), mask.side,
                            mask.side, mask.layers);
  sheet.background = "white";
  sheet.legends = {graspmap_tools::mask_legend(mask)};
  return libmap::to_png(
      libmap::draw_sheet(graspmap_tools::mask_sections(mask, options.section_layer), sheet));
}

std::string to_picture(const GripperMask& mask, const MaskOptions& options) {
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
  return libmap::to_png(libmap::render_scene(scene, view));
}

// Options of another output than the one that is asked for.
void refuse_ignored(const MaskOptions& options, const std::string& extension) {
  const MaskOptions unset;
  const auto refuse = [](const char* name, const std::string& reason) {
    throw libmap::Error(reason, {.file = {}, .field = name});
  };
  if (!options.sections && options.section_layer != unset.section_layer)
    refuse("--section-layer", "is for --sections");
  if (!options.sections && options.cell_width_px != unset.cell_width_px)
    refuse("--cell-width", "is for --sections");
  if (options.view != unset.view && (options.sections || extension != ".png"))
    refuse("--view", "is for a picture (.png) without --sections");
}

void mask(const MaskOptions& options, Run& run) {
  const std::string extension = std::filesystem::path(options.output).extension().string();
  if (extension != ".txt" && extension != ".png") libmap::require_cloud_format(options.output);
  if (options.sections && extension != ".png")
    throw libmap::Error("sections are drawn as .png", {.file = options.output});
  refuse_ignored(options, extension);
  run.claim_output(options.output);
  const auto file = libmap::find_data_file("grippers", options.gripper);
  const libgtd::Gripper gripper = libgtd::read_gripper(file, options.overrides);
  const GripperMask made = libgtd::make_gripper_mask(gripper, options.mask);
  run.add_input(file);
  run.manifest().frame = "mask";
  run.manifest().results.emplace_back("side_voxels", static_cast<std::int64_t>(made.side));
  run.manifest().results.emplace_back("layers", static_cast<std::int64_t>(made.layers));
  run.write_output(options.output, [&](const auto& temporary) {
    if (extension == ".txt")
      libmap::write_text(temporary, to_text(made));
    else if (extension == ".png")
      libmap::write_text(temporary, to_picture(made, options));
    else
      libmap::write_cloud(temporary, to_cloud(made));
  });
  run.say(fmt::format("{} x {} x {} voxels", made.side, made.side, made.layers));
}

}  // namespace

int main(int argc, char** argv) {
  MaskOptions options;
  graspmap_tools::Command command("mask");
  command.output(options.output,
                 "layers as text (.txt), solid voxels as a cloud (.vtp .pcd .ply .csv), or .png");
  bind(command.parameters(), options);
  return command.run(argc, argv, [&](Run& run) { mask(options, run); });
}
