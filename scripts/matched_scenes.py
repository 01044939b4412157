"""Copies of scenes from Blender that Dualight and Mitsuba render alike.

Changed is what one of them lacks or computes by other formulas, in the file that both read:

- Lamps get the size that they have in Blender, as no path finds the caustic of a lamp without extent:
  suns an angle, points and spots as balls that emit with the same intensity in all directions. Not so
  in `plain`, where nothing throws caustics and the lamp has no extent.
- What reflects like plastic becomes diffuse; coats and sheen go.
- Metals become white and smooth, for Fresnel's terms of coloured ones differ.
- Glass becomes smooth and white; nothing absorbs.
- Liquids are a little smaller, so that they stand free of their glass: Mitsuba does not nest bodies.
"""

import copy
import math

from gltf_to_mitsuba import BLENDER, Gltf, Json

# Radians and metres, as these lamps have them in Blender, whose exporter drops them. But the spot over the
# ring has 0.02 there: a few pixels that mirror it would be all of the error.
SUN = 0.00918043
RADII: dict[str, dict[str, float]] = {
    "cup": {"Fill": 0.05},
    "ring": {"Fill": 0.3, "Spot": 0.3},
    "pool": {},
    "interior": {"CeilingL": 0.05, "CeilingR": 0.05, "Pendant": 0.03, "Shelf": 0.02,
                 "Spot0": 0.03, "Spot1": 0.03, "SofaSpot": 0.03},
}
# By which factor nodes shrink that overlap another body.
SHRUNK: dict[str, dict[str, float]] = {"cup": {"Liquid": 0.95, "Water": 0.95}}


def plain_material(material: Json) -> None:
    """Makes a material one that both renderers have."""
    ext = material.setdefault("extensions", {})
    pbr = material.setdefault("pbrMetallicRoughness", {})
    for name in ("clearcoat", "sheen", "anisotropy"):
        ext.pop(f"KHR_materials_{name}", None)
    if ext.get("KHR_materials_transmission", {}).get("transmissionFactor", 0) == 1:
        pbr.update(baseColorFactor=[1, 1, 1, 1], roughnessFactor=0)
        volume = ext.get("KHR_materials_volume", {})
        volume.pop("attenuationDistance", None)
        volume.pop("attenuationColor", None)
    elif pbr.get("metallicFactor", 1) == 1 and not any(material.get("emissiveFactor", [0])):
        pbr.update(baseColorFactor=[1, 1, 1, 1], roughnessFactor=0)
    else:
        pbr["metallicFactor"] = 0
        ext["KHR_materials_specular"] = {"specularFactor": 0}


def ball(doc: Json, node: Json, radius: float) -> None:
    """Turns the node of a point or spot into a sphere of the same intensity."""
    lamp = doc["extensions"]["KHR_lights_punctual"]["lights"][node["extensions"].pop("KHR_lights_punctual")["light"]]
    color = lamp.get("color", [1, 1, 1])
    radiance = lamp["intensity"] / BLENDER / (math.pi * radius**2)
    doc["materials"].append({
        "name": f"{lamp['name']} as a ball", "emissiveFactor": color,
        "pbrMetallicRoughness": {"baseColorFactor": [0, 0, 0, 1], "metallicFactor": 0},
        "extensions": {"KHR_materials_emissive_strength": {"emissiveStrength": radiance},
                       "KHR_materials_specular": {"specularFactor": 0}},
    })
    # The sphere takes the place of the triangles; some there must be.
    primitive = dict(doc["meshes"][0]["primitives"][0], material=len(doc["materials"]) - 1)
    doc["meshes"].append({"primitives": [primitive]})
    node["mesh"] = len(doc["meshes"]) - 1
    node["extras"] = {"sphere_radius": radius}
    used = doc["extensionsUsed"]
    if "KHR_materials_emissive_strength" not in used:
        used.append("KHR_materials_emissive_strength")


def matched(file: Gltf, name: str, balls: float = 1.0, suns: float = 1.0) -> Gltf:
    """The copy of a scene, its lamps so many times as large as in Blender; `plain` is as it was."""
    doc = copy.deepcopy(file.doc)
    for material in doc["materials"]:
        plain_material(material)
    lights = doc.get("extensions", {}).get("KHR_lights_punctual", {}).get("lights", [])
    if name in RADII:
        for lamp in lights:
            if lamp["type"] == "directional":
                lamp["extras"] = {"dualight": {"angle": SUN * suns, "seen_by_camera": True}}
        for node in doc["nodes"]:
            index = node.get("extensions", {}).get("KHR_lights_punctual", {}).get("light")
            if index is not None and lights[index]["type"] != "directional":
                ball(doc, node, RADII[name][lights[index]["name"]] * balls)
    for node in doc["nodes"]:
        factor = SHRUNK.get(name, {}).get(node.get("name"))
        if factor:
            shrink(doc, node, factor)
    return Gltf(doc, file.binary)


def shrink(doc: Json, node: Json, factor: float) -> None:
    """Scales what a node shows about the middle of its bounds."""
    position = doc["meshes"][node["mesh"]]["primitives"][0]["attributes"]["POSITION"]
    bounds = doc["accessors"][position]
    middle = [(a + b) / 2 for a, b in zip(bounds["min"], bounds["max"])]
    if {"translation", "rotation", "scale", "matrix"} & set(node):
        raise ValueError(f"{node['name']} has a transform of its own")
    node["scale"] = [factor] * 3
    node["translation"] = [m * (1 - factor) for m in middle]
