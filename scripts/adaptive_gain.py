#!/usr/bin/env python3
"""What adaptive emission, or adaptive pixels, gain: noise of each layer times processor seconds.

    scripts/adaptive_gain.py SCENE [--of emission|pixel-sampling] [--seeds 10] [--size 64x64]
                             [OPTIONS OF dualight render ...]

Against uniform ones, all else alike, seed by seed in turns. It is of noise alone: emissions share
their bias, but adaptive pixels interpolate, and what that blurs is not counted. Intervals are 95 % by the
jackknife over seeds. Needs numpy and OpenEXR. DUALIGHT names the binary [target/release/dualight].
"""
import argparse
import os
import resource
import subprocess
import tempfile

import numpy as np
import Imath
import OpenEXR

LAYERS = ["", "caustics", "indirect", "direct", "specular"]


def seconds(command):
    """Runs it and tells the processor seconds that it took."""
    used = lambda: sum(resource.getrusage(resource.RUSAGE_CHILDREN)[:2])
    before = used()
    subprocess.run(command, check=True)
    return used() - before


def luminances(path):
    """Luminance of each layer."""
    file = OpenEXR.InputFile(path)
    window = file.header()["dataWindow"]
    shape = (window.max.y - window.min.y + 1, window.max.x - window.min.x + 1)
    kind = Imath.PixelType(Imath.PixelType.FLOAT)
    channel = lambda name: np.frombuffer(file.channel(name, kind), np.float32).reshape(shape).astype(float)
    out = {}
    for layer in LAYERS:
        prefix = layer + "." if layer else ""
        if prefix + "R" in file.header()["channels"]:
            weights = zip((0.2126, 0.7152, 0.0722), "RGB")
            out[layer] = sum(w * channel(prefix + c) for w, c in weights)
    return out


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("scene")
    parser.add_argument("--of", choices=["emission", "pixel-sampling"], default="emission")
    parser.add_argument("--seeds", type=int, default=10)
    parser.add_argument("--size", default="64x64")
    args, more = parser.parse_known_args()
    binary = os.environ.get("DUALIGHT", "target/release/dualight")
    names = ["uniform", "adaptive"]
    images, times = {n: [] for n in names}, {n: [] for n in names}
    with tempfile.TemporaryDirectory() as folder:
        path = os.path.join(folder, "picture.exr")
        for seed in range(args.seeds):
            for name in names:
                times[name].append(seconds(
                    [binary, "render", args.scene, "--integrator", "photon", "--" + args.of, name, "--size",
                     args.size, "--seed", str(seed), "--quiet", "-o", path] + more))
                images[name].append(luminances(path))
    mean = np.mean([i[""] for n in names for i in images[n]], axis=0)
    every = np.arange(args.seeds)

    def noise(name, layer, seeds):
        values = np.array([images[name][s][layer] for s in seeds])
        return np.mean(values.var(axis=0, ddof=1) / (mean**2 + 0.01))

    def gain(layer, seeds):
        cost = [noise(n, layer, seeds) * np.mean([times[n][s] for s in seeds]) for n in names]
        return np.log(cost[0] / cost[1])

    print(f"seconds: uniform {np.mean(times['uniform']):.2f}, adaptive {np.mean(times['adaptive']):.2f}")
    for layer in LAYERS:
        if not all(layer in images[n][0] and noise(n, layer, every) > 0 for n in names):
            continue
        whole = gain(layer, every)
        each = [gain(layer, np.delete(every, s)) for s in every]
        error = np.sqrt((args.seeds - 1) / args.seeds * np.sum((each - np.mean(each))**2))
        low, high = np.exp(whole - 1.96 * error), np.exp(whole + 1.96 * error)
        less = noise(names[0], layer, every) / noise(names[1], layer, every)
        print(f"{layer or 'picture':9} noise {less:.2f} times less, "
              f"faster {np.exp(whole):.2f} [{low:.2f}, {high:.2f}]")


if __name__ == "__main__":
    main()
