#!/usr/bin/env python3
"""Makes the pictures of docs/gallery.md from the program's own output: samples, junctions, phantoms, a fit.

Usage: make_gallery.py PROGRAM [PICTURES [FOLDER]]   (default: docs/images; a temporary folder for the models)
Needs python3-numpy and python3-pil (scripts/packages-dev.txt). `make gallery` runs it.
"""
import os
import subprocess
import sys
import tempfile

import numpy as np

import render_surface as rs

ROOT = os.path.dirname(os.path.dirname(os.path.abspath(__file__)))
LENGTH = 15.0  # of a junction's branches, in mm
WIDEST = 3.0   # radius, in mm


def unit(v):
    return np.array(v, float) / np.linalg.norm(v)


def in_plane(degrees):
    return np.array([np.cos(np.radians(degrees)), 0, np.sin(np.radians(degrees))])


def spread(count, least_deg, seed):
    """Random directions, none nearer to another than the angle."""
    random = np.random.default_rng(seed)
    while True:
        d = random.normal(size=(count, 3))
        d /= np.linalg.norm(d, axis=1, keepdims=True)
        angles = np.degrees(np.arccos(np.clip(d @ d.T, -1, 1))) + 180 * np.eye(count)
        if angles.min() > least_deg:
            return list(d), list(random.uniform(0.4, 1, count))


def one_sided(count, seed):
    random = np.random.default_rng(seed)
    while True:
        d, r = spread(count, 35, random.integers(1 << 30))
        if min(v[2] for v in d) > 0.1:
            return d, r


def junctions():
    """One junction for each class of benches/junction_classes.cpp: directions and shares of the widest radius."""
    cone = [unit([np.sin(0.7) * np.cos(t), np.sin(0.7) * np.sin(t), np.cos(0.7)]) for t in (0.1, 2.2, 4.1)]
    return {
        "ordinary": ([in_plane(-90), in_plane(50), in_plane(125)], [1, 0.8, 0.6]),
        "acute": ([in_plane(-90), in_plane(76), in_plane(102)], [1, 0.8, 0.7]),
        "one_sided_3": one_sided(3, 3),
        "one_sided_4": one_sided(4, 5),
        "cone_3": ([np.array([0, 0, -1.0]), *cone], [1, 0.7, 0.6, 0.5]),
        "random_4": spread(4, 40, 1),
        "random_5": spread(5, 40, 2),
        "random_6": spread(6, 40, 3),
        "random_8": spread(8, 35, 4),
        "twig": ([in_plane(180), in_plane(-15), in_plane(70)], [1, 0.9, 0.2]),
        "collinear": ([in_plane(180), in_plane(0), in_plane(65)], [1, 1, 0.6]),
        "planar": ([in_plane(0), in_plane(45), in_plane(95), in_plane(150)], [0.9, 0.6, 0.8, 0.7]),
    }


def tree_definition(directions, shares):
    lines = ["unit mm", "node center 0 0 0"]
    for k, d in enumerate(directions):
        lines.append("node end{} {:.6f} {:.6f} {:.6f}".format(k, *(LENGTH * np.asarray(d))))
    for k, share in enumerate(shares):
        ends = f"end{k} center" if k == 0 else f"center end{k}"
        lines.append(f"branch b{k} {ends} {WIDEST * share:.6f}")
    return "\n".join(lines + ["inlet end0", ""])


class Gallery:
    def __init__(self, program, pictures, folder):
        self.program, self.pictures, self.folder = os.path.abspath(program), os.path.abspath(pictures), folder

    def run(self, *arguments, may_warn=False):
        """Exit code 1 means that something is not sound, which a picture must not hide."""
        done = subprocess.run([self.program, *arguments], cwd=self.folder, capture_output=True, text=True, check=False)
        if done.returncode != 0 and not (may_warn and done.returncode == 1):
            sys.exit(f"{' '.join(arguments)}\n{done.stdout}{done.stderr}")

    def file(self, name):
        return os.path.join(self.folder, name)

    def draw(self, name, *surfaces, size=440, frame=None):
        """Several surfaces beside each other, seen alike."""
        frame = rs.camera(surfaces[-1].points) if frame is None else frame
        box = np.vstack([s.points for s in surfaces])
        path = os.path.join(self.pictures, name + ".png")
        rs.save(np.hstack([rs.render(s, size, frame, box) for s in surfaces]), path)
        print(path, os.path.getsize(path))

    def samples(self):
        for name in ("figure_7_18.swc", "circle_of_willis.csv", "y_graft.tree"):
            stem = name.split(".", maxsplit=1)[0]
            self.run("seed", os.path.join(ROOT, "samples", name), "-o", stem + ".glb")
            self.draw("sample_" + stem, rs.read_glb(self.file(stem + ".glb")))

    def junction_classes(self):
        for name, (directions, shares) in junctions().items():
            with open(self.file(name + ".tree"), "w", encoding="utf-8") as file:
                file.write(tree_definition(directions, shares))
            self.run("seed", name + ".tree", "-o", name + ".glb")
            self.draw("junction_" + name, rs.read_glb(self.file(name + ".glb")), size=360)

    def phantoms(self):
        """What was found in a noisy image, and the model that was fitted to it."""
        self.run("phantom", "potato", "--snr", "8", "-o", "potato.nii.gz")
        self.run("segment", "potato.nii.gz", "-o", "potato.nrrd")
        self.run("fit", "potato.nrrd", "potato.nii.gz", "-o", "potato.glb")
        self.draw("phantom_potato", rs.read_mask(self.file("potato.nrrd")), rs.read_glb(self.file("potato.glb")), size=400)
        for kind in ("cylinder", "bent-vessel", "bifurcation", "tree", "rings"):
            self.run("phantom", kind, "--snr", "8", "-o", kind + ".nii.gz")
            self.run("recover", kind + ".nii.gz", "-o", kind, may_warn=kind == "rings")
            self.draw("phantom_" + kind.replace("-", "_"), rs.read_mask(self.file(kind + "/mask.nrrd")),
                      rs.read_glb(self.file(kind + "/model.glb")), size=400)

    def fit(self):
        """Mask, model built from its centerlines, model fitted to the image with what is left in colours."""
        self.run("phantom", "tree", "--snr", "4", "--random-seed", "3", "-o", "noisy.nii.gz")
        self.run("recover", "noisy.nii.gz", "--no-fit", "-o", "before")
        self.run("fit", "before/model.json", "noisy.nii.gz", "-o", "after.json", "--residual", "left.glb")
        self.draw("fit_before_after", rs.read_mask(self.file("before/mask.nrrd")),
                  rs.read_glb(self.file("before/model.glb")), rs.read_glb(self.file("left.glb")), size=400)

    def tutorial(self):
        with open(os.path.join(ROOT, "docs/tutorial.md"), encoding="utf-8") as file:
            table = file.read().partition("mine.csv <<'END'\n")[2].partition("END\n")[0]
        with open(self.file("mine.csv"), "w", encoding="utf-8") as file:
            file.write(table)
        self.run("seed", "mine.csv", "-o", "mine.glb")
        self.draw("tutorial_fork", rs.read_glb(self.file("mine.glb")), size=360)


def main():
    if len(sys.argv) < 2:
        sys.exit(__doc__)
    pictures = sys.argv[2] if len(sys.argv) > 2 else os.path.join(ROOT, "docs/images")
    with tempfile.TemporaryDirectory() as temporary:
        folder = sys.argv[3] if len(sys.argv) > 3 else temporary
        os.makedirs(folder, exist_ok=True)
        gallery = Gallery(sys.argv[1], pictures, folder)
        for part in (gallery.samples, gallery.junction_classes, gallery.tutorial, gallery.phantoms, gallery.fit):
            part()


if __name__ == "__main__":
    main()
