#include "tools/support/foothold_file.h"

#include "libmap/core/error.h"

std::vector<graspmap_tools::FootholdMark> graspmap_tools::foothold_marks(
    const libmap::PointCloud& cloud, const std::string& file) {
  const auto field = [&](const char* name) -> const std::vector<double>& {
    const libmap::ScalarField* found = cloud.find_field(name);
    if (found) return found->values;
    throw libmap::Error("the file has no such field, so it does not contain footholds",
                        {.file = file, .field = name});
  };
  const std::vector<double>& x = field("approach_x");
  const std::vector<double>& y = field("approach_y");
  const std::vector<double>& z = field("approach_z");
  const std::vector<double>& score = field("score");
  std::vector<FootholdMark> marks;
  for (std::size_t n = 0; n < cloud.size(); ++n) {
    const Eigen::Vector3d approach(x[n], y[n], z[n]);
    if (!approach.allFinite() || approach.norm() < 1e-9)
      throw libmap::Error("not a direction: zero or not finite",
                          {.file = file, .field = "approach of foothold " + std::to_string(n + 1)});
    marks.push_back({cloud.positions[n], approach, score[n]});
  }
  return marks;
}
