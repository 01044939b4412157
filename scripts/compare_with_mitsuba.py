#!/usr/bin/env python3
"""Seconds to a relative mean squared error: Dualight against Mitsuba 3, on the box, in one run.

The box of scenes/box.gltf, its lamp with half the width 0.25 and 0.05 and the same flux, is rendered
by both from the same triangles, spheres and reflectances. The settings of both take turns, several
seeds each. Needs, beside a release build of Dualight, LLVM for Mitsuba's variant llvm_ad_rgb (Debian:
libllvm19; DRJIT_LIBLLVM_PATH names it where it is not found), and:

    python3 -m venv venv && venv/bin/pip install mitsuba==3.9.1 numpy
    venv/bin/python scripts/compare_with_mitsuba.py --size 128 --seeds 3 -o comparison.json

How errors are found. Mitsuba's path tracer has no bias: its error is its variance, which seeds tell
without a reference, and which falls as one over the samples. Dualight's photon maps have a bias, so
their pictures are compared with a long rendering by Dualight, and that with the mean of all pictures
by Mitsuba, over blocks of pixels, where its noise is small enough to see a bias. Time is that of
rendering: Mitsuba compiles its kernels in a picture before, Dualight's import is not counted.
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

ROOT = Path(__file__).resolve().parent.parent
TARGETS = [0.01, 0.003, 0.001]


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


def mitsuba_scene(mi, half_width, radiance, size):
    """The same box for Mitsuba."""
    from mitsuba import ScalarTransform4f as T

    def grey(r, g, b):
        return {"type": "twosided", "bsdf": {"type": "diffuse", "reflectance": {"type": "rgb", "value": [r, g, b]}}}

    # A rectangle reaches from -1 to 1 in x and y and faces +z.
    wall = lambda to_world, bsdf: {"type": "rectangle", "to_world": to_world, "bsdf": bsdf}
    white = grey(0.75, 0.75, 0.75)
    ball = lambda center, bsdf: {"type": "sphere", "center": center, "radius": 0.3, "bsdf": bsdf}
    move, turn = T().translate, T().rotate
    return mi.load_dict({
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
    })


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


def blocks(image, n=16):
    """Means over blocks of n by n pixels."""
    h, w, c = image.shape
    return image[: h // n * n, : w // n * n].reshape(h // n, n, w // n, n, c).mean(axis=(1, 3))


def dualight(program, scene, size, options, directory):
    """Renders with Dualight; returns the picture, the seconds of rendering and the statistics."""
    out = Path(directory) / "out.exr"
    line = [program, "render", scene, "--size", f"{size}x{size}", "-o", out, "--quiet", "--json", *options]
    done = subprocess.run([str(w) for w in line], check=True, capture_output=True, text=True)
    stages = {s["stage"]: s["seconds"] for s in json.loads(done.stdout)["statistics"]["stages"]}
    seconds = sum(t for stage, t in stages.items() if stage not in ("import", "write"))
    return read_exr(out), seconds, stages


def ladder(size, most=256):
    """Options of photon mapping, as `dualight accuracy` has them."""
    for spp in (n for n in (1, 4, 16, 64, 256) if n <= most):
        photons = max(size * size * min(spp, 16) // 4, 10_000)
        nearest = max(round(50 * (photons / 1e6) ** (2 / 3)), 8)
        yield spp, ["--spp", spp, "--photons", photons, "--caustic-photons", photons, "--nearest", nearest]


def reach(points, level):
    """Seconds at which a falling curve passes a level, by straight lines in logarithms."""
    if points and points[0][1] <= level:
        return points[0][0], "at most"
    for (t0, e0), (t1, e1) in zip(points, points[1:]):
        if e1 <= level:
            f = math.log(level / e0) / math.log(e1 / e0)
            return t0 * (t1 / t0) ** f, ""
    return None, "not reached"


def compare(half_width, args, directory):
    """Measures one lamp."""
    import mitsuba as mi
    import numpy as np

    scene, radiance = box(half_width, directory)
    theirs = mitsuba_scene(mi, half_width, radiance, args.size)
    render = lambda seed: np.array(mi.render(theirs, spp=args.spp, seed=seed), dtype=np.float64)
    render(1_000_000)
    pictures, seconds, ours = [], [], {spp: [] for spp, _ in ladder(args.size, args.most_spp)}
    profile = {}
    for seed in range(args.seeds):
        for _ in range(args.mitsuba_pictures):
            start = time.perf_counter()
            pictures.append(render(len(pictures)))
            seconds.append(time.perf_counter() - start)
        for spp, options in ladder(args.size, args.most_spp):
            image, t, stages = dualight(args.program, scene, args.size, [*options, "--seed", seed], directory)
            ours[spp].append((image, t))
            profile[spp] = stages
    reference, _, _ = dualight(
        args.program, scene, args.size,
        ["--spp", args.reference_spp, "--photons", "1M", "--caustic-photons", "1M", "--seed", 999], directory)

    weight = 1 / (reference**2 + 0.01)
    mean = np.mean(pictures, axis=0)
    variance = float(np.mean(np.var(pictures, axis=0, ddof=1) * weight))
    per_picture = float(np.median(seconds))
    # Error times seconds is constant for it.
    cost = variance * per_picture
    difference = rel_mse(blocks(mean), blocks(reference))
    n = len(pictures)
    stack = np.array([blocks(p) for p in pictures])
    noise = float(np.mean(np.var(stack, axis=0, ddof=1) / n / (blocks(reference) ** 2 + 0.01)))
    curve = [(float(np.median([t for _, t in runs])), float(np.mean([rel_mse(i, reference) for i, _ in runs])))
             for runs in ours.values()]
    rows = []
    for level in TARGETS:
        t, note = reach(curve, level)
        rows.append({"relmse": level, "mitsuba": cost / level, "dualight": t, "note": note,
                     "ratio": cost / level / t if t else None})
    result = {"half_width": half_width, "mitsuba_spp": args.spp, "mitsuba_relmse": variance,
              "mitsuba_seconds": per_picture, "dualight_curve": curve, "times": rows,
              "block_difference": difference, "block_noise": noise, "profile": profile}
    print(f"lamp half-width {half_width}: Mitsuba {args.spp} samples {per_picture:.2f} s relMSE {variance:.4f}")
    for t, e in curve:
        print(f"  Dualight {t:8.2f} s  relMSE {e:.5f}")
    for r in rows:
        t = f"{r['note']} {r['dualight']:.2f} s" if r["dualight"] else r["note"]
        ratio = f"{r['ratio']:.1f} times" if r["ratio"] else ""
        print(f"  relMSE {r['relmse']}: Mitsuba {r['mitsuba']:.1f} s, Dualight {t}  {ratio}")
    print(f"  over blocks the means differ by relMSE {difference:.2e}, of which noise {noise:.2e}")
    last = profile[max(profile)]
    total = sum(last.values())
    print("  time of Dualight's longest: " + ", ".join(f"{k} {100 * v / total:.0f} %" for k, v in last.items()))
    return result


def main():
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("--program", default=str(ROOT / "target" / "release" / "dualight"))
    parser.add_argument("--size", type=int, default=128, help="width and height in pixels")
    parser.add_argument("--seeds", type=int, default=3)
    parser.add_argument("--spp", type=int, default=256, help="samples of Mitsuba's pictures")
    parser.add_argument("--mitsuba-pictures", type=int, default=4, help="pictures by Mitsuba per seed")
    parser.add_argument("--most-spp", type=int, default=256, help="samples of Dualight's longest pictures")
    parser.add_argument("--reference-spp", type=int, default=1024)
    parser.add_argument("--half-widths", type=float, nargs="+", default=[0.25, 0.05])
    parser.add_argument("-o", "--output", help="JSON file to write")
    args = parser.parse_args()
    find_llvm()
    try:
        import mitsuba as mi
    except ImportError:
        sys.exit("compare_with_mitsuba.py: Mitsuba is not installed; see the head of this file")
    mi.set_variant("llvm_ad_rgb")
    with tempfile.TemporaryDirectory() as directory:
        results = [compare(h, args, directory) for h in args.half_widths]
    if args.output:
        Path(args.output).write_text(json.dumps({"mitsuba": mi.__version__, "results": results}, indent=1) + "\n")


if __name__ == "__main__":
    main()
