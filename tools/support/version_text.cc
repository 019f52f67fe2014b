#include "tools/support/version_text.h"

#include <CGAL/version.h>
#include <assimp/version.h>
#include <ceres/version.h>
#include <embree3/rtcore_config.h>
#include <oneapi/tbb/version.h>
#include <pcl/pcl_config.h>
#include <spdlog/version.h>
#include <sqlite3.h>
#include <vtkVersionMacros.h>
#include <nlohmann/json.hpp>
#include <opencv2/core/version.hpp>

#include <OpenMesh/Core/System/config.h>
#include <CLI/Version.hpp>
#include <Eigen/Core>

#include "commit.h"  // of the build folder

namespace graspmap_tools {

namespace {

#define GRASPMAP_TEXT_OF(macro) #macro
#define GRASPMAP_TEXT(macro) GRASPMAP_TEXT_OF(macro)

std::string dotted(int major, int minor, int patch) {
  return std::to_string(major) + "." + std::to_string(minor) + "." + std::to_string(patch);
}

}  // namespace

std::string version_text() {
  std::string text = "graspmap " GRASPMAP_VERSION "\ncommit: " GRASPMAP_COMMIT
                     "\ncompiler: " GRASPMAP_COMPILER "\n";
  const auto add = [&](const char* library, const std::string& version) {
    text += std::string(library) + ": " + version + "\n";
  };
  add("PCL", dotted(PCL_MAJOR_VERSION, PCL_MINOR_VERSION, PCL_REVISION_VERSION));
  add("CGAL", GRASPMAP_TEXT(CGAL_VERSION));
  add("OpenMesh", dotted(OM_GET_VER, OM_GET_MAJ, OM_GET_MIN));
  add("Ceres", CERES_VERSION_STRING);
  add("OpenCV", CV_VERSION);
  add("assimp", GRASPMAP_ASSIMP_VERSION);
  add("VTK", VTK_VERSION);
  add("Embree", RTC_VERSION_STRING);
  add("Eigen", dotted(EIGEN_WORLD_VERSION, EIGEN_MAJOR_VERSION, EIGEN_MINOR_VERSION));
  add("oneTBB", dotted(TBB_VERSION_MAJOR, TBB_VERSION_MINOR, TBB_VERSION_PATCH));
  add("SQLite", SQLITE_VERSION);
  add("CLI11", CLI11_VERSION);
  add("spdlog", dotted(SPDLOG_VER_MAJOR, SPDLOG_VER_MINOR, SPDLOG_VER_PATCH));
  add("nlohmann-json", dotted(NLOHMANN_JSON_VERSION_MAJOR, NLOHMANN_JSON_VERSION_MINOR,
                              NLOHMANN_JSON_VERSION_PATCH));
  return text;
}

}  // namespace graspmap_tools
