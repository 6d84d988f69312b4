"""The far side of :mod:`.process`: reads a file as Blender does, and renders it with Cycles.

``python blender.py JOB.json``. It runs as a file, in a Python that has ``bpy`` and NumPy and nothing of ours. The job
has the ``file``, the ``map``, the ``camera`` (4, 4) with columns right, up, backward and position in Blender's world,
the field of view ``angle`` along the longer side in radians, the ``size`` in pixels, ``spp``, ``threads`` and
``output``, the .npz file that is written:

``picture`` (H, W, 3): radiance, with direct light of the world and of lamps at the first surface, in front of the map.
``single``: the same without the light that goes between microfacets more than once, where there are any.
``base`` (H, W, 3): base colours over black. ``normals`` (H, W, 3): n / 2 + 1/2 of the normals n that materials are
shaded with, y up, over black. ``coverage`` (H, W): the part of each pixel that is surface.
"""

from __future__ import annotations

import json
import struct
import sys
import tempfile
from pathlib import Path
from typing import Any

import bpy
import numpy as np
from mathutils import Matrix

MATTE = 0.5
"""Reflectance of what the file says nothing of: our clay."""


def main(job: dict[str, Any]) -> None:
    bpy.ops.wm.read_factory_settings(use_empty=True)
    scene = bpy.context.scene
    load(job["file"])
    film(scene, job)
    camera(scene, job)
    dressed(Path(job["file"]).suffix.lower())
    world(scene, job["map"])
    output = Path(job["output"])
    found = {"picture": render(scene, output, job["spp"])[..., :3]}
    if single_scattering():
        found["single"] = render(scene, output, job["spp"])[..., :3]
    scene.render.film_transparent = True
    scene.world = None
    for lamp in [each for each in scene.objects if each.type == "LIGHT"]:
        lamp.hide_render = True
    keep = [material for material in bpy.data.materials if material.use_nodes]
    originals = {material.name: surface(material) for material in keep}
    for name, paint in (("base", base), ("normals", normal)):
        for material in keep:
            shown(material, originals[material.name], paint)
        pixels = render(scene, output, job.get("flat_spp", job["spp"]))
        found[name] = pixels[..., :3]
        found["coverage"] = pixels[..., 3]
    np.savez(output, version=bpy.app.version_string, **found)


# ------------------------------- What is rendered -------------------------------


def load(file: str) -> None:
    """With Blender's defaults but for what others turn by: y is up in all files but those of STL."""
    suffix = Path(file).suffix.lower()
    if suffix in (".glb", ".gltf"):
        # Candela and lux one to one: W of a lamp are 4 pi times its W/sr. By default, they are divided by 683.
        bpy.ops.import_scene.gltf(filepath=still(Path(file)), export_import_convert_lighting_mode="COMPAT")
    elif suffix == ".obj":
        bpy.ops.wm.obj_import(filepath=file)
    elif suffix == ".ply":
        bpy.ops.wm.ply_import(filepath=file, forward_axis="NEGATIVE_Z", up_axis="Y")
    elif suffix == ".stl":
        bpy.ops.wm.stl_import(filepath=file)
    else:
        sys.exit(f"{file}: Blender is not asked to read it")


def still(file: Path) -> str:
    """The file, or a copy without animations: things stand as its nodes say, not as the first frame has them."""
    content = file.read_bytes()
    if content[:4] != b"glTF":
        return str(file)
    (length,) = struct.unpack_from("<I", content, 12)
    document = json.loads(content[20 : 20 + length])
    if not document.pop("animations", None):
        return str(file)
    text = json.dumps(document).encode()
    text += b" " * (-len(text) % 4)
    chunks = struct.pack("<I4s", len(text), b"JSON") + text + content[20 + length :]
    copy = Path(tempfile.mkdtemp(prefix="stratalux-")) / file.name
    copy.write_bytes(b"glTF" + struct.pack("<II", 2, 12 + len(chunks)) + chunks)
    return str(copy)


def dressed(suffix: str) -> None:
    """Give a material to what came without one."""
    for each in bpy.data.objects:
        if each.type != "MESH":
            continue
        if not each.data.materials or all(material is None for material in each.data.materials):
            material = bpy.data.materials.new("none")
            material.use_nodes = True
            principled = material.node_tree.nodes["Principled BSDF"]
            is_gltf = suffix in (".glb", ".gltf")
            principled.inputs["Base Color"].default_value = (1, 1, 1, 1) if is_gltf else (MATTE, MATTE, MATTE, 1)
            principled.inputs["Metallic"].default_value = 1.0 if is_gltf else 0.0
            principled.inputs["Roughness"].default_value = 1.0
            if not is_gltf:
                principled.inputs["Specular IOR Level"].default_value = 0.0
            each.data.materials.clear()
            each.data.materials.append(material)


def film(scene: Any, job: dict[str, Any]) -> None:
    render, cycles = scene.render, scene.cycles
    render.engine = "CYCLES"
    (render.resolution_x, render.resolution_y), render.resolution_percentage = job["size"], 100
    render.threads_mode, render.threads, render.use_persistent_data = "FIXED", job["threads"], True
    render.use_compositing, render.use_sequencer = False, False
    render.image_settings.file_format = "OPEN_EXR"
    render.image_settings.color_depth, render.image_settings.color_mode = "32", "RGBA"
    scene.display_settings.display_device, scene.view_settings.view_transform = "sRGB", "Standard"
    cycles.device, cycles.use_denoising, cycles.use_adaptive_sampling = "CPU", False, False
    cycles.pixel_filter_type, cycles.filter_width = "BOX", 1.0
    cycles.max_bounces = cycles.diffuse_bounces = cycles.glossy_bounces = 0
    cycles.transmission_bounces = cycles.volume_bounces = 0
    cycles.transparent_max_bounces = 64
    cycles.sample_clamp_direct = cycles.sample_clamp_indirect = 0.0
    cycles.light_sampling_threshold = cycles.blur_glossy = 0.0
    cycles.use_auto_tile, cycles.use_fast_gi = False, False


def camera(scene: Any, job: dict[str, Any]) -> None:
    data = bpy.data.cameras.new("camera")
    data.sensor_fit, data.angle = "AUTO", job["angle"]
    data.clip_start, data.clip_end = job["clip"]
    one = bpy.data.objects.new("camera", data)
    one.matrix_world = Matrix(job["camera"])
    scene.collection.objects.link(one)
    scene.camera = one


def world(scene: Any, path: str) -> None:
    made = bpy.data.worlds.new("map")
    made.use_nodes = True
    nodes, links = made.node_tree.nodes, made.node_tree.links
    nodes.clear()
    kinds = ("TexEnvironment", "Background", "OutputWorld")
    picture, background, output = (nodes.new(f"ShaderNode{kind}") for kind in kinds)
    picture.image = bpy.data.images.load(path)
    picture.image.colorspace_settings.name = "Non-Color"
    links.new(picture.outputs["Color"], background.inputs["Color"])
    links.new(background.outputs["Background"], output.inputs["Surface"])
    made.cycles.sampling_method = "MANUAL"
    made.cycles.sample_map_resolution = picture.image.size[0]
    scene.world = made


def single_scattering() -> bool:
    """Rough reflections as glTF has them, which get darker where Blender makes up for what is lost; whether any do."""
    trees = [material.node_tree for material in bpy.data.materials if material.use_nodes]
    found = [node for tree in trees for node in tree.nodes if node.type == "BSDF_PRINCIPLED"]
    for node in found:
        node.distribution = "GGX"
    return bool(found)


# ------------------------------- Base colours and normals, as light that surfaces emit -------------------------------


def surface(material: Any) -> tuple[Any, Any | None]:
    """The socket of the surface, and the Principled BSDF (or what has its inputs), if there is one."""
    tree = material.node_tree
    output = next(node for node in tree.nodes if node.type == "OUTPUT_MATERIAL" and node.is_active_output)
    kinds = ("BSDF_PRINCIPLED", "EEVEE_SPECULAR")
    return output.inputs["Surface"], next((node for node in tree.nodes if node.type in kinds), None)


def shown(material: Any, original: tuple[Any, Any | None], paint: Any) -> None:
    """Emission of a colour under the material's own alpha; what has no Principled BSDF stays as it is."""
    target, bsdf = original
    tree = material.node_tree
    if bsdf is None:
        return
    emission, clear = tree.nodes.new("ShaderNodeEmission"), tree.nodes.new("ShaderNodeBsdfTransparent")
    mix = tree.nodes.new("ShaderNodeMixShader")
    paint(tree, bsdf, emission.inputs["Color"])
    alpha = bsdf.inputs.get("Alpha")
    if alpha is not None:
        connect(tree, alpha, mix.inputs["Fac"])
    elif "Transparency" in bsdf.inputs:
        one_minus = tree.nodes.new("ShaderNodeMath")
        one_minus.operation = "SUBTRACT"
        one_minus.inputs[0].default_value = 1.0
        connect(tree, bsdf.inputs["Transparency"], one_minus.inputs[1])
        tree.links.new(one_minus.outputs[0], mix.inputs["Fac"])
    tree.links.new(clear.outputs[0], mix.inputs[1])
    tree.links.new(emission.outputs[0], mix.inputs[2])
    tree.links.new(mix.outputs[0], target)


def base(tree: Any, bsdf: Any, target: Any) -> None:
    connect(tree, bsdf.inputs["Base Color"], target)


def normal(tree: Any, bsdf: Any, target: Any) -> None:
    """n / 2 + 1/2."""
    half = tree.nodes.new("ShaderNodeVectorMath")
    half.operation = "MULTIPLY_ADD"
    half.inputs[1].default_value = half.inputs[2].default_value = (0.5, 0.5, 0.5)
    if bsdf.inputs["Normal"].is_linked:
        tree.links.new(bsdf.inputs["Normal"].links[0].from_socket, half.inputs[0])
    else:
        tree.links.new(tree.nodes.new("ShaderNodeNewGeometry").outputs["Normal"], half.inputs[0])
    # Of (x, y, z) with z up, to (x, z, -y); -y / 2 + 1/2 is 1 - (y / 2 + 1/2).
    apart, joined = tree.nodes.new("ShaderNodeSeparateXYZ"), tree.nodes.new("ShaderNodeCombineXYZ")
    one_minus = tree.nodes.new("ShaderNodeMath")
    one_minus.operation = "SUBTRACT"
    one_minus.inputs[0].default_value = 1.0
    tree.links.new(half.outputs["Vector"], apart.inputs[0])
    tree.links.new(apart.outputs["X"], joined.inputs["X"])
    tree.links.new(apart.outputs["Z"], joined.inputs["Y"])
    tree.links.new(apart.outputs["Y"], one_minus.inputs[1])
    tree.links.new(one_minus.outputs[0], joined.inputs["Z"])
    tree.links.new(joined.outputs[0], target)


def connect(tree: Any, source: Any, target: Any) -> None:
    """What an input gets, to another input."""
    if source.is_linked:
        tree.links.new(source.links[0].from_socket, target)
    elif isinstance(source.default_value, float):
        target.default_value = source.default_value
    else:
        target.default_value = tuple(source.default_value)


# ------------------------------- Rendering -------------------------------


def render(scene: Any, output: Path, spp: int) -> Any:
    """Pixels (H, W, 4), the top row first."""
    scene.cycles.samples = spp
    bpy.ops.render.render()
    file = output.with_suffix(".exr")
    bpy.data.images["Render Result"].save_render(str(file), scene=scene)
    image = bpy.data.images.load(str(file))
    image.colorspace_settings.name = "Non-Color"
    image.alpha_mode = "CHANNEL_PACKED"
    width, height = image.size
    pixels = np.empty(width * height * image.channels, np.float32)
    image.pixels.foreach_get(pixels)
    bpy.data.images.remove(image)
    return pixels.reshape(height, width, -1)[::-1]


if __name__ == "__main__":
    main(json.loads(Path(sys.argv[1]).read_text(encoding="utf-8")))
