#!/usr/bin/env python3
"""Shows that pictures of the photon map, which come in passes with ever smaller kernels, converge to
those of the path tracer:

    scripts/check_convergence.py --program target/release/dualight [--seeds 4] [--size 48x48]

For some scenes a reference is rendered with `path`. `photon` then renders with more and more samples,
final gather off and on; each time the mean squared error against the reference is measured over some
seeds, less the reference's own variance. Prints a table of errors with the slope of log error over log
samples, which is -2/3 at least by the schedule of Knaus and Zwicker (Progressive Photon Mapping: A
Probabilistic Approach, ACM TOG 30(3), 2011). Status 1 if a slope is flatter. Standard library only.
"""
import argparse
import json
import math
import subprocess
import sys
import tempfile
from pathlib import Path

HERE = Path(__file__).resolve().parent


def run(program, *arguments):
    done = subprocess.run([program, *map(str, arguments)], capture_output=True, text=True)
    if done.returncode:
        sys.exit(f"{program} {' '.join(map(str, arguments))}: {done.stderr.strip()}")
    return done.stdout


def render(args, scene, output, integrator, spp, seed, *more):
    run(args.program, "render", scene, "--size", args.size, "--spp", spp, "--seed", seed, "-q",
        "--integrator", integrator, "-o", output, *more)
    return output


def mse(args, image, other):
    return json.loads(run(args.program, "diff", image, other, "--json"))["comparison"]["rmse"] ** 2


def slope(points):
    """Of the straight line through logarithms, by least squares."""
    logs = [(math.log(x), math.log(y)) for x, y in points]
    mx, my = (sum(c) / len(logs) for c in zip(*logs))
    return sum((x - mx) * (y - my) for x, y in logs) / sum((x - mx) ** 2 for x, _ in logs)


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("scenes", nargs="*", help="glTF files [default: the box and those of make_study_scenes.py]")
    parser.add_argument("--program", default="target/release/dualight")
    parser.add_argument("--seeds", type=int, default=4)
    parser.add_argument("--size", default="48x48")
    parser.add_argument("--spp", type=int, nargs="+", default=[16, 64, 256, 1024])
    parser.add_argument("--reference-spp", type=int, default=16384)
    parser.add_argument("--gather", nargs="+", default=["off", "on"], choices=["off", "on"])
    args = parser.parse_args()
    flat = False
    columns = " | ".join(f"{spp} samples" for spp in args.spp)
    print(f"| scene | final gather | {columns} | slope |")
    print("|---|---|" + "---:|" * (len(args.spp) + 1))
    with tempfile.TemporaryDirectory() as folder:
        folder = Path(folder)
        if not args.scenes:
            subprocess.run([sys.executable, HERE / "make_study_scenes.py", folder], check=True,
                           stdout=subprocess.DEVNULL)
            study = [folder / f"{name}.glb" for name in ("interior", "textured")]
            args.scenes = [HERE.parent / "scenes" / "box.gltf", *study]
        for scene in map(Path, args.scenes):
            # Two halves: how far they are apart tells the variance of either.
            halves = [render(args, scene, folder / f"r{k}.exr", "path", args.reference_spp // 2, 1000 + k)
                      for k in range(2)]
            own = mse(args, *halves) / 2
            for gather in args.gather:
                points = []
                for spp in args.spp:
                    errors = []
                    for seed in range(1, args.seeds + 1):
                        more = ["--pixel-sampling", "uniform"]
                        more += ["--gather", "off"] if gather == "off" else []
                        image = render(args, scene, folder / "p.exr", "photon", spp, seed, *more)
                        errors += [mse(args, image, half) - own for half in halves]
                    points.append((spp, max(sum(errors) / len(errors), sys.float_info.min)))
                fall = slope(points)
                flat |= fall > -2 / 3
                cells = " | ".join(f"{error:.2e}" for _, error in points)
                print(f"| {scene.stem} | {gather} | {cells} | {fall:.2f} |", flush=True)
    sys.exit(flat)


if __name__ == "__main__":
    main()
