// Centerlines as VTK's XML polydata (.vtp), as VMTK and 3D Slicer read them.
#pragma once

#include <filesystem>

#include "base/result.h"
#include "modeling/tree/centerline_tree.h"

namespace angiospline {

// Writes one polyline for each branch: point array MaximumInscribedSphereRadius; cell arrays
// BranchId, FromNode, ToNode and Name. Each branch has its own points: radii at a node may differ.
Result<void> write_vtk_centerlines(const std::filesystem::path& path, const CenterlineTree& tree);

}  // namespace angiospline
