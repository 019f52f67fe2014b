// `graspmap extract --bundler`: the pictures of a scan and their cameras for MeshLab.
#pragma once

#include <string>

#include "libmap/scan/scan_source.h"
#include "libmap/scan/view_selection.h"
#include "tools/command_line.h"
#include "tools/run.h"

namespace graspmap_tools {

// Which of the pictures that resemble each other is kept.
enum class PicturePreference { sharpest, first };

struct BundlerOptions {
  std::string folder;
  std::string poses = "auto";
  std::string transform;
  PicturePreference keep = PicturePreference::sharpest;
  libmap::ViewSelectionOptions selection;
};
void add_options(Command& command, BundlerOptions& options);

// Claims the folder; before the work.
void claim_bundler_folder(const BundlerOptions& options, const std::string& scan, Run& run);

// Writes bundle.out, list.txt and images. Frames that are broken are left out with a warning, with
// `strict` an Error.
void write_bundler_folder(BundlerOptions& options, const libmap::ScanSource& scan, bool strict,
                          Run& run);

}  // namespace graspmap_tools
