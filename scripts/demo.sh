#!/usr/bin/env bash
# The main job on built-in samples: an image and a centerline file become CAD solids.
# Usage: demo.sh PROGRAM FOLDER
set -euo pipefail
program=$1
out=$2
here=$(cd "$(dirname "${BASH_SOURCE[0]}")/.." && pwd)
mkdir -p "$out"
say() { printf '\n== %s\n' "$*"; }

say "1. A noisy image of a bifurcation (signal to noise 8), made here"
"$program" phantom bifurcation --snr 8 -o "$out/bifurcation.nii.gz" \
  --truth "$out/bifurcation-truth.nrrd" --truth-tree "$out/bifurcation-truth.swc"

say "2. From the image to a CAD model: mask, skeleton, graph, surfaces, solid"
"$program" recover "$out/bifurcation.nii.gz" --seed 63.5,63.5,30 -o "$out/bifurcation"

say "3. From centerlines with radii to a CAD model: a small tree of vessels"
"$program" seed "$here/samples/figure_7_18.swc" \
  -o "$out/tree.step" "$out/tree.iges" "$out/tree.glb" "$out/tree.stl" "$out/tree.json" "$out/tree.html"

say "4. Both solids measured, from the files a CAD program will open"
for file in "$out/bifurcation/model.step" "$out/tree.step"; do
  echo "-- $file"
  "$program" check "$file"
done

say "Look at these"
cat <<TEXT
  $out/tree.step                  the tree as a solid for CAD and CFD: FreeCAD, gmsh, CATIA, SolidWorks ...
  $out/tree.html                  the same on a page: 3-D view, plots, tables; open it in a browser
  $out/tree.glb                   the same for glTF viewers (Blender, Windows 3D Viewer, three.js ...)
  $out/bifurcation/model.step     the solid recovered from the image
  $out/bifurcation/report.html    the same on a page, with projections of the image
  $out/bifurcation/mask.nrrd      what was segmented; open it with bifurcation.nii.gz in 3D Slicer
TEXT
