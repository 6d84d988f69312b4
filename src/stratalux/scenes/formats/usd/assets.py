"""Images that a stage names: beside it, or in its package."""

from __future__ import annotations

import os
from pathlib import Path

from pxr import Ar, Sdf

from ...model import Picture
from ...sources import source
from ..beside import file_beside, is_below


class Assets:
    """The images of a file, each of which is found once."""

    def __init__(self, path: Path) -> None:
        self._folder = path.parent
        self._known: dict[str, Picture | None] = {}

    def picture(self, asset: Sdf.AssetPath) -> Picture | None:
        """The image of an asset path, or None if it is not there. It is looked for below the folder alone."""
        resolved = str(asset.resolvedPath)
        key = resolved or str(asset.path)
        if key not in self._known:
            self._known[key] = self._found(str(asset.path), resolved)
        return self._known[key]

    def _found(self, name: str, resolved: str) -> Picture | None:
        if Ar.IsPackageRelativePath(resolved):
            package, inner = Ar.SplitPackageRelativePathOuter(resolved)
            if not is_below(package, self._folder):
                return None
            opened = Ar.GetResolver().OpenAsset(Ar.ResolvedPath(resolved))
            return Picture(os.path.basename(inner), data=bytes(opened.GetBuffer())) if opened else None
        if resolved and is_below(resolved, self._folder) and os.path.isfile(resolved):
            return Picture(os.path.basename(resolved), source(Path(resolved)))
        path = file_beside(self._folder, name) if name else None
        return Picture(path.name, path) if path else None
