#!/usr/bin/env python3
"""Mean radiance of Blender's own exports: Dualight against Cycles, on the .blend each comes from.

For every NAME given, FOLDER holds NAME.blend and the NAME.glb that Blender's exporter wrote of it.
Cycles renders the one, Dualight the other, by both integrators, with the same camera, size and
frame; no bounce is cut and nothing clamped in either. Needs, beside a release build of Dualight:

    python3.11 -m venv venv && venv/bin/pip install bpy==5.0.1 OpenEXR
    venv/bin/python scripts/compare_with_cycles.py FOLDER box ring plain

The means over the picture and over its quarters are compared, each with the standard error that
independent runs tell. With --through-script the .blend is first exported by blender_export.py, which
carries what the exporter drops. Exit status 1 if a mean is farther off than --tolerance, given twice
its standard error. --png writes the pictures side by side, at exposure 0.
"""

import argparse
import os
import subprocess
import sys
import tempfile
from pathlib import Path

import numpy as np

ROOT = Path(__file__).resolve().parent.parent


def read_exr(path, layer=""):
    """A layer of an OpenEXR file; that of the shortest name which ends so."""
    import OpenEXR

    with OpenEXR.File(str(path), separate_channels=True) as f:
        channels = {name: c for part in f.parts for name, c in part.channels.items()}
        prefix = min((n[:-1] for n in channels if n[:-1].endswith(layer) and n[-1] == "R"), key=len)
        return np.stack([np.asarray(channels[prefix + c].pixels, dtype=np.float64) for c in "RGB"], axis=-1)


def cycles(blend, args, directory):
    """Independent renderings of a .blend by Cycles, and the frame they show."""
    import bpy

    bpy.ops.wm.open_mainfile(filepath=str(blend))
    scene = bpy.context.scene
    size = frame_size(scene, args.size)
    if args.sharp_edges:
        for mesh in bpy.data.meshes:
            mark_sharp(mesh)
    if args.lamp_radius is not None:
        for lamp in bpy.data.lights:
            if lamp.type in {"POINT", "SPOT"}:
                lamp.shadow_soft_size, lamp.use_soft_falloff = args.lamp_radius, False
    r, c = scene.render, scene.cycles
    r.engine, c.device = "CYCLES", "CPU"
    r.resolution_x, r.resolution_y, r.resolution_percentage = *size, 100
    r.film_transparent = False
    r.use_compositing = r.use_sequencer = False
    c.samples, c.use_adaptive_sampling, c.use_denoising = args.samples, False, False
    c.pixel_filter_type = "BOX"
    c.max_bounces = c.diffuse_bounces = c.glossy_bounces = c.transmission_bounces = 1024
    c.transparent_max_bounces = c.volume_bounces = 1024
    c.sample_clamp_direct = c.sample_clamp_indirect = 0.0
    c.caustics_reflective = c.caustics_refractive = True
    c.blur_glossy = c.light_sampling_threshold = 0.0
    r.image_settings.media_type = "MULTI_LAYER_IMAGE"
    r.image_settings.file_format, r.image_settings.color_depth = "OPEN_EXR_MULTILAYER", "32"
    layer = bpy.context.view_layer
    layer.use_pass_combined = layer.use_pass_glossy_direct = layer.use_pass_glossy_color = True
    images = []
    for seed in range(args.runs):
        c.seed = seed
        r.filepath = str(Path(directory) / f"cycles_{seed}.exr")
        with quiet():
            bpy.ops.render.render(write_still=True)
        image = read_exr(r.filepath, "Combined.")
        if args.point_lamps:
            image -= read_exr(r.filepath, "Glossy Direct.") * read_exr(r.filepath, "Glossy Color.")
        images.append(image)
    return np.array(images), size, scene.frame_current, r.fps / r.fps_base


def mark_sharp(mesh):
    """Marks the edges between flat and smooth faces. Blender takes them for sharp when it makes the normals
    that it draws with and exports; Cycles does so only where an edge says it, and otherwise bends the
    normals of smooth faces toward their flat neighbours."""
    kinds = {}
    for face in mesh.polygons:
        for key in face.edge_keys:
            kinds.setdefault(key, set()).add(face.use_smooth)
    for edge in mesh.edges:
        if len(kinds.get(edge.key, ())) == 2:
            edge.use_edge_sharp = True


def frame_size(scene, width):
    r = scene.render
    return width, max(1, round(width * r.resolution_y * r.pixel_aspect_y / (r.resolution_x * r.pixel_aspect_x)))


class quiet:
    """Keeps what Cycles says of every tile from standard output."""

    def __enter__(self):
        sys.stdout.flush()
        self.kept = os.dup(1)
        null = os.open(os.devnull, os.O_WRONLY)
        os.dup2(null, 1)
        os.close(null)

    def __exit__(self, *_):
        os.dup2(self.kept, 1)
        os.close(self.kept)


def dualight(scene, integrator, size, frame, fps, args, directory):
    """Independent renderings of an export by Dualight."""
    out = Path(directory) / "dualight.exr"
    images = []
    for seed in range(args.runs):
        line = [args.program, "render", scene, "-o", out, "--quiet", "--size", f"{size[0]}x{size[1]}",
                "--integrator", integrator, "--seed", seed, "--frame", frame, "--fps", fps]
        line += ["--spp", args.samples] if integrator == "path" else ["--quality", args.quality]
        subprocess.run([str(w) for w in line], check=True)
        images.append(read_exr(out))
    return np.array(images)


def means(images):
    """Means of the whole picture and of its quarters with their standard errors."""
    h, w = images.shape[1] // 2, images.shape[2] // 2
    parts = {"whole": images, "upper left": images[:, :h, :w], "upper right": images[:, :h, w:],
             "lower left": images[:, h:, :w], "lower right": images[:, h:, w:]}
    out = {}
    for name, part in parts.items():
        runs = part.mean(axis=(1, 2, 3))
        out[name] = runs.mean(), runs.std(ddof=1) / np.sqrt(len(runs)) if len(runs) > 1 else 0.0
    return out


def write_png(path, pictures):
    import bpy

    row = np.concatenate([np.concatenate([p, np.zeros((p.shape[0], 2, 3))], axis=1) for p in pictures], axis=1)
    row = np.clip(row, 0, 1)
    row = np.where(row <= 0.0031308, 12.92 * row, 1.055 * row ** (1 / 2.4) - 0.055)
    rgba = np.concatenate([row, np.ones((*row.shape[:2], 1))], axis=-1)[::-1].astype(np.float32)
    image = bpy.data.images.new("row", rgba.shape[1], rgba.shape[0])
    image.pixels.foreach_set(rgba.ravel())
    image.filepath_raw, image.file_format = str(path), "PNG"
    image.save()


def compare(name, args, directory):
    """Whether a scene comes out alike; prints the means."""
    blend, export = args.folder / f"{name}.blend", args.folder / f"{name}.glb"
    if args.through_script:
        export = Path(directory) / f"{name}.glb"
        subprocess.run([sys.executable, ROOT / "scripts" / "blender_export.py", blend, export],
                       check=True, stdout=subprocess.DEVNULL)
    theirs, size, frame, fps = cycles(blend, args, directory)
    reference = means(theirs)
    alike, pictures = True, [theirs.mean(axis=0)]
    for integrator in args.integrators.split(","):
        images = dualight(export, integrator, size, frame, fps, args, directory)
        pictures.append(images.mean(axis=0))
        for part, (mean, error) in means(images).items():
            expected, spread = reference[part]
            ratio = mean / expected
            sigma = ratio * np.hypot(error / mean, spread / expected)
            within = abs(ratio - 1) <= args.tolerance + 2 * sigma
            alike &= bool(within) or part != "whole"
            print(f"{name:10} {integrator:7} {part:12} {expected:9.5f} {mean:9.5f} {ratio:7.4f} ± {sigma:.4f}"
                  + ("" if within or part != "whole" else "  differs"), flush=True)
    if args.png:
        write_png(Path(args.png) / f"{name}.png", pictures)
    return alike


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folder", type=Path)
    parser.add_argument("names", nargs="+", metavar="NAME")
    parser.add_argument("--program", default=ROOT / "target" / "release" / "dualight")
    parser.add_argument("--size", type=int, default=128, help="width of the pictures")
    parser.add_argument("--samples", type=int, default=256, help="of the path tracers, per pixel and run")
    parser.add_argument("--quality", default="normal", help="of photon mapping")
    parser.add_argument("--integrators", default="path,photon")
    parser.add_argument("--runs", type=int, default=4)
    parser.add_argument("--tolerance", type=float, default=0.03)
    parser.add_argument("--through-script", action="store_true", help="export with blender_export.py first")
    parser.add_argument("--sharp-edges", action="store_true",
                        help="let Cycles shade by the normals that Blender exports (see mark_sharp)")
    parser.add_argument("--point-lamps", action="store_true",
                        help="leave out of Cycles what mirrors show of light sources: the exporter makes points "
                             "of lamps, and no mirror shows a point")
    parser.add_argument("--lamp-radius", type=float, metavar="METRES",
                        help="radius of points and spots in Cycles, which hardly finds the caustics of small ones")
    parser.add_argument("--png", help="folder for pictures: Cycles, then each integrator")
    args = parser.parse_args()
    print(f"{'scene':10} {'by':7} {'part':12} {'Cycles':>9} {'Dualight':>9} {'ratio':>7}")
    with tempfile.TemporaryDirectory() as directory:
        results = [compare(name, args, directory) for name in args.names]
    sys.exit(0 if all(results) else 1)


if __name__ == "__main__":
    main()
