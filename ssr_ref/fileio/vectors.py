"""A folder of test vectors: for each kernel NAME.json, NAME.csv and NAME.npz with the same cases.

`docs/vectors.md` is the contract. The same package gives the same bytes: no time, host or path.
"""

from __future__ import annotations

import json
from collections.abc import Iterable, Mapping
from itertools import product
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from .. import __version__
from ..typed import AnyArray
from . import folder as folders
from .folder import MANIFEST_FILE, FolderKind, disk_errors, whole_folder
from .npz import file_sha256, write_npz
from .vectors_schema import FORMAT, SCHEMA, SCHEMA_VERSION

if TYPE_CHECKING:
    from ..study.vectors import Field, VectorSet

SCHEMA_FILE, README_FILE = "schema.json", "README.txt"
_KIND = FolderKind("folder of test vectors", "folder", FORMAT)
_TYPE = {"float": "float", "int": "int32", "uint": "uint32"}
_FORMATS = ("float32", "float64")


def check_target(path: str | Path, *, force: bool = False) -> None:
    """Raise FileError unless test vectors can be written to `path`: before they are made."""
    folders.check_target(path, _KIND, force=force)


def write_vectors(sets: Iterable[VectorSet], path: str | Path, *, force: bool = False) -> Path:
    """Write a new folder of test vectors at `path`; returns the path.

    sets : made one at a time, so an iterator that makes them as it goes is fine.
    force : replace what is there, if it is such a folder or an empty one.

    Raises FileError if the path is taken or the disk refuses; what was there is then untouched.
    """
    target = Path(path)
    check_target(target, force=force)
    kernels = {}
    with whole_folder(target) as folder:
        for vectors in sets:
            name = vectors.subject.title
            with disk_errors(name):
                (folder / f"{name}.json").write_text(_json(vectors), "ascii", newline="\n")
                (folder / f"{name}.csv").write_text(_csv(vectors), "ascii", newline="\n")
                write_npz(folder / f"{name}.npz", _arrays(vectors))
            kernels[name] = _summary(vectors)
        with disk_errors(MANIFEST_FILE):
            (folder / SCHEMA_FILE).write_text(_text(SCHEMA), "ascii", newline="\n")
            (folder / README_FILE).write_text(_readme(kernels), "ascii", newline="\n")
            files = {p.name: file_sha256(p) for p in sorted(folder.iterdir())}
            manifest = {
                "format": FORMAT,
                "schema_version": SCHEMA_VERSION,
                "package": {"name": "ssr_ref", "version": __version__},
                "kernels": kernels,
                "files": files,
            }
            (folder / MANIFEST_FILE).write_text(_text(manifest), "ascii", newline="\n")
    return target


def hexadecimal(x: float) -> str:
    """A number as C's %a, without trailing zeros: "0x1.8p+0", "-0x0p+0", "nan", "inf", "-inf"."""
    if isinstance(x, int):
        return f"{x:#x}"
    text = float(x).hex()
    if "p" not in text:
        return text
    digits, exponent = text.split("p")
    return f"{digits.rstrip('0').rstrip('.') if '.' in digits else digits}p{exponent}"


def _summary(vectors: VectorSet) -> dict[str, Any]:
    asked = {to: int((~np.isnan(vectors.tolerance[to])).sum()) for to in _FORMATS}
    return {"cases": len(vectors.names), "asked": asked, "source": vectors.info.source}


def _text(data: Mapping[str, Any]) -> str:
    return json.dumps(data, sort_keys=True, indent=1, allow_nan=False) + "\n"


# --- JSON -----------------------------------------------------------------------------------------


def _json(vectors: VectorSet) -> str:
    """The header line by line, then one case a line."""
    subject, info = vectors.subject, vectors.info
    head = {
        "format": FORMAT,
        "schema_version": SCHEMA_VERSION,
        "name": subject.title,
        "kernel": subject.kernel,
        "form": subject.form,
        "measure": info.measure,
        "bound": info.bound,
        "why": info.why,
        "source": info.source,
        "inputs": [_field(field) for field in subject.inputs],
        "outputs": [
            {**_field(field), "measure": vectors.measure(field)} for field in subject.outputs
        ],
    }
    cases = ",\n".join(
        json.dumps(_case(vectors, i), sort_keys=True, separators=(",", ":"), allow_nan=False)
        for i in range(len(vectors.names))
    )
    lines = [f'"cases":[\n{cases}\n]']
    lines += [
        f"{json.dumps(key)}:{json.dumps(value, sort_keys=True)}" for key, value in head.items()
    ]
    return "{" + ",\n".join(sorted(lines)) + "}\n"


def _field(field: Field) -> dict[str, Any]:
    return {"name": field.name, "shape": list(field.shape), "type": _TYPE[field.kind]}


def _case(vectors: VectorSet, i: int) -> dict[str, Any]:
    condition = float(vectors.condition[i])
    tolerance = {to: float(vectors.tolerance[to][i]) for to in _FORMATS}
    return {
        "name": vectors.names[i],
        "condition": condition if np.isfinite(condition) else None,
        "tolerance_ulp": {to: None if np.isnan(t) else t for to, t in tolerance.items()},
        "inputs": {name: _value(array[i]) for name, array in vectors.inputs.items()},
        "outputs": {
            to: {name: _value(array[i]) for name, array in vectors.outputs[to].items()}
            for to in _FORMATS
        },
    }


def _value(value: Any) -> Any:
    if np.ndim(value):
        return [_value(part) for part in value]
    x = value.item()
    if np.isfinite(x):
        return {"decimal": x, "hex": hexadecimal(x)}
    name = "nan" if np.isnan(x) else "+inf" if x > 0 else "-inf"
    return {"class": name, "decimal": None, "hex": hexadecimal(x)}


# --- CSV ------------------------------------------------------------------------------------------


def _csv(vectors: VectorSet) -> str:
    """A head line of column names, then a line a case; floats hexadecimal, integers decimal."""
    columns: list[tuple[str, list[str]]] = [
        ("case", list(vectors.names)),
        ("condition", [str(c) for c in vectors.condition.tolist()]),
        *((f"tolerance.{to}", list(map(str, vectors.tolerance[to].tolist()))) for to in _FORMATS),
    ]
    for field in vectors.subject.inputs:
        columns += _columns(field, vectors.inputs[field.name], "")
    for to in _FORMATS:
        for field in vectors.subject.outputs:
            columns += _columns(field, vectors.outputs[to][field.name], f".{to}")
    lines = [",".join(name for name, _ in columns)]
    lines += [",".join(cells) for cells in zip(*(cells for _, cells in columns))]
    return "\n".join(lines) + "\n"


def _columns(field: Field, array: AnyArray, suffix: str) -> list[tuple[str, list[str]]]:
    """One column a component: name, its indices, the format, joined by dots."""
    found = []
    for index in product(*(range(n) for n in field.shape)):
        name = ".".join([field.name, *map(str, index)]) + suffix
        numbers = np.moveaxis(array, 0, -1)[index].tolist()
        cells = [hexadecimal(x) if field.kind == "float" else str(x) for x in numbers]
        found.append((name, cells))
    return found


# --- NPZ ------------------------------------------------------------------------------------------


def _arrays(vectors: VectorSet) -> dict[str, AnyArray]:
    found: dict[str, AnyArray] = {
        "case": np.array(vectors.names),
        "condition": vectors.condition,
        **{f"tolerance.{to}": vectors.tolerance[to] for to in _FORMATS},
    }
    for field in vectors.subject.inputs:
        found[f"in.{field.name}"] = _narrow(field, vectors.inputs[field.name], "float32")
    for to in _FORMATS:
        for field in vectors.subject.outputs:
            array = vectors.outputs[to][field.name]
            found[f"out.{field.name}.{to}"] = _narrow(field, array, to)
    return found


def _narrow(field: Field, array: AnyArray, to: str) -> AnyArray:
    """Exact: the numbers are of that format already. Every NaN becomes the same quiet one."""
    if field.kind != "float":
        return array
    narrow = array.astype(to)
    narrow[np.isnan(narrow)] = np.nan
    return narrow


def _readme(kernels: Mapping[str, Any]) -> str:
    width = max((len(name) for name in kernels), default=0)
    rows = [f"  {name:{width}}  {data['cases']:4} cases" for name, data in kernels.items()]
    return "\n".join(
        [
            "Test vectors of ssr_ref: arguments exact in float32, answers correctly rounded to",
            "float32 and float64 from 60 digits.",
            "",
            "NAME.json  every number as hexadecimal and decimal text; schema.json describes it",
            "NAME.csv   the same, a line a case, floats in C's hexadecimal form (strtof reads it)",
            "NAME.npz   the same as NumPy arrays",
            "manifest.json  SHA-256 of each file",
            "",
            "An answer is right if its error, in ulp, is at most the case's tolerance; a tolerance",
            "that is null (CSV, NPZ: nan) asks nothing. How errors are taken, and readers in C,",
            "GLSL, HLSL and WGSL: docs/vectors.md of the package.",
            "",
            *rows,
            "",
        ]
    )
