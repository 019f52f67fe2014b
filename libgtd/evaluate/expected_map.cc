#include "libgtd/evaluate/expected_map.h"

#include <CGAL/Distance_3/Point_3_Segment_3.h>
#include <CGAL/Distance_3/Segment_3_Segment_3.h>
#include <CGAL/Simple_cartesian.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <set>
#include <string_view>

#include "libgtd/evaluate/roc_tables.h"
#include "libmap/core/error.h"
#include "libmap/core/text.h"

namespace libgtd {
namespace {

using Kernel = CGAL::Simple_cartesian<double>;

constexpr std::array<std::string_view, 10> column_names = {
    "region", "x", "y", "z", "to_x", "to_y", "to_z", "radius", "graspable", "why"};

Kernel::Point_3 point_of(const Eigen::Vector3d& p) { return {p.x(), p.y(), p.z()}; }

// CGAL has no segment with equal ends.
double distance(const ExpectedRegion& a, const ExpectedRegion& b) {
  const bool ball_a = a.from == a.to;
  const bool ball_b = b.from == b.to;
  if (ball_a && ball_b) return (a.from - b.from).norm();
  if (ball_a) return distance(b, a);
  const Kernel::Segment_3 segment(point_of(a.from), point_of(a.to));
  if (ball_b) return std::sqrt(CGAL::squared_distance(point_of(b.from), segment));
  return std::sqrt(
      CGAL::squared_distance(segment, Kernel::Segment_3(point_of(b.from), point_of(b.to))));
}

void check_region(const ExpectedRegion& region) {
  if (region.name.empty()) throw libmap::Error("every region needs a name", {.field = "region"});
  const std::string field = "region '" + region.name + "'";
  if (!(region.radius_m > 0.0) || !std::isfinite(region.radius_m))
    throw libmap::Error(
        "out of range",
        {.field = field + ", radius", .value = libmap::to_text(region.radius_m), .bound = "> 0"});
  if (!region.from.allFinite() || !region.to.allFinite())
    throw libmap::Error("coordinates are not finite", {.field = field});
}

void check_columns(const libmap::Table& table) {
  const std::vector<std::string> known(column_names.begin(), column_names.end());
  std::set<std::string> seen;
  for (const std::string& column : table.columns) {
    if (std::find(known.begin(), known.end(), column) == known.end())
      throw libmap::Error("unknown column" + libmap::did_you_mean(column, known),
                          {.file = table.file, .field = column});
    if (!seen.insert(column).second)
      throw libmap::Error("column occurs more than once", {.file = table.file, .field = column});
  }
}

Eigen::Vector3d read_from(const libmap::Table& table, std::size_t row) {
  return {table.number(row, table.column("x")), table.number(row, table.column("y")),
          table.number(row, table.column("z"))};
}

// Reads the other end: all three cells or none.
Eigen::Vector3d read_to(const libmap::Table& table, std::size_t row, const Eigen::Vector3d& from) {
  Eigen::Vector3d to = from;
  int given = 0;
  for (Eigen::Index axis = 0; axis < 3; ++axis) {
    constexpr std::array<const char*, 3> names = {"to_x", "to_y", "to_z"};
    const auto value =
        table.optional_number(row, table.column(names[static_cast<std::size_t>(axis)]));
    if (!value) continue;
    to[axis] = *value;
    ++given;
  }
  if (given != 0 && given != 3)
    throw libmap::Error("some coordinates of the segment's end are missing",
                        {.file = table.file,
                         .field = "row " + std::to_string(row + 1) + ", columns to_x, to_y, to_z",
                         .bound = "all set, or all empty for a ball"});
  return to;
}

// Regions that contain a voxel: the undecided ones, or else the decided ones.
struct Membership {
  std::vector<std::size_t> regions;
  bool undecided = false;
};

Membership regions_at(const ExpectedMap& expected, const Eigen::Vector3d& point) {
  Membership membership;
  for (std::size_t r = 0; r < expected.regions.size(); ++r) {
    if (!expected.regions[r].contains(point)) continue;
    const bool undecided = !expected.regions[r].graspable;
    if (undecided && !membership.undecided) membership.regions.clear();
    membership.undecided = membership.undecided || undecided;
    if (undecided || !membership.undecided) membership.regions.push_back(r);
  }
  return membership;
}

void set_scores(std::vector<double> scores, RegionResult& region) {
  if (scores.empty()) return;
  // Sorted, so that the sum does not depend on the order of the map.
  std::sort(scores.begin(), scores.end());
  double sum = 0.0;
  for (const double score : scores) sum += score;
  region.mean_score = sum / static_cast<double>(scores.size());
  const std::size_t middle = scores.size() / 2;
  region.median_score =
      scores.size() % 2 == 1 ? scores[middle] : (scores[middle - 1] + scores[middle]) / 2.0;
}

const libmap::ScalarField& scores_of(const libmap::PointCloud& map) {
  if (map.empty()) throw libmap::no_elements("points of the map");
  const libmap::ScalarField* score = map.find_field("score");
  if (score == nullptr)
    throw libmap::Error("no such field; a graspability map is required", {.field = "score"});
  return *score;
}

}  // namespace

bool ExpectedRegion::contains(const Eigen::Vector3d& point) const {
  const Eigen::Vector3d along = to - from;
  const double length2 = along.squaredNorm();
  const double fraction =
      length2 > 0.0 ? std::clamp((point - from).dot(along) / length2, 0.0, 1.0) : 0.0;
  return (point - (from + fraction * along)).squaredNorm() <= radius_m * radius_m;
}

void ExpectedMap::check() const {
  std::set<std::string> names;
  bool any = false;
  for (std::size_t i = 0; i < regions.size(); ++i) {
    const ExpectedRegion& region = regions[i];
    check_region(region);
    if (!names.insert(region.name).second)
      throw libmap::Error("occurs more than once", {.field = "region '" + region.name + "'"});
    any = any || region.graspable.has_value();
    for (std::size_t j = 0; j < i; ++j) {
      const ExpectedRegion& other = regions[j];
      if (!region.graspable || !other.graspable || *region.graspable == *other.graspable) continue;
      if (distance(region, other) <= region.radius_m + other.radius_m)
        throw libmap::Error("overlap, but only one is expected to be graspable; shrink or move one",
                            {.field = "regions '" + other.name + "' and '" + region.name + "'"});
    }
  }
  if (!any)
    throw libmap::Error("no region has a label",
                        {.field = "graspable", .bound = "1 or 0 in at least one region"});
}

ExpectedMap parse_expected_map(const libmap::Table& table) {
  check_columns(table);
  ExpectedMap expected;
  for (std::size_t row = 0; row < table.rows.size(); ++row) {
    ExpectedRegion region;
    region.name = std::string(libmap::trim(table.rows[row][table.column("region")]));
    region.from = read_from(table, row);
    region.to = read_to(table, row, region.from);
    region.radius_m = table.number(row, table.column("radius"));
    region.graspable = label_at(table, row, table.column("graspable"));
    region.reason = table.rows[row][table.column("why")];
    expected.regions.push_back(std::move(region));
  }
  libmap::in_file(table.file, [&] { expected.check(); });
  return expected;
}

ExpectedMap transformed(const ExpectedMap& expected, const libmap::Pose& map_from_expected) {
  ExpectedMap carried = expected;
  for (ExpectedRegion& region : carried.regions) {
    region.from = map_from_expected * region.from;
    region.to = map_from_expected * region.to;
  }
  return carried;
}

std::optional<bool> RegionResult::predicted() const {
  if (voxels == 0) return std::nullopt;
  return 2 * reaching_cutoff >= voxels;
}

std::optional<double> youden_index(const Confusion& counts) {
  const std::optional<double> sensitivity = counts.true_positive_rate().value();
  const std::optional<double> specificity = counts.true_negative_rate().value();
  if (!sensitivity || !specificity) return std::nullopt;
  return *sensitivity + *specificity - 1.0;
}

ExpectedMapResult evaluate_expected_map(const libmap::PointCloud& map, const ExpectedMap& expected,
                                        double cutoff) {
  expected.check();
  const libmap::ScalarField& score = scores_of(map);
  const libmap::ScalarField* flag = map.find_field("graspable");
  const libmap::ScalarField* obstacle = map.find_field("obstacle");
  ExpectedMapResult result;
  result.regions.resize(expected.regions.size());
  if (flag != nullptr) result.voxels_by_flag.emplace();
  std::vector<std::vector<double>> region_scores(expected.regions.size());
  std::vector<std::optional<bool>> labels;
  std::vector<std::optional<double>> scores;
  for (std::size_t n = 0; n < map.size(); ++n) {
    const Membership at = regions_at(expected, map.positions[n]);
    const double value = score.values[n];
    if (at.regions.empty() || std::isnan(value)) {
      ++result.unlisted_voxels;
      continue;
    }
    const bool reaching_cutoff = reaches_cutoff(value, cutoff);
    const bool flagged = flag != nullptr && flag->values[n] > 0.0 &&
                         !(obstacle != nullptr && obstacle->values[n] > 0.0);
    for (const std::size_t r : at.regions) {
      RegionResult& region = result.regions[r];
      ++region.voxels;
      region.reaching_cutoff += reaching_cutoff ? 1 : 0;
      region.graspable += flagged ? 1 : 0;
      region_scores[r].push_back(value);
    }
    if (at.undecided) {
      ++result.undecided_voxels;
      continue;
    }
    const bool truth = *expected.regions[at.regions.front()].graspable;
    result.voxels_by_score.add(truth, reaching_cutoff);
    if (result.voxels_by_flag) result.voxels_by_flag->add(truth, flagged);
    labels.emplace_back(truth);
    scores.emplace_back(value);
  }
  for (std::size_t r = 0; r < expected.regions.size(); ++r) {
    set_scores(std::move(region_scores[r]), result.regions[r]);
    const std::optional<bool> predicted = result.regions[r].predicted();
    if (predicted && expected.regions[r].graspable)
      result.region_confusion.add(*expected.regions[r].graspable, *predicted);
  }
  RocOptions roc;
  roc.bootstrap_replicates = 0;
  result.auc = evaluate_roc(labels, scores, roc).auc;
  return result;
}

}  // namespace libgtd
