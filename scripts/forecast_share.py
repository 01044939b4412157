#!/usr/bin/env python3
"""Tells which share of a whole run of dualight goes to forecasts.

    cargo build --release
    scripts/forecast_share.py [--repeats N] RENDER_ARGUMENTS...

Runs `dualight render RENDER_ARGUMENTS` under `perf record` and looks at where the processor was:
at each sample, the functions that the compiler inlined into one another are told apart by the
debugging information. Import, both photon passes, their maps, the pixels and the writing of the
image are in it. Needs perf and llvm-symbolizer.
"""
import argparse
import collections
import re
import subprocess
import sys
import tempfile
from pathlib import Path

BINARY = Path(__file__).resolve().parent.parent / "target/release/dualight"

# What a sample is counted as: the first that one of its functions, or the file of one, matches.
KINDS = [
    ("forecasts",
     re.compile(r"SphereForecast|TriangleForecast|adaptive::casters::|Patches>?::walk|walks_off"
                r"|Finder>?::crossed|Placed>?::walk|patch::facing")),
    ("adjacency of meshes", re.compile(r"geometry::patch::|patches::(Labelled|ScenePatches)>?::new")),
    ("planning of cells and pixels, without check rays",
     re.compile(r"photons::adaptive::|integrators::pixel_(edges|plan)::")),
]


def samples(arguments, folder):
    """Where the processor was in the binary: address in the file -> how often; and all samples."""
    data = Path(folder) / "perf.data"
    image = Path(folder) / "image.exr"
    run = ["perf", "record", "-q", "-e", "cpu-clock:u", "-F", "1999", "-o", str(data), "--",
           str(BINARY), "render", *arguments, "-o", str(image), "-q"]
    subprocess.run(run, check=True)
    text = subprocess.run(["perf", "script", "-i", str(data), "--show-mmap-events", "-F", "ip,event"],
                          check=True, capture_output=True, text=True).stdout
    maps, found, count = [], collections.Counter(), 0
    mapped = re.compile(r"PERF_RECORD_MMAP2 .*: \[0x([0-9a-f]+)\(0x([0-9a-f]+)\) @ (\S+) .*\]: r-xp (.*)")
    for line in text.splitlines():
        if m := mapped.search(line):
            if m[4].strip() == str(BINARY):
                maps.append((int(m[1], 16), int(m[2], 16), int(m[3], 0)))
        elif m := re.fullmatch(r"\s*cpu-clock:\w+:\s+([0-9a-f]+)\s*", line):
            count += 1
            ip = int(m[1], 16)
            for start, size, offset in maps:
                if start <= ip < start + size:
                    found[ip - start + offset] += 1
    return found, count


def virtual(offset):
    """The address that an offset in the file is loaded at."""
    for start, address, size in virtual.segments:
        if start <= offset < start + size:
            return offset - start + address
    return offset


def segments():
    """Loaded parts of the binary: offset in the file, address, size."""
    text = subprocess.run(["readelf", "-lW", str(BINARY)], check=True, capture_output=True, text=True).stdout
    rows = re.findall(r"LOAD\s+0x(\w+) 0x(\w+) 0x\w+ 0x(\w+)", text)
    return [tuple(int(x, 16) for x in r) for r in rows]


def functions(offsets):
    """The functions that each place is in, innermost first."""
    wanted = "\n".join(hex(virtual(o)) for o in offsets)
    tool = ["llvm-symbolizer", f"--obj={BINARY}", "--inlines", "--output-style=GNU", "--functions=linkage",
            "--demangle", "--addresses"]
    text = subprocess.run(tool, input=wanted, check=True, capture_output=True, text=True).stdout
    out, current = {}, None
    for line in text.splitlines():
        if re.fullmatch(r"0x[0-9a-f]+", line):
            current = out.setdefault(int(line, 16), [])
        elif current is not None and line and not line.startswith(("/", "??")):
            current.append(line)
    return {o: out.get(virtual(o), []) for o in offsets}


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("--repeats", type=int, default=3, metavar="N", help="runs (3)")
    options, arguments = parser.parse_known_args()
    if not arguments or not BINARY.exists():
        sys.exit("forecast_share: name a scene, and build with cargo build --release first")
    virtual.segments = segments()
    shares = []
    for _ in range(options.repeats):
        with tempfile.TemporaryDirectory() as folder:
            found, count = samples(arguments, folder)
        named = functions(list(found))
        kinds = collections.Counter()
        for offset, n in found.items():
            text = " ".join(named[offset])
            kinds[next((k for k, p in KINDS if p.search(text)), "")] += n
        if not count or sum(map(len, named.values())) == 0:
            sys.exit("forecast_share: no samples, or no debugging information in the binary")
        shares.append({k: 100 * kinds[k] / count for k, _ in KINDS})
        print(f"{count} samples: " + ", ".join(f"{k} {v:.2f} %" for k, v in shares[-1].items()))
    for k, _ in KINDS:
        values = sorted(s[k] for s in shares)
        print(f"{k}: {sum(values) / len(values):.2f} % ({values[0]:.2f} to {values[-1]:.2f})")


if __name__ == "__main__":
    main()
