#include "recovery/imaging/skeleton/vessel_graph.h"

#include <algorithm>
#include <deque>
#include <iterator>

#include <fmt/format.h>

#include "base/index.h"

namespace angiospline {
namespace {

// Walks a labelled axis into nodes and arcs, in the order of the image; levels come later.
class Tracer {
 public:
  explicit Tracer(const SkeletonLabels& labels)
      : s_(labels),
        node_of_(labels.voxels.size(), -1),
        passed_(labels.voxels.size(), false),
        came_from_(labels.voxels.size(), -1) {
    graph_.grid = labels.grid;
  }

  VesselGraph trace() {
    for (std::size_t i = 0; i < s_.voxels.size(); ++i) add_node(static_cast<int>(i));
    std::vector<std::vector<int>> clusters;
    for (std::size_t n = 0; n < graph_.nodes.size(); ++n)
      clusters.push_back(search_cluster(static_cast<int>(n)));
    for (std::size_t n = 0; n < clusters.size(); ++n) leave(static_cast<int>(n), clusters[n]);
    for (std::size_t i = 0; i < s_.voxels.size(); ++i)
      if (s_.labels[i] == PointLabel::kNormal && !passed_[i]) add_ring(static_cast<int>(i));
    return std::move(graph_);
  }

 private:
  void add_node(int i) {
    const PointLabel label = s_.labels[index(i)];
    if (label == PointLabel::kNormal || label == PointLabel::kMutual) return;
    VesselNode node;
    node.voxel = s_.voxel(i);
    const auto number = static_cast<int>(graph_.nodes.size());
    if (label == PointLabel::kJunction) {
      const JunctionCluster& c = s_.clusters[index(s_.cluster[index(i)])];
      node.cluster_cycles = c.cycles;
      node.cluster_cavities = c.cavities;
      for (const int m : c.members) {
        node.cluster.push_back(s_.voxel(m));
        node_of_[index(m)] = number;
      }
    } else {
      node.cluster.push_back(node.voxel);
      node_of_[index(i)] = number;
    }
    main_.push_back(i);
    graph_.nodes.push_back(std::move(node));
  }

  // The voxels of a node's cluster, breadth first from the main point; came_from_ leads back to it.
  std::vector<int> search_cluster(int n) {
    std::vector<int> queue{main_[index(n)]};
    came_from_[index(queue[0])] = queue[0];
    for (std::size_t head = 0; head < queue.size(); ++head)
      for (const int next : s_.neighbors_of(queue[head]))
        if (node_of_[index(next)] == n && came_from_[index(next)] < 0) {
          came_from_[index(next)] = queue[head];
          queue.push_back(next);
        }
    return queue;
  }

  // Each step out of a cluster begins an arc.
  void leave(int n, const std::vector<int>& cluster) {
    for (const int at : cluster)
      for (const int next : s_.neighbors_of(at))
        if (node_of_[index(next)] != n) follow(n, at, next);
  }

  void follow(int n, int door, int exit) {
    if (node_of_[index(exit)] >= 0) {  // an end right at the junction, or two ends side by side
      if (node_of_[index(exit)] > n) add_arc(n, door, {}, exit);
      return;
    }
    if (passed_[index(exit)]) return;  // this arc was walked from its other side
    std::vector<int> chain;
    int before = door;
    int at = exit;
    for (;;) {
      passed_[index(at)] = true;
      chain.push_back(at);
      const auto around = s_.neighbors_of(at);  // a normal voxel has two neighbours
      const int next = around[0] == before ? around[1] : around[0];
      before = at;
      at = next;
      if (node_of_[index(at)] >= 0) break;
    }
    add_arc(n, door, chain, at);
  }

  void add_arc(int from, int door, const std::vector<int>& chain, int last) {
    VesselArc arc;
    arc.from = from;
    arc.to = node_of_[index(last)];
    append_way_to_main(arc.voxels, door);
    std::reverse(arc.voxels.begin(), arc.voxels.end());
    for (const int i : chain) arc.voxels.push_back(s_.voxel(i));
    append_way_to_main(arc.voxels, last);
    add(std::move(arc));
  }

  void append_way_to_main(std::vector<Voxel>& voxels, int i) const {
    for (; came_from_[index(i)] != i; i = came_from_[index(i)]) voxels.push_back(s_.voxel(i));
    voxels.push_back(s_.voxel(i));
  }

  void add(VesselArc arc) {
    const auto number = static_cast<int>(graph_.arcs.size());
    graph_.nodes[index(arc.from)].arcs.push_back(number);
    graph_.nodes[index(arc.to)].arcs.push_back(number);
    graph_.arcs.push_back(std::move(arc));
  }

  void add_ring(int first) {
    VesselNode node;
    node.voxel = s_.voxel(first);
    node.cluster.push_back(node.voxel);
    const auto number = static_cast<int>(graph_.nodes.size());
    VesselArc arc{number, number, {node.voxel}};
    int before = first;
    int at = s_.neighbors_of(first)[0];
    passed_[index(first)] = true;
    while (at != first) {
      passed_[index(at)] = true;
      arc.voxels.push_back(s_.voxel(at));
      const auto around = s_.neighbors_of(at);
      const int next = around[0] == before ? around[1] : around[0];
      before = at;
      at = next;
    }
    arc.voxels.push_back(node.voxel);
    graph_.nodes.push_back(std::move(node));
    add(std::move(arc));
  }

  const SkeletonLabels& s_;
  VesselGraph graph_;
  std::vector<int> main_;       // voxel of each node
  std::vector<int> node_of_;    // node of each voxel, -1 for normal ones
  std::vector<bool> passed_;    // normal voxels that belong to an arc
  std::vector<int> came_from_;  // in a cluster: one voxel nearer to the main point
};

int other_end(const VesselArc& arc, int node) { return arc.from == node ? arc.to : arc.from; }

// Components of an unordered graph, numbered by their first node.
std::vector<int> components(const VesselGraph& graph) {
  std::vector<int> component(graph.nodes.size(), -1);
  int count = 0;
  for (std::size_t n = 0; n < graph.nodes.size(); ++n) {
    if (component[n] >= 0) continue;
    std::vector<int> stack{static_cast<int>(n)};
    component[n] = count;
    while (!stack.empty()) {
      const int at = stack.back();
      stack.pop_back();
      for (const int a : graph.nodes[index(at)].arcs) {
        const int next = other_end(graph.arcs[index(a)], at);
        if (component[index(next)] >= 0) continue;
        component[index(next)] = count;
        stack.push_back(next);
      }
    }
    ++count;
  }
  return component;
}

std::int64_t squared(const Voxel& a, const Voxel& b) {
  std::int64_t sum = 0;
  for (std::size_t k = 0; k < 3; ++k) sum += std::int64_t{a[k] - b[k]} * (a[k] - b[k]);
  return sum;
}

int nearest_node(const VesselGraph& graph, const Voxel& voxel) {
  const auto nearest = std::min_element(graph.nodes.begin(), graph.nodes.end(),
                                        [&](const VesselNode& a, const VesselNode& b) {
                                          return squared(a.voxel, voxel) < squared(b.voxel, voxel);
                                        });
  return static_cast<int>(nearest - graph.nodes.begin());
}

// The level-order search: nodes and arcs are copied in the order in which it meets them.
class LevelOrder {
 public:
  explicit LevelOrder(const VesselGraph& graph)
      : in_(graph), number_(graph.nodes.size(), -1), seen_(graph.arcs.size(), false) {
    out_.grid = graph.grid;
  }

  void search_from(int root, int component) {
    if (number_[index(root)] >= 0) return;
    meet(root, 0, component);
    for (; head_ < order_.size(); ++head_) {
      const int at = order_[head_];
      const int number = number_[index(at)];
      const int level = out_.nodes[index(number)].level;
      for (const int a : in_.nodes[index(at)].arcs) {
        if (seen_[index(a)]) continue;
        seen_[index(a)] = true;
        VesselArc arc = in_.arcs[index(a)];
        if (arc.from != at) {
          std::swap(arc.from, arc.to);
          std::reverse(arc.voxels.begin(), arc.voxels.end());
        }
        if (number_[index(arc.to)] < 0) meet(arc.to, level + 1, component);
        arc.from = number;
        arc.to = number_[index(arc.to)];
        link(std::move(arc));
      }
    }
  }

  VesselGraph take() {
    for (VesselNode& node : out_.nodes) {
      std::sort(node.parents.begin(), node.parents.end());
      std::sort(node.children.begin(), node.children.end());
    }
    return std::move(out_);
  }

 private:
  void meet(int node, int level, int component) {
    number_[index(node)] = static_cast<int>(out_.nodes.size());
    order_.push_back(node);
    VesselNode copy = in_.nodes[index(node)];
    copy.arcs.clear();
    copy.parents.clear();
    copy.children.clear();
    copy.level = level;
    copy.component = component;
    out_.nodes.push_back(std::move(copy));
  }

  void link(VesselArc arc) {
    const auto a = static_cast<int>(out_.arcs.size());
    VesselNode& from = out_.nodes[index(arc.from)];
    VesselNode& to = out_.nodes[index(arc.to)];
    from.arcs.push_back(a);
    to.arcs.push_back(a);
    from.children.push_back(arc.to);
    to.parents.push_back(arc.from);
    out_.arcs.push_back(std::move(arc));
  }

  const VesselGraph& in_;
  VesselGraph out_;
  std::vector<int> number_;  // new number of each node
  std::vector<bool> seen_;   // arcs already copied
  std::vector<int> order_;   // the queue: nodes in the order in which they were met
  std::size_t head_ = 0;
};

}  // namespace

int VesselGraph::component_count() const {
  return nodes.empty() ? 0
                       : 1 + std::max_element(nodes.begin(), nodes.end(),
                                              [](const VesselNode& a, const VesselNode& b) {
                                                return a.component < b.component;
                                              })
                                 ->component;
}

int VesselGraph::cycle_count() const {
  return static_cast<int>(arcs.size()) - static_cast<int>(nodes.size()) + component_count();
}

int VesselGraph::multiple_parent_count() const {
  int count = 0;
  int component = -1;
  for (const VesselNode& node : nodes) {
    const bool is_root = node.component != component;
    component = node.component;
    count += static_cast<int>(node.parents.size()) - (is_root ? 0 : 1);
  }
  return count;
}

VesselGraph vessel_graph(const SkeletonLabels& labels, const std::vector<Voxel>& roots) {
  const VesselGraph graph = Tracer(labels).trace();
  std::vector<int> root_nodes;
  if (!graph.nodes.empty())
    for (const Voxel& root : roots) root_nodes.push_back(nearest_node(graph, root));
  return rooted_at(graph, root_nodes);
}

VesselGraph rooted_at(const VesselGraph& graph, const std::vector<int>& root_nodes) {
  const std::vector<int> component = components(graph);
  const int count =
      component.empty() ? 0 : 1 + *std::max_element(component.begin(), component.end());
  std::vector<int> root(index(count), -1);
  for (const int n : root_nodes) {
    EXPECTS(n >= 0 && index(n) < graph.nodes.size());
    int& r = root[index(component[index(n)])];
    if (r < 0) r = n;
  }
  for (const bool ends_only : {true, false})
    for (std::size_t n = 0; n < graph.nodes.size(); ++n) {
      int& r = root[index(component[n])];
      if (r < 0 && (!ends_only || graph.nodes[n].is_end())) r = static_cast<int>(n);
    }
  LevelOrder search(graph);
  for (int c = 0; c < count; ++c) search.search_from(root[index(c)], c);
  return search.take();
}

std::string level_order_table(const VesselGraph& graph) {
  std::string table = "Type       X    Y    Z  Level  Node\n";
  const auto line = [&](const char* type, int n) {
    const VesselNode& node = graph.nodes[index(n)];
    fmt::format_to(std::back_inserter(table), "{:<7}{:5}{:5}{:5}{:7}{:6}\n", type, node.voxel[0],
                   node.voxel[1], node.voxel[2], node.level, n);
  };
  for (std::size_t n = 0; n < graph.nodes.size(); ++n) {
    table += '\n';
    line("Node", static_cast<int>(n));
    for (const int p : graph.nodes[n].parents) line("Parent", p);
    for (const int c : graph.nodes[n].children) line("Child", c);
  }
  return table;
}

}  // namespace angiospline
