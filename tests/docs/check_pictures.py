#!/usr/bin/env python3
"""The pictures of the pages: each is used, together they are small, and the script that draws them still draws a model
right side out.

Usage: check_pictures.py ROOT PROGRAM. Exit code 77 where numpy or Pillow is missing.
"""
import glob
import os
import re
import subprocess
import sys
import tempfile

MOST_BYTES = 2_000_000
LEAST_DRAWN = 0.05   # share of the picture
MOST_INSIDE = 0.002  # share of what is drawn that shows a surface from inside


def page_faults(root):
    pictures = glob.glob(os.path.join(root, "docs/**/*.png"), recursive=True)
    text = ""
    for page in glob.glob(os.path.join(root, "*.md")) + glob.glob(os.path.join(root, "docs/*.md")):
        with open(page, encoding="utf-8") as file:
            text += file.read()
    used = {os.path.basename(name) for name in re.findall(r"!\[[^\]]*\]\(([^)]+)\)", text)}
    faults = [f"no page shows {os.path.relpath(p, root)}" for p in pictures if os.path.basename(p) not in used]
    total = sum(os.path.getsize(p) for p in pictures)
    if total > MOST_BYTES:
        faults.append(f"the pictures have {total} bytes, {MOST_BYTES} at most")
    print(f"{len(pictures)} pictures, {total} bytes")
    return faults


def shares(render_surface, surface):
    """How much of the picture is drawn, and how much of that shows an inside: all but the colour is left out."""
    surface.colours[:] = (1.0, 0.6, 0.2)
    picture = render_surface.render(surface, 160)
    drawn = (picture[..., :3] < 0.99).any(2)
    inside = drawn & (picture[..., 2] > picture[..., 0] + 0.02)
    return drawn.mean(), inside.sum() / max(drawn.sum(), 1)


def drawing_faults(root, program):
    import render_surface
    with tempfile.TemporaryDirectory() as folder:
        model = os.path.join(folder, "graft.glb")
        subprocess.run([program, "seed", os.path.join(root, "samples/y_graft.tree"), "-o", model], check=True,
                       stderr=subprocess.DEVNULL)
        drawn, inside = shares(render_surface, render_surface.read_glb(model))
        turned = render_surface.read_glb(model)
        turned.normals = -turned.normals
        _, turned_inside = shares(render_surface, turned)
    print(f"{drawn:.3f} of the picture is drawn, {inside:.4f} of it from inside; {turned_inside:.3f} when turned inside out")
    faults = []
    if drawn < LEAST_DRAWN:
        faults.append("the picture is empty")
    if inside > MOST_INSIDE:
        faults.append("the model shows its inside")
    if turned_inside < 0.9:
        faults.append("a model turned inside out would pass")
    return faults


def main():
    root, program = sys.argv[1], sys.argv[2]
    faults = page_faults(root)
    sys.dont_write_bytecode = True
    sys.path.insert(0, os.path.join(root, "scripts"))
    try:
        import numpy  # noqa: F401
        from PIL import Image  # noqa: F401
        is_able = True
    except ImportError:
        is_able = False
    if is_able:
        faults += drawing_faults(root, program)
    print("\n".join(faults))
    if faults:
        sys.exit(1)
    if not is_able:
        print("skipped: numpy or Pillow is not installed (python3-numpy, python3-pil)")
        sys.exit(77)


if __name__ == "__main__":
    main()
