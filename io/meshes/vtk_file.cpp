#include "io/meshes/vtk_file.h"

#include <algorithm>
#include <map>

#include <vtkCellArray.h>
#include <vtkCellData.h>
#include <vtkDoubleArray.h>
#include <vtkFieldData.h>
#include <vtkFloatArray.h>
#include <vtkIdList.h>
#include <vtkIntArray.h>
#include <vtkNew.h>
#include <vtkPointData.h>
#include <vtkPoints.h>
#include <vtkPolyData.h>
#include <vtkStringArray.h>
#include <vtkUnstructuredGrid.h>
#include <vtkXMLPolyDataReader.h>
#include <vtkXMLPolyDataWriter.h>
#include <vtkXMLUnstructuredGridReader.h>
#include <vtkXMLUnstructuredGridWriter.h>

#include "base/atomic_file.h"
#include "base/contract.h"
#include "io/text/text_encoding.h"
#include "io/text/text_file.h"
#include "io/text/vtk_xml.h"

namespace angiospline {
namespace {

vtkNew<vtkPoints> vtk_points(const Points3& points_mm) {
  vtkNew<vtkPoints> points;
  points->SetDataTypeToDouble();
  points->SetNumberOfPoints(points_mm.cols());
  for (Eigen::Index k = 0; k < points_mm.cols(); ++k) {
    points->SetPoint(k, points_mm(0, k), points_mm(1, k), points_mm(2, k));
  }
  return points;
}

vtkNew<vtkCellArray> vtk_triangles(const Eigen::Matrix3Xi& triangles) {
  vtkNew<vtkCellArray> cells;
  for (const auto& t : triangles.colwise()) {
    cells->InsertNextCell({vtkIdType{t[0]}, vtkIdType{t[1]}, vtkIdType{t[2]}});
  }
  return cells;
}

void add_mesh_arrays(vtkPointSet& set, const TriangleMesh& mesh,
                     const std::vector<MeshField>& fields) {
  vtkNew<vtkIntArray> face_id;
  vtkNew<vtkIntArray> entity_id;
  face_id->SetName("ModelFaceID");
  entity_id->SetName("CellEntityIds");
  std::vector<int> entity_of;
  int next_cap = 2;
  for (const MeshPart& part : mesh.parts) entity_of.push_back(is_wall(part.kind) ? 1 : next_cap++);
  for (const int part : mesh.part_of) {
    face_id->InsertNextValue(part + 1);
    entity_id->InsertNextValue(entity_of[static_cast<std::size_t>(part)]);
  }
  set.GetCellData()->AddArray(face_id);
  set.GetCellData()->AddArray(entity_id);

  vtkNew<vtkStringArray> names;
  names->SetName("FaceNames");
  for (const MeshPart& part : mesh.parts) names->InsertNextValue(valid_utf8(part.name));
  set.GetFieldData()->AddArray(names);

  if (mesh.normals.cols() > 0) {
    vtkNew<vtkFloatArray> normals;
    normals->SetName("Normals");
    normals->SetNumberOfComponents(3);
    for (const auto& n : mesh.normals.colwise()) normals->InsertNextTuple3(n[0], n[1], n[2]);
    set.GetPointData()->SetNormals(normals);
  }

  for (const MeshField& field : fields) {
    vtkNew<vtkDoubleArray> values;
    values->SetName(valid_utf8(field.name).c_str());
    for (const double v : field.values) values->InsertNextValue(v);
    set.GetPointData()->AddArray(values);
  }
}

Error unreadable(const std::filesystem::path& path, std::string what, std::string rule) {
  return {ErrorKind::kBadInput, std::move(what), path.string(), {}, std::move(rule)};
}

// Reads `path` with VTK's reader; what it says is said again by our error.
template <typename Reader>
bool read_xml(Reader& reader, const std::filesystem::path& path) {
  const Result<std::string> bytes = read_file(path);
  if (!bytes) return false;
  vtkObject::GlobalWarningDisplayOff();
  reader.ReadFromInputStringOn();
  reader.SetInputString(*bytes);
  reader.Update();
  return reader.GetErrorCode() == 0 && reader.GetOutput()->GetNumberOfPoints() > 0;
}

TriangleMesh mesh_of(vtkPointSet& set) {
  TriangleMesh mesh;
  mesh.points_mm.resize(3, set.GetNumberOfPoints());
  for (vtkIdType k = 0; k < set.GetNumberOfPoints(); ++k)
    set.GetPoint(k, mesh.points_mm.col(k).data());

  auto* ids = vtkIntArray::SafeDownCast(set.GetCellData()->GetArray("ModelFaceID"));
  auto* names = vtkStringArray::SafeDownCast(set.GetFieldData()->GetAbstractArray("FaceNames"));
  std::map<int, int> part_of_id;
  if (ids == nullptr) mesh.parts.push_back({"surface", PartKind::kBody, 0.0});

  std::vector<Eigen::Vector3i> triangles;
  vtkNew<vtkIdList> points;
  for (vtkIdType c = 0; c < set.GetNumberOfCells(); ++c) {
    set.GetCellPoints(c, points);
    const int type = set.GetCellType(c);
    const vtkIdType count = points->GetNumberOfIds();
    const bool strip = type == VTK_TRIANGLE_STRIP;
    if (count < 3 || !(strip || type == VTK_TRIANGLE || type == VTK_POLYGON || type == VTK_QUAD))
      continue;

    // Parts are numbered in the order in which their ids are met.
    int part = 0;
    if (ids != nullptr) {
      const int id = ids->GetValue(c);
      const auto [found, is_new] = part_of_id.try_emplace(id, static_cast<int>(mesh.parts.size()));
      part = found->second;
      if (is_new) {
        const bool named = names != nullptr && id >= 1 && id <= names->GetNumberOfValues();
        const std::string name =
            named ? std::string(names->GetValue(id - 1)) : "face_" + std::to_string(id);
        mesh.parts.push_back({name, part_kind_of_name(name), 0.0});
      }
    }

    // A polygon is a fan from its first point; in a strip every second triangle is turned.
    for (vtkIdType k = 1; k + 1 < count; ++k) {
      const vtkIdType first = strip ? k - 1 : 0;
      Eigen::Vector3i t(static_cast<int>(points->GetId(first)), static_cast<int>(points->GetId(k)),
                        static_cast<int>(points->GetId(k + 1)));
      if (strip && k % 2 == 0) std::swap(t[0], t[1]);
      triangles.push_back(t);
      mesh.part_of.push_back(part);
    }
  }

  mesh.triangles.resize(3, static_cast<Eigen::Index>(triangles.size()));
  for (std::size_t t = 0; t < triangles.size(); ++t) {
    mesh.triangles.col(static_cast<Eigen::Index>(t)) = triangles[t];
  }
  return mesh;
}

}  // namespace

Result<void> write_vtk_mesh(const std::filesystem::path& path, const TriangleMesh& mesh,
                            const std::vector<MeshField>& fields) {
  EXPECTS(!find_defect(mesh));
  for (const MeshField& field : fields) EXPECTS(field.values.size() == mesh.points_mm.cols());
  const std::string suffix = lower_case(path.extension().string());
  if (suffix == ".vtp") {
    vtkNew<vtkPolyData> data;
    data->SetPoints(vtk_points(mesh.points_mm));
    data->SetPolys(vtk_triangles(mesh.triangles));
    add_mesh_arrays(*data, mesh, fields);
    vtkNew<vtkXMLPolyDataWriter> writer;
    writer->SetInputData(data);
    return write_vtk_xml(path, *writer);
  }

  if (suffix == ".vtu") {
    vtkNew<vtkUnstructuredGrid> data;
    data->SetPoints(vtk_points(mesh.points_mm));
    data->SetCells(VTK_TRIANGLE, vtk_triangles(mesh.triangles));
    add_mesh_arrays(*data, mesh, fields);
    vtkNew<vtkXMLUnstructuredGridWriter> writer;
    writer->SetInputData(data);
    return write_vtk_xml(path, *writer);
  }
  return fail({ErrorKind::kCannotWrite, "unknown suffix", path.string(), path.extension().string(),
               "surfaces go to .vtp or .vtu"});
}

Result<TriangleMesh> read_vtk_mesh(const std::filesystem::path& path) {
  if (const auto bytes = read_file(path); !bytes) return fail(bytes.error());
  TriangleMesh mesh;
  if (lower_case(path.extension().string()) == ".vtu") {
    vtkNew<vtkXMLUnstructuredGridReader> reader;
    if (read_xml(*reader, path)) mesh = mesh_of(*reader->GetOutput());
  } else {
    vtkNew<vtkXMLPolyDataReader> reader;
    if (read_xml(*reader, path)) mesh = mesh_of(*reader->GetOutput());
  }

  if (mesh.triangles.cols() == 0) {
    return fail(unreadable(path, "no triangles could be read", "a VTK XML file with a surface"));
  }
  if (auto error = find_defect(mesh)) {
    error->where = path.string() + ": " + error->where;
    return fail(*error);
  }
  return mesh;
}

}  // namespace angiospline
