#include "libmap/fusion/normals.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <functional>
#include <optional>
#include <string>
#include <tuple>

#include "libmap/core/parallel.h"
#include "libmap/geometry/disjoint_sets.h"
#include "libmap/geometry/spatial_index.h"
#include "libmap/geometry/symmetric_eigen.h"

namespace libmap {

namespace {

// Neighbors with a smaller ratio of second to first eigenvalue of their covariance are collinear.
constexpr double min_spread = 1e-6;
// Number of neighbors per point in the graph of orientations.
constexpr std::size_t graph_neighbors = 10;

using Normals = std::vector<Eigen::Vector3f>;

Eigen::Vector3f plane_normal(const std::vector<Eigen::Vector3d>& positions,
                             const std::vector<NeighborPoint>& neighbors,
                             const Eigen::Vector3d& origin) {
  Eigen::Vector3d mean = Eigen::Vector3d::Zero();
  Eigen::Matrix3d moments = Eigen::Matrix3d::Zero();
  for (const NeighborPoint& neighbor : neighbors) {
    const Eigen::Vector3d arm = positions[neighbor.index] - origin;
    mean += arm;
    moments += arm * arm.transpose();
  }
  const auto count = static_cast<double>(neighbors.size());
  moments -= mean * mean.transpose() / count;
  const SymmetricEigen<3> spread = symmetric_eigen(moments);
  if (!(spread.values[1] > min_spread * spread.values[2])) return Eigen::Vector3f::Zero();
  return spread.vectors.col(0).cast<float>().normalized();
}

void turn_to(const std::vector<Eigen::Vector3d>& positions,
             const std::function<Eigen::Vector3d(std::size_t)>& eye, Normals& normals) {
  for (std::size_t n = 0; n < normals.size(); ++n)
    if ((eye(n) - positions[n]).dot(normals[n].cast<double>()) < 0.0) normals[n] = -normals[n];
}

bool has_normal(const Eigen::Vector3f& normal) { return !normal.isZero(0.0F); }

struct GraphEdge {
  float turn;  // 1 - |cosine| between the normals
  std::uint32_t a;
  std::uint32_t b;
};

class SpanningTree {
 public:
  SpanningTree(const std::vector<Eigen::Vector3d>& positions, const PointTree& tree,
               Normals& normals)
      : positions_(positions), tree_(tree), normals_(normals) {}

  std::size_t orient() {
    find_edges();
    choose_tree();
    std::vector<char> seen(normals_.size(), 0);
    std::size_t parts = 0;
    std::vector<std::uint32_t> part;
    for (std::uint32_t n = 0; n < normals_.size(); ++n) {
      if (seen[n] != 0 || !has_normal(normals_[n])) continue;
      walk(n, seen, part);
      turn_out(part);
      ++parts;
    }
    return parts;
  }

 private:
  void find_edges();
  void choose_tree();
  void walk(std::uint32_t first, std::vector<char>& seen, std::vector<std::uint32_t>& part);
  void turn_out(const std::vector<std::uint32_t>& part);

  const std::vector<Eigen::Vector3d>& positions_;
  const PointTree& tree_;
  Normals& normals_;
  std::vector<GraphEdge> edges_;
  std::vector<std::uint32_t> starts_;  // index of each point's first branch
  std::vector<std::uint32_t> branches_;
};

void SpanningTree::find_edges() {
  std::vector<std::array<GraphEdge, graph_neighbors>> found(normals_.size());
  parallel_for(normals_.size(), 1024, [&](std::size_t begin, std::size_t end) {
    for (std::size_t n = begin; n < end; ++n) {
      std::size_t count = 0;
      found[n].fill({-1.0F, 0, 0});
      if (!has_normal(normals_[n])) continue;
      for (const NeighborPoint& other : tree_.nearest(positions_[n], graph_neighbors + 1)) {
        if (other.index == n || count == graph_neighbors || !has_normal(normals_[other.index]))
          continue;
        const float turn = 1.0F - std::abs(normals_[n].dot(normals_[other.index]));
        const auto [a, b] = std::minmax(n, other.index);
        found[n][count++] = {std::max(0.0F, turn), static_cast<std::uint32_t>(a),
                             static_cast<std::uint32_t>(b)};
      }
    }
  });
  for (const auto& of_point : found)
    for (const GraphEdge& edge : of_point)
      if (edge.turn >= 0.0F) edges_.push_back(edge);
}

// Minimum spanning tree (Kruskal 1956).
void SpanningTree::choose_tree() {
  std::sort(edges_.begin(), edges_.end(), [](const GraphEdge& one, const GraphEdge& two) {
    return std::tie(one.turn, one.a, one.b) < std::tie(two.turn, two.a, two.b);
  });
  DisjointSets<std::uint32_t> groups(normals_.size());
  std::vector<GraphEdge> kept;
  for (const GraphEdge& edge : edges_) {
    if (groups.find(edge.a) == groups.find(edge.b)) continue;
    groups.join(edge.a, edge.b);
    kept.push_back(edge);
  }
  edges_.clear();
  starts_.assign(normals_.size() + 1, 0);
  for (const GraphEdge& edge : kept) {
    ++starts_[edge.a + 1];
    ++starts_[edge.b + 1];
  }
  for (std::size_t n = 0; n < normals_.size(); ++n) starts_[n + 1] += starts_[n];
  branches_.resize(2 * kept.size());
  std::vector<std::uint32_t> next(starts_.begin(), starts_.end() - 1);
  for (const GraphEdge& edge : kept) {
    branches_[next[edge.a]++] = edge.b;
    branches_[next[edge.b]++] = edge.a;
  }
}

// Collects the points connected to `first` and orients them like it.
void SpanningTree::walk(std::uint32_t first, std::vector<char>& seen,
                        std::vector<std::uint32_t>& part) {
  part.assign(1, first);
  seen[first] = 1;
  for (std::size_t i = 0; i < part.size(); ++i) {
    const std::uint32_t from = part[i];
    for (std::uint32_t b = starts_[from]; b < starts_[from + 1]; ++b) {
      const std::uint32_t to = branches_[b];
      if (seen[to] != 0) continue;
      seen[to] = 1;
      if (normals_[from].dot(normals_[to]) < 0.0F) normals_[to] = -normals_[to];
      part.push_back(to);
    }
  }
}

void SpanningTree::turn_out(const std::vector<std::uint32_t>& part) {
  const Eigen::Vector3d first = positions_[part.front()];
  Eigen::Vector3d middle = Eigen::Vector3d::Zero();
  for (const std::uint32_t n : part)
    middle += (positions_[n] - first) / static_cast<double>(part.size());
  double up = 0.0;
  double outwards = 0.0;
  for (const std::uint32_t n : part) {
    const Eigen::Vector3d normal = normals_[n].cast<double>();
    up += normal.z();
    outwards += normal.dot((positions_[n] - first - middle).stableNormalized());
  }
  if ((std::abs(outwards) > std::abs(up) ? outwards : up) >= 0.0) return;
  for (const std::uint32_t n : part) normals_[n] = -normals_[n];
}

// Fields with the sensor position of each point; nullopt if the cloud does not have them.
std::optional<std::array<const ScalarField*, 3>> view_fields(const PointCloud& cloud) {
  const std::array<const ScalarField*, 3> fields = {
      cloud.find_field("vp_x"), cloud.find_field("vp_y"), cloud.find_field("vp_z")};
  for (const ScalarField* field : fields) {
    if (field == nullptr) return std::nullopt;
    for (const double value : field->values)
      if (!std::isfinite(value)) return std::nullopt;
  }
  return fields;
}

void choose_sides(const PointCloud& cloud, const PointTree& tree, NormalEstimationResult& result) {
  result.undefined = static_cast<std::size_t>(
      std::count_if(result.normals.begin(), result.normals.end(),
                    [](const Eigen::Vector3f& normal) { return !has_normal(normal); }));
  if (const auto fields = view_fields(cloud)) {
    result.orientation = NormalOrientation::view_fields;
    const auto& [x, y, z] = *fields;
    turn_to(
        cloud.positions,
        [x = x, y = y, z = z](std::size_t n) {
          return Eigen::Vector3d(x->values[n], y->values[n], z->values[n]);
        },
        result.normals);
  } else if (!cloud.viewpoint.matrix().isIdentity(0.0)) {
    result.orientation = NormalOrientation::viewpoint;
    turn_to(
        cloud.positions, [&](std::size_t) { return cloud.viewpoint.translation(); },
        result.normals);
  } else {
    result.orientation = NormalOrientation::spanning_tree;
    result.parts = SpanningTree(cloud.positions, tree, result.normals).orient();
  }
}

}  // namespace

std::string_view to_text(NormalOrientation orientation) {
  if (orientation == NormalOrientation::view_fields) return "the points' view fields";
  return orientation == NormalOrientation::viewpoint ? "the cloud's viewpoint"
                                                     : "a minimum spanning tree";
}

void bind(ParameterTable& table, NormalEstimationOptions& options) {
  table.add("normal_neighbors", options.neighbors, {3, 1000},
            "number of nearest points to which a plane is fitted to estimate a normal");
}

NormalEstimationResult estimate_normals(const PointCloud& cloud,
                                        const NormalEstimationOptions& options) {
  check_parameters(options);
  cloud.check();
  NormalEstimationResult result;
  result.normals.resize(cloud.size());
  const PointTree tree(cloud.positions);
  parallel_for(cloud.size(), 1024, [&](std::size_t begin, std::size_t end) {
    for (std::size_t n = begin; n < end; ++n) {
      const auto neighbors =
          tree.nearest(cloud.positions[n], static_cast<std::size_t>(options.neighbors));
      result.normals[n] = plane_normal(cloud.positions, neighbors, cloud.positions[n]);
    }
  });
  choose_sides(cloud, tree, result);
  return result;
}

NormalEstimationResult orient_normals(const PointCloud& cloud) {
  cloud.check();
  NormalEstimationResult result;
  for (const Eigen::Vector3f& normal : cloud.normals)
    result.normals.push_back(normal.allFinite() ? normal.stableNormalized()
                                                : Eigen::Vector3f::Zero());
  choose_sides(cloud, PointTree(cloud.positions), result);
  return result;
}

}  // namespace libmap
