#!/usr/bin/env python3
"""Makes the tables of scenes and effects in docs/effects.md.

    cargo build --release
    scripts/effects_table.py [--repeats N] [--size WxH] [--spp N] [--matte-box] SCENE...

Each scene is rendered as the survey decides and with every effect forced, by turns, N times each;
what is compared is the time of the processor. From the statistics of the first run of either come
the decisions, counts and shares of time; from the images, how far they are apart: `same` if no bit
differs, otherwise the root of the mean squared difference and its share of the mean. An effect that
is part of the scene cannot be forced where the scene has nothing of it; the times are of all that
can be, together. Ends with 1 if an effect that is off counted anything.
"""
import argparse
import json
import os
import statistics
import subprocess
import sys
import tempfile
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
BINARY = ROOT / "target/release/dualight"


def changed_box(folder, name, change):
    """The box with some materials changed, as glTF: `change` takes each of them."""
    scene = json.loads((ROOT / "scenes/box.gltf").read_text())
    for material in scene["materials"]:
        change(material)
    path = Path(folder) / f"{name}_box.gltf"
    path.write_text(json.dumps(scene))
    return path


def matte(material):
    """A matte surface; with matte ones alone the box calls for no more than direct and indirect light."""
    extensions = material.setdefault("extensions", {})
    for name in [name for name in extensions if name != "KHR_materials_emissive_strength"]:
        del extensions[name]
    extensions["KHR_materials_specular"] = {"specularFactor": 0.0}
    values = material.setdefault("pbrMetallicRoughness", {})
    values.update({"metallicFactor": 0.0, "roughnessFactor": 1.0})


def render(scene, effects, arguments, folder):
    """Renders; the statistics, the image, and the seconds of the processor that it took."""
    image, told = Path(folder) / f"{effects}.exr", Path(folder) / f"{effects}.json"
    command = [str(BINARY), "render", str(scene), "--effects", effects, "-o", str(image), "-q",
               f"--json={told}", *arguments]
    process = subprocess.Popen(command, stderr=subprocess.DEVNULL)
    _, status, usage = os.wait4(process.pid, 0)
    if status != 0:
        sys.exit(f"failed: {' '.join(command)}")
    return json.loads(told.read_text()), image, usage.ru_utime + usage.ru_stime


def apart(one, other):
    """How far two images are apart, in words."""
    run = subprocess.run([str(BINARY), "diff", str(one), str(other)], capture_output=True, text=True)
    values = {}
    for line in run.stdout.splitlines():
        name, _, rest = line.strip().partition("  ")
        values[name] = rest.split()
    rmse = float(values["RMSE"][0])
    mean = sum(map(float, values["reference mean"])) / 3
    return "same" if rmse == 0.0 else f"RMSE {rmse:.1e}, {100 * rmse / mean:.2f} % of the mean"


def counted(counts):
    """The counts above zero, in words."""
    def short(n):
        for unit, size in [("G", 1e9), ("M", 1e6), ("k", 1e3)]:
            if n >= size:
                return f"{n / size:.3g}{unit}"
        return str(n)
    return ", ".join(f"{short(n)} {what}" for what, n in counts.items() if n > 0)


def row(scene, integrator, options):
    """Two lines of the tables: decisions and times; and whether every effect off counted 0."""
    arguments = ["--integrator", integrator, "--size", options.size, "--spp", str(options.spp),
                 "--threads", "2", "--seed", "1", "--pixel-sampling", "uniform"]
    with tempfile.TemporaryDirectory() as folder:
        times = {"auto": [], "all": []}
        for turn in range(options.repeats):
            for effects in sorted(times, reverse=turn % 2 == 0):
                found, image, seconds = render(scene, effects, arguments, folder)
                times[effects].append(seconds)
                if effects == "auto":
                    told = found
        same = apart(Path(folder) / "auto.exr", Path(folder) / "all.exr")
    on = [e for e in told["effects"] if e["on"]]
    off = [e for e in told["effects"] if not e["on"]]
    idle = all(n == 0 for e in off for n in e["counts"].values())
    cells = []
    for e in on:
        share = "not timed" if e["time_share"] is None else f"{100 * e['time_share']:.1f} %"
        cells.append(f"`{e['name']}` {share}: {counted(e['counts']) or 'nothing'}")
    name = Path(scene).stem
    ratio = statistics.median(b / a for a, b in zip(times["auto"], times["all"]))
    seconds = statistics.median(times["auto"])
    detected = f"| {name} | `{integrator}` | {'<br>'.join(cells)} | {len(off)} | {'yes' if idle else 'NO'} |"
    forced = f"| {name} | `{integrator}` | {seconds:.2f} | {ratio:.3f} | {same} |"
    return detected, forced, idle


def main():
    parser = argparse.ArgumentParser(description=__doc__,
                                     formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--matte-box", action="store_true", help="also scenes/box.gltf with every surface matte")
    parser.add_argument("scenes", nargs="+", type=Path, metavar="SCENE")
    parser.add_argument("--repeats", type=int, default=5)
    parser.add_argument("--size", default="128x128")
    parser.add_argument("--spp", type=int, default=16)
    options = parser.parse_args()
    rows = []
    with tempfile.TemporaryDirectory() as folder:
        for scene in options.scenes + ([changed_box(folder, "matte", matte)] if options.matte_box else []):
            for integrator in ["path", "photon"]:
                rows.append(row(scene, integrator, options))
                print(f"{scene} by {integrator}: done", file=sys.stderr)
    print("| scene | integrator | on: share of time, counts | off | off counted 0 |\n|---|---|---|---|---|")
    for detected, _, _ in rows:
        print(detected)
    print("\n| scene | integrator | s | time of `all` over `auto` | pictures |\n|---|---|---|---|---|")
    for _, forced, _ in rows:
        print(forced)
    return 0 if all(idle for _, _, idle in rows) else 1


if __name__ == "__main__":
    sys.exit(main())
