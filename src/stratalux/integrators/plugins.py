"""Registration of our Mitsuba plugins, which Mitsuba keeps per variant and forgets when the variant changes."""

from __future__ import annotations

import importlib
import importlib.abc
import importlib.machinery
import importlib.util
import sys
from collections.abc import Sequence
from types import ModuleType
from typing import Any

INTEGRATORS = (
    "direct_stratified",
    "direct_importance",
    "direct_wavelet",
    "direct_lights",
    "path_stratified",
    "mitsuba_own",
)
"""Modules of ``stratalux.integrators``, a line each. A module lists its ``TECHNIQUES``, and in ``PLUGINS`` the
integrators that it brings, by the name that Mitsuba's scenes use."""

_SHARED = (
    "stratalux.integrators.common",
    "stratalux.integrators.light_samples",
    "stratalux.integrators.automatic.variate",
    "stratalux.integrators.automatic.visibility",
    "stratalux.integrators.automatic.lobes",
    "stratalux.integrators.automatic.balance",
    "stratalux.integrators.automatic.nested_strata",
    "stratalux.integrators.automatic.sample",
    "stratalux.integrators.automatic.launch",
    "stratalux.integrators.automatic.view",
    "stratalux.integrators.automatic.image",
    "stratalux.integrators.indirect.vertex",
    "stratalux.integrators.indirect.paths",
    "stratalux.integrators.indirect.launch",
    "stratalux.integrators.indirect.image",
)
_loaded_for: str | None = None


def register() -> None:
    """Make the plugins known to Mitsuba, now and after every change of variant. Safe to call again.

    Importing ``stratalux`` does this; it is also the package's entry point in the group ``mitsuba``.
    """
    import mitsuba as mi

    mi.detail.remove_variant_callback(_on_variant)
    mi.detail.add_variant_callback(_on_variant)
    if mi.variant() is not None:
        _register_variant(mi.variant())


def _on_variant(old: str | None, new: str) -> None:
    _register_variant(new)


def _register_variant(variant: str) -> None:
    import mitsuba as mi

    global _loaded_for
    supported = not variant.startswith("scalar") and not variant.endswith("polarized")
    if supported and _loaded_for != variant:
        # The classes derive from the variant's own base classes, so their modules are loaded anew.
        for name in (*_SHARED, *(f"stratalux.integrators.{name}" for name in INTEGRATORS)):
            module = sys.modules.get(name)
            importlib.import_module(name) if module is None else importlib.reload(module)
        _loaded_for = variant
    if supported:
        for module in integrator_modules():
            for name, plugin in module.PLUGINS.items():
                mi.register_integrator(name, plugin)
    else:
        # Their classes cannot even be defined here; the names of our plugins are those of their modules.
        for name in INTEGRATORS:
            mi.register_integrator(name, _refusal(name, variant))


def integrator_modules() -> list[ModuleType]:
    """The modules of :data:`INTEGRATORS`, as loaded for the variant that is active."""
    if _loaded_for is None:
        raise RuntimeError("no vectorised Mitsuba variant has been set; mitsuba.set_variant('llvm_ad_rgb')")
    return [sys.modules[f"stratalux.integrators.{name}"] for name in INTEGRATORS]


def _refusal(name: str, variant: str) -> Any:
    def refuse(props: Any) -> Any:
        raise RuntimeError(
            f"'{name}' does not run in the variant '{variant}'; choose a vectorised, unpolarised one: "
            "mitsuba.set_variant('llvm_ad_rgb')"
        )

    return refuse


def register_on_import() -> None:
    """Register now if Mitsuba has been imported, else as soon as it is: ``import stratalux`` stays light."""
    if "mitsuba" in sys.modules:
        register()
    elif not any(isinstance(finder, _MitsubaFinder) for finder in sys.meta_path):
        sys.meta_path.insert(0, _MitsubaFinder())


class _MitsubaFinder(importlib.abc.MetaPathFinder):
    """Lets the import of ``mitsuba`` end with our registration, then removes itself."""

    def find_spec(
        self, fullname: str, path: Sequence[str] | None, target: ModuleType | None = None
    ) -> importlib.machinery.ModuleSpec | None:
        if fullname != "mitsuba":
            return None
        sys.meta_path.remove(self)
        spec = importlib.util.find_spec(fullname)
        if spec is not None and spec.loader is not None:
            spec.loader = _RegisteringLoader(spec.loader)
        return spec


class _RegisteringLoader(importlib.abc.Loader):
    def __init__(self, loader: Any) -> None:
        self._loader = loader

    def create_module(self, spec: importlib.machinery.ModuleSpec) -> ModuleType | None:
        return self._loader.create_module(spec)  # type: ignore[no-any-return]

    def exec_module(self, module: ModuleType) -> None:
        self._loader.exec_module(module)
        register()
