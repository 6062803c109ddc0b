#include <angiospline/io/centerlines/centerline_file.h>
#include <angiospline/io/export/export_model.h>
#include <angiospline/modeling/build/build_model.h>

int main() {
  const auto tree = angiospline::read_centerline_file("tree.swc");
  if (!tree) return 2;
  const auto model = angiospline::build_model(*tree);
  if (!model) return 1;
  return angiospline::export_model(*model, {"tree.step", "tree.glb"}) ? 0 : 1;
}
