#!/usr/bin/python3
"""Compares a Gmsh MSH 2 file with a certificate: areas of the physical groups, volume, inverted cells.

usage: check_mesh_groups.py MODEL.json MODEL.msh     (MODEL.json: what `check --json` prints)
Exit code 0 when every face name is a group whose area is that of the model within 6 %, that of a dodecagon in a circle.
"""
import json
import sys


def read_msh(path):
    lines = open(path).read().split("\n")

    def block(name):
        start = lines.index("$" + name)
        count = int(lines[start + 1])
        return lines[start + 2:start + 2 + count]

    names = {}
    for line in block("PhysicalNames"):
        dimension, tag, name = line.split(" ", 2)
        names[(int(dimension), int(tag))] = name.strip('"')
    points = {}
    for line in block("Nodes"):
        fields = line.split()
        points[int(fields[0])] = tuple(float(x) for x in fields[1:4])
    elements = []
    for line in block("Elements"):
        fields = [int(x) for x in line.split()]
        elements.append((fields[1], fields[3], fields[3 + fields[2]:]))
    return names, points, elements


def minus(a, b):
    return tuple(x - y for x, y in zip(a, b))


def cross(a, b):
    return (a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0])


def dot(a, b):
    return sum(x * y for x, y in zip(a, b))


def main():
    certificate = json.load(open(sys.argv[1]))
    names, points, elements = read_msh(sys.argv[2])
    areas, volume, inverted = {}, 0.0, 0
    for kind, group, nodes in elements:
        corners = [points[n] for n in nodes]
        if kind == 2:
            normal = cross(minus(corners[1], corners[0]), minus(corners[2], corners[0]))
            name = names[(2, group)]
            areas[name] = areas.get(name, 0.0) + 0.5 * dot(normal, normal) ** 0.5
        elif kind == 4:
            v = dot(cross(minus(corners[1], corners[0]), minus(corners[2], corners[0])),
                    minus(corners[3], corners[0])) / 6
            volume += v
            inverted += v <= 0
    wanted = {}
    for face in certificate["faces"]:
        wanted[face["name"]] = wanted.get(face["name"], 0.0) + face["area_mm2"]
    worst = 0.0
    for name, area in sorted(wanted.items()):
        share = areas.get(name, 0.0) / area
        worst = max(worst, abs(share - 1))
        if abs(share - 1) > 0.06:
            print(f"  {name}: {areas.get(name, 0.0):.4f} mm2 meshed, {area:.4f} mm2 in the model")
    ratio = volume / certificate["volume_mm3"]
    good = worst <= 0.06 and set(areas) == set(wanted) and inverted == 0 and abs(ratio - 1) < 0.06
    print(f"  {len(areas)} groups, areas within {100 * worst:.2f} %, volume {100 * ratio:.2f} %, "
          f"{inverted} inverted cells")
    return 0 if good else 1


if __name__ == "__main__":
    sys.exit(main())
