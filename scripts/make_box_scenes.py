#!/usr/bin/env python3
"""Writes scenes/box.gltf (analytic balls) and scenes/box_mesh.glb (tessellated balls).

The scene is the paper's: a box with a diffuse, a mirror and a glass ball under a square lamp.
Standard library only; the same files every time.
"""
import base64
import json
import math
import struct
from pathlib import Path

FLOAT, U32 = 5126, 5125
RADIUS = 0.3
BALLS = [("diffuse ball", "grey", (-0.6, -0.7, 0.1)),
         ("mirror ball", "mirror", (0.0, -0.7, -0.4)),
         ("glass ball", "glass", (0.6, -0.7, 0.3))]


class Buffer:
    """Collects vertex data and the accessors into it."""

    def __init__(self):
        self.data, self.views, self.accessors = b"", [], []

    def add(self, rows, kind, component, target, bounds=False):
        flat = [x for row in rows for x in row] if kind != "SCALAR" else rows
        code = "f" if component == FLOAT else "I"
        raw = struct.pack(f"<{len(flat)}{code}", *flat)
        self.views.append({"buffer": 0, "byteOffset": len(self.data), "byteLength": len(raw),
                           "target": target})
        accessor = {"bufferView": len(self.views) - 1, "componentType": component,
                    "count": len(rows), "type": kind}
        if bounds:
            f32 = [struct.unpack(f"<{len(flat)}f", raw)[k::3] for k in range(3)]
            accessor["min"], accessor["max"] = [min(c) for c in f32], [max(c) for c in f32]
        self.accessors.append(accessor)
        self.data += raw
        return len(self.accessors) - 1


def quad(buffer, p, e1, e2):
    """A parallelogram; its front is where e1 x e2 points."""
    add = lambda *vs: tuple(sum(c) for c in zip(*vs))
    rows = [p, add(p, e1), add(p, e1, e2), add(p, e2)]
    return {"attributes": {"POSITION": buffer.add(rows, "VEC3", FLOAT, 34962, True)},
            "indices": buffer.add([0, 1, 2, 0, 2, 3], "SCALAR", U32, 34963)}


def ball(buffer, rings, sectors):
    """A UV sphere with smooth normals around the origin."""
    normals = []
    for i in range(rings + 1):
        t = math.pi * i / rings
        for j in range(sectors + 1):
            a = 2 * math.pi * (j % sectors) / sectors
            normals.append((math.sin(t) * math.cos(a), math.cos(t), math.sin(t) * math.sin(a)))
    indices = []
    for i in range(rings):
        for j in range(sectors):
            a = i * (sectors + 1) + j
            b = a + sectors + 1
            if i > 0:
                indices += [a, a + 1, b]
            if i < rings - 1:
                indices += [a + 1, b + 1, b]
    positions = [tuple(RADIUS * c for c in n) for n in normals]
    return {"attributes": {"POSITION": buffer.add(positions, "VEC3", FLOAT, 34962, True),
                           "NORMAL": buffer.add(normals, "VEC3", FLOAT, 34962)},
            "indices": buffer.add(indices, "SCALAR", U32, 34963)}


def lambert(name, color):
    return {"name": name,
            "pbrMetallicRoughness": {"baseColorFactor": color + [1.0], "metallicFactor": 0.0,
                                     "roughnessFactor": 1.0},
            "extensions": {"KHR_materials_specular": {"specularFactor": 0.0}}}


def materials():
    lamp = lambert("lamp", [0.0, 0.0, 0.0])
    lamp["emissiveFactor"] = [1.0, 1.0, 1.0]
    lamp["extensions"]["KHR_materials_emissive_strength"] = {"emissiveStrength": 15.0}
    mirror = {"name": "mirror", "pbrMetallicRoughness": {
        "baseColorFactor": [1.0] * 4, "metallicFactor": 1.0, "roughnessFactor": 0.0}}
    glass = {"name": "glass",
             "pbrMetallicRoughness": {"baseColorFactor": [1.0] * 4, "metallicFactor": 0.0,
                                      "roughnessFactor": 0.0},
             "extensions": {"KHR_materials_transmission": {"transmissionFactor": 1.0},
                            "KHR_materials_ior": {"ior": 1.5},
                            "KHR_materials_volume": {"thicknessFactor": 2 * RADIUS}}}
    return [lambert("grey", [0.75] * 3), lambert("red", [0.75, 0.1, 0.1]),
            lambert("green", [0.1, 0.75, 0.1]), lamp, mirror, glass]


def scene(rings, sectors, analytic):
    buffer, meshes, nodes = Buffer(), [], []
    mats = materials()
    number = {m["name"]: i for i, m in enumerate(mats)}

    def add(name, material, primitive, **node):
        meshes.append({"name": name, "primitives": [dict(primitive, material=number[material])]})
        nodes.append(dict(node, name=name, mesh=len(meshes) - 1))

    x, y, z = (2, 0, 0), (0, 2, 0), (0, 0, 2)
    low = (-1, -1, -1)
    add("floor", "grey", quad(buffer, low, z, x))
    add("ceiling", "grey", quad(buffer, (-1, 1, -1), x, z))
    add("back wall", "grey", quad(buffer, low, x, y))
    add("left wall", "red", quad(buffer, low, y, z))
    add("right wall", "green", quad(buffer, (1, -1, -1), z, y))
    add("lamp", "lamp", quad(buffer, (-0.25, 0.998, -0.25), (0.5, 0, 0), (0, 0, 0.5)))
    shape = ball(buffer, rings, sectors)
    for name, material, center in BALLS:
        extras = {"extras": {"sphere_radius": RADIUS}} if analytic else {}
        add(name, material, shape, translation=list(center), **extras)
    nodes.append({"name": "camera", "camera": 0, "translation": [0, 0, 3.8]})
    used = sorted({e for m in mats for e in m.get("extensions", {})})
    return buffer, {
        "asset": {"version": "2.0", "generator": "make_box_scenes.py"},
        "extensionsUsed": used, "scene": 0,
        "scenes": [{"name": "box", "nodes": list(range(len(nodes)))}],
        "nodes": nodes, "meshes": meshes, "materials": mats,
        "cameras": [{"name": "camera", "type": "perspective", "perspective": {
            "yfov": math.radians(39.3), "aspectRatio": 1.0, "znear": 0.1, "zfar": 100.0}}],
        "accessors": buffer.accessors, "bufferViews": buffer.views,
        "buffers": [{"byteLength": len(buffer.data)}],
    }


def write_glb(path, buffer, doc):
    """Writes a binary glTF."""
    text = json.dumps(doc, separators=(",", ":")).encode()
    text += b" " * (-len(text) % 4)
    data = buffer.data + b"\0" * (-len(buffer.data) % 4)
    chunk = lambda kind, body: struct.pack("<I4s", len(body), kind) + body
    body = chunk(b"JSON", text) + chunk(b"BIN\0", data)
    path.write_bytes(struct.pack("<4sII", b"glTF", 2, 12 + len(body)) + body)


def main():
    folder = Path(__file__).resolve().parent.parent / "scenes"
    # Viewers without analytic spheres show these coarse balls instead.
    buffer, doc = scene(12, 24, analytic=True)
    uri = base64.b64encode(buffer.data).decode()
    doc["buffers"][0]["uri"] = "data:application/octet-stream;base64," + uri
    (folder / "box.gltf").write_text(json.dumps(doc, indent=1) + "\n")

    buffer, doc = scene(128, 256, analytic=False)
    write_glb(folder / "box_mesh.glb", buffer, doc)


if __name__ == "__main__":
    main()
