"""Draws junctions from two sides with patch boundaries and reflection stripes, by numpy and Pillow:
draw_junctions.py OUT.png SIZE COLUMNS FILE=LABEL ...
FILE: a dump of bench_junctions (36 points a patch) or a native model, of which the junctions are drawn."""
import json
import sys

import numpy as np
from PIL import Image, ImageDraw

STEPS = 18  # facets along each side of a patch
DEGREE = 5
LIGHT = np.array([-0.3, 0.45, 0.84])
OUTSIDE, INSIDE = np.array([226, 120, 100.0]), np.array([110, 140, 215.0])


def basis(knots, parameters):
    """Values of all B-splines at each parameter."""
    count = len(knots) - DEGREE - 1
    out = np.zeros((len(parameters), count))
    for row, t in enumerate(parameters):
        span = min(max(np.searchsorted(knots, t, "right") - 1, DEGREE), count - 1)
        values = np.array([1.0])
        for k in range(1, DEGREE + 1):
            raised = np.zeros(k + 1)
            for j in range(k):
                low, high = knots[span + 1 - k + j], knots[span + 1 + j]
                share = (t - low) / (high - low)
                raised[j] += (1 - share) * values[j]
                raised[j + 1] += share * values[j]
            values = raised
        out[row, span - DEGREE:span + 1] = values
    return out


def patches(path):
    """Control nets with their knots."""
    if not path.endswith(".json"):
        single = np.array([0.0] * 6 + [1.0] * 6)
        return [(net, single, single) for net in np.loadtxt(path).reshape(-1, 6, 6, 3)]
    network = json.load(open(path))["network"]
    pool = np.array(network["control_points_mm"])
    out = []
    for patch in network["patches"]:
        if network["regions"][patch["region"]]["kind"] != "junction":
            continue
        u, v = (np.array(patch[way]["knots"], float) for way in "uv")
        out.append((pool[patch["control"]].reshape(len(u) - 6, len(v) - 6, 3), u, v))
    return out


def grids(path):
    """Points of each patch on a grid."""
    out = []
    for net, u, v in patches(path):
        along = [basis(k, np.linspace(k[DEGREE], k[-DEGREE - 1], STEPS + 1)) for k in (u, v)]
        out.append(np.einsum("ai,bj,ijk->abk", along[0], along[1], net))
    return out


def fill(corners, normals, depth, image):
    """One triangle, in pixels."""
    (x, y, z), (height, width) = corners.T, depth.shape
    x0, x1 = max(int(np.floor(x.min())), 0), min(int(np.ceil(x.max())) + 1, width)
    y0, y1 = max(int(np.floor(y.min())), 0), min(int(np.ceil(y.max())) + 1, height)
    area = (y[1] - y[2]) * (x[0] - x[2]) + (x[2] - x[1]) * (y[0] - y[2])
    if x0 >= x1 or y0 >= y1 or abs(area) < 1e-9:
        return
    px, py = np.meshgrid(np.arange(x0, x1, dtype=float), np.arange(y0, y1, dtype=float))
    a = ((y[1] - y[2]) * (px - x[2]) + (x[2] - x[1]) * (py - y[2])) / area
    b = ((y[2] - y[0]) * (px - x[2]) + (x[0] - x[2]) * (py - y[2])) / area
    weights = np.stack([a, b, 1 - a - b], -1)
    here = weights @ z
    seen = (weights >= -1e-3).all(-1) & (here > depth[y0:y1, x0:x1])
    if not seen.any():
        return
    normal = weights[seen] @ normals
    normal /= np.linalg.norm(normal, axis=-1, keepdims=True) + 1e-30
    front = normal[:, 2:] > 0
    normal = np.where(front, normal, -normal)
    lit = np.clip(normal @ LIGHT, 0, 1)[:, None]
    mirrored = 2 * normal[:, 2:] * normal[:, 1:2]  # of the line of sight, upwards
    stripe = np.sign(np.sin(14 * np.arcsin(np.clip(mirrored, -1, 1))))
    color = np.where(front, OUTSIDE, INSIDE) * (0.35 + 0.65 * lit) * (0.93 + 0.07 * stripe)
    depth[y0:y1, x0:x1][seen] = here[seen]
    image[y0:y1, x0:x1][seen] = color + 60 * lit**30


def draw_line(line, depth, image):
    """A patch boundary where it is in front."""
    for start, end in zip(line[:-1], line[1:]):
        count = int(np.ceil(1.5 * np.linalg.norm((end - start)[:2]))) + 2
        points = start + np.linspace(0, 1, count)[:, None] * (end - start)
        for dx, dy in ((0, 0), (0, 1), (1, 0), (1, 1)):
            x, y = np.round(points[:, 0]).astype(int) + dx, np.round(points[:, 1]).astype(int) + dy
            inside = (x >= 0) & (x < depth.shape[1]) & (y >= 0) & (y < depth.shape[0])
            x, y, z = x[inside], y[inside], points[inside, 2]
            front = z > depth[y, x] - 4
            image[y[front], x[front]] = 25


def view(surfaces, turn, size):
    pixels = 2 * size  # drawn at twice the size, then averaged
    every = np.concatenate([s.reshape(-1, 3) for s in surfaces]) @ turn.T
    low, high = every.min(0), every.max(0)
    scale = 0.92 * pixels / (high - low)[:2].max()
    image, depth = np.full((pixels, pixels, 3), 255.0), np.full((pixels, pixels), -np.inf)
    placed = []
    for surface in surfaces:
        grid = (surface @ turn.T - (low + high) / 2) * scale
        normals = np.cross(np.gradient(grid, axis=0), np.gradient(grid, axis=1))
        normals /= np.linalg.norm(normals, axis=-1, keepdims=True) + 1e-30
        grid = grid * [1, -1, 1] + [pixels / 2, pixels / 2, 0]
        for i in range(grid.shape[0] - 1):
            for j in range(grid.shape[1] - 1):
                for rows, columns in (([i, i + 1, i + 1], [j, j, j + 1]), ([i, i + 1, i], [j, j + 1, j + 1])):
                    fill(grid[rows, columns], normals[rows, columns], depth, image)
        placed.append(grid)
    for grid in placed:
        for line in (grid[0], grid[-1], grid[:, 0], grid[:, -1]):
            draw_line(line, depth, image)
    image = np.clip(image, 0, 255).reshape(size, 2, size, 2, 3).mean((1, 3))
    return Image.fromarray(image.astype(np.uint8))


def main(out, size, columns, items):
    cells = []
    for item in items:
        path, label = item.split("=")
        surfaces = grids(path)
        every = np.concatenate([s.reshape(-1, 3) for s in surfaces])
        axes = np.linalg.svd(every - every.mean(0), full_matrices=False)[2]
        if np.linalg.det(axes) < 0:
            axes[2] *= -1
        c, s = np.cos(0.6), np.sin(0.6)
        tilt = np.array([[1, 0, 0], [0, c, -s], [0, s, c]])
        cell = Image.new("RGB", (2 * size, size + 16), "white")
        cell.paste(view(surfaces, tilt @ axes, size), (0, 16))
        cell.paste(view(surfaces, tilt @ np.diag([-1.0, 1, -1]) @ axes, size), (size, 16))
        ImageDraw.Draw(cell).text((4, 2), label, fill=(0, 0, 0))
        cells.append(cell)
    rows = -(-len(cells) // columns)
    sheet = Image.new("RGB", (columns * 2 * size, rows * (size + 16)), "white")
    for k, cell in enumerate(cells):
        sheet.paste(cell, (k % columns * 2 * size, k // columns * (size + 16)))
    sheet.quantize(200).save(out, optimize=True)


if __name__ == "__main__":
    main(sys.argv[1], int(sys.argv[2]), int(sys.argv[3]), sys.argv[4:])
