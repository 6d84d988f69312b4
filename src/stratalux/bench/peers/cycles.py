"""Cycles, through Blender as a Python module; run by :mod:`.serve`.

Light of the world only, by as many bounces as the scene says: none for direct light. No denoiser, no clamping, no light
left out; the importance map is as fine as the map. The BVH is kept between renderings.
"""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

import bpy
import numpy as np
from mathutils import Matrix
from numpy.typing import NDArray

_MIS = {"direct_light_sampling_type": "MULTIPLE_IMPORTANCE_SAMPLING"}
_NEE = {"direct_light_sampling_type": "NEXT_EVENT_ESTIMATION"}
_SOBOL, _BLUE = {"sampling_pattern": "TABULATED_SOBOL"}, {"sampling_pattern": "BLUE_NOISE"}
_FIXED, _ADAPTIVE = {"use_adaptive_sampling": False}, {"use_adaptive_sampling": True, "adaptive_threshold": 0.01}
_TREE, _NO_TREE = {"use_light_tree": True}, {"use_light_tree": False}

CONFIGURATIONS = {
    "MIS, tabulated Sobol": {**_MIS, **_SOBOL, **_FIXED, **_TREE},
    "MIS, tabulated Sobol, no light tree": {**_MIS, **_SOBOL, **_FIXED, **_NO_TREE},
    "MIS, tabulated Sobol, adaptive": {**_MIS, **_SOBOL, **_ADAPTIVE, **_TREE},
    "MIS, blue noise": {**_MIS, **_BLUE, **_FIXED, **_TREE},
    "light samples, tabulated Sobol, no light tree": {**_NEE, **_SOBOL, **_FIXED, **_NO_TREE},
}
"""Properties of ``scene.cycles``, by name of the configuration. The threshold is Blender's default."""
_HEADER = 1 << 14
"""Bytes of an OpenEXR file among which its header is."""


def version() -> str:
    return f"Cycles of Blender {bpy.app.version_string}"


class Renderer:
    def __init__(self, scene: dict[str, NDArray[Any]], folder: Path) -> None:
        self.file = folder / "cycles.exr"
        bpy.ops.wm.read_factory_settings(use_empty=True)
        self.scene = bpy.context.scene
        _film(self.scene, scene["size"].tolist(), int(scene["threads"]), int(scene["depth"]) - 2)
        _camera(self.scene, scene["camera"], float(scene["tangent"]))
        body, ground = (float(albedo) for albedo in scene["albedo"])
        _mesh(self.scene, "body", scene["vertices"], scene["faces"], scene["normals"], body)
        _mesh(self.scene, "ground", scene["ground_vertices"], scene["ground_faces"], None, ground)
        _world(self.scene, folder / "map.exr")

    def render(self, settings: dict[str, Any], spp: int, seed: int) -> tuple[NDArray[np.float32], dict[str, Any]]:
        cycles = self.scene.cycles
        for name, value in {"samples": spp, "seed": seed, **settings}.items():
            setattr(cycles, name, value)
        bpy.ops.render.render()
        bpy.data.images["Render Result"].save_render(str(self.file), scene=self.scene)
        times = _times(self.file.read_bytes()[:_HEADER])
        return _pixels(self.file), {"spp": spp, **times}


def _film(scene: Any, size: list[int], threads: int, bounces: int) -> None:
    render, cycles = scene.render, scene.cycles
    render.engine = "CYCLES"
    (render.resolution_x, render.resolution_y), render.resolution_percentage = size, 100
    render.threads_mode, render.threads, render.use_persistent_data = "FIXED", threads, True
    render.film_transparent, render.use_compositing, render.use_sequencer = False, False, False
    render.image_settings.file_format = "OPEN_EXR"
    render.image_settings.color_depth, render.image_settings.color_mode = "32", "RGB"
    scene.display_settings.display_device, scene.view_settings.view_transform = "sRGB", "Raw"
    cycles.device, cycles.use_denoising = "CPU", False
    cycles.pixel_filter_type, cycles.filter_width = "BOX", 1.0
    cycles.max_bounces = cycles.diffuse_bounces = cycles.glossy_bounces = bounces
    cycles.transmission_bounces = cycles.volume_bounces = cycles.transparent_max_bounces = 0
    cycles.sample_clamp_direct = cycles.sample_clamp_indirect = 0.0
    cycles.light_sampling_threshold = cycles.blur_glossy = 0.0
    cycles.use_auto_tile, cycles.use_fast_gi = False, False


def _camera(scene: Any, frame: NDArray[np.float64], tangent: float) -> None:
    data = bpy.data.cameras.new("camera")
    width, height = scene.render.resolution_x, scene.render.resolution_y
    data.sensor_fit = "AUTO"  # the angle is that of the longer side
    data.angle = 2 * np.arctan(tangent * max(width, height) / min(width, height))
    data.clip_start, data.clip_end = 1e-3, 1e4
    camera = bpy.data.objects.new("camera", data)
    camera.matrix_world = Matrix((frame * [-1, 1, -1, 1]).tolist())  # right, up, backward, position
    scene.collection.objects.link(camera)
    scene.camera = camera


def _mesh(scene: Any, name: str, vertices: Any, faces: Any, normals: Any, albedo: float) -> None:
    mesh = bpy.data.meshes.new(name)
    mesh.vertices.add(len(vertices))
    mesh.vertices.foreach_set("co", vertices.astype(np.float32).ravel())
    mesh.loops.add(faces.size)
    mesh.loops.foreach_set("vertex_index", faces.astype(np.int32).ravel())
    mesh.polygons.add(len(faces))
    mesh.polygons.foreach_set("loop_start", np.arange(0, faces.size, 3, dtype=np.int32))
    mesh.polygons.foreach_set("use_smooth", np.full(len(faces), normals is not None))
    mesh.update(calc_edges=True)
    if normals is not None:
        mesh.normals_split_custom_set_from_vertices(normals.tolist())
    material = bpy.data.materials.new(name)
    material.use_nodes = True
    nodes, links = material.node_tree.nodes, material.node_tree.links
    nodes.clear()
    diffuse, output = nodes.new("ShaderNodeBsdfDiffuse"), nodes.new("ShaderNodeOutputMaterial")
    diffuse.inputs["Color"].default_value = (albedo, albedo, albedo, 1)
    diffuse.inputs["Roughness"].default_value = 0.0
    links.new(diffuse.outputs["BSDF"], output.inputs["Surface"])
    mesh.materials.append(material)
    scene.collection.objects.link(bpy.data.objects.new(name, mesh))


def _world(scene: Any, path: Path) -> None:
    world = bpy.data.worlds.new("map")
    world.use_nodes = True
    nodes, links = world.node_tree.nodes, world.node_tree.links
    nodes.clear()
    kinds = ("TexEnvironment", "Background", "OutputWorld")
    picture, background, output = (nodes.new(f"ShaderNode{kind}") for kind in kinds)
    picture.image = bpy.data.images.load(str(path))
    picture.image.colorspace_settings.name = "Non-Color"
    picture.projection, picture.interpolation = "EQUIRECTANGULAR", "Linear"
    background.inputs["Strength"].default_value = 1.0
    links.new(picture.outputs["Color"], background.inputs["Color"])
    links.new(background.outputs["Background"], output.inputs["Surface"])
    world.cycles.sampling_method = "MANUAL"
    world.cycles.sample_map_resolution = picture.image.size[0]
    scene.world = world


def _times(header: bytes) -> dict[str, float]:
    """Seconds of the rendering and of handing it the scene, as Cycles notes them in the file, in hundredths."""
    found = {}
    for name, key in (("seconds", b"render_time"), ("setup_seconds", b"synchronization_time")):
        pattern = rb"cycles\.[^\0]*\." + key + rb"\0string\0.{4}(?:(\d+):)?(\d+):(\d+\.\d+)"
        match = re.search(pattern, header, re.DOTALL)
        if match is None:
            raise RuntimeError(f"Cycles did not note its {key.decode()} in the file")
        hours, minutes, seconds = (float(group or 0) for group in match.groups())
        found[name] = 3600 * hours + 60 * minutes + seconds
    return found


def _pixels(path: Path) -> NDArray[np.float32]:
    image = bpy.data.images.load(str(path))
    image.colorspace_settings.name = "Non-Color"
    width, height = image.size
    pixels = np.empty(width * height * image.channels, np.float32)
    image.pixels.foreach_get(pixels)
    bpy.data.images.remove(image)
    return pixels.reshape(height, width, -1)[::-1, :, :3]  # Blender's first row is the lowest
