// `graspmap convert SCAN --bundler` and `--colmap`: the pictures of a scan and their cameras, for
// MeshLab and for COLMAP.
#pragma once

#include "libmap/scan/colmap_builder.h"
#include "libmap/scan/picture_file.h"
#include "libmap/scan/scan_source.h"
#include "tools/support/command_line.h"
#include "tools/support/scan_poses.h"

namespace graspmap_tools {

// Which of the pictures that resemble each other is kept.
enum class PicturePreference { sharpest, first };

struct PictureOptions {
  std::string bundler;  // folders; empty: not wanted
  std::string colmap;
  PosesOption poses;
  std::string transform;
  PicturePreference keep = PicturePreference::sharpest;
  libmap::ViewSelectionOptions selection;
  libmap::ColmapBuilderOptions points;

  bool wanted() const { return !bundler.empty() || !colmap.empty(); }
};
void add_options(Command& command, PictureOptions& options);

// Claims the folders; before the work.
void claim_picture_folders(const PictureOptions& options, const std::string& scan, Run& run);

// Bundler: bundle.out, list.txt and images, resampled, of the views that are selected. COLMAP:
// sparse/cameras.txt, images.txt, points3D.txt and images, all of them and as they are stored.
// Frames that are broken are left out with a warning, with `strict` an Error.
void write_picture_folders(PictureOptions& options, const libmap::ScanSource& scan, bool strict,
                           Run& run);

}  // namespace graspmap_tools
