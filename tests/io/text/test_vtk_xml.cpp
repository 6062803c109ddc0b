#include <gtest/gtest.h>
#include <unistd.h>
#include <vtkNew.h>
#include <vtkPoints.h>
#include <vtkPolyData.h>
#include <vtkXMLPolyDataReader.h>
#include <vtkXMLPolyDataWriter.h>

#include "base/atomic_file.h"
#include "io/text/vtk_xml.h"

namespace angiospline {
namespace {

TEST(VtkXml, IsWrittenAsRawCompressedDataThatVtkReads) {
  vtkNew<vtkPoints> points;
  for (int k = 0; k < 1000; ++k) points->InsertNextPoint(k, 0, 0);
  vtkNew<vtkPolyData> data;
  data->SetPoints(points);
  vtkNew<vtkXMLPolyDataWriter> writer;
  writer->SetInputData(data);

  const std::filesystem::path path =
      std::filesystem::temp_directory_path() / ("vtk_xml_" + std::to_string(getpid()) + ".vtp");
  ASSERT_TRUE(write_vtk_xml(path, *writer));
  const std::string text = read_file(path).value();
  EXPECT_NE(text.find("compressor=\"vtkZLibDataCompressor\""), std::string::npos);
  EXPECT_NE(text.find("header_type=\"UInt64\""), std::string::npos);
  EXPECT_NE(text.find("<AppendedData encoding=\"raw\">"), std::string::npos);

  vtkNew<vtkXMLPolyDataReader> reader;
  reader->SetFileName(path.c_str());
  reader->Update();
  EXPECT_EQ(reader->GetOutput()->GetNumberOfPoints(), 1000);
  std::filesystem::remove(path);
}

TEST(VtkXml, AFolderThatDoesNotExistIsAnErrorOfWriting) {
  vtkNew<vtkPolyData> data;
  vtkNew<vtkXMLPolyDataWriter> writer;
  writer->SetInputData(data);
  const auto written = write_vtk_xml("no/such/folder/a.vtp", *writer);
  ASSERT_FALSE(written);
  EXPECT_EQ(written.error().kind, ErrorKind::kCannotWrite);
}

}  // namespace
}  // namespace angiospline
