"""Make mistakes in the code, one at a time, and list those that no test finds: python -m scripts.mutants [MODULE ...]

Cosmic Ray makes the mistakes, in a copy of the sources: the working tree stays as it is. Each is tested in a process of
its own, forked when the large libraries are imported and nothing of ours is. A mistake is found if a test fails, if the
tests crash, or if they take far longer than they do without it.
"""

from __future__ import annotations

import argparse
import ast
import atexit
import compileall
import gc
import importlib
import os
import random
import re
import resource
import shutil
import signal
import sys
import tempfile
import time
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

ROOT = Path(__file__).parents[1]
PACKAGE = ROOT / "src" / "stratalux"
FOLDERS = ("maps", "rigs", "sampling", "integrators")

# Of all that each operator could become, what a person might have written.
MISTAKES = re.compile(
    r"core/(ReplaceBinaryOperator_(Add_Sub|Sub_Add|Mul_Div|Div_Mul|FloorDiv_Mul|Mod_Mul|Pow_Mul|LShift_RShift|RShift_LShift"
    r"|BitAnd_BitOr|BitOr_BitAnd|BitXor_BitAnd)"
    r"|ReplaceComparisonOperator_(Lt_LtE|Lt_GtE|LtE_Lt|LtE_Gt|Gt_GtE|Gt_LtE|GtE_Gt|GtE_Lt|Eq_NotEq|NotEq_Eq|Is_IsNot|IsNot_Is)"
    r"|ReplaceUnaryOperator_Delete_.*|NumberReplacer|AddNot|ExceptionReplacer|ReplaceBreakWithContinue"
    r"|ReplaceContinueWithBreak|ReplaceAndWithOr|ReplaceOrWithAnd|ReplaceTrueWithFalse|ReplaceFalseWithTrue"
    r"|ZeroIterationForLoop)"
)

# What tests a module, quickest first, and pytest's -k; where nothing is said, tests/<folder>/test_<module>.py alone.
TESTS = {
    "maps/energy_table.py": "maps/test_energy_table.py maps/test_envmap.py maps/test_median_cut.py",
    "maps/envmap.py": "maps/test_envmap.py maps/test_sheets.py",
    "maps/geometry.py": "maps/test_geometry.py maps/test_envmap.py maps/test_irradiance.py maps/test_median_cut.py",
    **dict.fromkeys(
        (
            f"maps/layouts/{name}.py"
            for name in ("angular", "cube", "equal_area", "faces", "latlong", "layout", "mirror_ball", "octahedral")
        ),
        "maps/layouts/test_layouts.py maps/test_resampling.py",
    ),
    "maps/layouts/guess.py": "maps/test_sheets.py",
    "maps/layouts/openexr_cube.py": "maps/layouts/test_layouts.py maps/test_sheets.py",
    "maps/regions.py": "maps/test_regions.py maps/test_median_cut.py",
    "rigs/__init__.py": "rigs/test_rig.py",
    "rigs/formats/__init__.py": "rigs/formats/test_formats.py",
    "rigs/formats/beside.py": "rigs/formats/test_formats.py",
    "rigs/formats/blender.py": "rigs/formats/test_formats.py",
    "rigs/formats/csv.py": "rigs/formats/test_formats.py",
    "rigs/formats/gltf.py": "rigs/formats/test_formats.py",
    "rigs/formats/godot.py": "rigs/formats/test_formats.py",
    "rigs/formats/mitsuba.py": "rigs/formats/test_formats.py",
    "rigs/formats/pbrt.py": "rigs/formats/test_formats.py",
    "rigs/formats/radiance.py": "rigs/formats/test_formats.py",
    "rigs/formats/three.py": "rigs/formats/test_formats.py",
    "rigs/formats/unreal.py": "rigs/formats/test_formats.py",
    "rigs/formats/usd.py": "rigs/formats/test_formats.py",
    "rigs/kmeans.py": "rigs/test_clusters.py rigs/test_rig.py -k kmeans or reduced",
    "rigs/lloyd.py": "rigs/test_clusters.py rigs/test_rig.py -k lloyd",
    "rigs/making.py": "cli/test_cli.py -k rig or sun",
    "rigs/median_cut_lights.py": "rigs/test_clusters.py rigs/test_rig.py -k median",
    "rigs/penrose.py": "rigs/test_penrose.py rigs/test_rig.py -k penrose",
    "rigs/picture.py": "cli/test_cli.py -k rig or stratify",
    "rigs/rig.py": "rigs/test_rig.py -k not kmeans and not penrose",
    "rigs/settings.py": "rigs/test_settings.py cli/test_cli.py -k rig or sun",
    "rigs/structured.py": "rigs/test_structured.py rigs/test_rig.py -k structured",
    "rigs/harmonics.py": "rigs/test_harmonics.py rigs/test_conversion.py",
    "rigs/sh_files.py": "rigs/test_conversion.py -k harmonics",
    "rigs/sun.py": "rigs/test_fitted.py rigs/test_conversion.py -k sun or wide",
    "rigs/voronoi.py": "rigs/test_clusters.py rigs/test_rig.py -k lloyd or kmeans or directions",
    "sampling/leaf_sampler.py": "statistics/test_leaf_sampler.py sampling/test_leaves.py",
    "sampling/leaves.py": "sampling/test_leaves.py statistics/test_leaf_sampler.py",
    "sampling/points.py": "statistics/test_points.py",
    "sampling/recording.py": "sampling/test_recording.py integrators/automatic/test_launch.py",
    "sampling/region_sampler.py": "statistics/test_region_sampler.py",
    "integrators/automatic/adaptive.py": "integrators/automatic/test_adaptive.py statistics/test_nested_strata.py",
    "integrators/automatic/image.py": "integrators/automatic/test_view.py integrators/automatic/test_launch.py "
    "integrators/automatic/test_visibility.py statistics/test_nested_strata.py",
    "integrators/automatic/launch.py": "integrators/automatic/test_launch.py integrators/automatic/test_look.py "
    "statistics/test_scenes.py statistics/test_nested_strata.py",
    "integrators/automatic/lobes.py": "integrators/automatic/test_lobes.py integrators/automatic/test_balance.py "
    "statistics/test_nested_strata.py -k not fireflies",
    "integrators/automatic/nested_strata.py": "integrators/automatic/test_nested_strata.py "
    "integrators/automatic/test_balance.py integrators/test_derivatives.py statistics/test_nested_strata.py",
    "integrators/automatic/sample.py": "integrators/automatic/test_sample.py integrators/automatic/test_launch.py "
    "integrators/test_environment.py integrators/test_derivatives.py "
    "statistics/test_nested_strata.py",
    "integrators/automatic/variate.py": "integrators/automatic/test_variate.py statistics/test_nested_strata.py",
    "integrators/common.py": "integrators/test_common.py integrators/test_weights.py integrators/test_derivatives.py "
    "statistics/test_others_are_off.py "
    "statistics/test_scenes.py statistics/test_techniques.py statistics/test_unbiased.py",
    "integrators/direct_lights.py": "integrators/test_direct_lights.py statistics/test_lights.py "
    "integrators/test_techniques.py",
    "integrators/environment.py": "integrators/test_environment.py statistics/test_scenes.py",
    "integrators/mitsuba_own.py": "integrators/test_techniques.py",
    "integrators/catcher.py": "integrators/test_catcher.py statistics/test_catcher.py",
    "integrators/derivatives.py": "integrators/test_derivatives.py integrators/test_straight.py "
    "statistics/test_one_point.py statistics/test_derivatives.py -k learn or derivative or refused",
    "integrators/direct_importance.py": "integrators/test_direct_importance.py statistics/test_one_point.py "
    "statistics/test_techniques.py -k points or seeds or importance or low_discrepancy",
    "integrators/direct_stratified.py": "integrators/test_weights.py statistics/test_one_point.py "
    "integrators/test_techniques.py statistics/test_unbiased.py -k not importance and not wavelet and not lamps",
    "integrators/direct_wavelet.py": "statistics/test_one_point.py statistics/test_wavelet.py -k wavelet",
    "integrators/light_samples.py": "integrators/test_light_samples.py integrators/test_weights.py "
    "statistics/test_one_point.py integrators/automatic/test_launch.py statistics/test_nested_strata.py "
    "-k not importance and not wavelet and not lamps",
    "integrators/other_emitters.py": "integrators/test_common.py statistics/test_one_point.py "
    "statistics/test_others_are_off.py statistics/test_unbiased.py "
    "-k emitter or power or delta or lamps or others_are_off or light or without",
    "integrators/path_stratified.py": "integrators/test_path_stratified.py statistics/test_path.py",
    "integrators/sight.py": "integrators/test_sight.py integrators/test_backdrop.py integrators/test_catcher.py "
    "integrators/test_straight.py",
    "integrators/straight.py": "integrators/test_straight.py statistics/test_one_point.py statistics/test_straight.py "
    "-k straight or masks or lamps",
    "integrators/automatic/view.py": "integrators/automatic/test_view.py statistics/test_nested_strata.py",
    "integrators/indirect/image.py": "statistics/test_path.py integrators/test_path_stratified.py",
    "integrators/indirect/launch.py": "statistics/test_path.py integrators/test_path_stratified.py",
    "integrators/indirect/paths.py": "statistics/test_path.py integrators/test_path_stratified.py",
    "integrators/indirect/vertex.py": "statistics/test_path.py integrators/test_path_stratified.py",
    "maps/frames.py": "maps/test_frames.py",
    "rigs/quality.py": "rigs/test_quality.py rigs/test_harmonics.py",
}


@dataclass(frozen=True)
class Mutant:
    module: str
    line: int
    code: str
    old: str
    new: str

    def __str__(self) -> str:
        return f"{self.module}:{self.line}\n    - {self.old}\n    + {self.new}"


def main() -> int:
    parser = argparse.ArgumentParser(prog="make mutants", description=__doc__)
    parser.add_argument("modules", nargs="*", help="files or folders below src/stratalux, such as maps/median_cut.py")
    parser.add_argument("--sample", type=int, metavar="N", help="N mistakes in each module, the same ones every time")
    arguments = parser.parse_args()
    signal.signal(signal.SIGTERM, lambda *_: sys.exit(143))  # what is made here is removed
    os.environ.update(OPENBLAS_NUM_THREADS="1", OMP_NUM_THREADS="1")  # before NumPy is imported: one core is enough
    # Of two files of one size and one second, the cache would take the first.
    sys.dont_write_bytecode, os.environ["PYTHONDONTWRITEBYTECODE"] = True, "1"
    os.chdir(ROOT)
    with tempfile.TemporaryDirectory(prefix="stratalux-mutants-") as folder:
        source = Path(folder) / "stratalux"
        shutil.copytree(PACKAGE, source, ignore=shutil.ignore_patterns("__pycache__"))
        compileall.compile_dir(source, quiet=1)
        os.environ["PYTHONPATH"] = folder
        sys.path.insert(0, folder)
        _import_what_is_not_ours()
        table, status = [f"{'module':40} {'mutants':>8} {'killed':>8} {'survived':>8}"], 0
        try:
            for module in _modules(arguments.modules or FOLDERS):
                mutants = list(_mutants(module))
                if arguments.sample is not None and arguments.sample < len(mutants):
                    mutants = random.Random(1).sample(mutants, arguments.sample)
                alive = _survivors(source, module, mutants)
                table.append(f"{module:40} {len(mutants):8} {len(mutants) - alive:8} {alive:8}")
        except KeyboardInterrupt:
            table.append("stopped")
            status = 130
    print("", *table, sep="\n")
    return status


def _modules(names: list[str] | tuple[str, ...]) -> Iterator[str]:
    for name in names:
        path = PACKAGE / name
        files = sorted(path.rglob("*.py")) if path.is_dir() else [path]
        if not all(file.is_file() for file in files) or not files:
            raise SystemExit(f"{name}: no such module below src/stratalux")
        yield from (str(file.relative_to(PACKAGE)) for file in files if len(file.read_text().splitlines()) > 1)


def _mutants(module: str) -> Iterator[Mutant]:
    from cosmic_ray.ast import ast_nodes, get_ast
    from cosmic_ray.mutating import mutate_code
    from cosmic_ray.plugins import get_operator, operator_names

    source = (PACKAGE / module).read_text()
    left_out = _words(source)
    for name in filter(MISTAKES.fullmatch, operator_names()):
        operator = get_operator(name)()
        places = [
            (node, start) for node in ast_nodes(get_ast(source)) for start, _ in operator.mutation_positions(node)
        ]
        for occurrence, (node, start) in enumerate(places):
            # A parameter's asterisk is taken for a product.
            if node.parent is not None and node.parent.type in ("parameters", "param") and node.type == "operator":
                continue
            code = mutate_code(source, operator, occurrence)
            if code is None or any(first <= start < last for first, last in left_out):
                continue
            line = start[0]
            old, new = source.splitlines()[line - 1].strip(), code.splitlines()[line - 1].strip()
            yield Mutant(module, line, code, old, new)


def _words(source: str) -> list[tuple[tuple[int, int], tuple[int, int]]]:
    """Where nothing is computed: annotations, decorators, and what errors and warnings say."""
    nodes: list[ast.AST | None] = []
    for node in ast.walk(ast.parse(source)):
        if isinstance(node, ast.FunctionDef):
            nodes += [*node.decorator_list, node.returns]
        elif isinstance(node, ast.ClassDef):
            nodes += node.decorator_list
        elif isinstance(node, ast.arg | ast.AnnAssign):
            nodes.append(node.annotation)
        elif isinstance(node, ast.Raise) or (isinstance(node, ast.Call) and "warn" in ast.unparse(node.func)):
            nodes.append(node)
    return [((n.lineno, n.col_offset), (n.end_lineno, n.end_col_offset)) for n in nodes if n is not None]


def _survivors(source: Path, module: str, mutants: list[Mutant]) -> int:
    """Print the mistakes that no test finds, and count them."""
    folder, _, name = module.rpartition("/")
    files, _, chosen = TESTS.get(module, f"{folder}/test_{name}").partition(" -k ")
    tests = [*(f"tests/{file}" for file in files.split()), "-k", chosen]
    target = source / module
    # What Python left of the module before would be read instead.
    for cached in (target.parent / "__pycache__").glob(f"{target.stem}.*"):
        cached.unlink()
    original = target.read_text()
    began = time.monotonic()
    if not _passes(tests, None):
        raise SystemExit(f"{module}: {' '.join(tests)} fail without a mistake")
    limit = 10 + 5 * (time.monotonic() - began)
    print(f"{module}: {len(mutants)} mistakes, each in {limit:.0f} s at most", file=sys.stderr)
    alive = 0
    for mutant in mutants:
        target.write_text(mutant.code)
        if _passes(tests, limit):
            print(mutant, flush=True)
            alive += 1
    target.write_text(original)
    return alive


def _import_what_is_not_ours() -> None:
    for name in ("drjit", "hypothesis.extra.numpy", "mitsuba", "OpenImageIO", "pytest", "scipy.spatial", "scipy.stats"):
        importlib.import_module(name)
    gc.freeze()  # what is collected when pytest ends
    atexit.register(gc.unfreeze)


def _passes(tests: list[str], limit: float | None) -> bool:
    child = os.fork()
    if child == 0:
        _test(tests)
    os.setpgid(child, child)  # as tests start processes of their own
    end = None if limit is None else time.monotonic() + limit
    try:
        while True:
            ended, status = os.waitpid(child, os.WNOHANG)
            if ended:
                return os.waitstatus_to_exitcode(status) == 0
            if end is not None and time.monotonic() > end:
                return False
            time.sleep(0.02)
    finally:
        _kill(child)


def _test(tests: list[str]) -> None:
    import pytest

    status = 1
    try:
        nothing = os.open(os.devnull, os.O_RDWR)
        for stream in range(3):
            os.dup2(nothing, stream)
        resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
        memory = os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES")
        resource.setrlimit(resource.RLIMIT_AS, (memory // 2, memory // 2))
        status = int(pytest.main(["-x", "-q", "-p", "no:cacheprovider", *tests]))
    finally:
        os._exit(status)


def _kill(group: int) -> None:
    try:
        os.killpg(group, signal.SIGKILL)
        os.waitpid(group, 0)
    except (ProcessLookupError, ChildProcessError):
        pass


if __name__ == "__main__":
    sys.exit(main())
