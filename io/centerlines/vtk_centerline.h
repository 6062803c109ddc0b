// Polylines with radii in VTK's files: .vtp (XML) and legacy .vtk, as VMTK and 3D Slicer write
// them.
#pragma once

#include <string_view>

#include "base/result.h"
#include "io/reading/reader_options.h"
#include "modeling/tree/centerline_tree.h"

namespace angiospline {

// The radius is the point array MaximumInscribedSphereRadius, else Radius, else radius; without
// one: an error that lists the arrays. Lines that share points are a graph as it is; otherwise
// lines that overlap within a quarter of the radius are merged, and an end inside another line's
// lumen is joined to it. ASCII, base64 and raw data, inline and appended, zlib-compressed or not;
// both byte orders. The frame is what "SPACE=" in the header says. Errors: no lines, claims larger
// than the file can hold, data cut short, an unknown compressor, indices out of range, radii that
// are not positive.
Result<CenterlineTree> parse_vtp_centerline(std::string_view bytes, std::string_view name,
                                            const CenterlineFileOptions& options = {});
Result<CenterlineTree> parse_vtk_centerline(std::string_view bytes, std::string_view name,
                                            const CenterlineFileOptions& options = {});

}  // namespace angiospline
