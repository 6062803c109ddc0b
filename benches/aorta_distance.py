#!/usr/bin/env python3
"""How far a reference surface lies from a fitted model of the same image.

    angiospline recover DATA/volumes/vmtk_aorta.mha -o OUT
    /usr/bin/python3 benches/aorta_distance.py DATA/volumes/vmtk_aorta.mha DATA/surfaces/aorta-final-levelset.mha OUT/model.stl

The reference is the zero surface of the level set; distances run from its points to the nearest sample of the
model, in millimetres. It follows the image where a profile of grey values across it, between the levels 1.8 to
3 mm on either side, sums up to a wall within 0.5 mm of it and the contrast is at least 40 % of the median's.
Needs numpy, scipy and scikit-image.
"""
import re
import struct
import sys
import zlib

import numpy as np
from scipy.ndimage import map_coordinates
from scipy.spatial import cKDTree
from skimage.measure import marching_cubes

TYPES = {"MET_FLOAT": "<f4", "MET_DOUBLE": "<f8", "MET_SHORT": "<i2", "MET_UCHAR": "u1"}


def read_mha(path):
    data = open(path, "rb").read()
    at = data.index(b"\n", data.index(b"ElementDataFile = LOCAL")) + 1
    head = dict(line.split(" = ", 1) for line in data[:at].decode("latin1").splitlines() if " = " in line)
    body = zlib.decompress(data[at:]) if head.get("CompressedData") == "True" else data[at:]
    size = [int(x) for x in head["DimSize"].split()]
    voxels = np.frombuffer(body, TYPES[head["ElementType"].strip()], count=int(np.prod(size)))
    numbers = lambda key: np.array([float(x) for x in head[key].split()])
    return (voxels.reshape(size[::-1]).astype(float), numbers("ElementSpacing"), numbers("Offset"),
            numbers("TransformMatrix").reshape(3, 3))


def read_stl(path):
    data = open(path, "rb").read()
    if data[:5] == b"solid" and b"facet" in data[:400]:
        found = re.findall(rb"vertex\s+(\S+)\s+(\S+)\s+(\S+)", data)
        return np.array(found, dtype=float).reshape(-1, 3, 3)
    count = struct.unpack("<I", data[80:84])[0]
    kind = np.dtype([("n", "<f4", 3), ("v", "<f4", (3, 3)), ("a", "<u2")])
    return np.frombuffer(data[84:], kind, count=count)["v"].astype(float)


def main(image_path, level_path, model_path):
    image, spacing, offset, direction = read_mha(image_path)
    level = read_mha(level_path)[0]
    index = marching_cubes(level, 0.0)[0]  # z, y, x
    points = (index[:, ::-1] * spacing) @ direction + offset
    triangles = read_stl(model_path)
    weights = [(i / 8, j / 8, 1 - (i + j) / 8) for i in range(9) for j in range(9 - i)]
    samples = np.concatenate([np.einsum("c,ncx->nx", w, triangles) for w in np.array(weights)])
    distance = cKDTree(samples).query(points)[0]

    step = spacing[::-1]
    slope = np.stack([map_coordinates(g / s, index.T, order=1) for g, s in zip(np.gradient(level), step)], 1)
    normal = slope / np.linalg.norm(slope, axis=1, keepdims=True)
    grey = lambda s: map_coordinates(image, (index + s * normal / step).T, order=1, mode="nearest")
    inside = np.mean([grey(-s) for s in (1.8, 2.4, 3.0)], 0)
    outside = np.mean([grey(s) for s in (1.8, 2.4, 3.0)], 0)
    contrast = inside - outside
    profile = np.mean([grey(s) for s in np.linspace(-1.2, 1.2, 17)], 0)
    wall = (profile - outside) / np.where(contrast > 0, contrast, np.inf) * 2.4 - 1.2
    follows = (contrast > 0.4 * np.median(contrast)) & (np.abs(wall) < 0.5)

    voxel = float(np.cbrt(np.prod(spacing)))
    for name, d in (("all of it", distance), ("where it follows the image", distance[follows])):
        print(f"{name}: {len(d)} points, mean {d.mean():.3f} mm ({d.mean() / voxel:.2f} voxel), "
              f"median {np.median(d):.3f} mm, 95 % below {np.percentile(d, 95):.2f} mm")


if __name__ == "__main__":
    main(*sys.argv[1:4])
