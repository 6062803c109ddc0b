#include "io/centerlines/vtp_writer.h"

#include <vtkCellArray.h>
#include <vtkCellData.h>
#include <vtkDoubleArray.h>
#include <vtkIntArray.h>
#include <vtkNew.h>
#include <vtkPointData.h>
#include <vtkPoints.h>
#include <vtkPolyData.h>
#include <vtkStringArray.h>
#include <vtkXMLPolyDataWriter.h>

#include "io/text/text_encoding.h"
#include "io/text/vtk_xml.h"

namespace angiospline {

Result<void> write_vtk_centerlines(const std::filesystem::path& path, const CenterlineTree& tree) {
  vtkNew<vtkPoints> points;
  points->SetDataTypeToDouble();
  vtkNew<vtkCellArray> lines;
  vtkNew<vtkDoubleArray> radius;
  radius->SetName("MaximumInscribedSphereRadius");

  vtkNew<vtkIntArray> id;
  vtkNew<vtkIntArray> from;
  vtkNew<vtkIntArray> to;
  vtkNew<vtkStringArray> name;
  id->SetName("BranchId");
  from->SetName("FromNode");
  to->SetName("ToNode");
  name->SetName("Name");

  for (std::size_t b = 0; b < tree.branches.size(); ++b) {
    const CenterlineBranch& branch = tree.branches[b];
    lines->InsertNextCell(static_cast<int>(branch.points_mm.cols()));
    for (Eigen::Index k = 0; k < branch.points_mm.cols(); ++k) {
      lines->InsertCellPoint(points->InsertNextPoint(branch.points_mm.col(k).data()));
      radius->InsertNextValue(branch.radii_mm[k]);
    }
    id->InsertNextValue(static_cast<int>(b));
    from->InsertNextValue(branch.from);
    to->InsertNextValue(branch.to);
    name->InsertNextValue(valid_utf8(branch.name));
  }

  vtkNew<vtkPolyData> data;
  data->SetPoints(points);
  data->SetLines(lines);
  data->GetPointData()->AddArray(radius);
  data->GetCellData()->AddArray(id);
  data->GetCellData()->AddArray(from);
  data->GetCellData()->AddArray(to);
  data->GetCellData()->AddArray(name);

  vtkNew<vtkXMLPolyDataWriter> writer;
  writer->SetInputData(data);
  return write_vtk_xml(path, *writer);
}

}  // namespace angiospline
