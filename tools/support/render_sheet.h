// `graspmap render FILE FILE...`: several files side by side in one picture.
#pragma once

#include <string>
#include <vector>

#include "libmap/core/image.h"
#include "libmap/core/parameters.h"
#include "libmap/view/picture_sheet.h"
#include "tools/support/run.h"
#include "tools/support/scene_file.h"

namespace graspmap_tools {

struct SheetOptions {
  std::vector<std::string> files;
  // Texts with '|' between.
  std::string captions;
  std::string column_titles;
  std::string row_titles;
  libmap::Viewpoint view = libmap::Viewpoint::top;
  SceneFileOptions scene;
  libmap::PictureSheetOptions sheet;
};

// What a picture of one file does not have.
void bind(libmap::ParameterTable& table, SheetOptions& options);

// Maps, clouds, meshes, tile stores and pictures (.png) with one legend. Throws Error naming the
// file.
libmap::ColorImage draw_sheet(SheetOptions options, Run& run);

}  // namespace graspmap_tools
