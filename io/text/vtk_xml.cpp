#include "io/text/vtk_xml.h"

#include <vtkXMLWriter.h>

#include "base/atomic_file.h"

namespace angiospline {

Result<void> write_vtk_xml(const std::filesystem::path& path, vtkXMLWriter& writer) {
  writer.WriteToOutputStringOn();
  writer.SetCompressorTypeToZLib();
  writer.EncodeAppendedDataOff();
  writer.SetHeaderTypeToUInt64();
  if (writer.Write() == 0) {
    return fail({ErrorKind::kCannotWrite, "VTK could not write the data", path.string(), {}, {}});
  }
  return write_file(path, writer.GetOutputString());
}

}  // namespace angiospline
