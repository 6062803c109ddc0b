#include "io/meshes/glb_file.h"

#include <cstdint>
#include <cstring>
#include <limits>
#include <sstream>

#include <Eigen/Geometry>
#include <tiny_gltf.h>

#include "base/atomic_file.h"
#include "base/contract.h"
#include "base/version.h"
#include "io/meshes/palette.h"
#include "io/meshes/part_arrays.h"
#include "io/text/text_encoding.h"

namespace angiospline {
namespace {

using Vec3f = Eigen::Vector3f;

Vec3 turned(const Vec3& v) { return {v.x(), v.z(), -v.y()}; }

// Collects arrays in one buffer and describes them.
class BufferBuilder {
 public:
  explicit BufferBuilder(tinygltf::Model& model) : model_(model) {}

  template <typename Item>
  int add(const std::vector<Item>& items, int component, int type, int target) {
    tinygltf::BufferView view;
    view.buffer = 0;
    view.byteOffset = bytes_.size();
    view.byteLength = items.size() * sizeof(Item);
    view.target = target;
    bytes_.resize(bytes_.size() + view.byteLength);
    std::memcpy(bytes_.data() + view.byteOffset, items.data(), view.byteLength);

    // An accessor must begin at a multiple of its component (glTF 2.0, section 3.6.2.4).
    while (bytes_.size() % 4 != 0) bytes_.push_back(0);

    tinygltf::Accessor accessor;
    accessor.bufferView = static_cast<int>(model_.bufferViews.size());
    accessor.componentType = component;
    accessor.type = type;
    accessor.count = items.size();
    model_.bufferViews.push_back(std::move(view));
    model_.accessors.push_back(std::move(accessor));
    return static_cast<int>(model_.accessors.size()) - 1;
  }

  int add_positions(const std::vector<Vec3f>& positions) {
    const int accessor = add(positions, TINYGLTF_COMPONENT_TYPE_FLOAT, TINYGLTF_TYPE_VEC3,
                             TINYGLTF_TARGET_ARRAY_BUFFER);
    Vec3f low = positions.front();
    Vec3f high = low;
    for (const Vec3f& p : positions) {
      low = low.cwiseMin(p);
      high = high.cwiseMax(p);
    }
    model_.accessors.back().minValues = {low.x(), low.y(), low.z()};
    model_.accessors.back().maxValues = {high.x(), high.y(), high.z()};
    return accessor;
  }

  // 16 bits where they reach; the largest 16-bit value is reserved.
  int add_indices(const std::vector<std::uint32_t>& indices, std::size_t points) {
    constexpr int kTarget = TINYGLTF_TARGET_ELEMENT_ARRAY_BUFFER;
    if (points >= std::numeric_limits<std::uint16_t>::max()) {
      return add(indices, TINYGLTF_COMPONENT_TYPE_UNSIGNED_INT, TINYGLTF_TYPE_SCALAR, kTarget);
    }
    const std::vector<std::uint16_t> narrow(indices.begin(), indices.end());
    return add(narrow, TINYGLTF_COMPONENT_TYPE_UNSIGNED_SHORT, TINYGLTF_TYPE_SCALAR, kTarget);
  }

  std::size_t size() const { return bytes_.size(); }
  void finish() {
    tinygltf::Buffer buffer;
    buffer.data = std::move(bytes_);
    model_.buffers.push_back(std::move(buffer));
  }

 private:
  tinygltf::Model& model_;
  std::vector<unsigned char> bytes_;
};

tinygltf::Material material_of(const std::string& name, const Vec3& linear) {
  tinygltf::Material material;
  material.name = name;
  material.pbrMetallicRoughness.baseColorFactor = {linear.x(), linear.y(), linear.z(), 1.0};
  material.pbrMetallicRoughness.metallicFactor = 0.0;
  material.pbrMetallicRoughness.roughnessFactor = 0.45;
  return material;
}

// The index of the material of this name, made at its first use.
int material_index(tinygltf::Model& model, const std::string& name, const Vec3& srgb) {
  for (std::size_t m = 0; m < model.materials.size(); ++m) {
    if (model.materials[m].name == name) return static_cast<int>(m);
  }
  model.materials.push_back(material_of(name, linear_from_srgb(srgb)));
  return static_cast<int>(model.materials.size()) - 1;
}

void add_part(tinygltf::Model& model, BufferBuilder& buffer, const TriangleMesh& mesh,
              std::size_t p, const PartArrays& arrays, const GlbOptions& options) {
  const MeshPart& part = mesh.parts[p];
  std::vector<Vec3f> positions;
  std::vector<Vec3f> normals;
  for (const int k : arrays.points) {
    positions.push_back(gltf_from_world(mesh.points_mm.col(k)).cast<float>());
  }
  for (const Vec3& n : arrays.normals) normals.push_back(turned(n).cast<float>());

  // One primitive a part: its name and material are what other programs select by.
  tinygltf::Primitive primitive;
  primitive.mode = TINYGLTF_MODE_TRIANGLES;
  primitive.attributes["POSITION"] = buffer.add_positions(positions);
  primitive.attributes["NORMAL"] = buffer.add(normals, TINYGLTF_COMPONENT_TYPE_FLOAT,
                                              TINYGLTF_TYPE_VEC3, TINYGLTF_TARGET_ARRAY_BUFFER);

  if (options.field && is_wall(part.kind)) {
    const ColourScale scale = scale_of(*options.field);
    std::vector<Eigen::Vector4f> colours;
    for (const int k : arrays.points) {
      const Vec3 rgb = linear_from_srgb(scale.colour(options.field->values[k]));
      colours.emplace_back(rgb.homogeneous().cast<float>());
    }
    primitive.attributes["COLOR_0"] = buffer.add(colours, TINYGLTF_COMPONENT_TYPE_FLOAT,
                                                 TINYGLTF_TYPE_VEC4, TINYGLTF_TARGET_ARRAY_BUFFER);
    primitive.material = material_index(model, "field", Vec3::Ones());
  } else {
    primitive.material = material_index(model, valid_utf8(part.name), part_colour(part));
  }
  primitive.indices = buffer.add_indices(arrays.indices, arrays.points.size());

  tinygltf::Mesh gltf_mesh;
  gltf_mesh.name = valid_utf8(part.name);
  gltf_mesh.primitives.push_back(std::move(primitive));
  tinygltf::Node node;
  node.name = gltf_mesh.name;
  node.mesh = static_cast<int>(model.meshes.size());
  node.extras =
      tinygltf::Value(tinygltf::Value::Object{{"kind", tinygltf::Value(to_string(part.kind))},
                                              {"radius_mm", tinygltf::Value(part.radius_mm)}});
  model.meshes.push_back(std::move(gltf_mesh));
  model.nodes[0].children.push_back(static_cast<int>(model.nodes.size()));
  model.nodes.push_back(std::move(node));
}

tinygltf::Node root_node(const GlbOptions& options) {
  tinygltf::Node root;
  root.name = valid_utf8(options.name);
  if (options.field) {
    const ColourScale scale = scale_of(*options.field);
    root.extras = tinygltf::Value(
        tinygltf::Value::Object{{"field", tinygltf::Value(valid_utf8(options.field->name))},
                                {"low", tinygltf::Value(scale.low)},
                                {"high", tinygltf::Value(scale.high)}});
  }
  return root;
}

}  // namespace

Vec3 gltf_from_world(const Vec3& point_mm) { return turned(point_mm) / 1000.0; }

Result<std::string> mesh_to_glb(const TriangleMesh& mesh, const GlbOptions& options) {
  EXPECTS(!find_defect(mesh));
  EXPECTS(!options.field || options.field->values.size() == mesh.points_mm.cols());
  if (mesh.triangles.cols() == 0) {
    return fail({ErrorKind::kFailed, "there is nothing to write", "glTF", "0 triangles", {}});
  }
  tinygltf::Model model;
  model.asset.version = "2.0";
  model.asset.generator = "angiospline " + version();
  model.scenes.resize(1);
  model.scenes[0].nodes = {0};
  model.defaultScene = 0;
  model.nodes.push_back(root_node(options));

  BufferBuilder buffer(model);
  const std::vector<PartArrays> parts = arrays_of_parts(mesh);
  for (std::size_t p = 0; p < parts.size(); ++p) {
    if (!parts[p].indices.empty()) add_part(model, buffer, mesh, p, parts[p], options);
  }
  if (buffer.size() > std::numeric_limits<std::uint32_t>::max() - (64U << 20U)) {
    return fail({ErrorKind::kFailed, "mesh is too large for one binary glTF file", "glTF",
                 std::to_string(buffer.size()) + " bytes", "a GLB holds less than 4 GB"});
  }

  buffer.finish();
  std::ostringstream stream;
  if (!tinygltf::TinyGLTF().WriteGltfSceneToStream(&model, stream, false, true) || !stream) {
    return fail({ErrorKind::kFailed, "the glTF library refused the model", "glTF", {}, {}});
  }
  return std::move(stream).str();
}

Result<void> write_glb(const std::filesystem::path& path, const TriangleMesh& mesh,
                       const GlbOptions& options) {
  const Result<std::string> bytes = mesh_to_glb(mesh, options);
  if (!bytes) return fail(bytes.error());
  std::vector<unsigned char> copy(bytes->begin(), bytes->end());
  tinygltf::Model model;
  std::string error;
  std::string warning;
  if (!tinygltf::TinyGLTF().LoadBinaryFromMemory(&model, &error, &warning, copy.data(),
                                                 static_cast<unsigned>(copy.size())) ||
      !warning.empty()) {
    return fail(
        {ErrorKind::kFailed, "the file does not read back", path.string(), error + warning, {}});
  }
  return write_file(path, *bytes);
}

}  // namespace angiospline
