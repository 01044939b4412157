#!/usr/bin/env python3
"""Reads an image that `dualight render` wrote with the official OpenEXR library and checks its
layout. Exit status: 0 as it should be, 1 not so, 77 the package OpenEXR is not installed."""

import sys

try:
    import OpenEXR
except ImportError:
    print("the Python package OpenEXR is not installed", file=sys.stderr)
    sys.exit(77)

if len(sys.argv) != 2:
    sys.exit("usage: check_exr.py IMAGE.exr")

COLOURS = ["", "direct.", "specular.", "caustics.", "indirect.", "albedo."]
EXPECTED = (
    {p + c for p in COLOURS for c in "RGB"}
    | {p + c for p in ("N.", "P.") for c in "XYZ"}
    | {"A", "Z", "photons.global", "photons.caustic"}
)

with OpenEXR.File(sys.argv[1], separate_channels=True) as file:
    if len(file.parts) != 1:
        sys.exit(f"{len(file.parts)} parts instead of one")
    found = set(file.channels())
    if found != EXPECTED:
        sys.exit(f"missing {EXPECTED - found}, surplus {found - EXPECTED}")
    header = file.header()
    if header["compression"] != OpenEXR.ZIP_COMPRESSION:
        sys.exit(f"compression {header['compression']}")
    channels = {name: c.pixels for name, c in file.channels().items()}
    for c in "RGB":
        parts = sum(channels[p + c].astype("f8") for p in COLOURS[1:5])
        off = abs(parts - channels[c]).max()
        if off > 4e-3 * max(1.0, abs(parts).max()):
            sys.exit(f"the components of {c} miss the beauty image by {off}")
    for name in ("Z", "N.X", "P.Y", "photons.global"):
        if channels[name].dtype != "float32":
            sys.exit(f"{name} is {channels[name].dtype}")
    print(f"{sys.argv[1]}: {len(found)} channels, {header.get('software')}")
