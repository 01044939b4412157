#!/usr/bin/env python3
"""Checks that blender_export.py leaves out what is hidden from rendering, and nothing else.

    python3.11 scripts/check_blender_export.py        # with bpy from PyPI

Makes a scene in which lamps and cubes are hidden in every way there is, exports it, and compares
the file with what Cycles shows of such scenes.
"""

import json
import os
import struct
import subprocess
import sys
import tempfile

import bpy

# Names say what must become of the object.
SHOWN, HIDDEN = "shown", "hidden"


def collection(name, parent, hide=False):
    c = bpy.data.collections.new(name)
    c.hide_render = hide
    if parent:
        parent.children.link(c)
    return c


def add(name, where, kind, hide=False):
    """A lamp, a cube or an empty in the collection `where`."""
    data = None
    if kind == 'CUBE':
        bpy.ops.mesh.primitive_cube_add()
        data = bpy.context.object.data
        bpy.data.objects.remove(bpy.context.object)
    elif kind != 'EMPTY':
        data = bpy.data.lights.new(name, kind)
    ob = bpy.data.objects.new(name, data)
    ob.hide_render = hide
    where.objects.link(ob)
    return ob


def make():
    """The scene."""
    bpy.ops.wm.read_factory_settings(use_empty=True)
    scene = bpy.context.scene
    on = collection("on", scene.collection)
    off = collection("off", scene.collection, hide=True)
    below = collection("below", off)
    excluded = collection("excluded", scene.collection)
    lib, lib_off = collection("lib", None), collection("lib off", None, hide=True)
    for kind in ('CUBE', 'POINT', 'AREA'):
        for name, where, hide in (("plain", on, False), ("lib", lib, False)):
            add(f"{SHOWN} {kind} {name}", where, kind, hide)
        for name, where, hide in (("switched off", on, True), ("in a collection that is off", off, False),
                                  ("below one", below, False), ("excluded", excluded, False),
                                  ("lib", lib, True), ("lib off", lib_off, False)):
            add(f"{HIDDEN} {kind} {name}", where, kind, hide)
        both = add(f"{SHOWN} {kind} in two collections", off, kind)
        on.objects.link(both)
        child = add(f"{SHOWN} {kind} below a hidden parent", on, kind)
        child.parent = bpy.data.objects[f"{HIDDEN} {kind} switched off"]
    # A hidden cutter still cuts.
    cut = add(f"{SHOWN} CUBE that is cut", on, 'CUBE')
    cutter = add(f"{HIDDEN} CUBE that cuts", on, 'CUBE', hide=True)
    cutter.location = (1, 1, 1)
    modifier = cut.modifiers.new("cut", 'BOOLEAN')
    modifier.object, modifier.operation = cutter, 'DIFFERENCE'
    for x, of in ((5, lib), (10, lib), (15, lib_off)):
        instance = add(f"instance of {of.name}", on, 'EMPTY')
        instance.instance_type, instance.instance_collection = 'COLLECTION', of
        instance.location.x = x
    for layer in bpy.context.view_layer.layer_collection.children:
        layer.exclude = layer.name == "excluded"
    # Blender renders through cameras that are hidden.
    camera = bpy.data.objects.new("camera", bpy.data.cameras.new("camera"))
    off.objects.link(camera)
    scene.camera = camera
    return sorted(o.name for o in bpy.data.objects if o.name.startswith(SHOWN))


def read(path):
    with open(path, 'rb') as f:
        data = f.read()
    n = struct.unpack('<I', data[12:16])[0]
    return json.loads(data[20:20 + n])


def seen(node):
    return ("mesh" in node or "KHR_lights_punctual" in node.get("extensions", {})
            or "area_light" in node.get("extras", {}).get("dualight", {}))


def main():
    with tempfile.TemporaryDirectory() as d:
        blend, out = os.path.join(d, "s.blend"), os.path.join(d, "s.glb")
        expected = make()
        bpy.ops.wm.save_as_mainfile(filepath=blend)
        script = os.path.join(os.path.dirname(os.path.abspath(__file__)), "blender_export.py")
        subprocess.run([sys.executable, script, blend, out], check=True, stdout=subprocess.DEVNULL)
        doc = read(out)
    found = [n["name"] for n in doc["nodes"] if seen(n)]
    # The library stands in two places.
    wanted = sorted(expected + [n for n in expected if n.endswith("lib")])
    assert sorted(found) == wanted, set(found) ^ set(wanted)
    assert any("camera" in n for n in doc["nodes"]), "the camera is missing"
    assert HIDDEN not in json.dumps([n.get("extras") for n in doc["nodes"]]), "marks are left"
    cut = next(n for n in doc["nodes"] if n["name"].endswith("is cut"))
    indices = doc["meshes"][cut["mesh"]]["primitives"][0]["indices"]
    assert doc["accessors"][indices]["count"] > 36, "the cutter did not cut"
    print(f"{len(found)} nodes are shown, as they must be")


if __name__ == "__main__":
    main()
