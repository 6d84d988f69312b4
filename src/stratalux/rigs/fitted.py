"""Lights that are fitted to the irradiance of a map, over all normals, and an ambient light beside them.

With c(t) = max(0, t), a light of colour w from d gives w c(n·d), and two of them have the inner product

    K(a·b) = ∫ c(n·a) c(n·b) dn = 2/3 (sin γ + (π − γ) cos γ),   cos γ = a·b,

over all normals n (Cho and Saul 2009, the kernel of degree 1). So the squared error of a rig is wᵀKw − 2 wᵀg + const,
with g_i = Σ flux K(d_i·ω) over the map, without any sampling of normals. For given directions the colours w ≥ 0 are a
non-negative least squares problem for each channel; the directions go down the gradient of what is left, that of the
three channels together (variable projection: Golub and Pereyra 1973).

Ambient light of harmonics up to degree l takes these degrees of the map over exactly, less what the lights have of
them. So K and g lose their parts of these degrees (A_l² (2l + 1) / 4π P_l, A_l being those of the clamped cosine).
Lights could then take more than there is, and the ambient light would be negative: that its irradiance is not, for a
few normals, is a condition on w, which enters the least squares with slack variables that are not negative either.
"""

from __future__ import annotations

import warnings

import numpy as np
from numpy.typing import NDArray

from ..errors import InputError, RigWarning
from ..maps.envmap import EnvironmentMap
from .harmonics import harmonics
from .kmeans import kmeans
from .lights import Lights
from .quality import sources, spread
from .rig import check_count
from .sun import Sun, find_sun

_Float = NDArray[np.float64]

MOST_LIGHTS = 128
"""More of them are better placed by the other techniques, which take less time."""
_DEGREES = {"none": 0, "constant": 1, "sh2": 3}
"""How many degrees the ambient light has."""
_CANDIDATES = 512
_ROUNDS = 120
_A = np.pi * np.array([1, 2 / 3, 1 / 4])
_CONDITIONS = 32
"""Normals for which the ambient light must not be negative."""
_FIRMNESS = 2.0
"""Weight of these, against errors of irradiance."""


def fitted(environment: EnvironmentMap, n: int, *, ambient: str = "none") -> Lights:
    """At most ``n`` lights, and an ``ambient`` light: ``none``, ``constant`` or ``sh2``.

    A sun is kept apart: it is one of the lights, where the map has it, as wide, and at least with its light. There are
    fewer than ``n`` lights where more do not help. Raises :class:`InputError` if ``n`` is less than 1 or more than
    :data:`MOST_LIGHTS` or the number of texels, or if the ambient light is unknown.
    """
    check_count(environment, n)
    if n > MOST_LIGHTS:
        raise InputError(f"number of lights: {n} is more than {MOST_LIGHTS}, the most that are fitted; choose kmeans")
    sun = find_sun(environment)
    fit = _Fit(environment, _degrees(ambient), sun if sun.is_one else None)
    free = n - len(fit.fixed)
    starts = [fit.greedy(free)]
    if 0 < free <= environment.height * environment.width:
        starts.append(kmeans(environment, free).direction)
    best = min((fit.descend(start) for start in starts), key=fit.error)
    return fit.lights(best, "fitted", ambient)


def sun_and_sky(environment: EnvironmentMap, *, ambient: str = "sh2") -> Lights:
    """One light, the sun, with its angle and its colour, and the rest of the map as ambient light.

    A :class:`RigWarning` says where the brightest spot of the map is no sun. Raises :class:`InputError` if the ambient
    light is unknown.
    """
    sun = find_sun(environment)
    if not sun.is_one:
        warnings.warn(f"{sun.doubt}; --method fitted places lights as they light best", RigWarning, stacklevel=2)
    points, flux = sources(environment)
    colour = sun.colour[None]
    left = _left(points, flux, sun.direction[None], colour, _degrees(ambient))
    return Lights(sun.direction[None], colour, np.array([sun.angle]), "sun", ambient=left)


def _degrees(ambient: str) -> int:
    if ambient not in _DEGREES:
        raise InputError(f"ambient: '{ambient}' is unknown; use one of {', '.join(_DEGREES)}")
    return _DEGREES[ambient]


class _Fit:
    """The least squares problem of a map; directions that are asked for come after the sun's, where it has one."""

    def __init__(self, environment: EnvironmentMap, degrees: int, sun: Sun | None) -> None:
        self.points, self.flux = sources(environment)
        self.degrees, self.sun = degrees, sun
        self.fixed = np.empty((0, 3)) if sun is None else sun.direction[None]
        self.least = np.empty((0, 3)) if sun is None else sun.colour[None]
        self.normals = spread((0, 1, _CONDITIONS)[min(degrees, 2)])
        # What the map has for the ambient light at most.
        self.most = np.maximum(self.share(self.normals @ self.points.T)[0] @ self.flux, 0)

    def kernel(self, t: _Float) -> tuple[_Float, _Float]:
        """K of cosines, without the degrees of the ambient light, and its derivative."""
        t = np.clip(t, -1, 1)
        γ = np.arccos(t)
        K, slope = 2 / 3 * (np.sqrt(1 - t * t) + (np.pi - γ) * t), 2 / 3 * (np.pi - γ)
        for degree in range(self.degrees):
            factor = _A[degree] ** 2 * (2 * degree + 1) / (4 * np.pi)
            K -= factor * (np.ones_like(t), t, (3 * t * t - 1) / 2)[degree]
            slope -= factor * (np.zeros_like(t), np.ones_like(t), 3 * t)[degree]
        return K, slope

    def share(self, t: _Float) -> tuple[_Float, _Float]:
        """Irradiance of the ambient light's degrees of a light, at cosines from it, and its derivative."""
        S, slope = np.zeros_like(t), np.zeros_like(t)
        for degree in range(self.degrees):
            factor = _A[degree] * (2 * degree + 1) / (4 * np.pi)
            S += factor * (np.ones_like(t), t, (3 * t * t - 1) / 2)[degree]
            slope += factor * (np.zeros_like(t), np.ones_like(t), 3 * t)[degree]
        return S, slope

    def colours(self, d: _Float) -> tuple[_Float, float]:
        """The best colours (N, 3) of lights at ``d`` (N, 3), and the squared error up to a constant."""
        K, _ = self.kernel(d @ d.T)
        g = self.kernel(d @ self.points.T)[0] @ self.flux
        w, error, _ = self._solve(K, g, self.share(self.normals @ d.T)[0])
        return w, error

    def _solve(self, K: _Float, g: _Float, C: _Float) -> tuple[_Float, float, _Float]:
        """The colours, the squared error, and by how much (C w + slack − most) each condition is missed."""
        from scipy.linalg import cholesky, solve_triangular
        from scipy.optimize import nnls

        least = np.zeros_like(g)
        least[: len(self.least)] = self.least
        R = cholesky(K + 1e-9 * np.trace(K) / len(K) * np.eye(len(K)))
        target = solve_triangular(R, g - K @ least, trans=1)
        w, missed = np.empty_like(g), np.zeros((len(C), 3))
        for c in range(3):
            most, broken = self.most[:, c] - C @ least[:, c], np.zeros(len(C), dtype=bool)
            while True:  # with those conditions only that are broken without them
                n, m = len(K), int(np.count_nonzero(broken))
                rows = np.zeros((n + m, n + m))
                rows[:n, :n], rows[n:, :n], rows[n:, n:] = R, _FIRMNESS * C[broken], _FIRMNESS * np.eye(m)
                x, _ = nnls(rows, np.append(target[:, c], _FIRMNESS * most[broken]), maxiter=30 * (n + m) + 100)
                more = ~broken & (C @ x[:n] - most > 1e-9 * np.abs(most).max(initial=1e-30))
                if not more.any():
                    break
                broken |= more
            w[:, c] = least[:, c] + x[:n]
            missed[broken, c] = C[broken] @ x[:n] + x[n:] - most[broken]
        error = np.sum(w * (K @ w)) - 2 * np.sum(w * g) + _FIRMNESS**2 * np.sum(missed**2)
        return w, float(error), missed

    def error(self, d: _Float) -> float:
        return self.colours(d)[1] if len(d) else 0.0

    def greedy(self, n: int) -> _Float:
        """Directions (N, 3), each of which is where it helps most, after those before it."""
        d = self.fixed
        candidates = np.concatenate([spread(_CANDIDATES), self.points[np.argsort(-self.flux.sum(axis=1))[:64]]])
        K, _ = self.kernel(candidates @ candidates.T)
        g = self.kernel(candidates @ self.points.T)[0] @ self.flux
        size = np.maximum(np.diag(K), 1e-12)
        for _ in range(n):
            w = self.colours(d)[0] if len(d) else np.empty((0, 3))
            gain = np.sum(np.maximum(g - self.kernel(candidates @ d.T)[0] @ w, 0) ** 2, axis=1) / size
            d = np.concatenate([d, candidates[[np.argmax(gain)]]])
        return d[len(self.fixed) :]

    def slope(self, free: _Float) -> tuple[float, _Float]:
        """The squared error of lights at ``free`` (N, 3), unit vectors, beside the sun, and its gradient (N, 3)."""
        d = np.concatenate([self.fixed, free])
        K, K_slope = self.kernel(d @ d.T)
        G, G_slope = self.kernel(d @ self.points.T)
        C, C_slope = self.share(self.normals @ d.T)
        w, error, missed = self._solve(K, G @ self.flux, C)
        # Of the colours there is no slope: they are the best ones, or bounded.
        among = (K_slope * (w @ w.T)) @ d
        apart = (G_slope * (w @ self.flux.T)) @ self.points
        kept = _FIRMNESS**2 * ((C_slope * (missed @ w.T)).T @ self.normals)
        along = 2 * (among - apart + kept)[len(self.fixed) :]
        return error, along - np.sum(along * free, axis=1, keepdims=True) * free

    def descend(self, start: _Float) -> _Float:
        """All directions, after those of ``start`` (N, 3) have been refined."""
        from scipy.optimize import minimize

        if not len(start):
            return self.fixed
        scale = float(np.sum(self.flux) ** 2) or 1.0

        def f(x: _Float) -> tuple[float, _Float]:
            v = x.reshape(-1, 3)
            length = np.linalg.norm(v, axis=1, keepdims=True)
            error, slope = self.slope(v / length)
            return error / scale, (slope / length / scale).ravel()

        rounds = _ROUNDS if len(start) <= 16 else _ROUNDS // 4
        found = minimize(f, start.ravel(), jac=True, method="L-BFGS-B", options={"maxiter": rounds, "ftol": 1e-10})
        v = found.x.reshape(-1, 3)
        return np.concatenate([self.fixed, v / np.linalg.norm(v, axis=1, keepdims=True)])

    def lights(self, d: _Float, method: str, ambient: str) -> Lights:
        """The lights at ``d``; those that stay black are left out."""
        w, _ = self.colours(d)
        total = w.sum(axis=1)
        lit = (total > 0) | (np.arange(len(d)) == np.argmax(total))
        angle = np.zeros(len(d))
        if self.sun is not None:
            angle[0] = self.sun.angle
        left = _left(self.points, self.flux, d, w, self.degrees)
        return Lights(d[lit], w[lit], angle[lit], method, ambient=left)


def _left(points: _Float, flux: _Float, d: _Float, w: _Float, degrees: int) -> _Float | None:
    """The coefficients (9, 3) of the map's radiance less those of the lights, or None without a degree."""
    if not degrees:
        return None
    left = harmonics(points).T @ flux - harmonics(d).T @ w
    left[degrees**2 :] = 0
    return np.asarray(left)
