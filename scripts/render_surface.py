#!/usr/bin/env python3
"""Pictures of surfaces without a screen: a depth buffer and smooth shading, by numpy and Pillow.

Usage: render_surface.py MODEL.glb PICTURE.png [SIZE]; scripts/make_gallery.py uses it as a module.

Colours are the file's. The inside of a surface is drawn dark blue, so that one that is wrong side out cannot pass for
right; light comes from the file's own normals, so that a wrinkle of a few degrees shows.
"""
import gzip
import json
import struct
import sys

import numpy as np
from PIL import Image

INSIDE = np.array([0.16, 0.22, 0.45])
KEY = np.array([-0.35, 0.55, 0.76])
FILL = np.array([0.75, -0.1, 0.65])
OVERSAMPLE = 2
MARGIN = 0.04  # of the picture


class Surface:
    """Triangles with a colour and a normal at each corner point, in a right-handed world."""

    def __init__(self, points, normals, colours, triangles):
        self.points, self.normals, self.colours, self.triangles = points, normals, colours, triangles


def joined(surfaces):
    start, triangles = 0, []
    for s in surfaces:
        triangles.append(s.triangles + start)
        start += len(s.points)
    return Surface(*(np.vstack([getattr(s, part) for s in surfaces]) for part in ("points", "normals", "colours")),
                   np.vstack(triangles))


def read_glb(path):
    """All meshes of a file of ours (no transformations, positions and normals as floats)."""
    with open(path, "rb") as file:
        data = file.read()
    length = struct.unpack_from("<I", data, 12)[0]
    scene = json.loads(data[20:20 + length])
    binary = data[28 + length:]
    kinds = {5126: np.float32, 5125: np.uint32, 5123: np.uint16, 5121: np.uint8}
    widths = {"SCALAR": 1, "VEC3": 3, "VEC4": 4}

    def array(number):
        accessor = scene["accessors"][number]
        view = scene["bufferViews"][accessor["bufferView"]]
        kind, width = kinds[accessor["componentType"]], widths[accessor["type"]]
        at = view.get("byteOffset", 0) + accessor.get("byteOffset", 0)
        flat = np.frombuffer(binary, kind, accessor["count"] * width, at)
        return flat.reshape(-1, width) / (255.0 if kind == np.uint8 else 1)

    found = []
    for mesh in scene["meshes"]:
        for primitive in mesh["primitives"]:
            points = array(primitive["attributes"]["POSITION"]).astype(float)
            normals = array(primitive["attributes"]["NORMAL"]).astype(float)
            material = scene["materials"][primitive["material"]]
            base = np.array(material["pbrMetallicRoughness"].get("baseColorFactor", [1, 1, 1, 1])[:3], float)
            colours = np.tile(base, (len(points), 1))
            if "COLOR_0" in primitive["attributes"]:
                colours = colours * array(primitive["attributes"]["COLOR_0"])[:, :3]
            # glTF keeps colours linear; pictures do not.
            colours = np.clip(colours, 0, 1) ** (1 / 2.2)
            triangles = array(primitive["indices"]).astype(np.int64).reshape(-1, 3)
            found.append(Surface(points, normals, colours, triangles))
    return joined(found)


def read_mask(path, colour=(0.80, 0.62, 0.56)):
    """The faces of a mask's voxels, turned as the program's GLB files are: (x, y, z) mm to (x, z, -y) m."""
    with open(path, "rb") as file:
        header, _, body = file.read().partition(b"\n\n")
    fields = dict(line.split(": ", 1) for line in header.decode().split("\n") if ": " in line)
    if fields["encoding"].strip() in ("gzip", "gz"):
        body = gzip.decompress(body)
    sizes = [int(n) for n in fields["sizes"].split()]
    mask = np.frombuffer(body, np.uint8, int(np.prod(sizes))).reshape(sizes[::-1]).transpose(2, 1, 0) > 0
    axes = np.array([[float(x) for x in axis.strip("()").split(",")] for axis in fields["space directions"].split()])
    origin = np.array([float(x) for x in fields["space origin"].strip().strip("()").split(",")])
    padded = np.pad(mask, 1)
    points, normals = [], []
    for axis in range(3):
        for side in (0, 1):
            beside = np.roll(padded, 1 if side == 0 else -1, axis)
            at = np.argwhere(padded & ~beside) - 1
            u, v = (axis + 1) % 3, (axis + 2) % 3
            corners = np.zeros((4, 3))
            corners[:, axis] = side
            ring = [(0, 0), (1, 0), (1, 1), (0, 1)]
            for k, (a, b) in enumerate(ring if side else ring[::-1]):
                corners[k, u], corners[k, v] = a, b
            points.append((at[:, None, :] + corners[None] - 0.5).reshape(-1, 3))
            normal = np.zeros(3)
            normal[axis] = 2 * side - 1
            normals.append(np.tile(normal, (4 * len(at), 1)))
    index = np.vstack(points)
    world = origin + index @ axes
    turned = np.stack([world[:, 0], world[:, 2], -world[:, 1]], 1) / 1000
    n = np.vstack(normals) @ (axes / np.linalg.norm(axes, axis=1)[:, None])
    n = np.stack([n[:, 0], n[:, 2], -n[:, 1]], 1)
    quads = np.arange(len(index)).reshape(-1, 4)
    triangles = np.vstack([quads[:, [0, 1, 2]], quads[:, [0, 2, 3]]])
    return Surface(turned, n, np.tile(np.array(colour, float), (len(index), 1)), triangles)


def camera(points, tilt_deg=20, up=None):
    """Rows right, up, towards the eye: the two longest axes of the points across, a little from above and aside."""
    centred = points - points.mean(0)
    values, vectors = np.linalg.eigh(centred.T @ centred)
    eye = vectors[:, 0]
    eye = eye * (1 if eye[2] > 0 else -1)
    up = vectors[:, 2] if up is None else np.array(up, float)
    up = up * (1 if up[1] >= 0 else -1)
    right = np.cross(up, eye)
    right /= np.linalg.norm(right)
    up = np.cross(eye, right)
    a, b = np.radians([tilt_deg, -0.8 * tilt_deg])
    frame = np.array([right, up, eye])
    about_x = np.array([[1, 0, 0], [0, np.cos(a), -np.sin(a)], [0, np.sin(a), np.cos(a)]])
    about_y = np.array([[np.cos(b), 0, np.sin(b)], [0, 1, 0], [-np.sin(b), 0, np.cos(b)]])
    return about_x @ about_y @ frame


def shaded(colours, normals, depth_share):
    facing = normals[:, 2:3] > 0
    n = np.where(facing, normals, -normals)
    key, fill = (np.clip(n @ (light / np.linalg.norm(light)), 0, 1)[:, None] for light in (KEY, FILL))
    half = KEY / np.linalg.norm(KEY) + np.array([0, 0, 1])
    shine = np.clip(n @ (half / np.linalg.norm(half)), 0, 1)[:, None] ** 40
    edge = (1 - np.clip(n[:, 2:3], 0, 1)) ** 3
    base = np.where(facing, colours, INSIDE)
    lit = base * (0.28 + 0.62 * key + 0.22 * fill) * (1 - 0.45 * edge) + 0.22 * shine
    return np.clip(lit * (0.82 + 0.18 * depth_share), 0, 1)


def samples(surface, frame, scale, shift):
    """Points on the triangles, dense enough to leave no pixel out: places, depths, colours and normals."""
    seen = surface.points @ frame.T
    seen = seen * scale + shift
    normals = surface.normals @ frame.T
    corners = seen[surface.triangles]
    longest = np.max(np.linalg.norm(corners - np.roll(corners, 1, 1), axis=2)[:, :], axis=1)
    counts = np.clip(np.ceil(longest * 1.6).astype(int) + 1, 2, 400)
    out = []
    for count in np.unique(counts):
        chosen = surface.triangles[counts == count]
        i, j = np.meshgrid(np.arange(count), np.arange(count), indexing="ij")
        inside = i + j < count
        a, b = i[inside] / (count - 1), j[inside] / (count - 1)
        weights = np.stack([1 - a - b, a, b], 1)
        for part in np.array_split(chosen, max(1, len(chosen) * len(weights) // 2_000_000)):
            out.append([np.einsum("wk,tkc->twc", weights, values[part]).reshape(-1, 3)
                        for values in (seen, normals, surface.colours)])
    return [np.vstack(column) for column in zip(*out)]


def render(surface, size=440, frame=None, box=None):
    """A picture with a transparent background. `box`: points to fit into it (the surface's own otherwise)."""
    frame = camera(surface.points) if frame is None else frame
    big = size * OVERSAMPLE
    flat = (surface.points if box is None else box) @ frame.T
    low, high = flat.min(0), flat.max(0)
    extent = max(high[0] - low[0], high[1] - low[1])
    scale = big * (1 - 2 * MARGIN) / extent
    shift = np.array([big / 2, big / 2, 0]) - scale * np.array([*(low + high)[:2] / 2, 0])
    places, normals, colours = samples(surface, frame, scale, shift)
    normals /= np.maximum(np.linalg.norm(normals, axis=1, keepdims=True), 1e-12)

    # The nearest sample of each pixel: sorted from far to near, the last one written stays.
    x, y = np.floor(places[:, 0]).astype(int), big - 1 - np.floor(places[:, 1]).astype(int)
    kept = (x >= 0) & (x < big) & (y >= 0) & (y < big)
    pixel = (y * big + x)[kept]
    order = np.argsort(places[kept, 2], kind="stable")
    nearest = np.full(big * big, -1)
    nearest[pixel[order]] = np.flatnonzero(kept)[order]
    drawn = nearest >= 0
    chosen = nearest[drawn]
    depth = places[chosen, 2]
    share = (depth - depth.min()) / max(float(np.ptp(depth)), 1e-12)
    picture = np.zeros((big * big, 4))
    picture[drawn, :3] = shaded(colours[chosen], normals[chosen], share[:, None])
    picture[drawn, 3] = 1

    # Averages over pixels, of colours that count as much as they cover.
    picture[:, :3] *= picture[:, 3:]
    blocks = picture.reshape(size, OVERSAMPLE, size, OVERSAMPLE, 4).mean((1, 3))
    return blocks + (1 - blocks[..., 3:]) * np.array([1, 1, 1, 1.0])


def save(picture, path):
    """White where nothing is, cut to what is drawn, as a small PNG."""
    rgb = picture[..., :3]
    drawn = np.argwhere((rgb < 0.995).any(2))
    (top, left), (bottom, right) = np.maximum(drawn.min(0) - 8, 0), drawn.max(0) + 9
    image = Image.fromarray((np.clip(rgb[top:bottom, left:right], 0, 1) * 255 + 0.5).astype(np.uint8))
    image.quantize(160, method=Image.Quantize.MEDIANCUT, dither=Image.Dither.FLOYDSTEINBERG).save(path, optimize=True)


def main():
    if len(sys.argv) < 3:
        sys.exit(__doc__)
    size = int(sys.argv[3]) if len(sys.argv) > 3 else 440
    save(render(read_glb(sys.argv[1]), size), sys.argv[2])


if __name__ == "__main__":
    main()
