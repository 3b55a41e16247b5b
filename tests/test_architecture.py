"""Rules about the source itself, read with `ast`: import order, no BLAS, no libm, light import."""

from __future__ import annotations

import ast
import subprocess
import sys
from pathlib import Path

import pytest

import ssr_ref

PACKAGE = Path(ssr_ref.__file__).parent
MODULES = sorted(PACKAGE.rglob("*.py"))

# docs/README.md, "Layout": a module imports only what stands on an earlier line, or beside it in
# its own line.
LAYERS = [
    ["errors", "typed", "_jit"],
    ["vecmath"],
    ["transforms"],
    ["camera"],
    ["texture"],
    ["scene"],
    ["settings"],
    ["presets"],
    ["buffers"],
    ["scenes"],
    ["raster"],
    ["shading"],
    ["depth"],
    ["ssr"],
    ["analytic"],
    ["planar"],
    ["maths"],
    ["truth"],
    ["pipeline"],
    ["blame"],
    ["study"],
    ["report"],
    ["meshfiles"],
    ["fileio"],
    ["cli"],
    ["__main__"],
]
RANK = {name: rank for rank, names in enumerate(LAYERS) for name in names}
CORE = {"errors", "typed", "_jit", "vecmath", "transforms", "camera", "texture", "scene"}
CORE |= {"settings", "presets"}
CORE |= {"buffers", "scenes", "raster", "shading", "depth", "ssr", "analytic", "maths", "pipeline"}
CORE |= {"blame", "planar", "truth"}
OUTSIDE_CORE = {"imageio", "trimesh", "typer", "rich", "OpenEXR", "PIL", "matplotlib"}


def part(path: Path) -> str:
    """The layer a file belongs to: the first folder, or the file's own name."""
    return path.relative_to(PACKAGE).parts[0].removesuffix(".py")


def imports(path: Path) -> list[tuple[int, str, bool]]:
    """(line, dotted name, whether inside the package) of each import, type-only ones left out."""
    tree = ast.parse(path.read_text())
    type_only = {
        id(inner)
        for node in ast.walk(tree)
        if isinstance(node, ast.If) and ast.unparse(node.test) == "TYPE_CHECKING"
        for inner in ast.walk(node)
    }
    package = ["ssr_ref", *path.relative_to(PACKAGE).parts[:-1]]
    found: list[tuple[int, str, bool]] = []
    for node in ast.walk(tree):
        if id(node) in type_only:
            continue
        if isinstance(node, ast.Import):
            found += [(node.lineno, a.name, a.name.startswith("ssr_ref")) for a in node.names]
        elif isinstance(node, ast.ImportFrom):
            if node.level:
                base = package[: len(package) - node.level + 1]
                for alias in node.names:
                    name = ".".join([*base, *filter(None, [node.module]), alias.name])
                    found.append((node.lineno, name, True))
            else:
                name = node.module or ""
                found.append((node.lineno, name, name.startswith("ssr_ref")))
    return found


def test_every_module_has_a_layer() -> None:
    assert {part(p) for p in MODULES} - {"__init__"} == set(RANK)


@pytest.mark.parametrize("path", MODULES, ids=lambda p: str(p.relative_to(PACKAGE)))
def test_imports_go_one_way(path: Path) -> None:
    if part(path) == "__init__":
        return
    for line, name, inside in imports(path):
        if not inside:
            continue
        target = name.split(".")[1] if "." in name else "__init__"
        if target not in RANK:  # a name of ssr_ref/__init__.py itself, such as __version__
            continue
        assert RANK[target] <= RANK[part(path)], f"{path}:{line} imports {name}, a later layer"


@pytest.mark.parametrize("path", [p for p in MODULES if part(p) in CORE], ids=lambda p: p.stem)
def test_core_imports_no_file_or_command_line_library(path: Path) -> None:
    used = {name.split(".")[0] for _, name, inside in imports(path) if not inside}
    assert not used & OUTSIDE_CORE


# What may reach a golden: everything but pictures, printing and the command line.
GOLDEN = [p for p in MODULES if part(p) not in ("report", "cli", "__main__", "__init__")]
LIBM = {
    "sin", "cos", "tan", "arcsin", "arccos", "arctan", "arctan2", "exp", "exp2", "expm1", "log",
    "log2", "log10", "log1p", "power", "float_power", "hypot", "cbrt", "sinh", "cosh", "tanh",
    "deg2rad", "rad2deg",
}  # fmt: skip
BLAS = {"dot", "matmul", "inner", "outer", "vdot", "einsum", "tensordot", "linalg", "cross"}
TRIMESH = {"apply_transform", "to_geometry", "apply_scale", "apply_translation"}


def banned(tree: ast.AST) -> list[str]:
    """Uses of BLAS, libm or trimesh transforms: what differs between processors."""
    found = []
    for node in ast.walk(tree):
        line = getattr(node, "lineno", 0)
        if isinstance(node, ast.BinOp) and isinstance(node.op, ast.MatMult):
            found.append(f"line {line}: @")
        if isinstance(node, ast.Attribute):
            owner = ast.unparse(node.value)
            if owner in ("np", "numpy") and node.attr in LIBM | BLAS:
                found.append(f"line {line}: {owner}.{node.attr}")
            if owner == "math" or node.attr in TRIMESH | {"dot"}:
                found.append(f"line {line}: {owner}.{node.attr}")
            if owner.endswith("linalg"):
                found.append(f"line {line}: {owner}.{node.attr}")
        if isinstance(node, ast.Import) and any(a.name in ("math", "cmath") for a in node.names):
            found.append(f"line {line}: import math")
        if isinstance(node, ast.ImportFrom) and node.module in ("math", "cmath"):
            found.append(f"line {line}: from math import")
    return found


@pytest.mark.parametrize("path", GOLDEN, ids=lambda p: str(p.relative_to(PACKAGE)))
def test_no_blas_and_no_libm_on_golden_paths(path: Path) -> None:
    assert banned(ast.parse(path.read_text())) == []


@pytest.mark.parametrize(
    "line",
    ["a @ b", "np.dot(a, b)", "np.linalg.inv(a)", "np.sin(x)", "import math", "math.sqrt(2)",
     "mesh.apply_transform(m)", "from math import exp", "a.dot(b)"],
)  # fmt: skip
def test_the_ban_sees_what_it_bans(line: str) -> None:
    assert banned(ast.parse(line)) != []


def test_numba_options_stand_in_one_place() -> None:
    for path in MODULES:
        if path.stem == "_jit":
            continue
        for node in ast.walk(ast.parse(path.read_text())):
            name = ast.unparse(node) if isinstance(node, ast.Attribute | ast.Name) else ""
            assert name not in ("numba.njit", "njit", "numba.jit", "jit"), f"{path}"
            assert not (isinstance(node, ast.keyword) and node.arg == "fastmath"), f"{path}"


def test_import_loads_numpy_only() -> None:
    code = (
        "import sys; before = set(sys.modules); import numpy; known = set(sys.modules); "
        "import ssr_ref; print(sorted({m.split('.')[0] for m in set(sys.modules) - known}))"
    )
    out = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert set(ast.literal_eval(out.stdout)) == {"__future__", "ssr_ref"}


def test_public_names_resolve() -> None:
    for name in ssr_ref.__all__:
        assert getattr(ssr_ref, name) is not None
    with pytest.raises(AttributeError, match="no attribute 'nothing'"):
        _ = ssr_ref.nothing  # type: ignore[attr-defined]
