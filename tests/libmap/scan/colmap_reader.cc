#include "tests/libmap/scan/colmap_reader.h"

#include <fstream>
#include <sstream>

#include "libmap/core/file_output.h"

namespace graspmap_test {

namespace {

// Calls use(words) for each line that is not a comment.
template <typename Use>
void each_line(const std::filesystem::path& path, const Use& use) {
  std::ifstream file(path);
  for (std::string line; std::getline(file, line);) {
    std::istringstream words(line);
    if (!line.starts_with('#')) use(words);
  }
}

}  // namespace

libmap::ColmapModel read_colmap_model(const std::filesystem::path& path) {
  const std::filesystem::path folder = libmap::find_colmap_model(path);
  libmap::ColmapModel model;
  each_line(folder / "cameras.txt", [&](std::istringstream& words) {
    int id = 0;
    words >> id;
    libmap::ColmapCamera& camera = model.cameras[id];
    words >> camera.model >> camera.width >> camera.height;
    for (double parameter = 0; words >> parameter;) camera.parameters.push_back(parameter);
  });
  model.images =
      libmap::parse_colmap_images(libmap::read_whole_file(folder / "images.txt"), "images.txt");
  each_line(folder / "points3D.txt", [&](std::istringstream& words) {
    std::int64_t id = 0;
    words >> id;
    libmap::ColmapPoint& point = model.points[id];
    words >> point.position.x() >> point.position.y() >> point.position.z();
    for (std::uint8_t& channel : point.color) {
      int value = 0;
      words >> value;
      channel = static_cast<std::uint8_t>(value);
    }
    words >> point.error_px;
    for (libmap::ColmapTrackElement element; words >> element.image >> element.observation;)
      point.track.push_back(element);
  });
  return model;
}

}  // namespace graspmap_test
