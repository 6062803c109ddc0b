#!/usr/bin/env bash
# Runs the program on the samples, on phantoms and, where ANGIOSPLINE_DATA names it, on real data, and leaves one
# checksum a file. Two states of the code compute the same where their lists are the same:
#   scripts/record_results.sh build/release/cli/angiospline out/before   (build the other state)
#   scripts/record_results.sh build/release/cli/angiospline out/after
#   diff out/before/checksums.txt out/after/checksums.txt
# Usage: record_results.sh PROGRAM OUTDIR [quick]
set -uo pipefail
program=$(realpath "$1")
mkdir -p "$2"
out=$(realpath "$2")
samples=$(cd "$(dirname "${BASH_SOURCE[0]}")/../samples" && pwd)
data=${ANGIOSPLINE_DATA:-}
cd "$out"

# run NAME ARGUMENTS...: what the command prints and its exit code, without what differs from run to run: times.
run() {
  local name=$1 code
  shift
  echo "$name" >&2
  "$program" "$@" >"$name.out" 2>"$name.err"
  code=$?
  /usr/bin/python3 - "$name.out" "$code" <<'PYTHON'
import json
import re
import sys


def without_times(pairs):
    return {key: value for key, value in pairs if key != "seconds"}


path, code = sys.argv[1:]
text = open(path).read()
try:
    text = json.dumps(json.loads(text, object_pairs_hook=without_times), indent=1)
except ValueError:
    text = re.sub(r"[0-9.]+ m?s\b", "_ s", text)  # the tables of `reproduce` tell how long each took
open(path, "w").write(f"{text}\nexit code {code}\n")
PYTHON
}

formats() { echo "$1.json $1.step $1.igs $1.brep $1.glb $1.stl $1.vtp $1.html $1.geo"; }

for sample in figure_7_18.swc circle_of_willis.csv y_graft.tree; do
  run "seed_${sample%.*}" seed "$samples/$sample" -o $(formats "${sample%.*}") --json
done
run seed_extended seed "$samples/figure_7_18.swc" --extend-outlets 5 --extend-inlets 3 -o extended.json --json
run check_tree check circle_of_willis.step --json
run compare_tree compare figure_7_18.json figure_7_18.step --json
run smooth_tree smooth figure_7_18.json -o smoothed.json --json
run phantom_bifurcation phantom bifurcation --snr 8 -o head.nii.gz --truth truth.nrrd
run segment segment head.nii.gz --seed 63.5,63.5,30 -o mask.nrrd --json
run thin thin mask.nrrd -o skeleton.nrrd --json
run graph graph skeleton.nrrd -o graph.graphml --json
run compare_masks compare-masks truth.nrrd mask.nrrd --json
run recover recover head.nii.gz --seed 63.5,63.5,30 -o head --json
run fit fit head/model.json head.nii.gz -o fitted.json --residual left.glb --json
run phantom_potato phantom potato --snr 4 -o potato.nii.gz --truth potato.nrrd
run fit_closed fit potato.nrrd potato.nii.gz -o sac.json --json
run fit_sparse fit head/model.json head.nii.gz --solver sparse -o sparse.json --json
if [ "${3:-}" != quick ]; then run reproduce reproduce 7.1; fi
if [ -n "$data" ]; then
  lines=$data/centerlines
  run seed_ica seed "$lines/example_centerline_ICA.swc" -o ica.json ica.step --json
  run seed_aorta seed "$lines/aorta-centerline.vtp" -o aorta.json aorta.step --json
  run seed_carotid seed "$lines/carotid_left_centerline.vtp" -o carotid.json --json
  run seed_iliac seed "$lines/aorta.pth" "$lines/right_iliac.pth" -o iliac --json
  if [ "${3:-}" != quick ]; then
    run seed_bh0005 seed "$lines/BH0005.swc" --clearance 0.1 -o bh0005.json --json
    run seed_vascusynth seed "$lines/vascusynth_N200_tree_structure.xml" -o vascusynth.json --json
    run recover_aorta recover "$data/volumes/vmtk_aorta.mha" -o aorta_image --json
    run recover_mra recover "$data/volumes/chris_MRA.nii.gz" -o mra --json
  fi
fi
# Reports, records and summaries tell times.
find . -type f ! -name '*.err' ! -name checksums.txt ! -name 'report*' ! -name 'summary.*' ! -name '*.seed.json' | sort | xargs sha256sum >checksums.txt
wc -l <checksums.txt >&2
