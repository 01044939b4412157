#!/usr/bin/env python3
"""Exports a Blender scene to a GLB that Dualight renders as Cycles does.

    blender -b file.blend --python scripts/blender_export.py -- out.glb
    python3.11 scripts/blender_export.py file.blend out.glb        # with bpy from PyPI

Blender's own exporter writes the file. What it drops goes into `extras` under the names of
docs/blender.md: area lamps, the size of lamps, the world, lenses and sensor shift. Glass that
fills a closed mesh becomes a volume, absorption is converted, and lamps on which the exporter
fails are rewritten first. What is hidden from rendering is left out. The .blend itself is not
changed.
"""

import argparse
import json
import math
import os
import struct
import sys

import bpy

PHOTOMETRIC = 683.0  # what the exporter multiplies lamps by


def warn(text):
    print(f"blender_export: warning: {text}", file=sys.stderr)


# ------------------------------------------------------------------ what is rendered

HIDDEN = "dualight_hidden"  # marks objects for `complete`, and does not reach the file


def members(collection):
    """Objects of a collection that is instanced, as far as renderings show them."""
    if collection.hide_render:
        return set()
    out = {ob for ob in collection.objects if not ob.hide_render}
    return out.union(*(members(c) for c in collection.children))


def rendered(scene):
    """The objects that a rendering of the scene shows: neither they, nor all collections that
    they are in, are switched off for rendering or excluded from the view layers."""
    def below(layer):
        if layer.collection.hide_render:
            return set()
        own = [] if layer.exclude else layer.collection.objects
        out = {ob for ob in own if not ob.hide_render}
        return out.union(*(below(child) for child in layer.children))

    out = set().union(*(below(v.layer_collection) for v in scene.view_layers if v.use))
    fresh = list(out)
    while fresh:
        ob = fresh.pop()
        if ob.instance_type == 'COLLECTION' and ob.instance_collection:
            more = members(ob.instance_collection) - out
            out |= more
            fresh += more
    return out


def hide_others(scenes, shown):
    """Makes the exporter leave out what no rendering shows. It goes by the objects and by the
    collections right above them only, and takes instanced collections whole: what it writes all
    the same is marked. Cameras are looked through even if they are hidden."""
    for ob in bpy.data.objects:
        if ob.type == 'CAMERA':
            ob.hide_render = False
        elif ob not in shown:
            ob.hide_render = True
            ob[HIDDEN] = True
    for scene in scenes:
        for ob in scene.objects:
            # The exporter takes objects for hidden that are in hidden collections alone, and for
            # shown those that stand in the scene itself.
            keep = ob.type == 'CAMERA' or ob in shown
            if keep and all(c.hide_render for c in ob.users_collection):
                scene.collection.objects.link(ob)


def strip(doc):
    """Takes from marked nodes what could be seen of them; their children stay in place."""
    for node in doc.get("nodes", []):
        if not node.get("extras", {}).pop(HIDDEN, False):
            continue
        for key in ("mesh", "skin", "weights"):
            node.pop(key, None)
        node.get("extensions", {}).pop("KHR_lights_punctual", None)
        node.get("extensions", {}).pop("EXT_mesh_gpu_instancing", None)
        for key in ("extras", "extensions"):
            if key in node and not node[key]:
                del node[key]


# ------------------------------------------------------------------ lamps

def lamp_color(lamp):
    """The lamp's colour with its temperature."""
    color = list(lamp.color)
    if lamp.use_temperature:
        color = [c * t for c, t in zip(color, lamp.temperature_color)]
    return [max(c, 0.0) for c in color]


def scale_of(ob):
    """Lengths of the x and y axes of an object in the world."""
    m = ob.matrix_world.to_3x3()
    return m.col[0].length, m.col[1].length


def surface_of(lamp, ob):
    """The area in m² that 'Normalize' divides by."""
    if lamp.type == 'AREA':
        sx, sy = scale_of(ob)
        width, height = area_size(lamp)
        disk = lamp.shape in {'DISK', 'ELLIPSE'}
        return width * height * sx * sy * (math.pi / 4 if disk else 1.0)
    if lamp.type == 'SUN':
        # Its radiance is then the strength itself: E = pi sin^2 L.
        return math.pi * math.sin(lamp.angle / 2) ** 2 if lamp.angle > 0 else 1.0
    r = lamp.shadow_soft_size
    return 4 * math.pi * r * r if r > 0 else 1.0


def area_size(lamp):
    square = lamp.shape in {'SQUARE', 'DISK'}
    return lamp.size, lamp.size if square else lamp.size_y


def power_of(lamp, ob):
    """Strength in W, for suns in W/m², with exposure and without 'Normalize' taken in."""
    power = lamp.energy * 2.0 ** lamp.exposure
    return power if lamp.normalize else power * surface_of(lamp, ob)


def collect_lamps(shown):
    """By object name: what the file is to say of each lamp among the objects `shown`."""
    out = {}
    for ob in sorted(shown, key=lambda ob: ob.name):
        if ob.type != 'LIGHT':
            continue
        lamp = ob.data
        if lamp.use_nodes and any(n.type not in {'EMISSION', 'OUTPUT_LIGHT'}
                                  for n in lamp.node_tree.nodes):
            warn(f"lamp '{ob.name}': its nodes are not exported")
        color, power = lamp_color(lamp), power_of(lamp, ob)
        # Warm lamps are more than 1 in red, and glTF's colours end at 1.
        most = max(color)
        if most > 1.0:
            color, power = [c / most for c in color], power * most
        entry = {"color": color, "power": power, "type": lamp.type}
        seen = bool(ob.visible_camera)
        if lamp.type == 'AREA':
            if lamp.spread < math.pi * 0.999:
                warn(f"lamp '{ob.name}': its spread is not exported; it shines as at 180 degrees")
            width, height = area_size(lamp)
            shape = lamp.shape.lower()
            size = width if shape in {"square", "disk"} else [width, height]
            sx, sy = scale_of(ob)
            entry["node"] = {"area_light": {
                "shape": shape, "size": size, "power": power,
                "color": color, "seen_by_camera": seen,
            }}
            if sx == 0 or sy == 0:
                warn(f"lamp '{ob.name}' has no area and is left out")
                entry["node"] = None
        elif lamp.type == 'SUN':
            entry["light"] = {"angle": min(lamp.angle, math.pi * 0.999), "seen_by_camera": seen}
        else:
            entry["light"] = {"radius": lamp.shadow_soft_size, "seen_by_camera": seen}
        out[ob.name] = entry
    return out


def tame_lamps(lamps):
    """Sets aside what Blender's exporter stops at, and gives each lamp data of its own, since
    data shared by objects of different scale can mean different power."""
    for name, entry in lamps.items():
        ob = bpy.data.objects[name]
        if ob.data.users > 1:
            ob.data = ob.data.copy()
        lamp = ob.data
        lamp.use_temperature = False
        lamp.normalize = True
        lamp.exposure = 0.0
        lamp.use_nodes = False
        lamp.color = entry["color"]
        lamp.energy = entry["power"]


# ------------------------------------------------------------------ cameras

def collect_cameras(scene):
    """By object name: lens and shift."""
    out = {}
    r = scene.render
    width, height = r.resolution_x * r.pixel_aspect_x, r.resolution_y * r.pixel_aspect_y
    for ob in scene.objects:
        if ob.type != 'CAMERA':
            continue
        cam = ob.data
        entry = {}
        if cam.shift_x or cam.shift_y:
            # Blender's shift is in parts of the side that the sensor is fitted to.
            fit = cam.sensor_fit
            if fit == 'AUTO':
                fit = 'HORIZONTAL' if width >= height else 'VERTICAL'
            side = width if fit == 'HORIZONTAL' else height
            entry["shift"] = [cam.shift_x * side / width, cam.shift_y * side / height]
        dof = cam.dof
        if dof.use_dof:
            focal = cam.lens * 1e-3 if cam.type == 'PERSP' else 1.0
            distance = dof.focus_distance
            if dof.focus_object:
                to = dof.focus_object.matrix_world.translation - ob.matrix_world.translation
                forward = -ob.matrix_world.to_3x3().col[2].normalized()
                distance = abs(to.dot(forward))
            if distance > 0 and dof.aperture_fstop > 0:
                entry.update({
                    "aperture_radius": 0.5 * focal / dof.aperture_fstop,
                    "focus_distance": distance,
                    "blades": dof.aperture_blades if dof.aperture_blades >= 3 else 0,
                    "blade_rotation": dof.aperture_rotation,
                    "aperture_ratio": dof.aperture_ratio,
                })
        if cam.type not in {'PERSP', 'ORTHO'}:
            warn(f"camera '{ob.name}': {cam.type} is not exported")
        out[ob.name] = entry
    return out


# ------------------------------------------------------------------ world

def collect_world(scene, out_path):
    """The environment: a colour, or an image beside the file."""
    world = scene.world
    if world is None:
        return None
    seen = not scene.render.film_transparent and bool(world.cycles_visibility.camera)
    nodes = world.node_tree.nodes if world.node_tree else []
    output = next((n for n in nodes if n.type == 'OUTPUT_WORLD' and n.is_active_output), None)
    source = None
    if output and output.inputs['Surface'].is_linked:
        source = output.inputs['Surface'].links[0].from_node
    if output and source is None:
        return None
    plain = source and source.type == 'BACKGROUND' and not any(i.is_linked for i in source.inputs)
    if output is None or plain:
        color = list((source.inputs['Color'].default_value if plain else world.color)[:3])
        strength = source.inputs['Strength'].default_value if plain else 1.0
        if strength == 0 or max(color) == 0:
            return None
        return {"color": color, "strength": strength, "seen_by_camera": seen}
    return {"image": bake_world(scene, out_path), "seen_by_camera": seen}


def bake_world(scene, out_path):
    """Renders any other world, whatever its nodes, to an equirectangular image."""
    name = os.path.splitext(os.path.basename(out_path))[0] + "_world.exr"
    bake = bpy.data.scenes.new("dualight bake")
    bake.world = scene.world
    cam = bpy.data.cameras.new("dualight bake")
    cam.type = 'PANO'
    (cam if hasattr(cam, 'panorama_type') else cam.cycles).panorama_type = 'EQUIRECTANGULAR'
    ob = bpy.data.objects.new("dualight bake", cam)
    # Middle of the image along +x, up along +z.
    ob.rotation_euler = (math.pi / 2, 0.0, -math.pi / 2)
    bake.collection.objects.link(ob)
    bake.camera = ob
    bake.render.engine = 'CYCLES'
    bake.cycles.device = 'CPU'
    bake.cycles.samples = 4
    bake.cycles.use_denoising = False
    bake.cycles.use_adaptive_sampling = False
    bake.cycles.sample_clamp_direct = 0.0
    bake.render.film_transparent = False
    bake.render.resolution_x, bake.render.resolution_y = 2048, 1024
    bake.render.resolution_percentage = 100
    bake.render.image_settings.file_format = 'OPEN_EXR'
    bake.render.image_settings.color_depth = '32'
    bake.render.filepath = os.path.join(os.path.dirname(os.path.abspath(out_path)), name)
    visible = scene.world.cycles_visibility.camera
    scene.world.cycles_visibility.camera = True
    bpy.ops.render.render(write_still=True, scene=bake.name)
    scene.world.cycles_visibility.camera = visible
    bpy.data.scenes.remove(bake)
    return name


# ------------------------------------------------------------------ materials

def principled(material):
    nodes = material.node_tree.nodes if material.node_tree else []
    return next((n for n in nodes if n.type == 'BSDF_PRINCIPLED'), None)


def is_closed(mesh):
    """Whether every edge joins two faces that turn the same way round, equal positions joined."""
    ids, edges = {}, {}
    key = [ids.setdefault(tuple(v.co), len(ids)) for v in mesh.vertices]
    for face in mesh.polygons:
        corners = [key[v] for v in face.vertices]
        for a, b in zip(corners, corners[1:] + corners[:1]):
            if a != b:
                edges[a, b] = edges.get((a, b), 0) + 1
    return bool(edges) and all(n == edges.get((b, a), 0) for (a, b), n in edges.items())


def collect_glass(shown):
    """By material name: thickness and absorption of what fills closed meshes among the objects
    `shown`."""
    graph = bpy.context.evaluated_depsgraph_get()
    closed, size = {}, {}
    for ob in shown:
        if ob.type not in {'MESH', 'CURVE', 'SURFACE', 'META', 'FONT'}:
            continue
        used = [s.material for s in ob.material_slots if s.material]
        glass = [m for m in used if is_glass(m)]
        if not glass:
            continue
        evaluated = ob.evaluated_get(graph)
        mesh = evaluated.to_mesh()
        whole = is_closed(mesh)
        evaluated.to_mesh_clear()
        for m in glass:
            closed[m.name] = closed.get(m.name, True) and whole
            size[m.name] = max(size.get(m.name, 0.0), min(ob.dimensions))
    out = {}
    for name, whole in closed.items():
        if not whole:
            warn(f"material '{name}': used by an open mesh, so its glass is taken as thin")
            continue
        out[name] = {"thickness": max(size[name], 1e-4), **absorption(bpy.data.materials[name])}
    return out


def is_glass(material):
    node = principled(material)
    if node is None:
        return False
    transmission = node.inputs['Transmission Weight']
    return transmission.is_linked or transmission.default_value > 0


def absorption(material):
    """Cycles absorbs by exp(-(1-c) density d), glTF by c^(d/distance): the colour e^-(1-c) at
    the distance 1/density is the same law."""
    nodes = material.node_tree.nodes
    output = next((n for n in nodes if n.type == 'OUTPUT_MATERIAL' and n.is_active_output), None)
    if output is None or not output.inputs['Volume'].is_linked:
        return {}
    node = output.inputs['Volume'].links[0].from_node
    if node.type != 'VOLUME_ABSORPTION' or any(i.is_linked for i in node.inputs):
        warn(f"material '{material.name}': its volume is not a plain Volume Absorption")
        return {}
    density = node.inputs['Density'].default_value
    if density <= 0:
        return {}
    color = [math.exp(-(1.0 - c)) for c in node.inputs['Color'].default_value[:3]]
    return {"attenuationColor": [min(c, 1.0) for c in color], "attenuationDistance": 1.0 / density}


# ------------------------------------------------------------------ the file

def read_glb(path):
    with open(path, 'rb') as f:
        data = f.read()
    n = struct.unpack('<I', data[12:16])[0]
    return json.loads(data[20:20 + n]), data[20 + n:]


def write_glb(path, doc, rest):
    text = json.dumps(doc, separators=(',', ':')).encode()
    text += b' ' * (-len(text) % 4)
    head = struct.pack('<4sII', b'glTF', 2, 20 + len(text) + len(rest))
    with open(path + '.part', 'wb') as f:
        f.write(head + struct.pack('<I4s', len(text), b'JSON') + text + rest)
    os.replace(path + '.part', path)


def ours(owner, entry):
    if entry:
        extras = owner.setdefault("extras", {})
        extras["dualight"] = {**extras.get("dualight", {}), **entry}


def tell_lamp(node, lights, entry):
    ours(node, entry.get("node"))
    link = node.get("extensions", {}).get("KHR_lights_punctual")
    if link is None or "light" not in entry:
        return
    light = lights[link["light"]]
    ours(light, entry["light"])
    # The exporter goes by the mode that was chosen; the power is known here.
    per_steradian = 1.0 if entry["type"] == 'SUN' else 1.0 / (4.0 * math.pi)
    light["intensity"] = entry["power"] * per_steradian * PHOTOMETRIC
    light["color"] = entry["color"]


def complete(path, per_scene, glass):
    """Adds to the exported file what was collected."""
    doc, rest = read_glb(path)
    strip(doc)
    nodes = {}
    for node in doc.get("nodes", []):
        nodes.setdefault(node.get("name"), []).append(node)
    lights = doc.get("extensions", {}).get("KHR_lights_punctual", {}).get("lights", [])
    for scene, (lamps, cameras, world) in per_scene.items():
        for name, entry in {**lamps, **cameras}.items():
            if name not in nodes:
                warn(f"'{name}' did not reach the file")
                continue
            # Objects of instanced collections stand in several places.
            for node in nodes[name]:
                if name not in cameras:
                    tell_lamp(node, lights, entry)
                elif "camera" in node:
                    ours(doc["cameras"][node["camera"]], entry)
        if world:
            for s in doc.get("scenes", []):
                if s.get("name") == scene:
                    ours(s, {"environment": world})
    volume = "KHR_materials_volume"
    for m in doc.get("materials", []):
        entry = glass.get(m.get("name"))
        if entry is None or "KHR_materials_transmission" not in m.get("extensions", {}):
            continue
        known = m["extensions"].setdefault(volume, {})
        known.setdefault("thicknessFactor", entry["thickness"])
        for key in ("attenuationColor", "attenuationDistance"):
            known.pop(key, None)
            if key in entry:
                known[key] = entry[key]
        used = doc.setdefault("extensionsUsed", [])
        if volume not in used:
            used.append(volume)
    write_glb(path, doc, rest)


def main(argv):
    parser = argparse.ArgumentParser(prog="blender_export.py", description=__doc__,
                                     formatter_class=argparse.RawDescriptionHelpFormatter)
    if not bpy.data.filepath:
        parser.add_argument("blend", help="the scene")
    parser.add_argument("out", help="the GLB to write")
    parser.add_argument("--no-animations", action="store_true", help="leave animations out")
    args = parser.parse_args(argv)
    if not args.out.lower().endswith(".glb"):
        parser.error(f"{args.out}: only .glb can be written")
    if not bpy.data.filepath:
        bpy.ops.wm.open_mainfile(filepath=os.path.abspath(args.blend))
    out = os.path.abspath(args.out)
    scenes = list(bpy.data.scenes)
    shown = {s.name: rendered(s) for s in scenes}
    glass = collect_glass(shown[bpy.context.scene.name])
    for scene in scenes:
        if scene is not bpy.context.scene:
            glass = {**collect_glass(shown[scene.name]), **glass}
    per_scene = {s.name: (collect_lamps(shown[s.name]), collect_cameras(s),
                          collect_world(s, out if s is bpy.context.scene else
                                        out[:-4] + "_" + s.name + ".glb"))
                 for s in scenes}
    for lamps, _, _ in per_scene.values():
        tame_lamps(lamps)
    hide_others(scenes, set().union(*shown.values()))
    bpy.ops.export_scene.gltf(
        filepath=out, export_format='GLB', export_cameras=True, export_lights=True,
        export_extras=True, export_apply=True, export_yup=True, use_renderable=True,
        export_import_convert_lighting_mode='SPEC',
        export_animations=not args.no_animations)
    complete(out, per_scene, glass)
    print(f"wrote {out}")


if __name__ == "__main__":
    main(sys.argv[sys.argv.index("--") + 1:] if "--" in sys.argv else sys.argv[1:])
