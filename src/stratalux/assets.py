"""The real data of the paper and of the benchmarks: what it is, whose it is, where it is found, how it is fetched.

None of it is part of the package. :class:`Assets` looks for it in these folders, in this order:

1. the folder that the caller names;
2. the folder that ``$STRATALUX_ASSETS`` names;
3. ``../shared/assets`` beside a checkout of the sources;
4. the folder ``assets`` of the cache (:func:`stratalux.caches.cache_folder`), where fetched files go.

Each file has the SHA-256 of the one that our figures were measured with. That very file was seen in a public repository
at the commit that its URL names; whatever else the URL may serve one day is refused.
"""

from __future__ import annotations

import hashlib
import logging
import os
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from .caches import cache_folder
from .errors import InputError

Progress = Callable[[str, int, int], None]
"""Is told the name of the file that is fetched, the bytes that are there, and the bytes that there will be."""


@dataclass(frozen=True)
class AssetFile:
    """``file``: path within a folder of assets. ``sha256`` and ``size`` (bytes): of the file that was measured with.

    ``url`` serves that file.
    """

    file: str
    sha256: str
    size: int
    url: str


@dataclass(frozen=True)
class Asset:
    """A map, a mesh or a scene.

    ``files``: all that it needs, the one to load first. ``source``: page of its owner. ``alternatives``: files that can
    be loaded instead, and give other figures.
    """

    name: str
    what: str
    owner: str
    terms: str
    source: str
    files: tuple[AssetFile, ...]
    alternatives: tuple[str, ...] = ()

    @property
    def file(self) -> str:
        """Path of the file to load, within a folder of assets."""
        return self.files[0].file

    @property
    def size(self) -> int:
        """Bytes of all files."""
        return sum(file.size for file in self.files)


@dataclass(frozen=True)
class Found:
    """The file to load, and whether it and all that belongs to it are what our figures were measured with."""

    path: Path
    as_measured: bool


_RAW = "https://raw.githubusercontent.com"
_PBRT = f"{_RAW}/mmp/pbrt-v2/e6f6334f3c26ca29eba2b27af4e60fec9fdc7a8d/scenes/textures"
_MITSUBA = f"{_RAW}/mitsuba-renderer/mitsuba-data/01100fa9b0b154492061a92404f26dcd7b784dbb/scenes/matpreview"
_MODELS = f"{_RAW}/alecjacobson/common-3d-test-models/8a4f8642acaf43f9cd7b67858a1502e1055ef202/data"
_PMNDRS = f"{_RAW}/pmndrs/assets/d8709a9b11247dc51b72bb32fade56048807d868/src/hdri"
_PHOTON = f"{_RAW}/nwtnni/photon/60c15cca7509a8b43a8ab9aa4cb444c29775ad78/models"
_TRIMESH = f"{_RAW}/mikedh/trimesh/a513c0e2cfa6dfbd3121a6dfd8ceb002b9ef55d8/models"
_POLY_HAVEN = f"{_RAW}/pmndrs/drei-assets/456060a26bbeb8fdf79326f224b6d99b8bcce736/hdri"
"""A copy: no snapshot of what Poly Haven's own server sends could be compared with."""


def _poly_haven(name: str, what: str, original: str, sha256: str, size: int) -> Asset:
    return Asset(
        name=name,
        what=f"{what}, 1024x512",
        owner="Poly Haven",
        terms="CC0",
        source=f"https://polyhaven.com/a/{original}",
        files=(AssetFile(f"envmaps/{name}.hdr", sha256, size, f"{_POLY_HAVEN}/{original}_1k.hdr"),),
    )


_REGISTRY = (
    Asset(
        name="grace",
        what="Grace Cathedral, the map of the paper, 1024x512",
        owner="P. Debevec",
        terms="research use; credit the author",
        source="https://www.pauldebevec.com/Probes/",
        files=(
            AssetFile(
                "envmaps/grace_latlong.exr",
                "7c017bce200658354d72774712e51f039d472aa1399a91c2d0e3eb81ca909079",
                1_726_329,
                f"{_PBRT}/grace_latlong.exr",  # the owner publishes an angular map; this is its latitude-longitude form
            ),
        ),
    ),
    Asset(
        name="venice",
        what="a quay in Venice at dawn, 1024x512",
        owner="Poly Haven",
        terms="CC0",
        source="https://github.com/pmndrs/assets",  # which of Poly Haven's it is, is not said there
        files=(
            AssetFile(
                "envmaps/venice.hdr",
                "d41b07ae03ae80b4d78a467bda484b19d86fe3ce9acda9b13c15e3fbfe8bf71f",
                1_451_415,
                f"{_PMNDRS}/venice.hdr",
            ),
        ),
    ),
    _poly_haven(
        "studio",
        "a photo studio",
        "studio_small_03",
        "29267a4aa8c10de26cae758e4e3c4daadde88673798666ad657724bab7224a35",
        1_680_234,
    ),
    _poly_haven(
        "forest",
        "a forest",
        "forest_slope",
        "926a6bb81897919b2924f42407162b8d54be91eab2da3fe7fe19daf308cfa09a",
        1_911_073,
    ),
    _poly_haven(
        "night",
        "a camp at night",
        "dikhololo_night",
        "6861489f983cdc0c22435b781a3487171bd25f25f9cc52c46ac402d48e08249e",
        1_745_132,
    ),
    Asset(
        name="sky",
        what="sun and clouds over a horizon, 1024x512",
        owner="Poly Haven",
        terms="CC0",
        source="https://polyhaven.com/a/kloofendal_48d_partly_cloudy_puresky",
        files=(
            AssetFile(
                "envmaps/sky.hdr",
                "fd94c84997b8a3c353b62c2125a9b44e19509956986a126e472684432a02d798",
                1_435_119,
                f"{_PMNDRS}/sky.hdr",
            ),
        ),
    ),
    _poly_haven(
        "apartment",
        "an apartment",
        "lebombo",
        "a02c9615adeba91a753c3e4737c3ce7a719273df822eeaa85d24982bd43c9ecb",
        1_476_953,
    ),
    _poly_haven(
        "warehouse",
        "an empty warehouse",
        "empty_warehouse_01",
        "9b3d611cadc32c3a0c7e084ce5611c0650293881c4a041e7fa13748fe0dc6451",
        1_672_140,
    ),
    Asset(
        name="buddha",
        what="Happy Buddha, 100,000 triangles (the paper: 1.09 million)",
        owner="Stanford 3D Scanning Repository",
        terms="research use; credit the repository",
        source="https://graphics.stanford.edu/data/3Dscanrep/",
        files=(
            AssetFile(
                "meshes/happy_buddha.obj",
                "1b2479c77154f90c31281cb69ff1963dcd2ceb52d9803555eb70a2a1a09111de",
                3_368_022,
                f"{_PHOTON}/buddha.obj",
            ),
        ),
        alternatives=("meshes/happy_vrip.ply",),  # the whole of it, as the Stanford repository has it
    ),
    Asset(
        name="teapot",
        what="Utah teapot, 6,320 triangles",
        owner="M. Newell, University of Utah",
        terms="public domain",
        source="https://users.cs.utah.edu/~dejohnso/models/teapot.html",
        files=(
            AssetFile(
                "meshes/teapot.obj",
                "1b5396fedd74b577e32cef41146582c2f2e1a050d5b4915193c0ac1ad4187ed4",
                210_614,
                f"{_MODELS}/teapot.obj",
            ),
        ),
    ),
    Asset(
        name="truck",
        what="a milk truck, in glTF with its textures",
        owner="Cesium",
        terms="CC-BY 4.0, the logo is a trademark of Cesium",
        source="https://github.com/KhronosGroup/glTF-Sample-Assets/tree/main/Models/CesiumMilkTruck",
        files=(
            AssetFile(
                "models/CesiumMilkTruck.glb",
                "2f17d0f4f48f23cf9d6c8d117e8f5a9ab3e2374dfd8b2e207506438c2c0b0b84",
                542_144,
                f"{_TRIMESH}/CesiumMilkTruck.glb",
            ),
        ),
    ),
    Asset(
        name="matpreview",
        what="Mitsuba's material preview, a scene",
        owner="the Mitsuba authors",
        terms="the repository states none; credit the authors",
        source="https://github.com/mitsuba-renderer/mitsuba-data",
        files=(
            AssetFile(
                "scenes/matpreview/matpreview.xml",
                "dfff282b9f3e36117ce91da3059a41ecd18998db38a50dcc9cc554fc1d247b4c",
                3_465,
                f"{_MITSUBA}/matpreview.xml",
            ),
            AssetFile(
                "scenes/matpreview/matpreview.serialized",
                "3db708c2fc2cf009e779c72e2ff0e016ab7fe2b9ebcf9a51e218dac1fc8571a8",
                857_057,
                f"{_MITSUBA}/matpreview.serialized",
            ),
            AssetFile(
                "scenes/matpreview/envmap.exr",
                "8e38b990409aa8ce4a6ce96801acbebaebf1c3c99514fb0fac1b909ee3d357d9",
                426_040,
                f"{_MITSUBA}/envmap.exr",
            ),
        ),
    ),
)

ASSETS: dict[str, Asset] = {asset.name: asset for asset in _REGISTRY}
"""All that is known, by name."""


class Assets:
    """Finds assets, and fetches them.

    ``folder`` is looked through first, and gets what is fetched; None: only the usual folders, and the cache gets it.
    Raises :class:`InputError` if it is no folder. Methods take an asset by its name, or by the path of its file within
    a folder of assets; they raise :class:`InputError` where neither is known.
    """

    def __init__(self, folder: str | Path | None = None, *, registry: Mapping[str, Asset] = ASSETS) -> None:
        self.folder = None if folder is None else Path(folder)
        self.registry = registry
        if self.folder is not None and not self.folder.is_dir():
            raise InputError(f"{self.folder}: no such folder; name one that has assets, or gets them")

    @property
    def cache(self) -> Path:
        """The folder of the cache."""
        return cache_folder() / "assets"

    @property
    def folders(self) -> tuple[Path, ...]:
        """Where is looked, in this order."""
        named = os.environ.get("STRATALUX_ASSETS")
        places = (self.folder, Path(named) if named else None, _beside_checkout(), self.cache)
        return tuple(dict.fromkeys(place for place in places if place is not None))

    def __getitem__(self, name: str) -> Asset:
        """The asset of a name, or of a file."""
        for asset in self.registry.values():
            if name in (asset.name, asset.file):
                return asset
        raise InputError(f"no asset is called '{name}'; known: {', '.join(self.registry)}")

    def find(self, name: str) -> Path | None:
        """The file to load, or None. An alternative counts only where the asset is asked for by its name."""
        found = self._search(name)
        return None if found is None else found[0] / found[1]

    def locate(self, name: str) -> Found | None:
        """The same, and whether it is what was measured with. Raises :class:`InputError` if it cannot be read."""
        found = self._search(name)
        if found is None:
            return None
        folder, main = found
        asset = self[name]
        same = main == asset.file and all(sha256_of(folder / file.file) == file.sha256 for file in asset.files)
        return Found(folder / main, same)

    def require(self, name: str) -> Path:
        """The file to load. Raises :class:`InputError`, which says where was looked and what to type."""
        path = self.find(name)
        if path is not None:
            return path
        asset = self[name]
        looked = ", ".join(str(folder) for folder in self.folders)
        raise InputError(
            f"{asset.name} is missing: there is no {asset.file} in {looked}; type: stratalux assets fetch {asset.name}"
        )

    def fetch(self, name: str, progress: Progress | None = None) -> Path:
        """The file to load, downloaded unless it is there; a damaged one of the cache is replaced.

        Files appear complete and with the right SHA-256, or not at all. Raises :class:`InputError` if pooch is not
        installed, the network fails, another file is served, or nothing can be written.
        """
        asset = self[name]
        found = self.locate(asset.name)
        # Somebody's own file is never replaced, nor is it hidden behind a fetched one.
        if found and (found.as_measured or not found.path.is_relative_to(self.cache)):
            return found.path
        for file in asset.files:
            path = self._destination / file.file
            if self.folder is not None and path.exists() and sha256_of(path) != file.sha256:
                raise InputError(f"{path}: is another file than the one to fetch; move it away")
            _download(file, path, progress)
        return self._destination / asset.file

    def _search(self, name: str) -> tuple[Path, str] | None:
        """The first folder that has all that the asset needs, and the file to load within it."""
        asset = self[name]
        files = [tuple(file.file for file in asset.files)]
        if name == asset.name:
            files += [(alternative,) for alternative in asset.alternatives]
        for folder in self.folders:
            for needed in files:
                if all(os.path.isfile(folder / file) for file in needed):  # unlike pathlib's, False without access
                    return folder, needed[0]
        return None

    @property
    def _destination(self) -> Path:
        return self.folder or self.cache


def _beside_checkout() -> Path | None:
    root = Path(__file__).resolve().parents[2]
    return root.parent / "shared" / "assets" if (root / "pyproject.toml").is_file() else None


def sha256_of(path: Path) -> str:
    """SHA-256 of a file's content. Raises :class:`InputError` if it cannot be read."""
    try:
        return hashlib.sha256(path.read_bytes()).hexdigest()
    except OSError as error:
        raise InputError(f"{path}: cannot be read ({error.strerror or error})") from None


def _download(file: AssetFile, path: Path, progress: Progress | None) -> None:
    try:
        import pooch
        from requests.exceptions import RequestException
    except ImportError:
        raise InputError("fetching needs pooch: pip install 'stratalux[assets]'") from None
    from .images.files import umask

    watch = False if progress is None else _Watch(path.name, file.size, progress)
    downloader = pooch.HTTPDownloader(progressbar=watch, chunk_size=_CHUNK)
    by_hand = f"try again, or place the file at {path}"
    try:
        with _quiet(pooch.get_logger()):
            pooch.retrieve(file.url, file.sha256, path.name, path.parent, downloader=downloader)
        path.chmod(0o666 & ~umask())  # pooch leaves the file to its owner alone
    except RequestException as error:
        raise InputError(f"{file.url}: cannot be downloaded ({_reason(error)}); {by_hand}") from None
    except OSError as error:
        raise InputError(f"{path}: cannot be written ({error.strerror or error}); choose another folder") from None
    except ValueError:
        raise InputError(
            f"{file.url}: serves another file than the one pinned (SHA-256), not kept; {by_hand}"
        ) from None


_CHUNK = 1 << 16
"""Bytes between two reports of the progress."""


class _Watch:
    """What pooch takes for a progress bar. It sets ``total`` by what the server says, which need not say anything."""

    def __init__(self, name: str, size: int, progress: Progress) -> None:
        self.name, self.size, self.progress, self.total, self.done = name, size, progress, 0, 0

    def update(self, count: int) -> None:
        self.done = min(self.done + count, self.size)
        self.progress(self.name, self.done, self.size)

    def reset(self) -> None:
        self.done = 0

    def close(self) -> None:
        self.progress(self.name, self.size, self.size)


@contextmanager
def _quiet(logger: logging.Logger) -> Iterator[None]:
    """pooch prints each download, and the commands say what they do themselves."""
    level = logger.level
    logger.setLevel(logging.WARNING)
    try:
        yield
    finally:
        logger.setLevel(level)


def _reason(error: Any) -> str:
    """A few words in place of the nested representations that requests puts together."""
    if error.response is not None:
        return f"the server answers {error.response.status_code}"
    names = {"ConnectTimeout": "timed out", "ReadTimeout": "timed out", "ConnectionError": "no connection"}
    return names.get(type(error).__name__, type(error).__name__)
