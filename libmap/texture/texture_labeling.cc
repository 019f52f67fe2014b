#include "libmap/texture/texture_steps.h"

#include <algorithm>
#include <cstddef>
#include <numeric>
#include <span>

#include "libmap/geometry/disjoint_sets.h"

namespace libmap {

namespace {

// Minimum relative decrease of the energy in a cycle for another cycle to follow.
constexpr double min_gain = 1e-2;
constexpr int max_cycles = 12;
constexpr int rounds_per_cycle = 2;
constexpr int rounds_of_regions = 3;

// A candidate photograph of a node and its cost.
struct Label {
  std::uint32_t photo = 0;
  float cost = 0.0F;  // m2
  float sum = 0.0F;   // cost with the best labels of all descendants in the tree
};

// A neighbor of a node and the cost of a seam between both.
struct Neighbor {
  std::uint32_t node = 0;
  float cost = 0.0F;  // m2
};

// Seen triangles, or regions of them, and the label chosen for each.
struct Graph {
  std::vector<std::uint32_t> first_neighbor{0};
  std::vector<Neighbor> neighbors;
  std::vector<std::uint32_t> first_label{0};
  std::vector<Label> labels;  // at least one per node, by ascending photograph
  std::vector<std::uint32_t> chosen;

  std::size_t size() const { return chosen.size(); }
  std::span<const Neighbor> neighbors_of(std::uint32_t node) const {
    return {neighbors.data() + first_neighbor[node], neighbors.data() + first_neighbor[node + 1]};
  }
  std::span<Label> labels_of(std::uint32_t node) {
    return {labels.data() + first_label[node], labels.data() + first_label[node + 1]};
  }
  std::span<const Label> labels_of(std::uint32_t node) const {
    return {labels.data() + first_label[node], labels.data() + first_label[node + 1]};
  }
  std::uint32_t photo_of(std::uint32_t node) const { return labels[chosen[node]].photo; }
  void choose(std::uint32_t node, std::uint32_t photo);
  double seams() const;   // cost of all seams
  double energy() const;  // cost of all labels and seams
};

void Graph::choose(std::uint32_t node, std::uint32_t photo) {
  const auto own = labels_of(node);
  const auto found = std::lower_bound(
      own.begin(), own.end(), photo,
      [](const Label& label, std::uint32_t wanted) { return label.photo < wanted; });
  chosen[node] = first_label[node] + static_cast<std::uint32_t>(found - own.begin());
}

double Graph::seams() const {
  double sum = 0.0;
  for (std::uint32_t node = 0; node < size(); ++node)
    for (const Neighbor& neighbor : neighbors_of(node))
      if (neighbor.node > node && photo_of(neighbor.node) != photo_of(node))
        sum += static_cast<double>(neighbor.cost);
  return sum;
}

double Graph::energy() const {
  double sum = seams();
  for (const std::uint32_t label : chosen) sum += static_cast<double>(labels[label].cost);
  return sum;
}

// Optimizes one forest of nodes after another.
class ForestDescent {
 public:
  explicit ForestDescent(Graph& graph)
      : graph_(graph),
        order_(graph.size()),
        in_forest_(graph.size(), 1),
        parent_(graph.size()),
        least_(graph.size()) {
    std::iota(order_.begin(), order_.end(), 0U);
  }

  void improve() {
    choose_forest();
    root_trees();
    for (std::size_t i = from_root_.size(); i-- > 0;) gather(from_root_[i]);
    for (const std::uint32_t node : from_root_) settle(node);
  }

 private:
  void choose_forest();
  void root_trees();
  void gather(std::uint32_t node);
  void settle(std::uint32_t node);

  Graph& graph_;
  std::vector<std::uint32_t> order_;
  std::vector<std::uint8_t> in_forest_;
  std::vector<std::uint32_t> from_root_;  // nodes of all trees, parents before children
  std::vector<std::uint32_t> parent_;
  std::vector<float> least_;  // minimum of each node's sums
};

// Adds nodes one after another unless they close a cycle, nodes outside the previous forest first.
void ForestDescent::choose_forest() {
  std::stable_partition(order_.begin(), order_.end(),
                        [this](std::uint32_t node) { return in_forest_[node] == 0; });
  std::fill(in_forest_.begin(), in_forest_.end(), std::uint8_t{0});
  DisjointSets<std::uint32_t> sets(graph_.size());
  std::vector<std::uint32_t> trees;
  for (const std::uint32_t node : order_) {
    trees.clear();
    for (const Neighbor& neighbor : graph_.neighbors_of(node))
      if (in_forest_[neighbor.node] != 0) trees.push_back(sets.find(neighbor.node));
    std::sort(trees.begin(), trees.end());
    if (std::adjacent_find(trees.begin(), trees.end()) != trees.end()) continue;
    in_forest_[node] = 1;
    for (const std::uint32_t tree : trees) sets.join(tree, node);
  }
}

void ForestDescent::root_trees() {
  constexpr std::uint32_t unknown = 0xffffffff;
  from_root_.clear();
  std::fill(parent_.begin(), parent_.end(), unknown);
  for (const std::uint32_t root : order_) {
    if (in_forest_[root] == 0 || parent_[root] != unknown) continue;
    parent_[root] = root;
    std::size_t next = from_root_.size();
    from_root_.push_back(root);
    for (; next < from_root_.size(); ++next)
      for (const Neighbor& neighbor : graph_.neighbors_of(from_root_[next])) {
        if (in_forest_[neighbor.node] == 0 || parent_[neighbor.node] != unknown) continue;
        parent_[neighbor.node] = from_root_[next];
        from_root_.push_back(neighbor.node);
      }
  }
}

// Computes the cost of each label of a node with the best labels of its descendants.
void ForestDescent::gather(std::uint32_t node) {
  const auto own = graph_.labels_of(node);
  for (Label& label : own) label.sum = label.cost;
  for (const Neighbor& neighbor : graph_.neighbors_of(node)) {
    const std::uint32_t n = neighbor.node;
    if (in_forest_[n] == 0) {
      for (Label& label : own)
        if (label.photo != graph_.photo_of(n)) label.sum += neighbor.cost;
      continue;
    }
    if (parent_[node] == n) continue;
    const auto theirs = graph_.labels_of(n);
    std::size_t k = 0;
    for (Label& label : own) {
      while (k < theirs.size() && theirs[k].photo < label.photo) ++k;
      const float changed = least_[n] + neighbor.cost;
      const bool shared = k < theirs.size() && theirs[k].photo == label.photo;
      label.sum += shared ? std::min(changed, theirs[k].sum) : changed;
    }
  }
  least_[node] = own[0].sum;
  for (const Label& label : own) least_[node] = std::min(least_[node], label.sum);
}

void ForestDescent::settle(std::uint32_t node) {
  float seam = 0.0F;
  for (const Neighbor& neighbor : graph_.neighbors_of(node))
    if (neighbor.node == parent_[node]) seam = neighbor.cost;
  const std::uint32_t above = graph_.photo_of(parent_[node]);
  const bool is_root = parent_[node] == node;
  const auto cost = [&](const Label& label) {
    return label.sum + (!is_root && label.photo != above ? seam : 0.0F);
  };
  const auto own = graph_.labels_of(node);
  const auto best = std::min_element(
      own.begin(), own.end(), [&](const Label& a, const Label& b) { return cost(a) < cost(b); });
  graph_.chosen[node] = graph_.first_label[node] + static_cast<std::uint32_t>(best - own.begin());
}

// Merges connected nodes of one photograph. The labels of a region are those common to its nodes.
struct Regions {
  Graph graph;
  std::vector<std::uint32_t> of_node;
};

std::vector<std::vector<std::uint32_t>> members_of(const Graph& graph,
                                                   std::vector<std::uint32_t>& region) {
  constexpr std::uint32_t unknown = 0xffffffff;
  std::vector<std::vector<std::uint32_t>> members;
  region.assign(graph.size(), unknown);
  for (std::uint32_t seed = 0; seed < graph.size(); ++seed) {
    if (region[seed] != unknown) continue;
    const auto number = static_cast<std::uint32_t>(members.size());
    std::vector<std::uint32_t>& nodes = members.emplace_back(1, seed);
    region[seed] = number;
    for (std::size_t i = 0; i < nodes.size(); ++i)
      for (const Neighbor& neighbor : graph.neighbors_of(nodes[i])) {
        if (region[neighbor.node] != unknown ||
            graph.photo_of(neighbor.node) != graph.photo_of(seed))
          continue;
        region[neighbor.node] = number;
        nodes.push_back(neighbor.node);
      }
  }
  return members;
}

std::vector<Label> common_labels(const Graph& graph, const std::vector<std::uint32_t>& nodes) {
  const auto first = graph.labels_of(nodes[0]);
  std::vector<Label> common(first.begin(), first.end());
  for (std::size_t i = 1; i < nodes.size(); ++i) {
    const auto labels = graph.labels_of(nodes[i]);
    std::size_t k = 0;
    std::erase_if(common, [&](Label& label) {
      while (k < labels.size() && labels[k].photo < label.photo) ++k;
      if (k == labels.size() || labels[k].photo != label.photo) return true;
      label.cost += labels[k].cost;
      return false;
    });
  }
  return common;
}

Regions regions_of(const Graph& graph) {
  Regions regions;
  const auto members = members_of(graph, regions.of_node);
  Graph& coarse = regions.graph;
  std::vector<Neighbor> around;
  for (std::uint32_t r = 0; r < members.size(); ++r) {
    around.clear();
    for (const std::uint32_t node : members[r])
      for (const Neighbor& neighbor : graph.neighbors_of(node))
        if (regions.of_node[neighbor.node] != r)
          around.push_back({regions.of_node[neighbor.node], neighbor.cost});
    std::stable_sort(around.begin(), around.end(),
                     [](const Neighbor& a, const Neighbor& b) { return a.node < b.node; });
    const std::size_t first = coarse.neighbors.size();
    for (const Neighbor& neighbor : around) {
      if (coarse.neighbors.size() > first && coarse.neighbors.back().node == neighbor.node)
        coarse.neighbors.back().cost += neighbor.cost;
      else
        coarse.neighbors.push_back(neighbor);
    }
    coarse.first_neighbor.push_back(static_cast<std::uint32_t>(coarse.neighbors.size()));
    const std::vector<Label> labels = common_labels(graph, members[r]);
    coarse.labels.insert(coarse.labels.end(), labels.begin(), labels.end());
    coarse.first_label.push_back(static_cast<std::uint32_t>(coarse.labels.size()));
    coarse.chosen.push_back(0);
    coarse.choose(r, graph.photo_of(members[r][0]));
  }
  return regions;
}

// Cost of a view per square meter: 0 for the best view, 1 for a view of half its quality.
double lack_of(const ViewQuality& view, const ViewQuality& best) {
  constexpr double most = 50.0;
  return std::min(most, static_cast<double>(best.quality / view.quality) - 1.0);
}

// Graph of the seen triangles, each with its best view chosen. `node_of` is one per triangle.
Graph graph_of(const TriangleMesh& mesh, const std::vector<HalfEdge>& opposite,
               const ViewTable& views, double seam_cost_m,
               const std::vector<std::uint32_t>& node_of) {
  Graph graph;
  for (std::uint32_t t = 0; t < mesh.triangles.size(); ++t) {
    if (views[t].empty()) continue;
    const double area = 0.5 * area_normal(mesh, mesh.triangles[t]).norm();
    const auto first = static_cast<std::ptrdiff_t>(graph.labels.size());
    for (const ViewQuality& view : views[t])
      graph.labels.push_back(
          {view.photo, static_cast<float>(area * lack_of(view, views[t][0])), 0.0F});
    std::sort(graph.labels.begin() + first, graph.labels.end(),
              [](const Label& a, const Label& b) { return a.photo < b.photo; });
    graph.first_label.push_back(static_cast<std::uint32_t>(graph.labels.size()));
    graph.chosen.push_back(0);
    graph.choose(node_of[t], views[t][0].photo);
    for (HalfEdge h = 3 * t; h < 3 * t + 3; ++h) {
      if (!is_joined(opposite[h]) || views[opposite[h] / 3].empty()) continue;
      const double length = along(mesh, h).norm();
      graph.neighbors.push_back(
          {node_of[opposite[h] / 3], static_cast<float>(seam_cost_m * length)});
    }
    graph.first_neighbor.push_back(static_cast<std::uint32_t>(graph.neighbors.size()));
  }
  return graph;
}

void improve_regions(Graph& graph) {
  Regions regions = regions_of(graph);
  ForestDescent descent(regions.graph);
  for (int round = 0; round < rounds_of_regions; ++round) descent.improve();
  for (std::uint32_t node = 0; node < graph.size(); ++node)
    graph.choose(node, regions.graph.photo_of(regions.of_node[node]));
}

}  // namespace

TextureLabels label_triangles(const TriangleMesh& mesh, const std::vector<HalfEdge>& opposite,
                              const ViewTable& views, const LabelingOptions& options) {
  TextureLabels result;
  std::vector<std::uint32_t> node_of(mesh.triangles.size(), 0);
  std::uint32_t nodes = 0;
  for (std::size_t t = 0; t < node_of.size(); ++t)
    if (!views[t].empty()) node_of[t] = nodes++;
  // The length of the seams is derived from their cost, so the cost must not be 0.
  const double seam_cost_m = std::max(options.seam_cost_m, 1e-9);
  Graph graph = graph_of(mesh, opposite, views, seam_cost_m, node_of);
  result.seams_before_m = graph.seams() / seam_cost_m;
  result.energy_before = graph.energy();
  result.energy = result.energy_before;
  ForestDescent descent(graph);
  for (int cycle = 0; cycle < max_cycles; ++cycle) {
    for (int round = 0; round < rounds_per_cycle; ++round) descent.improve();
    improve_regions(graph);
    const double improved = graph.energy();
    const bool done = result.energy - improved < min_gain * result.energy;
    result.energy = improved;
    if (done) break;
  }
  result.seams_m = graph.seams() / seam_cost_m;
  for (std::size_t t = 0; t < node_of.size(); ++t)
    result.photos.push_back(views[t].empty() ? no_photo : graph.photo_of(node_of[t]));
  return result;
}

}  // namespace libmap
