#include <cstdio>

#include <angiospline/modeling/build/build_model.h>

int main() {
  angiospline::CenterlineTree tree;
  tree.nodes = {{"a", {0, 0, 0}}, {"b", {0, 0, 40}}};
  tree.branches = {{"a-b", 0, 1, angiospline::Points3(3, 3), Eigen::Vector3d(2, 2, 2)}};
  tree.branches[0].points_mm << 0, 0, 0, 0, 0, 0, 0, 20, 40;
  const auto model = angiospline::build_model(tree);
  if (!model) return std::puts(model.error().message().c_str()), 1;
  std::printf("%zu patches, %zu rims\n", model->network.patches.size(), model->network.rims.size());
  return model->network.rims.size() == 2 ? 0 : 1;
}
