#!/usr/bin/env python3
"""Counts the instructions that effects cost where a scene does not call for them.

    scripts/effects_cost.py [--target-dir FOLDER] [--group NAMES]...

Builds the program (release) whole, and again without the code of a group of effects
(DUALIGHT_WITHOUT, see build.rs), renders a scene that calls for none of the group with both, and
compares the instructions that valgrind's callgrind counts. Counted is the thread that renders: of
the whole run, from the survey to the last pixel, without import, output and the thread that keeps
the clock. Backend `bvh`, one thread. What a group costs bounds what each of its effects costs.

The pictures of both must be the same. Takes some minutes for each build; needs valgrind.
"""
import argparse
import os
import re
import subprocess
import sys
import tempfile
from pathlib import Path

from effects_table import changed_box

ROOT = Path(__file__).resolve().parent.parent

GROUPS = [
    ["textures", "normals"],
    ["alpha"],
    ["absorption", "environment", "lens", "instances"],
    ["dispersion", "translucency", "coat", "sheen", "iridescence", "anisotropy"],
]

ARGUMENTS = ["--size", "32x32", "--spp", "16", "--photons", "2000", "--caustic-photons", "2000",
             "--threads", "1", "--accel", "bvh", "--seed", "1", "--pixel-sampling", "uniform"]


def build(without, target):
    """The program without the code of these effects."""
    environment = {**os.environ, "DUALIGHT_WITHOUT": ",".join(without), "CARGO_TARGET_DIR": str(target)}
    subprocess.run(["cargo", "build", "--release", "--quiet"], cwd=ROOT, env=environment, check=True)
    program = target / ("-".join(["dualight-without", *without]) if without else "dualight-whole")
    program.write_bytes((target / "release/dualight").read_bytes())
    program.chmod(0o755)
    return program


def polished(material):
    """A wall of glossy plastic: a material of the general kind, with none of its layers."""
    transmits = "KHR_materials_transmission" in material.get("extensions", {})
    if "emissiveFactor" not in material and not transmits:
        material.pop("extensions", None)
        values = material.setdefault("pbrMetallicRoughness", {})
        values.update({"metallicFactor": 0.0, "roughnessFactor": 0.4})


def instructions(program, scene, integrator, folder):
    """Instructions of the busiest thread, and the image."""
    out = Path(folder) / "callgrind.out"
    for old in Path(folder).glob("callgrind.out*"):
        old.unlink()
    image = Path(folder) / f"{program.name}-{Path(scene).stem}-{integrator}.exr"
    command = ["valgrind", "--tool=callgrind", "--separate-threads=yes", f"--callgrind-out-file={out}",
               str(program), "render", str(scene), "--integrator", integrator, "-o", str(image), "-q",
               *ARGUMENTS]
    subprocess.run(command, check=True, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
    found = [0]
    for part in Path(folder).glob("callgrind.out*"):
        found += map(int, re.findall(r"^(?:summary|totals): (\d+)", part.read_text(errors="replace"), re.M))
    return max(found), image


def main():
    parser = argparse.ArgumentParser(description=__doc__,
                                     formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--target-dir", type=Path, default=ROOT / "target/effects_cost", metavar="FOLDER")
    parser.add_argument("--group", action="append", type=lambda names: names.split(","), metavar="NAMES",
                        help="effects that are left out together; may be repeated [default: four groups]")
    options = parser.parse_args()
    target = options.target_dir.resolve()
    target.mkdir(parents=True, exist_ok=True)
    whole = build([], target)
    print("| left out | scene | integrator | instructions with | without | more |\n|---|---|---|---|---|---|",
          flush=True)
    groups = options.group or GROUPS
    counted = {}
    with tempfile.TemporaryDirectory() as folder:
        scenes = [ROOT / "scenes/box.gltf", changed_box(folder, "polished", polished)]
        for group in groups:
            lean = build(group, target)
            for scene in scenes:
                for integrator in ["path", "photon"]:
                    key = (scene, integrator)
                    if key not in counted:
                        counted[key] = instructions(whole, *key, folder)
                    compare(group, key, counted[key], instructions(lean, *key, folder), whole)


def compare(group, key, with_it, without, program):
    """Prints a line of the table, or ends where the pictures differ."""
    (scene, integrator), (all_in, one), (out, other) = key, with_it, without
    diff = subprocess.run([str(program), "diff", str(one), str(other)], capture_output=True, text=True,
                          check=True).stdout
    if not re.search(r"RMSE +0\.0+$", diff, re.M):
        sys.exit(f"without {group}, {scene.name} by {integrator} is another picture")
    names = ", ".join(f"`{name}`" for name in group)
    print(f"| {names} | {scene.stem} | `{integrator}` | {all_in / 1e6:.2f} M | {out / 1e6:.2f} M | "
          f"{100 * (all_in / out - 1):+.3f} % |", flush=True)


if __name__ == "__main__":
    main()
