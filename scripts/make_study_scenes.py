#!/usr/bin/env python3
"""Writes the scenes that docs/accuracy.md measures besides the box:

    scripts/make_study_scenes.py [FOLDER]

caustics.glb  a ring of gold and a goblet of glass, as meshes, under a small lamp
interior.glb  a room that light reaches through a window only, everything diffuse
textured.glb  bricks and tiles: colours, roughness and bumps from images
speck.glb     the box with a glass ball one hundredth as wide
cup.glb       the box with a goblet of glass, as a mesh, for the glass ball

Standard library only; the same files every time.
"""
import argparse
import math
import random
import struct
import zlib
from pathlib import Path

import make_box_scenes
from make_box_scenes import FLOAT, U32, Buffer, lambert, quad, write_glb


def revolved(buffer, profile, sectors):
    """A surface of revolution about y. The profile is a list of (radius, height), from below to
    above along the outside."""
    rows, normals, uvs, indices = [], [], [], []
    n = len(profile)
    for i, (r, y) in enumerate(profile):
        (r0, y0), (r1, y1) = profile[max(i - 1, 0)], profile[min(i + 1, n - 1)]
        length = math.hypot(r1 - r0, y1 - y0) or 1.0
        out, up = (y1 - y0) / length, -(r1 - r0) / length
        for j in range(sectors + 1):
            a = 2 * math.pi * (j % sectors) / sectors
            c, s = math.cos(a), math.sin(a)
            rows.append((r * c, y, -r * s))
            normals.append((out * c, up, -out * s))
            uvs.append((j / sectors, 1 - i / (n - 1)))
    for i in range(n - 1):
        for j in range(sectors):
            a = i * (sectors + 1) + j
            b = a + sectors + 1
            indices += [a, a + 1, b + 1, a, b + 1, b]
    return {"attributes": {"POSITION": buffer.add(rows, "VEC3", FLOAT, 34962, True),
                           "NORMAL": buffer.add(normals, "VEC3", FLOAT, 34962),
                           "TEXCOORD_0": buffer.add(uvs, "VEC2", FLOAT, 34962)},
            "indices": buffer.add(indices, "SCALAR", U32, 34963)}


def textured_quad(buffer, p, e1, e2, repeats):
    """A parallelogram on which an image is repeated."""
    primitive = quad(buffer, p, e1, e2)
    corners = [(0, 0), (repeats, 0), (repeats, repeats), (0, repeats)]
    primitive["attributes"]["TEXCOORD_0"] = buffer.add(corners, "VEC2", FLOAT, 34962)
    return primitive


def box(buffer, low, high):
    """The six faces of a box, seen from outside."""
    (x, y, z), (X, Y, Z) = low, high
    dx, dy, dz = (X - x, 0, 0), (0, Y - y, 0), (0, 0, Z - z)
    return [quad(buffer, low, dx, dz), quad(buffer, (x, Y, z), dz, dx),
            quad(buffer, low, dz, dy), quad(buffer, (X, y, z), dy, dz),
            quad(buffer, low, dy, dx), quad(buffer, (x, y, Z), dx, dy)]


def lamp(strength, color=(1.0, 1.0, 1.0)):
    material = lambert("lamp", [0.0, 0.0, 0.0])
    material["emissiveFactor"] = list(color)
    material["extensions"]["KHR_materials_emissive_strength"] = {"emissiveStrength": strength}
    return material


def looking(eye, at, yfov):
    """A camera node's rotation and translation, and the camera."""
    sub = lambda a, b: [p - q for p, q in zip(a, b)]
    unit = lambda a: [p / math.sqrt(sum(q * q for q in a)) for p in a]
    cross = lambda a, b: [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2],
                          a[0] * b[1] - a[1] * b[0]]
    back = unit(sub(eye, at))
    right = unit(cross([0, 1, 0], back))
    up = cross(back, right)
    matrix = right + [0] + up + [0] + back + [0] + list(eye) + [1]
    camera = {"name": "camera", "type": "perspective", "perspective": {
        "yfov": math.radians(yfov), "aspectRatio": 4 / 3, "znear": 0.05, "zfar": 100.0}}
    return {"name": "camera", "camera": 0, "matrix": matrix}, camera


class Scene:
    """Collects nodes and what they are made of."""

    def __init__(self, name):
        self.name, self.buffer = name, Buffer()
        self.nodes, self.meshes, self.materials, self.images = [], [], [], []

    def material(self, description):
        self.materials.append(description)
        return len(self.materials) - 1

    def add(self, name, material, *primitives, **node):
        self.meshes.append({"name": name,
                            "primitives": [dict(p, material=material) for p in primitives]})
        self.nodes.append(dict(node, name=name, mesh=len(self.meshes) - 1))

    def texture(self, width, pixel):
        """A square image; `pixel` gives three bytes for a column and a row."""
        rows = b"".join(b"\0" + bytes(v for x in range(width) for v in pixel(x, y))
                        for y in range(width))
        chunk = lambda kind, body: (struct.pack(">I", len(body)) + kind + body
                                    + struct.pack(">I", zlib.crc32(kind + body)))
        png = (b"\x89PNG\r\n\x1a\n" + chunk(b"IHDR", struct.pack(">IIBBBBB", width, width, 8, 2, 0, 0, 0))
               + chunk(b"IDAT", zlib.compress(rows, 9)) + chunk(b"IEND", b""))
        self.buffer.data += b"\0" * (-len(self.buffer.data) % 4)
        self.buffer.views.append({"buffer": 0, "byteOffset": len(self.buffer.data),
                                  "byteLength": len(png)})
        self.buffer.data += png + b"\0" * (-len(png) % 4)
        self.images.append({"bufferView": len(self.buffer.views) - 1, "mimeType": "image/png"})
        return {"index": len(self.images) - 1}

    def document(self, camera):
        node, camera = camera
        nodes = self.nodes + [node]
        doc = {"asset": {"version": "2.0", "generator": "make_study_scenes.py"},
               "extensionsUsed": sorted({e for m in self.materials
                                         for e in m.get("extensions", {})}),
               "scene": 0, "scenes": [{"name": self.name, "nodes": list(range(len(nodes)))}],
               "nodes": nodes, "meshes": self.meshes, "materials": self.materials,
               "cameras": [camera], "accessors": self.buffer.accessors,
               "bufferViews": self.buffer.views,
               "buffers": [{"byteLength": len(self.buffer.data)}]}
        if self.images:
            doc["images"] = self.images
            doc["textures"] = [{"source": i} for i in range(len(self.images))]
        return doc


def caustics():
    s = Scene("caustics")
    b = s.buffer
    grey = s.material(lambert("grey", [0.6, 0.58, 0.55]))
    gold = s.material({"name": "gold", "doubleSided": True, "pbrMetallicRoughness": {
        "baseColorFactor": [1.0, 0.77, 0.34, 1.0], "metallicFactor": 1.0, "roughnessFactor": 0.0}})
    glass = s.material({"name": "glass", "pbrMetallicRoughness": {
        "metallicFactor": 0.0, "roughnessFactor": 0.0},
        "extensions": {"KHR_materials_transmission": {"transmissionFactor": 1.0},
                       "KHR_materials_ior": {"ior": 1.5},
                       "KHR_materials_volume": {"thicknessFactor": 0.1}}})
    light = s.material(lamp(100.0))
    s.add("floor", grey, quad(b, (-3, 0, -3), (0, 0, 6), (6, 0, 0)))
    s.add("wall", grey, quad(b, (-3, 0, -1.6), (6, 0, 0), (0, 3.5, 0)))
    # The section of the ring is a rounded rectangle, closed.
    section = [(0.55 + 0.025 * math.cos(t) ** 3, 0.125 + 0.125 * math.sin(t))
               for t in (2 * math.pi * k / 32 for k in range(33))]
    s.add("ring", gold, revolved(b, section, 192), translation=[-0.55, 0.001, 0.1])
    s.add("goblet", glass, revolved(b, goblet(), 128), translation=[0.65, 0.002, 0.0])
    s.add("lamp", light, quad(b, (1.3, 3.0, 0.7), (0.4, 0, 0), (0, 0, 0.4)))
    return s.buffer, s.document(looking((0.0, 1.7, 3.0), (0.05, 0.25, 0.0), 34))


def goblet():
    """Foot, stem and bowl, outside and inside, smooth: a body of glass."""
    outside = [(0.0, 0.0), (0.26, 0.0), (0.28, 0.015), (0.26, 0.03), (0.1, 0.05), (0.04, 0.1),
               (0.035, 0.25), (0.06, 0.33), (0.2, 0.42), (0.27, 0.55), (0.27, 0.68), (0.24, 0.8)]
    inside = [(0.235, 0.805), (0.23, 0.8), (0.255, 0.68), (0.255, 0.56), (0.19, 0.445), (0.0, 0.4)]
    points = outside + inside
    # Catmull and Rom's curve through all of them.
    out = []
    for i in range(len(points) - 1):
        p = [points[min(max(i + k, 0), len(points) - 1)] for k in (-1, 0, 1, 2)]
        for k in range(6):
            t = k / 6
            w = [(-t + 2 * t * t - t ** 3) / 2, (2 - 5 * t * t + 3 * t ** 3) / 2,
                 (t + 4 * t * t - 3 * t ** 3) / 2, (t ** 3 - t * t) / 2]
            r, y = (sum(a * q[c] for a, q in zip(w, p)) for c in range(2))
            out.append((max(r, 0.0), max(y, 0.0)))
    return out + [points[-1]]


def interior():
    s = Scene("interior")
    b = s.buffer
    white = s.material(lambert("white", [0.8, 0.78, 0.74]))
    floor = s.material(lambert("floor", [0.45, 0.3, 0.2]))
    blue = s.material(lambert("blue", [0.2, 0.3, 0.55]))
    red = s.material(lambert("red", [0.6, 0.2, 0.15]))
    light = s.material(lamp(40.0, (1.0, 0.95, 0.85)))
    x, y, z = (4, 0, 0), (0, 2.6, 0), (0, 0, 5)
    s.add("floor", floor, quad(b, (0, 0, 0), z, x))
    s.add("ceiling", white, quad(b, (0, 2.6, 0), x, z))
    s.add("back", white, quad(b, (0, 0, 0), x, y))
    s.add("front", white, quad(b, (0, 0, 5), y, x))
    s.add("right", blue, quad(b, (4, 0, 0), z, y))
    # The left wall leaves a window open, from z = 1 to 2.4 and y = 0.9 to 2.1, and is 0.2 thick.
    for low, high in [((-0.2, 0, 0), (0, 2.6, 1)), ((-0.2, 0, 2.4), (0, 2.6, 5)),
                      ((-0.2, 0, 1), (0, 0.9, 2.4)), ((-0.2, 2.1, 1), (0, 2.6, 2.4))]:
        s.add("left", white, *box(b, low, high))
    s.add("table", red, *box(b, (1.5, 0.7, 0.9), (2.9, 0.76, 2.1)))
    for px, pz in [(1.55, 0.95), (2.8, 0.95), (1.55, 2.0), (2.8, 2.0)]:
        s.add("leg", red, *box(b, (px, 0, pz), (px + 0.05, 0.7, pz + 0.05)))
    vase = [(0.0, 0.0), (0.09, 0.0), (0.13, 0.1), (0.12, 0.22), (0.06, 0.32), (0.07, 0.38)]
    s.add("vase", white, revolved(b, vase, 48), translation=[2.2, 0.761, 1.4])
    s.add("shelf", white, *box(b, (3.5, 0.0, 0.3), (3.95, 1.5, 1.6)))
    s.add("lamp", light, quad(b, (-1.6, 2.2, 1.0), (0.9, 0.9, 0), (0, 0, 1.4)))
    return s.buffer, s.document(looking((2.6, 1.5, 4.7), (1.8, 1.0, 0.0), 52))


def textured():
    s = Scene("textured")
    b, rng, size = s.buffer, random.Random(1), 256
    shade = [[rng.uniform(0.75, 1.0) for _ in range(8)] for _ in range(8)]

    def brick(x, y):
        """Which brick, and how far from the mortar, in pixels."""
        row = y // 32
        column = (x + 32 * (row % 2)) % size // 64
        u, v = (x + 32 * (row % 2)) % 64, y % 32
        return shade[row][column], min(u, 63 - u, v, 31 - v)

    def height(x, y):
        return min(brick(x % size, y % size)[1], 5) / 5

    def color(x, y):
        k, d = brick(x, y)
        grain = rng.uniform(0.9, 1.0)
        base = (0.72, 0.33, 0.24) if d > 2 else (0.75, 0.72, 0.68)
        return [int(255 * c * (k if d > 2 else 1.0) * grain) for c in base]

    def bump(x, y):
        dx, dy = (height(x + 1, y) - height(x - 1, y)), (height(x, y + 1) - height(x, y - 1))
        n = (-0.5 * dx, 0.5 * dy, 1.0)
        length = math.sqrt(sum(c * c for c in n))
        return [int(round(127.5 + 127.5 * c / length)) for c in n]

    def tile(x, y):
        dark = (x // 64 + y // 64) % 2
        return [30, 60, 90] if dark else [225, 220, 205]

    def finish(x, y):
        d = min(x % 64, y % 64)
        return [255, 190 if d < 3 else 60 + 60 * ((x // 64 + y // 64) % 2), 0]

    wall = s.material({"name": "bricks", "normalTexture": s.texture(size, bump),
                       "pbrMetallicRoughness": {"baseColorTexture": s.texture(size, color),
                                                "metallicFactor": 0.0, "roughnessFactor": 0.9}})
    tiles = {"baseColorTexture": s.texture(size, tile),
             "metallicRoughnessTexture": s.texture(size, finish), "metallicFactor": 0.0}
    ground = s.material({"name": "tiles", "pbrMetallicRoughness": tiles})
    light = s.material(lamp(30.0))
    s.add("floor", ground, textured_quad(b, (-3, 0, -2), (0, 0, 5), (6, 0, 0), 3))
    s.add("wall", wall, textured_quad(b, (-3, 0, -1.5), (6, 0, 0), (0, 3, 0), 2))
    column = [(0.0, 0.0), (0.4, 0.0), (0.4, 0.1), (0.3, 0.2), (0.28, 1.1), (0.4, 1.2), (0.0, 1.2)]
    s.add("column", wall, revolved(b, column, 64), translation=[-0.9, 0.001, -0.2])
    ball = [(0.45 * math.sin(math.pi * k / 32), 0.45 - 0.45 * math.cos(math.pi * k / 32))
            for k in range(33)]
    s.add("ball", ground, revolved(b, ball, 64), translation=[0.7, 0.001, 0.2])
    s.add("lamp", light, quad(b, (-0.6, 3.2, 1.0), (1.2, 0, 0), (0, 0, 0.8)))
    return s.buffer, s.document(looking((0.3, 1.5, 4.2), (-0.05, 0.7, 0.0), 36))


def speck():
    buffer, doc = make_box_scenes.scene(12, 24, analytic=True)
    ball = next(n for n in doc["nodes"] if n["name"] == "glass ball")
    radius = make_box_scenes.RADIUS / 100
    ball.update(translation=[0.6, radius - 1, 0.3], extras={"sphere_radius": radius})
    return buffer, doc


def cup():
    buffer, doc = make_box_scenes.scene(12, 24, analytic=True)
    ball = next(n for n in doc["nodes"] if n["name"] == "glass ball")
    del ball["extras"]
    ball.update(name="goblet", translation=[0.6, -0.998, 0.3])
    mesh = doc["meshes"][ball["mesh"]]
    mesh["name"] = "goblet"
    mesh["primitives"][0].update(revolved(buffer, goblet(), 128))
    doc["buffers"][0]["byteLength"] = len(buffer.data)
    return buffer, doc


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("folder", nargs="?", type=Path, default=Path("."), metavar="FOLDER")
    folder = parser.parse_args().folder
    folder.mkdir(parents=True, exist_ok=True)
    for make in (caustics, interior, textured, speck, cup):
        write_glb(folder / f"{make.__name__}.glb", *make())


main()
