#!/usr/bin/env python3
"""Renders six scenes in three units, each a thousand times the other, and compares the pictures:

    scripts/check_scale.py --program target/release/dualight [--seeds 8] [--size 96x96]

The scenes are those of scenes/, of make_study_scenes.py, and the box under lamps without surface
with tinted glass. A larger unit means: the scene's roots below one node with a scale; intensities
of points and spots times its square; ranges and distances of attenuation times it. All settings
are the defaults; every picture has a seed of its own.

Prints a table: the ratio of the pictures' means with its standard error, and relMSE between a picture
in the one unit and in the other over that between two in the same. Status 1 if a ratio is farther
from 1 than four of its standard errors. Standard library only.
"""
import argparse
import copy
import json
import math
import struct
import subprocess
import sys
import tempfile
from pathlib import Path

HERE = Path(__file__).resolve().parent
SCALES = [1e-3, 1e3]


def read(path):
    """The JSON of a glTF file and the rest of it, if it is a .glb."""
    raw = path.read_bytes()
    if path.suffix == ".gltf":
        return json.loads(raw), None
    length = struct.unpack("<I", raw[12:16])[0]
    return json.loads(raw[20:20 + length]), raw[20 + length:]


def write(path, doc, rest):
    if rest is None:
        path.write_text(json.dumps(doc))
        return
    text = json.dumps(doc).encode()
    text += b" " * (-len(text) % 4)
    head = struct.pack("<4sIIII", b"glTF", 2, 20 + len(text) + len(rest), len(text), 0x4E4F534A)
    path.write_bytes(head + text + rest)


def lamps(doc):
    """The box with a point, a spot and a sun for its lamp, and with tinted glass."""
    doc = copy.deepcopy(doc)
    for material in doc["materials"]:
        if material["name"] == "lamp":
            del material["emissiveFactor"], material["extensions"]["KHR_materials_emissive_strength"]
        if material["name"] == "glass":
            material["extensions"]["KHR_materials_volume"].update(
                attenuationDistance=0.5, attenuationColor=[0.6, 0.9, 0.7])
    down = [-math.sqrt(0.5), 0.0, 0.0, math.sqrt(0.5)]
    lights = [({"type": "point", "intensity": 400.0, "range": 8.0}, [-0.5, 0.6, 0.4], None),
              ({"type": "spot", "intensity": 1500.0, "spot": {"outerConeAngle": 0.5}}, [0.5, 0.9, 0.3], down),
              ({"type": "directional", "intensity": 200.0}, [0.0, 0.0, 0.0], None)]
    doc["extensions"] = {"KHR_lights_punctual": {"lights": [light for light, _, _ in lights]}}
    doc["extensionsUsed"] = sorted({*doc["extensionsUsed"], "KHR_lights_punctual"})
    for i, (_, place, turn) in enumerate(lights):
        node = {"translation": place, "extensions": {"KHR_lights_punctual": {"light": i}}}
        doc["scenes"][0]["nodes"].append(len(doc["nodes"]))
        doc["nodes"].append(node | ({"rotation": turn} if turn else {}))
    return doc


def scaled(doc, s):
    """The same scene in a unit that is smaller by `s`."""
    doc = copy.deepcopy(doc)
    for scene in doc["scenes"]:
        doc["nodes"].append({"name": "unit", "scale": [s] * 3, "children": scene["nodes"]})
        scene["nodes"] = [len(doc["nodes"]) - 1]
    for light in doc.get("extensions", {}).get("KHR_lights_punctual", {}).get("lights", []):
        if light["type"] != "directional":
            light["intensity"] = light.get("intensity", 1.0) * s * s
        if "range" in light:
            light["range"] *= s
    for material in doc.get("materials", []):
        volume = material.get("extensions", {}).get("KHR_materials_volume", {})
        if "attenuationDistance" in volume:
            volume["attenuationDistance"] *= s
    for camera in doc.get("cameras", []):
        kind = camera[camera["type"]]
        for length in ("znear", "zfar", "xmag", "ymag"):
            if length in kind:
                kind[length] *= s
    return doc


def run(program, *arguments):
    done = subprocess.run([program, *map(str, arguments)], capture_output=True, text=True)
    if done.returncode:
        sys.exit(f"{program} {' '.join(map(str, arguments))}: {done.stderr.strip()}")
    return done.stdout


def mean_and_error(values):
    mean = sum(values) / len(values)
    square = sum((v - mean) ** 2 for v in values) / (len(values) - 1)
    return mean, math.sqrt(square / len(values))


def pictures(args, scene, folder, first):
    out = []
    for k in range(args.seeds):
        out.append(folder / f"{scene.stem}_{first + k}.exr")
        run(args.program, "render", scene, "--size", args.size, "--seed", first + k, "-q", "-o", out[-1])
    return out


def compared(args, images, others):
    """Pairs of images, as `dualight diff` sees them: means of the first ones, and relMSE."""
    pairs = [json.loads(run(args.program, "diff", a, b, "--json"))["comparison"]
             for a, b in zip(images, others)]
    # Single outliers are no matter of scale, and are as many in every unit.
    return [sum(p["mean"]) / 3 for p in pairs], [p["rel_mse_trimmed"] for p in pairs]


def scenes(folder):
    """Names, documents and buffers of the scenes."""
    subprocess.run([sys.executable, HERE / "make_study_scenes.py", folder], check=True,
                   stdout=subprocess.DEVNULL)
    box = read(HERE.parent / "scenes" / "box.gltf")
    yield "box", *box
    yield "box_mesh", *read(HERE.parent / "scenes" / "box_mesh.glb")
    for name in ("caustics", "interior", "textured"):
        yield name, *read(folder / f"{name}.glb")
    yield "lamps", lamps(box[0]), box[1]


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--program", default="target/release/dualight")
    parser.add_argument("--seeds", type=int, default=8)
    parser.add_argument("--size", default="96x96")
    args = parser.parse_args()
    wrong = False
    print("| scene | scale | ratio of means | in standard errors | relMSE across units over that within |")
    print("|---|---:|---:|---:|---:|")
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        for name, doc, rest in scenes(folder):
            path = folder / f"{name}_1{'.gltf' if rest is None else '.glb'}"
            write(path, doc, rest)
            plain = pictures(args, path, folder, 1)
            means, within = compared(args, plain, plain[1:] + plain[:1])
            base, base_error = mean_and_error(means)
            for i, s in enumerate(SCALES):
                path = folder / f"{name}_x{i}{path.suffix}"
                write(path, scaled(doc, s), rest)
                other = pictures(args, path, folder, 1001 + 1000 * i)
                means, across = compared(args, other, plain)
                mean, error = mean_and_error(means)
                ratio, error = mean / base, math.hypot(error / mean, base_error / base)
                off = (ratio - 1) / error
                wrong |= abs(off) > 4
                noise = sum(across) / sum(within)
                print(f"| {name} | {s:g} | {ratio:.4f} ± {error:.4f} | {off:+.1f} | {noise:.2f} |", flush=True)
    sys.exit(wrong)


if __name__ == "__main__":
    main()
