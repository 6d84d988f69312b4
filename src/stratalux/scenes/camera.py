"""From where a scene is seen: through a camera of its file, or one that frames the object.

Matrices of Mitsuba's cameras have the columns left, up, forward and position; those of a file right, up, backward.
"""

from __future__ import annotations

import warnings
from collections.abc import Sequence
from typing import Any

import mitsuba as mi
import numpy as np
import numpy.typing as npt

from ..errors import InputError, SceneWarning
from .model import Camera
from .settings import CameraSettings

AZIMUTH_DEGREES = 30.0
ELEVATION_DEGREES = 17.0
FIELD_OF_VIEW_DEGREES = 30.0
"""Along the shorter side of the film."""

MARGIN = 0.08
"""The part of the film's width and height that stays free on either side of the object."""

LEAST_DISTANCE = 0.1
"""Of the camera from the nearest point, in diagonals of the object: what points at the camera does not touch it."""

_NEAR, _FAR = 1e-2, 1e4
"""Mitsuba's own limits of what is seen."""
_RIGID = 1e-3
"""How much the axes of a camera may differ from perpendicular ones of equal length: single precision and some more."""
_BACK = 10.0
"""How far an orthographic camera is moved back, in distances of the object's furthest point."""
_LISTED = 20

Matrix = npt.NDArray[np.float64]


def sensor(
    camera: CameraSettings,
    points: npt.ArrayLike,
    cameras: Sequence[Camera] = (),
    size: tuple[int, int] = (600, 400),
    spp: int = 64,
    sampler: str = "independent",
    origin: npt.ArrayLike = (0.0, 0.0, 0.0),
) -> dict[str, Any]:
    """The dictionary of a Mitsuba sensor, with its film and its sampler.

    ``points``: vertices (N, 3) of the object, y up, and ``cameras`` those of the file, both in the scene's coordinates.
    ``size``: (width, height) of the film in pixels; ``spp``: samples per pixel of the ``sampler``. ``origin`` (3,):
    where that of the scene is in the coordinates that the settings speak of.

    Through a camera of the file, at least what it frames is seen: on a film that is wider than the camera, its height
    is that of the picture, and on a narrower one its width. Without such a camera, see :func:`camera_frame`. Warns with
    a :class:`SceneWarning` of what a camera says and is not shown. Raises :class:`InputError` for a camera that the
    file does not have or that can see nothing, and for a lens that it cannot have.
    """
    width, height = size
    aspect = width / height
    points = np.asarray(points, dtype=np.float64)
    chosen = _chosen(camera, cameras)
    if chosen is None:
        matrix = _framing(camera, points, aspect, np.asarray(origin, dtype=np.float64))
        lens: dict[str, Any] = {"type": "perspective", "fov": _fov(camera), "fov_axis": "smaller"}
        aperture, focus = camera.aperture or 0.0, camera.focus
    else:
        name = _title(cameras, chosen)
        matrix, lens = _of_file(cameras[chosen], name, aspect)
        aperture = cameras[chosen].aperture if camera.aperture is None else camera.aperture
        focus = cameras[chosen].focus if camera.focus is None else camera.focus
        if lens["type"] == "orthographic" and aperture:
            if camera.aperture:
                raise InputError(f"aperture: {name} is orthographic, for which all is sharp; leave it out")
            warnings.warn(f"{name}: is orthographic, for which all is sharp; its aperture is left out", SceneWarning, 2)
            aperture = 0.0
    if camera.focus is not None and not aperture:
        raise InputError("focus: all is sharp without a lens; give its aperture, too")
    seen = (points - matrix[:3, 3]) @ matrix[:3, :3]
    reach = float(np.linalg.norm(seen, axis=1).max())
    if lens["type"] == "orthographic" and seen[:, 2].min() > 0:
        # From further back it sees the same of the object, and does not begin below the ground.
        matrix[:3, 3] -= _BACK * reach * matrix[:3, 2]
    if aperture:
        focus = _nearest(seen, lens, aspect) if focus is None else focus
        lens |= {"type": "thinlens", "aperture_radius": aperture, "focus_distance": focus}
    stretch = np.diag([*lens.pop("scale", (1.0, 1.0)), 1.0, 1.0])
    return {
        **lens,
        "to_world": mi.ScalarTransform4f((matrix @ stretch).tolist()),
        # Small scenes are not cut off in front, nor large ones behind.
        "near_clip": min(_NEAR, reach / 100),
        "far_clip": max(_FAR, reach * 1000),
        "film": {
            "type": "hdrfilm",
            "width": width,
            "height": height,
            "pixel_format": "rgb",
            "component_format": "float16",
            "rfilter": {"type": "gaussian"},
        },
        "sampler": {"type": sampler, "sample_count": spp},
    }


# ------------------------------- Which one -------------------------------


def _chosen(camera: CameraSettings, cameras: Sequence[Camera]) -> int | None:
    """Index of the file's camera that is looked through, or None."""
    if camera.camera == "none" or camera.placed or (camera.camera == "auto" and not cameras):
        return None
    if camera.camera == "auto":
        return 0
    return _index(camera.camera, [one.name for one in cameras])


def own_camera(camera: CameraSettings, scene: mi.Scene) -> int:
    """Index of the camera among those of a Mitsuba scene, which has its own; raises :class:`InputError`."""
    lens = (name for name in ("aperture", "focus") if getattr(camera, name) is not None)
    if asked := (*camera.placed, *lens):
        raise InputError(
            f"{asked[0].replace('_', '-')}: a Mitsuba scene brings its own cameras; change its sensor, or choose one "
            "with camera"
        )
    if camera.camera == "none":
        raise InputError("camera none: a Mitsuba scene is seen through its own cameras; leave it out")
    return 0 if camera.camera == "auto" else _index(camera.camera, [one.id() for one in scene.sensors()])


def _index(wanted: str, names: Sequence[str]) -> int:
    """Index of the camera ``wanted``: of its name, unless it is a number."""
    if not names:
        raise InputError(f"camera '{wanted}': the file has none; leave it out, and the object is framed")
    if wanted.isascii() and wanted.isdecimal():
        found = [int(wanted)] if len(wanted) < 10 and int(wanted) < len(names) else []
    else:
        found = [index for index, name in enumerate(names) if name == wanted]
    if len(found) == 1:
        return found[0]
    if found:
        raise InputError(f"camera '{wanted}': several are called so; give an index: {', '.join(map(str, found))}")
    listed = ", ".join(f"{index} ({name!r})" if name else str(index) for index, name in enumerate(names[:_LISTED]))
    more = f" and {len(names) - _LISTED} more" if len(names) > _LISTED else ""
    raise InputError(f"camera '{wanted}': there is none; give one of {listed}{more}")


def _title(cameras: Sequence[Camera], index: int) -> str:
    name = cameras[index].name
    return f"camera {index} ({name!r})" if name else f"camera {index}"


# ------------------------------- A camera of the file -------------------------------


def _of_file(camera: Camera, name: str, aspect: float) -> tuple[Matrix, dict[str, Any]]:
    """Where it stands as Mitsuba has it, and its projection on a film of this ``aspect``."""
    matrix = _rigid(camera, name)
    matrix[:3, [0, 2]] *= -1
    own = aspect if camera.aspect is None else camera.aspect
    if not (np.isfinite(own) and own > 0):
        raise InputError(
            f"{name}: an aspect of {own:g} is none; correct the file, or frame the object with camera none"
        )
    if camera.height is not None:
        if not (np.isfinite(camera.height) and camera.height > 0):
            raise InputError(f"{name}: sees a height of {camera.height:g}, which is nothing; correct the file")
        # Mitsuba's orthographic film is 2 wide.
        half = camera.height / 2 * max(aspect, own)
        return matrix, {"type": "orthographic", "scale": (half, half)}
    if not 0 < camera.fov < np.pi:
        raise InputError(f"{name}: a field of view of {np.degrees(camera.fov):g} degrees is none; correct the file")
    if aspect >= own:
        return matrix, {"type": "perspective", "fov": float(np.degrees(camera.fov)), "fov_axis": "y"}
    across = 2 * np.arctan(own * np.tan(camera.fov / 2))
    return matrix, {"type": "perspective", "fov": float(np.degrees(across)), "fov_axis": "x"}


def _rigid(camera: Camera, name: str) -> Matrix:
    """The camera's matrix without scale, shear and mirroring: it looks the same way, and up stays up.

    A uniform scale changes nothing of a perspective view, and is no reason to warn.
    """
    given = np.array(camera.matrix, dtype=np.float64)
    lengths = np.linalg.norm(given[:3, :3], axis=0)
    if not (np.isfinite(given).all() and lengths[1] > 0 and lengths[2] > 0):
        raise InputError(
            f"{name}: its matrix is not finite or flat; correct the file, or frame the object: camera none"
        )
    back, up = given[:3, 2] / lengths[2], given[:3, 1] / lengths[1]
    up = up - back * (up @ back)
    if np.linalg.norm(up) < 1e-6:
        raise InputError(f"{name}: looks along its own up axis; correct the file, or frame the object: camera none")
    up /= np.linalg.norm(up)
    matrix = np.eye(4)
    matrix[:3, :3] = np.stack([np.cross(up, back), up, back], axis=1)
    matrix[:3, 3] = given[:3, 3]
    distorted = np.abs(given[:3, :3] / lengths[2] - matrix[:3, :3]).max() > _RIGID
    has_lengths = camera.height is not None or camera.aperture > 0
    if distorted or (has_lengths and abs(lengths[2] - 1) > _RIGID):
        warnings.warn(
            f"{name}: its matrix scales, shears or mirrors, which is left out: it stands and looks as the file says",
            SceneWarning,
            3,
        )
    return matrix


# ------------------------------- A camera that frames the object -------------------------------


def _fov(camera: CameraSettings) -> float:
    return FIELD_OF_VIEW_DEGREES if camera.fov is None else camera.fov


def _framing(camera: CameraSettings, points: Matrix, aspect: float, origin: Matrix) -> Matrix:
    azimuth, elevation, *distance = camera.orbit or (AZIMUTH_DEGREES, ELEVATION_DEGREES)
    if camera.look_at is None:
        frame = camera_frame(points, aspect, azimuth, elevation, _fov(camera))
        if distance:
            middle = (points.min(axis=0) + points.max(axis=0)) / 2
            depth = (middle - frame[:3, 3]) @ frame[:3, 2]
            frame[:3, 3] += (depth - distance[0]) * frame[:3, 2]
        return frame
    target = np.array(camera.look_at) - origin
    frame = np.eye(4)
    frame[:3, :3] = _axes(azimuth, elevation)
    seen = (points - target) @ frame[:3, :3]
    if not distance:
        needed = float(np.max(np.abs(seen[:, :2]) / _slope(aspect, _fov(camera)) - seen[:, 2:]))
        least = _least_distance(points)
        # Where all of the object is behind the point, no distance is needed, and the point still has to be seen.
        distance = [max(needed, least - float(seen[:, 2].min()), least)]
    frame[:3, 3] = target - distance[0] * frame[:3, 2]
    return frame


def camera_frame(
    points: npt.ArrayLike,
    aspect: float,
    azimuth: float = AZIMUTH_DEGREES,
    elevation: float = ELEVATION_DEGREES,
    fov: float = FIELD_OF_VIEW_DEGREES,
) -> Matrix:
    """The (4, 4) camera-to-world matrix of the closest camera that has all (N, 3) `points` in its frame.

    Columns are left, up, forward (Mitsuba's camera axes) and position; `aspect` is width over height. The camera looks
    from `azimuth` (degrees from +z towards +x) and `elevation` (degrees above the horizon), with `fov` degrees along
    the shorter side of the film. In camera coordinates a point (x, y, z) lies in the frame of a camera at (cx, cy, cz)
    if |x - cx| <= tx (z - cz), and the same for y. The interval that this leaves for cx is
    [max(x - tx z) + tx cz, min(x + tx z) - tx cz]: it is not empty up to a largest cz, which is taken,
    but for :data:`LEAST_DISTANCE`. Within the interval, cx makes the free borders on both sides equal.
    """
    axes = _axes(azimuth, elevation)
    slope = _slope(aspect, fov)
    seen = axes.T @ np.asarray(points, dtype=np.float64).T
    lowest = np.max(seen[:2] - slope[:, None] * seen[2], axis=1)
    highest = np.min(seen[:2] + slope[:, None] * seen[2], axis=1)
    depth = min(np.min((highest - lowest) / (2 * slope)), seen[2].min() - _least_distance(points))
    low, high = lowest + slope * depth, highest - slope * depth
    distance = seen[2] - depth
    # Moving the camera one way moves all of the image the other way: halve the interval until centred.
    for _ in range(24):
        centre = (low + high) / 2
        image = (seen[:2] - centre[:, None]) / distance
        further = image.max(axis=1) + image.min(axis=1) > 0
        low, high = np.where(further, centre, low), np.where(further, high, centre)
    frame = np.eye(4)
    frame[:3, :3] = axes
    frame[:3, 3] = axes @ np.array([*(low + high) / 2, depth])
    return frame


def _axes(azimuth: float, elevation: float) -> Matrix:
    """Left, up and forward (as columns) of a camera that looks to the middle; from the zenith, up is as just below."""
    turn, rise = np.radians([np.fmod(azimuth, 360), elevation])
    left = np.array([-np.cos(turn), 0.0, np.sin(turn)])
    forward = -np.array([np.sin(turn) * np.cos(rise), np.sin(rise), np.cos(turn) * np.cos(rise)])
    return np.stack([left, np.cross(forward, left), forward], axis=1)


def _least_distance(points: npt.ArrayLike) -> float:
    return LEAST_DISTANCE * float(np.linalg.norm(np.ptp(np.asarray(points, dtype=np.float64), axis=0)))


def _slope(aspect: float, fov: float) -> Matrix:
    """Tangents of half the width and half the height of the film without its margins."""
    shorter = np.tan(np.radians(fov) / 2) * (1 - 2 * MARGIN)
    return np.array(shorter * np.array([max(aspect, 1), max(1 / aspect, 1)]))


def _nearest(seen: Matrix, lens: dict[str, Any], aspect: float) -> float:
    """Depth of the nearest of the points that are in the picture, or else before the camera.

    ``seen``: (N, 3) in Mitsuba's camera coordinates.
    """
    tangent = np.tan(np.radians(lens["fov"]) / 2)
    across = {"x": 1.0, "y": aspect, "smaller": max(aspect, 1.0)}[lens["fov_axis"]] * tangent
    before = seen[seen[:, 2] > 0]
    inside = (np.abs(before[:, :2]) <= before[:, 2:] * [across, across / aspect]).all(axis=1)
    depths = before[inside, 2] if inside.any() else before[:, 2]
    if not len(depths):
        raise InputError("focus: nothing of the object is before the camera; give the distance that is sharp")
    return float(depths.min())
