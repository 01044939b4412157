#!/usr/bin/env python3
"""Seconds to a relative mean squared error: Dualight against Mitsuba 3 on seven scenes, in one run.

The box of scenes/box.gltf, its lamp with half the width 0.25 and 0.05 and the same flux, and five scenes
exported from Blender are rendered by Mitsuba's path tracer, by Dualight's `path` and by Dualight as it
is by default, from the same triangles, spheres, lamps and reflectances: matched_scenes.py says what is
changed in the files for that, gltf_to_mitsuba.py reads them. The three take turns, several seeds each.
Needs, beside a release build of Dualight, LLVM for Mitsuba's variant llvm_ad_rgb (Debian: libllvm19;
DRJIT_LIBLLVM_PATH names it where it is not found), and:

    python3 -m venv venv && venv/bin/pip install mitsuba==3.9.1 numpy
    venv/bin/python scripts/compare_with_mitsuba.py --assets DIRECTORY --budget 85 -o comparison.json
    venv/bin/python scripts/compare_with_mitsuba.py --table comparison.json

DIRECTORY holds cup.glb, ring.glb, pool.glb, interior.glb and plain.glb.

How errors are found. Path tracers have no bias: their error is their variance, which seeds tell
without a reference, and which falls as one over the samples, so that one number of samples tells the
seconds to every error. Where light is missing from the mean of all their pictures, since not one path
found it, the variance says too little; then the error of that mean gives a bound from below, "more
than". Dualight by default may have a bias: its pictures, of more and more samples a
pixel and no other option, are compared with two long renderings by its `photon` without interpolation, less
the error of those, which their difference tells. That reference is compared with the mean of all
pictures of both path tracers over blocks of pixels, where their noise is small enough to see a bias;
--enlarge makes the lamps of the scenes from Blender so large that paths find them.
Time is that of rendering, on the clock: Mitsuba compiles its kernels in a picture before, Dualight's
import is not counted.
"""

import argparse
import glob
import json
import math
import os
import subprocess
import sys
import tempfile
import time
from pathlib import Path

from comparison_table import table

ROOT = Path(__file__).resolve().parent.parent
TARGETS = [0.01, 0.003, 0.001]
BOXES = {"box": 0.25, "box-small": 0.05}
SCENES = [*BOXES, "cup", "ring", "pool", "interior", "plain"]
# Parts of a scene's time.
SHARES = {"reference": 0.3, "mitsuba": 0.25, "path": 0.15, "auto": 0.3}
# Of the reference: nothing interpolated, which would be a bias.
LONG = ("--integrator", "photon", "--interpolation", "off")
BLOCK = 8


def find_llvm():
    """Lets Dr.Jit find LLVM where Debian puts it."""
    if "DRJIT_LIBLLVM_PATH" not in os.environ:
        found = sorted(glob.glob("/usr/lib/*/libLLVM*19*.so*") + glob.glob("/usr/lib/llvm-19/lib/libLLVM*.so*"))
        if found:
            os.environ["DRJIT_LIBLLVM_PATH"] = found[0]


def box(half_width, directory):
    """The box with a lamp of another size and the same flux, as glTF."""
    scene = json.loads((ROOT / "scenes" / "box.gltf").read_text())
    factor = half_width / 0.25
    lamp = next(n for n in scene["nodes"] if n["name"] == "lamp")
    lamp["scale"] = [factor, 1.0, factor]
    material = next(m for m in scene["materials"] if m["name"] == "lamp")
    strength = material["extensions"]["KHR_materials_emissive_strength"]
    strength["emissiveStrength"] /= factor**2
    path = Path(directory) / f"box_{half_width}.gltf"
    path.write_text(json.dumps(scene))
    return path, strength["emissiveStrength"]


def mitsuba_box(half_width, radiance, size):
    """The same box for Mitsuba."""
    from mitsuba import ScalarTransform4f as T

    def grey(r, g, b):
        return {"type": "twosided", "bsdf": {"type": "diffuse", "reflectance": {"type": "rgb", "value": [r, g, b]}}}

    # A rectangle reaches from -1 to 1 in x and y and faces +z.
    wall = lambda to_world, bsdf: {"type": "rectangle", "to_world": to_world, "bsdf": bsdf}
    white = grey(0.75, 0.75, 0.75)
    ball = lambda center, bsdf: {"type": "sphere", "center": center, "radius": 0.3, "bsdf": bsdf}
    move, turn = T().translate, T().rotate
    return {
        "type": "scene",
        "integrator": {"type": "path"},
        "sensor": {
            "type": "perspective", "fov": 39.3, "fov_axis": "y",
            "to_world": T().look_at(origin=[0, 0, 3.8], target=[0, 0, 0], up=[0, 1, 0]),
            "film": {"type": "hdrfilm", "width": size, "height": size, "rfilter": {"type": "box"},
                     "pixel_format": "rgb", "component_format": "float32"},
            "sampler": {"type": "independent"},
        },
        "floor": wall(move([0, -1, 0]) @ turn([1, 0, 0], -90), white),
        "ceiling": wall(move([0, 1, 0]) @ turn([1, 0, 0], 90), white),
        "back": wall(move([0, 0, -1]), white),
        "left": wall(move([-1, 0, 0]) @ turn([0, 1, 0], 90), grey(0.75, 0.1, 0.1)),
        "right": wall(move([1, 0, 0]) @ turn([0, 1, 0], -90), grey(0.1, 0.75, 0.1)),
        "lamp": {
            "type": "rectangle",
            "to_world": move([0, 0.998, 0]) @ turn([1, 0, 0], 90) @ T().scale([half_width, half_width, 1]),
            "bsdf": grey(0, 0, 0),
            "emitter": {"type": "area", "radiance": {"type": "rgb", "value": [radiance] * 3}},
        },
        "diffuse": ball([-0.6, -0.7, 0.1], white),
        "mirror": ball([0.0, -0.7, -0.4], {"type": "conductor", "material": "none"}),
        "glass": ball([0.6, -0.7, 0.3], {"type": "dielectric", "int_ior": 1.5, "ext_ior": 1.0}),
    }


def prepare(name, args, directory):
    """The scene for both: the file, Mitsuba's dictionary and the height of the picture."""
    if name in BOXES:
        path, radiance = box(BOXES[name], directory)
        return path, mitsuba_box(BOXES[name], radiance, args.size), args.size
    import gltf_to_mitsuba
    import matched_scenes

    file = matched_scenes.matched(gltf_to_mitsuba.Gltf.read(Path(args.assets) / f"{name}.glb"), name, *args.enlarge)
    path = Path(directory) / f"{name}.glb"
    file.write(path)
    height = round(args.size / file.doc["cameras"][0]["perspective"]["aspectRatio"])
    return path, gltf_to_mitsuba.scene_dict(file, args.size, height), height


def rel_mse(a, b):
    import numpy as np

    return float(np.mean((a - b) ** 2 / (b**2 + 0.01)))


def read_exr(path):
    import mitsuba as mi
    import numpy as np

    bitmap = mi.Bitmap(str(path))
    names = [f.name for f in bitmap.struct_()]
    data = np.array(bitmap, dtype=np.float64).reshape(bitmap.height(), bitmap.width(), -1)
    return np.stack([data[..., names.index(c)] for c in "RGB"], axis=-1)


def blocks(image, n=BLOCK):
    """Means over blocks of n by n pixels."""
    h, w, c = image.shape
    return image[: h // n * n, : w // n * n].reshape(h // n, n, w // n, n, c).mean(axis=(1, 3))


class Dualight:
    """Renders one scene with Dualight."""

    def __init__(self, program, scene, size, directory):
        self.program, self.scene, self.size = program, scene, size
        self.out = Path(directory) / "out.exr"
        self.taken, self.stages = {}, {}

    def render(self, spp, seed, *options):
        """The picture and the seconds of rendering; notes the integrator taken and the stages."""
        line = [self.program, "render", self.scene, "--size", "{}x{}".format(*self.size), "-o", self.out,
                "--quiet", "--json", "--spp", spp, "--seed", seed, *options]
        done = subprocess.run([str(w) for w in line], check=True, capture_output=True, text=True)
        told = json.loads(done.stdout)
        self.taken[spp] = told["settings"]["integrator"]
        self.stages = {s["stage"]: s["seconds"] for s in told["statistics"]["stages"]}
        return read_exr(self.out), sum(t for s, t in self.stages.items() if s not in ("import", "write"))

    def rate(self, *options):
        """Seconds of a picture, and of one sample a pixel more."""
        (_, few), (_, many) = (self.render(spp, 0, *options) for spp in (4, 32))
        return few, max(many - few, 1e-3 * many) / 28


def power_of_two(x, least, most):
    return 2 ** round(math.log2(min(max(x, least), most)))


def steady(runs, reference, floor, block_floor):
    """What pictures without bias tell: their relMSE, the seconds of one, and what an error costs."""
    import numpy as np

    pictures = np.array([p for p, _ in runs])
    variance = float(np.mean(np.var(pictures, axis=0, ddof=1) / (reference**2 + 0.01)))
    seconds = float(np.median([t for _, t in runs]))
    agrees = agreement(pictures, reference, block_floor)
    # Error times seconds is constant for it.
    cost, missing = variance * seconds, agrees["difference"] > 3 * agrees["noise"]
    if missing:
        cost = max(cost, (rel_mse(pictures.mean(axis=0), reference) - floor) * seconds * len(pictures))
    return {"pictures": len(pictures), "seconds": seconds, "relmse": variance, "cost": cost,
            "light_missing": missing, "agreement": agrees}


def agreement(pictures, reference, reference_noise):
    """How the mean of pictures differs from the reference over blocks, and how much of it is noise."""
    import numpy as np

    mean, truth = blocks(pictures.mean(axis=0)), blocks(reference)
    stack = np.array([blocks(p) for p in pictures])
    noise = np.mean(np.var(stack, axis=0, ddof=1) / len(stack) / (truth**2 + 0.01))
    return {"ratio_of_means": float(mean.mean() / truth.mean()), "difference": rel_mse(mean, truth),
            "noise": float(noise) + reference_noise}


def reach(points, level):
    """Seconds at which a falling curve passes a level, by straight lines in logarithms."""
    if points and points[0][1] <= level:
        return points[0][0], "at most"
    for (t0, e0), (t1, e1) in zip(points, points[1:]):
        if e1 <= level:
            f = math.log(level / e0) / math.log(max(e1, 1e-12) / e0)
            return t0 * (t1 / t0) ** f, ""
    return None, "not reached"


def compare(name, args, directory):
    """Measures one scene."""
    import mitsuba as mi
    import numpy as np

    began = time.perf_counter()
    path, described, height = prepare(name, args, directory)
    theirs = mi.load_dict(described)
    ours = Dualight(args.program, path, (args.size, height), directory)

    def mitsuba(spp, seed):
        start = time.perf_counter()
        picture = np.array(mi.render(theirs, spp=spp, seed=seed), dtype=np.float64)
        return picture, time.perf_counter() - start

    mitsuba(16, 1_000_000)
    per_sample = mitsuba(16, 1_000_001)[1] / 16
    _, photon_rate = ours.rate(*LONG)
    _, path_rate = ours.rate("--integrator", "path")
    first, auto_rate = ours.rate()
    left = max(args.budget - (time.perf_counter() - began), 0.3 * args.budget)
    share = {k: v * left / (2 if k == "reference" else args.seeds) for k, v in SHARES.items()}
    mitsuba_spp = power_of_two(share["mitsuba"] / 2 / per_sample, 16, 256)
    mitsuba_pictures = max(round(share["mitsuba"] / (mitsuba_spp * per_sample)), 2)
    path_spp = power_of_two(share["path"] / 2 / path_rate, 16, 4096)
    # A ladder of factors of four takes 4/3 of the time of its last rung.
    longest = max((share["auto"] / 4 * 3 - first) / auto_rate, 16)
    ladder = [4**k for k in range(1 + int(math.log(longest, 4)))]

    mitsuba(mitsuba_spp, 1_000_002)
    runs = {"mitsuba": [], "path": [], "auto": {spp: [] for spp in ladder}}
    for seed in range(args.seeds):
        runs["mitsuba"] += [mitsuba(mitsuba_spp, len(runs["mitsuba"]) + k) for k in range(mitsuba_pictures)]
        runs["path"] += [ours.render(path_spp, 2 * seed + k, "--integrator", "path") for k in range(2)]
        for spp in ladder:
            runs["auto"][spp].append(ours.render(spp, seed))
    taken, stages = {spp: ours.taken[spp] for spp in ladder}, ours.stages
    reference_spp = max(round(share["reference"] / photon_rate), 16)
    long = [ours.render(reference_spp, 1000 + k, *LONG) for k in range(2)]
    halves = [picture for picture, _ in long]

    reference = (halves[0] + halves[1]) / 2
    spread = lambda a, b, truth: float(np.mean((a - b) ** 2 / (truth**2 + 0.01))) / 4
    floor = spread(*halves, reference)
    block_floor = spread(*(blocks(h) for h in halves), blocks(reference))
    result = {"scene": name, "width": args.size, "height": height,
              "reference_spp": reference_spp, "reference_seconds": sum(t for _, t in long), "reference_relmse": floor,
              "taken": taken, "profile": stages}
    for key, spp in (("mitsuba", mitsuba_spp), ("path", path_spp)):
        result[key] = {"spp": spp, **steady(runs[key], reference, floor, block_floor)}
    curve = [(float(np.median([t for _, t in r])), float(np.mean([rel_mse(i, reference) for i, _ in r])) - floor)
             for r in runs["auto"].values()]
    result["curve"] = [[spp, t, e] for spp, (t, e) in zip(ladder, curve)]
    result["times"] = []
    for level in TARGETS:
        t, note = reach(curve, level) if level > floor else (None, "below the error of the reference")
        result["times"].append({"relmse": level, "mitsuba": result["mitsuba"]["cost"] / level,
                                "path": result["path"]["cost"] / level, "auto": t, "note": note})
    result["elapsed"] = time.perf_counter() - began
    report(result)
    return result


def report(result):
    """Tells a scene's figures as they are measured."""
    print(f"{result['scene']}: {result['elapsed']:.0f} s in all, reference {result['reference_spp']} samples,"
          f" {result['reference_seconds']:.1f} s, relMSE {result['reference_relmse']:.2e}")
    for key in ("mitsuba", "path"):
        r = result[key]
        a = r["agreement"]
        print(f"  {key}: {r['pictures']} pictures of {r['spp']} samples, {r['seconds']:.2f} s,"
              f" relMSE {r['relmse']:.4g}; means {a['ratio_of_means']:.4f}, blocks differ by {a['difference']:.2e},"
              f" of which noise {a['noise']:.2e}{', light is missing' if r['light_missing'] else ''}")
    for spp, t, e in result["curve"]:
        print(f"  auto ({result['taken'][spp]}): {spp} samples {t:.2f} s relMSE {e:.3g}")
    total = sum(result["profile"].values())
    parts = ", ".join(f"{k} {100 * v / total:.0f} %" for k, v in result["profile"].items())
    print("  time of the longest: " + parts, flush=True)


def main():
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("--program", default=str(ROOT / "target" / "release" / "dualight"))
    parser.add_argument("--scenes", nargs="+", choices=SCENES, default=SCENES, metavar="NAME", help=", ".join(SCENES))
    parser.add_argument("--assets", default=".", help="directory of the .glb files from Blender")
    parser.add_argument("--size", type=int, default=128, help="width in pixels; the camera says the height")
    parser.add_argument("--budget", type=float, default=85, help="seconds for each scene, about")
    parser.add_argument("--seeds", type=int, default=3, help="turns, each with seeds of its own")
    parser.add_argument("--enlarge", type=float, nargs=2, default=[1, 1], metavar=("BALLS", "SUNS"),
                        help="factors of the sizes of lamps, to see that the renderers agree")
    parser.add_argument("-o", "--output", help="JSON file to write")
    parser.add_argument("--table", metavar="FILE", help="only print the tables of a JSON file written before")
    args = parser.parse_args()
    if args.table:
        print(table(json.loads(Path(args.table).read_text())))
        return
    find_llvm()
    try:
        import mitsuba as mi
    except ImportError:
        sys.exit("compare_with_mitsuba.py: Mitsuba is not installed; see the head of this file")
    mi.set_variant("llvm_ad_rgb")
    results = []
    with tempfile.TemporaryDirectory() as directory:
        for name in args.scenes:
            results.append(compare(name, args, directory))
            if args.output:
                done = {"mitsuba": mi.__version__, "results": results}
                Path(args.output).write_text(json.dumps(done, indent=1) + "\n")


if __name__ == "__main__":
    main()
