"""The extensions of glTF: which are read, and which of those that a file uses are not shown."""

from __future__ import annotations

import warnings
from pathlib import Path
from typing import Any

from ....errors import InputError, SceneWarning

_SHAPES = (
    "EXT_mesh_gpu_instancing",
    "EXT_meshopt_compression",
    "KHR_draco_mesh_compression",
    "KHR_mesh_quantization",
    "KHR_meshopt_compression",
    "KHR_node_visibility",
)
_LIGHTS = ("KHR_lights_punctual",)
_MATERIALS = (
    "KHR_materials_anisotropy",
    "KHR_materials_clearcoat",
    "KHR_materials_emissive_strength",
    "KHR_materials_ior",
    "KHR_materials_pbrSpecularGlossiness",
    "KHR_materials_sheen",
    "KHR_materials_specular",
    "KHR_materials_transmission",
    "KHR_materials_unlit",
    "KHR_materials_volume",
)
_TEXTURES = ("EXT_texture_webp", "KHR_texture_basisu", "KHR_texture_transform", "MSFT_texture_dds")
READ = frozenset(_SHAPES + _LIGHTS + _MATERIALS + _TEXTURES)

_SILENT = frozenset(
    (
        "EXT_instance_features",
        "EXT_mesh_features",
        "EXT_mesh_manifold",
        "EXT_structural_metadata",
        "KHR_materials_variants",
        "KHR_node_hoverability",
        "KHR_node_selectability",
        "KHR_xmp",
        "KHR_xmp_json_ld",
        "MSFT_lod",
        "MSFT_screencoverage",
    )
)
"""Extensions that change no picture, as they speak to other programs, or of coarser shapes for slower ones; variants
are told elsewhere."""

_PARTLY = frozenset(
    (
        "EXT_texture_avif",
        "KHR_animation_pointer",
        "KHR_materials_diffuse_transmission",
        "KHR_materials_dispersion",
        "KHR_materials_iridescence",
    )
)
"""Extensions without which a file can be shown, though not all that it says, even if it says that it requires them."""


def check_required(path: Path, names: list[str]) -> None:
    """Refuse, with :class:`InputError`, a file that cannot be understood without an extension that is not read."""
    unknown = sorted(set(names) - READ - _SILENT - _PARTLY)
    if unknown:
        raise InputError(f"{path}: requires {', '.join(unknown)}, which is not supported; export it without")


class LeftOut:
    """Collects what a file says of something that is shown, and that is not shown itself."""

    def __init__(self) -> None:
        self._names: dict[str, None] = {}

    def add(self, what: str) -> None:
        """Have it told, once."""
        self._names[what] = None

    def extensions_of(self, *objects: dict[str, Any]) -> None:
        """The extensions of objects of the document that nobody here reads."""
        for each in objects:
            for name in each.get("extensions", {}):
                if name not in READ and name not in _SILENT:
                    self.add(name)

    def tell(self, path: Path) -> None:
        """One warning for all of it."""
        if self._names:
            verb = "is" if len(self._names) == 1 else "are"
            warnings.warn(f"{path}: {', '.join(self._names)} {verb} not shown", SceneWarning, stacklevel=3)
