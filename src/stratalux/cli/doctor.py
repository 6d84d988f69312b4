"""``stratalux doctor``."""

from __future__ import annotations

import platform
import sys
from importlib.metadata import PackageNotFoundError, version

import click

_PACKAGES = ("stratalux", "mitsuba", "drjit", "numpy", "trimesh", "click", "rich")


@click.command()
def doctor() -> None:
    """Say which versions are installed, which Mitsuba variants work, and what to install where not.

    Exits with 1 if no variant works.

    \b
    Examples:
      stratalux doctor
    """
    click.echo(f"{'python':12} {platform.python_version()}  {sys.executable}")
    for package in _PACKAGES:
        try:
            found = version(package)
        except PackageNotFoundError:
            found = "missing; pip install " + package
        click.echo(f"{package:12} {found}")

    from ..rendering import variants  # a broken Mitsuba must not hide the lines above

    llvm = variants.llvm_library()
    where = variants.llvm_path() or "unknown place"
    click.echo(f"{'llvm':12} " + (f"{llvm}  {where}" if llvm else f"not found; {variants.llvm_advice()}"))
    aborts = llvm is not None and variants.llvm_aborts()
    import mitsuba as mi

    works = []
    for variant in mi.variants():
        reason = variants.why_not(variant)
        if reason is None and aborts and variant.startswith("llvm"):
            reason = f"aborts with this LLVM library; {variants.llvm_advice()}"
        works += [variant] if reason is None else []
        click.echo(f"{variant:30} {'works' if reason is None else reason}")
    if not works:
        click.echo(f"no variant works: {variants.llvm_advice()}")
        sys.exit(1)
    default = next((variant for variant in variants.PREFERRED if variant in works), works[0])
    click.echo(f"renders with {default} by default")
