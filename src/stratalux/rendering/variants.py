"""Choosing a Mitsuba variant that works on this machine, or saying what to install."""

from __future__ import annotations

import os
import subprocess
import sys

import drjit as dr
import mitsuba as mi

from ..errors import InputError

PREFERRED = ("cuda_ad_rgb", "llvm_ad_rgb")
"""The first of these that works is the default."""


def llvm_library() -> str | None:
    """Version of the LLVM library that Dr.Jit found, or None."""
    if not dr.has_backend(dr.JitBackend.LLVM):
        return None
    return str(dr.detail.llvm_version())


def llvm_path() -> str | None:
    """File from which the LLVM library was loaded, where the system tells."""
    try:
        with open("/proc/self/maps", encoding="utf-8") as maps:
            return next((line.split()[-1] for line in maps if "libLLVM" in line), None)
    except OSError:
        return os.environ.get("DRJIT_LIBLLVM_PATH")


def llvm_advice() -> str:
    """What to type where Dr.Jit finds no LLVM."""
    if sys.platform == "darwin":
        return "brew install llvm"
    return "sudo apt-get install libllvm19 (any libllvm from 17 on), or set DRJIT_LIBLLVM_PATH to libLLVM.so"


def llvm_aborts() -> bool:
    """Whether the LLVM library ends a process that runs a kernel, as versions before 17 do on some processors."""
    program = (
        "import mitsuba as mi, drjit as dr; mi.set_variant('llvm_ad_rgb'); dr.eval(dr.maximum(mi.Float([1, 2]), 0))"
    )
    return subprocess.run([sys.executable, "-c", program], capture_output=True, check=False).returncode < 0


def why_not(variant: str) -> str | None:
    """Why a variant cannot render here, or None if it can."""
    if variant not in mi.variants():
        return f"unknown; Mitsuba has {', '.join(mi.variants())}"
    if variant.startswith("scalar"):
        return "is not vectorised"
    if variant.endswith("polarized"):
        return "tracks polarisation, which the plugins do not"
    if variant.startswith("llvm") and not dr.has_backend(dr.JitBackend.LLVM):
        return f"finds no LLVM library; {llvm_advice()}"
    if variant.startswith("cuda") and not dr.has_backend(dr.JitBackend.CUDA):
        return "finds no NVIDIA GPU and driver"
    return None


def choose_variant(name: str | None = None) -> str:
    """Activate the variant ``name``, or the first of :data:`PREFERRED` that works, and return its name.

    Raises :class:`InputError` that says what is missing.
    """
    candidates = PREFERRED if name is None else (name,)
    reasons = {}
    for variant in candidates:
        reasons[variant] = why_not(variant)
        if reasons[variant] is None:
            mi.set_variant(variant)
            return variant
    variant = candidates[-1]
    raise InputError(f"variant {variant}: {reasons[variant]}")
