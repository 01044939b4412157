"""Reads a glTF binary file and makes the dictionary of a Mitsuba 3 scene that is the same.

What is taken is what both renderers compute by the same formulas: diffuse surfaces, smooth mirrors
that reflect all colours alike, smooth solid glass without absorption, panes of thin glass; points;
suns, with an angle as a far disc; surfaces that emit; spheres by `sphere_radius` in a node's extras;
perspective cameras. Anything else is an error that names it: matched_scenes.py changes a file so that
nothing else is left. Lamps are read as Dualight reads them in files of Blender's exporter, divided
by 683.

    import mitsuba, gltf_to_mitsuba as g
    mitsuba.set_variant("llvm_ad_rgb")
    scene = mitsuba.load_dict(g.scene_dict(g.Gltf.read("plain.glb"), width=128, height=128))
"""

import json
import math
import struct
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Iterator

import numpy as np

Json = dict[str, Any]
BLENDER = 683.0
COMPONENTS = {5120: "i1", 5121: "u1", 5122: "i2", 5123: "u2", 5125: "u4", 5126: "f4"}
WIDTHS = {"SCALAR": 1, "VEC2": 2, "VEC3": 3, "VEC4": 4}
# A far disc stands for a sun at so many radii of the scene.
FAR = 1000.0


class Unmatched(ValueError):
    """The file has something that Mitsuba does not compute as Dualight does."""


@dataclass
class Gltf:
    """A .glb file: its JSON, and the bytes of its binary chunk."""

    doc: Json
    binary: bytes

    @classmethod
    def read(cls, path: Path | str) -> "Gltf":
        raw = Path(path).read_bytes()
        magic, version, _ = struct.unpack_from("<4sII", raw)
        if (magic, version) != (b"glTF", 2):
            raise Unmatched(f"{path} is not binary glTF 2.0")
        length = struct.unpack_from("<I", raw, 12)[0]
        chunk = 20 + length
        size = struct.unpack_from("<I", raw, chunk)[0]
        return cls(json.loads(raw[20:chunk]), raw[chunk + 8:chunk + 8 + size])

    def write(self, path: Path | str) -> None:
        text = json.dumps(self.doc).encode()
        text += b" " * (-len(text) % 4)
        data = self.binary + b"\0" * (-len(self.binary) % 4)
        head = struct.pack("<4sII", b"glTF", 2, 28 + len(text) + len(data))
        Path(path).write_bytes(head + struct.pack("<I4s", len(text), b"JSON") + text
                               + struct.pack("<I4s", len(data), b"BIN\0") + data)

    def view(self, index: int) -> bytes:
        view = self.doc["bufferViews"][index]
        start = view.get("byteOffset", 0)
        return self.binary[start:start + view["byteLength"]]

    def accessor(self, index: int) -> np.ndarray:
        """The elements of an accessor, one a row."""
        accessor = self.doc["accessors"][index]
        view = self.doc["bufferViews"][accessor["bufferView"]]
        if "sparse" in accessor or "byteStride" in view:
            raise Unmatched(f"accessor {index} is sparse or interleaved")
        width = WIDTHS[accessor["type"]]
        flat = np.frombuffer(self.view(accessor["bufferView"]), "<" + COMPONENTS[accessor["componentType"]],
                             accessor["count"] * width, accessor.get("byteOffset", 0))
        return flat.reshape(-1, width)

    def nodes(self) -> Iterator[tuple[Json, np.ndarray]]:
        """Every node of the default scene with its transform to the world."""
        pending = [(i, np.eye(4)) for i in self.doc["scenes"][self.doc.get("scene", 0)]["nodes"]]
        while pending:
            index, parent = pending.pop()
            node = self.doc["nodes"][index]
            world = parent @ local(node)
            pending += [(child, world) for child in node.get("children", [])]
            yield node, world


def local(node: Json) -> np.ndarray:
    """The matrix of a node's own transform."""
    if "matrix" in node:
        return np.array(node["matrix"], dtype=float).reshape(4, 4).T
    x, y, z, w = node.get("rotation", [0, 0, 0, 1])
    m = np.eye(4)
    m[:3, :3] = np.array([
        [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
        [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
        [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)],
    ]) @ np.diag(node.get("scale", [1, 1, 1]))
    m[:3, 3] = node.get("translation", [0, 0, 0])
    return m


def rgb(color: Any) -> Json:
    return {"type": "rgb", "value": [float(c) for c in color]}


def emission(material: Json) -> np.ndarray:
    """The radiance of a material."""
    strength = material.get("extensions", {}).get("KHR_materials_emissive_strength", {}).get("emissiveStrength", 1.0)
    return np.array(material.get("emissiveFactor", [0, 0, 0]), dtype=float) * strength


def texture(file: Gltf, slot: Json) -> Json:
    """A bitmap of an image within the file, looked up as glTF says."""
    import mitsuba as mi

    if "extensions" in slot or slot.get("texCoord", 0):
        raise Unmatched("a texture has a transform, or coordinates other than the first")
    entry = file.doc["textures"][slot["index"]]
    sampler = file.doc.get("samplers", [{}])[entry.get("sampler", 0)]
    wrap = {sampler.get("wrapS", 10497), sampler.get("wrapT", 10497)}
    if len(wrap) > 1 or wrap - {10497, 33071}:
        raise Unmatched("a texture repeats in one direction only, or is mirrored")
    stream = mi.MemoryStream()
    data = file.view(file.doc["images"][entry["source"]]["bufferView"])
    stream.write(data)
    stream.seek(0)
    return {"type": "bitmap", "bitmap": mi.Bitmap(stream), "filter_type": "bilinear",
            "wrap_mode": "clamp" if wrap == {33071} else "repeat"}


def bsdf(file: Gltf, material: Json) -> Json:
    """The material, if both renderers have it."""
    name, ext = material.get("name", "material"), dict(material.get("extensions", {}))
    pbr = material.get("pbrMetallicRoughness", {})
    known = {"KHR_materials_specular", "KHR_materials_transmission", "KHR_materials_volume", "KHR_materials_ior",
             "KHR_materials_emissive_strength"}
    if set(ext) - known or material.get("alphaMode", "OPAQUE") != "OPAQUE" or "normalTexture" in material:
        raise Unmatched(f"{name}: an extension, alpha or a normal map")
    base = list(pbr.get("baseColorFactor", [1, 1, 1, 1]))[:3]
    smooth = pbr.get("roughnessFactor", 1) == 0 and "metallicRoughnessTexture" not in pbr
    if ext.get("KHR_materials_transmission", {}).get("transmissionFactor", 0) == 1:
        volume = ext.get("KHR_materials_volume", {})
        if not smooth or base != [1, 1, 1] or "attenuationDistance" in volume or "baseColorTexture" in pbr:
            raise Unmatched(f"{name}: glass that is rough, coloured or absorbs")
        kind = "dielectric" if volume.get("thicknessFactor", 0) > 0 else "thindielectric"
        return {"type": kind, "int_ior": float(ext.get("KHR_materials_ior", {}).get("ior", 1.5)), "ext_ior": 1.0}
    if pbr.get("metallicFactor", 1) == 1:
        if not smooth or base != [1, 1, 1] or "baseColorTexture" in pbr:
            raise Unmatched(f"{name}: a metal that is rough or coloured")
        return {"type": "twosided", "bsdf": {"type": "conductor", "material": "none"}}
    if pbr["metallicFactor"] != 0 or ext.get("KHR_materials_specular", {}).get("specularFactor", 1) != 0:
        raise Unmatched(f"{name}: it is neither diffuse nor a mirror")
    reflectance = rgb(base)
    if "baseColorTexture" in pbr:
        if base != [1, 1, 1]:
            raise Unmatched(f"{name}: a texture times a colour")
        reflectance = texture(file, pbr["baseColorTexture"])
    return {"type": "twosided", "bsdf": {"type": "diffuse", "reflectance": reflectance}}


def faces_away(positions: np.ndarray, faces: np.ndarray) -> bool:
    """Whether a surface is open and turns its front away from the world's origin.

    Surfaces of Blender emit from both sides, those of Mitsuba from the front: it has to be the one that
    lights the scene. A closed surface has its front outside."""
    a, b, c = (positions[faces[:, k]] for k in range(3))
    areas = np.cross(b - a, c - a)
    total = areas.sum(axis=0)
    is_open = np.linalg.norm(total) > 1e-3 * np.linalg.norm(areas, axis=1).sum()
    return bool(is_open and total @ positions.mean(axis=0) > 0)


def mesh(file: Gltf, primitive: Json, world: np.ndarray, name: str, surface: Json) -> Any:
    """A primitive as a mesh in the world's coordinates."""
    import mitsuba as mi

    if primitive.get("mode", 4) != 4 or "indices" not in primitive:
        raise Unmatched(f"{name} is not a list of indexed triangles")
    attributes = primitive["attributes"]
    positions = file.accessor(attributes["POSITION"]) @ world[:3, :3].T + world[:3, 3]
    normals = file.accessor(attributes["NORMAL"]) @ np.linalg.inv(world[:3, :3])
    normals /= np.maximum(np.linalg.norm(normals, axis=1, keepdims=True), 1e-30)
    faces = file.accessor(primitive["indices"]).reshape(-1, 3).astype(np.uint32)
    if np.linalg.det(world[:3, :3]) < 0:
        faces = faces[:, [0, 2, 1]]
    if "emitter" in surface and faces_away(positions, faces):
        faces, normals = faces[:, [0, 2, 1]], -normals
    properties = mi.Properties()
    for key, value in surface.items():
        properties[key] = mi.load_dict(value)
    uv = "TEXCOORD_0" in attributes
    made = mi.Mesh(name, len(positions), len(faces), props=properties, has_vertex_normals=True, has_vertex_texcoords=uv)
    params = mi.traverse(made)
    params["vertex_positions"] = np.ascontiguousarray(positions, dtype=np.float32).ravel()
    params["vertex_normals"] = np.ascontiguousarray(normals, dtype=np.float32).ravel()
    params["faces"] = np.ascontiguousarray(faces).ravel()
    if uv:
        params["vertex_texcoords"] = np.ascontiguousarray(file.accessor(attributes["TEXCOORD_0"]), np.float32).ravel()
    params.update()
    return made


def light(file: Gltf, node: Json, world: np.ndarray, reach: float) -> Json:
    """A lamp of KHR_lights_punctual; of lamps with extent, the sun alone."""
    from mitsuba import ScalarTransform4f as T

    index = node["extensions"]["KHR_lights_punctual"]["light"]
    lamp = file.doc["extensions"]["KHR_lights_punctual"]["lights"][index]
    extent = lamp.get("extras", {}).get("dualight", {})
    power = np.array(lamp.get("color", [1, 1, 1]), dtype=float) * lamp.get("intensity", 1) / BLENDER
    if lamp["type"] == "point" and "radius" not in extent:
        return {"type": "point", "position": world[:3, 3].tolist(), "intensity": rgb(power)}
    if lamp["type"] != "directional":
        raise Unmatched(f"{lamp.get('name')}: a spot, or a ball that is no surface")
    down = -world[:3, 2] / np.linalg.norm(world[:3, 2])
    if "angle" not in extent:
        return {"type": "directional", "direction": down.tolist(), "irradiance": rgb(power)}
    half = extent["angle"] / 2
    away = -down * FAR * reach
    up = [1, 0, 0] if abs(down[0]) < 0.5 else [0, 1, 0]
    turn = T().look_at(origin=away.tolist(), target=[0, 0, 0], up=up)
    size = FAR * reach * math.tan(half)
    return {"type": "disk", "to_world": turn @ T().scale([size, size, 1]),
            "bsdf": {"type": "diffuse", "reflectance": rgb([0] * 3)},
            "emitter": {"type": "area", "radiance": rgb(power / (math.pi * math.sin(half) ** 2))}}


def camera(file: Gltf, index: int, world: np.ndarray, width: int, height: int) -> Json:
    from mitsuba import ScalarTransform4f as T

    definition = file.doc["cameras"][index]
    if definition["type"] != "perspective" or "dualight" in definition.get("extras", {}):
        raise Unmatched("a camera that is not a plain perspective one")
    return {
        "type": "perspective", "fov": math.degrees(definition["perspective"]["yfov"]), "fov_axis": "y",
        # Mitsuba's cameras look along +z.
        "to_world": T(world @ np.diag([-1.0, 1.0, -1.0, 1.0])), "near_clip": 1e-3, "far_clip": 1e6,
        "film": {"type": "hdrfilm", "width": width, "height": height, "rfilter": {"type": "box"},
                 "pixel_format": "rgb", "component_format": "float32"},
        "sampler": {"type": "independent"},
    }


def scene_dict(file: Gltf, width: int, height: int) -> Json:
    """The whole scene; of several cameras the first."""
    if "animations" in file.doc or "dualight" in file.doc["scenes"][file.doc.get("scene", 0)].get("extras", {}):
        raise Unmatched("an animation or a world")
    nodes = list(file.nodes())
    made: Json = {"type": "scene", "integrator": {"type": "path"}}
    reach = max(float(np.linalg.norm(w[:3, 3])) for _, w in nodes) + 1.0
    first = min((n["camera"] for n, _ in nodes if "camera" in n), default=None)
    for number, (node, world) in enumerate(nodes):
        if node.get("camera", -1) == first:
            made["sensor"] = camera(file, first, world, width, height)
        if "KHR_lights_punctual" in node.get("extensions", {}):
            made[f"light{number}"] = light(file, node, world, reach)
        if "mesh" not in node:
            continue
        for part, primitive in enumerate(file.doc["meshes"][node["mesh"]]["primitives"]):
            material = file.doc["materials"][primitive["material"]]
            surface = {"bsdf": bsdf(file, material)}
            if emission(material).any():
                surface["emitter"] = {"type": "area", "radiance": rgb(emission(material))}
            radius = node.get("extras", {}).get("sphere_radius")
            key = f"shape{number}_{part}"
            if radius is None:
                made[key] = mesh(file, primitive, world, key, surface)
            else:
                scale = abs(np.linalg.det(world[:3, :3])) ** (1 / 3)
                made[key] = {"type": "sphere", "center": world[:3, 3].tolist(), "radius": radius * scale, **surface}
    return made
