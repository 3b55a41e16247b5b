"""Test vectors: correct rounding, conditions, files, and that they tell right from wrong."""

from __future__ import annotations

import csv
import hashlib
import json
import os
import random
import re
import subprocess
import sys
from collections.abc import Callable
from dataclasses import replace
from fractions import Fraction
from pathlib import Path
from typing import Any

import mpmath
import numpy as np
import pytest
from mpmath import mpf

from ssr_ref.__main__ import main
from ssr_ref.errors import FileError, MathsError
from ssr_ref.fileio.npz import read_npz
from ssr_ref.fileio.vectors import hexadecimal, write_vectors
from ssr_ref.maths.registry import kernels
from ssr_ref.study.condition import choice_is_near, condition_number
from ssr_ref.study.rounding import FLOAT32, FLOAT64, Format, correctly_rounded
from ssr_ref.study.subjects import SUBJECTS, select
from ssr_ref.study.vectors import Case, Field, VectorSet, check, make, ulp_errors

NAN, INF = float("nan"), float("inf")
NAMES = [subject.title for subject in SUBJECTS]


@pytest.fixture(scope="module")
def sets() -> dict[str, VectorSet]:
    return {subject.title: make(subject) for subject in SUBJECTS}


@pytest.fixture(scope="module")
def folder(sets: dict[str, VectorSet], tmp_path_factory: pytest.TempPathFactory) -> Path:
    return write_vectors(sets.values(), tmp_path_factory.mktemp("vectors") / "v")


# ---- Rounding ------------------------------------------------------------------------------------


def nearest_by_search(exact: Fraction, to: Format) -> float:
    """The float of the format with the least distance, ties to an even significand."""
    size = abs(exact)
    guess = size.numerator.bit_length() - size.denominator.bit_length() - to.bits - 2
    step = Fraction(2) ** max(guess, to.lowest)
    while size >= step * 2**to.bits:
        step *= 2
    low = size // step
    below, above = low * step, (low + 1) * step
    if size - below != above - size:
        chosen = below if size - below < above - size else above
    else:
        chosen = below if low % 2 == 0 else above
    if chosen >= Fraction(2) ** to.overflow:
        return INF if exact > 0 else -INF
    return float(chosen) if exact > 0 else -float(chosen)


@pytest.mark.parametrize("to", [FLOAT32, FLOAT64], ids=lambda f: f.name)
def test_rounding_equals_a_search_over_exact_fractions(to: Format) -> None:
    """Significands of 1 to 120 bits at all exponents, half of them ties or one part off a tie."""
    source = random.Random(3)
    for i in range(3000):
        bits = source.randint(1, to.bits + 12)
        significand = source.getrandbits(bits) | 1 << (bits - 1)
        exponent = source.randint(to.lowest - 30, to.overflow + 2 - bits)
        if i % 2:  # 1…1|100…0 and its neighbours
            significand = (significand << 20) + (1 << 19) + source.choice((-1, 0, 1))
            exponent = to.lowest + source.randint(-40, 4) if i % 4 == 1 else exponent
        exact = Fraction(significand) * Fraction(2) ** exponent * source.choice((-1, 1))
        with mpmath.workprec(300):
            number = mpf(exact.numerator) / exact.denominator
        assert correctly_rounded(number, to) == nearest_by_search(exact, to), (
            significand,
            exponent,
        )


def test_rounding_agrees_with_numpy_and_python() -> None:
    """float64 → float32 by NumPy's cast, decimal fractions → float64 by Python's reader."""
    source = random.Random(4)
    with np.errstate(over="ignore"):
        for _ in range(2000):
            x = source.uniform(-2, 2) * 2.0 ** source.randint(-160, 130)
            assert correctly_rounded(mpf(x), FLOAT32) == float(np.float32(x))
            text = f"{source.getrandbits(90)}e{source.randint(-345, 285)}"
            with mpmath.workdps(60):
                assert correctly_rounded(mpf(text), FLOAT64) == float(text)


def test_rounding_at_the_edges_of_the_formats() -> None:
    with mpmath.workdps(60):
        for to in (FLOAT32, FLOAT64):
            tiny, top = mpf(2) ** to.lowest, mpf(2) ** to.overflow
            greatest = float(top - top / 2**to.bits)
            assert correctly_rounded(tiny / 2, to) == 0.0  # a tie: 0 is even
            assert correctly_rounded(tiny / 2 * (1 + mpf(10) ** -50), to) == float(tiny)
            assert correctly_rounded(-tiny * 3 / 2, to) == -2 * float(tiny)
            edge = top - top / 2 ** (to.bits + 1)  # half a step over the greatest: even is 2^emax
            assert correctly_rounded(edge, to) == INF and correctly_rounded(-edge, to) == -INF
            assert correctly_rounded(edge * (1 - mpf(10) ** -50), to) == greatest
            assert correctly_rounded(mpmath.inf, to) == INF
            assert correctly_rounded(-mpmath.inf, to) == -INF
            assert np.isnan(correctly_rounded(mpmath.nan, to))
        # Closer to a tie than the oracle is sure of: the tie, so to even. 1 + 2⁻²⁴ ± 10⁻⁵⁸.
        for off in (1, -1):
            assert correctly_rounded(1 + mpf(2) ** -24 + off * mpf(10) ** -58, FLOAT32) == 1.0


# ---- Condition and tolerance ---------------------------------------------------------------------


def test_condition_numbers_of_known_functions() -> None:
    """x − y: (|x| + |y|)/|x − y|; x³: 3; |x − 1| just beside its kink; max over outputs."""
    one = [(slice(0, 1), "component")]
    assert condition_number(lambda a: [mpf(a[0]) - a[1]], [1.0, 0.75], one) == 7.0
    assert condition_number(lambda a: [mpf(a[0]) ** 3], [1.7], one) == 3.0
    assert condition_number(lambda a: [mpf(a[0]) - a[1]], [2.0, 2.0], one) == INF
    assert condition_number(lambda a: [mpf(a[0])], [0.0], one) == 0.0
    assert (
        condition_number(lambda a: [abs(mpf(a[0]) - 1)], [1.0], [(slice(0, 1), "absolute")]) == 1.0
    )
    # (x, 2x − y) at (3, 5): components 1 and 11; norm: √5·3 + 5 over √(9 + 1).
    both = [(slice(0, 2), "component")], [(slice(0, 2), "norm")]
    values = [
        condition_number(lambda a: [mpf(a[0]), 2 * mpf(a[0]) - a[1]], [3.0, 5.0], g) for g in both
    ]
    assert values == [11.0, 3.7]
    # The larger side of a kink counts for a vector too: (2, 0) on the left moves twice as far.
    kink = lambda a: [mpf(a[0]) * (2 if mpf(a[0]) < 1 else 1) - (mpf(a[0]) < 1), mpf(0)]  # noqa: E731
    assert condition_number(kink, [1.0], [(slice(0, 2), "norm")]) == 2.0
    # A choice that flips on one side only leaves the other; on both sides there is no derivative.
    step = lambda a: [int(mpf(a[0]) >= 1), mpf(a[0]) * (7 if mpf(a[0]) >= 1 else 1)]  # noqa: E731
    groups = [(slice(0, 1), "exact"), (slice(1, 2), "component")]
    assert condition_number(step, [1.0], groups) == 1.0
    spike = lambda a: [int(mpf(a[0]) == 1), mpf(1)]  # noqa: E731
    assert condition_number(spike, [1.0], groups) == INF
    assert choice_is_near(step, [1.0 + 2.0**-20], 19) and not choice_is_near(step, [1.5], 2)


def test_errors_are_in_ulp_of_the_measure_s_scale() -> None:
    """By hand: 1 + 3·2⁻²³ is 3 ulp; of the vector (3, 4), norm 5, an ulp is 2⁻²¹."""
    e = 2.0**-23
    for measure, want, got, ulp in (
        ("component", (1.0, 0.0), (1.0 + 3 * e, 0.0), 3.0),
        ("component", (1.0, 0.0), (1.0, -0.0), 0.0),
        ("component", (1.0, 0.0), (1.0, 2.0**-149), 1.0),
        ("norm", (1.0, 0.0), (1.0, e), 1.0),
        ("norm", (3.0, 4.0), (3.0 + 4 * e, 4.0), 1.0),
        ("absolute", (3.0, 4.0), (3.0, 4.0 + 5 * e), 5.0),
        ("exact", (3.0, 4.0), (3.0, 4.0), 0.0),
        ("exact", (3.0, 4.0), (3.0, 4.0 + e), INF),
    ):
        assert ulp_errors(np.array([got]), np.array([want]), measure, FLOAT32) == [ulp]
    for got, wanted in ((1.0, NAN), (NAN, 1.0), (INF, NAN), (-INF, INF), (1e38, INF)):
        assert ulp_errors(np.array([got]), np.array([wanted]), "component", FLOAT32) == [INF]
    for same in (NAN, INF, -INF):
        assert ulp_errors(np.array([same]), np.array([same]), "norm", FLOAT32) == [0.0]


def test_a_case_at_the_edge_asks_nothing() -> None:
    """A choice made by arithmetic, at its border; arguments beyond float32's safe range."""
    plain = next(s for s in SUBJECTS if s.kernel == "srgb_decode")
    cases = [Case("far", (0.5,)), Case("near", (1.0 + 2.0**-23,)), Case("tiny", (2.0**-100,))]
    subject = replace(
        plain,
        outputs=(Field("above", kind="int"), Field("linear")),
        oracle=lambda x: (int(mpf(x) > 1), mpf(x)),
        cases=lambda: cases,
        chooses_by_input=False,
    )
    found = make(subject)
    assert np.isnan(found.tolerance["float32"]).tolist() == [False, True, True]
    assert np.isnan(found.tolerance["float64"]).tolist() == [False, False, False]


@pytest.mark.parametrize(
    ("case", "message"),
    [
        (Case("x", (0.1,)), "0.1 is no float32"),
        (Case("x", (1,)), "1 is no float32"),
        (Case("x", (1.0, 2.0)), "2 arguments, not 1"),
        (Case("x", (1.0,), (1.0, 2.0)), "2 results of 1"),
        (Case("a, b", (1.0,)), "cannot be named 'a, b'"),
    ],
)
def test_a_case_that_is_none_is_refused(case: Case, message: str) -> None:
    plain = next(s for s in SUBJECTS if s.kernel == "srgb_decode")
    with pytest.raises(ValueError, match=message):
        make(replace(plain, cases=lambda: [case]))
    with pytest.raises(ValueError, match="two cases are named 'y'"):
        make(replace(plain, cases=lambda: [Case("y", (0.5,)), Case("y", (0.25,))]))


# ---- The sets ------------------------------------------------------------------------------------


def test_every_kernel_has_vectors() -> None:
    assert {s.kernel for s in SUBJECTS} == {info.name for info in kernels()}
    assert len(set(NAMES)) == len(NAMES)
    # Forms without vectors of their own: in one file with another form, or there to be compared.
    without = {i.key for i in kernels()} - {s.info().key for s in SUBJECTS}
    assert without == {"cube_face/face", "ray_setup/inverse_depth"} | {
        f"intersect_sphere/{form}"
        for form in ("textbook", "textbook_unit", "stable", "kahan", "hearn_baker")
    }
    assert [s.title for s in select(["cube_face", "linear_depth_d3d"])] == [
        "linear_depth_d3d",
        "cube_face",
    ]
    assert len(select(["linear_depth"])) == 13
    with pytest.raises(MathsError, match="no kernel 'normalise' has test vectors; expected"):
        select(["normalise"])


@pytest.mark.parametrize("name", NAMES)
def test_the_package_passes_its_own_vectors(sets: dict[str, VectorSet], name: str) -> None:
    found = check(sets[name])
    assert found.failed == (), found
    assert found.asked >= 60
    assert np.count_nonzero(~np.isnan(sets[name].tolerance["float32"])) >= 45


@pytest.mark.parametrize("name", NAMES)
def test_a_broken_kernel_fails_them(sets: dict[str, VectorSet], name: str) -> None:
    """Each output in turn: a changed sign, and twice the number plus 1."""
    vectors = sets[name]
    fields = vectors.subject.outputs
    want = vectors.outputs["float64"]
    assert check(replaced(vectors, lambda: [want[f.name] for f in fields])).failed == ()
    for field in fields:
        for wrong in (np.negative, lambda a: a + a + 1):
            if wrong is np.negative and np.count_nonzero(want[field.name]) <= 20:
                continue  # the error of a sum is 0 mostly
            with np.errstate(invalid="ignore"):
                bad = [wrong(want[f.name]) if f is field else want[f.name] for f in fields]
            failed = check(replaced(vectors, lambda bad=bad: bad)).failed
            assert len(failed) > 10, (field.name, len(failed))


def test_a_tolerance_is_the_last_error_that_passes(sets: dict[str, VectorSet]) -> None:
    """One case off by exactly its tolerance passes, by an ulp more it fails, and alone."""
    vectors = sets["srgb_decode"]
    i, want = vectors.names.index("half"), vectors.outputs["float64"]["linear"]
    ulp, tolerance = FLOAT64.ulp(float(want[i])), vectors.tolerance["float64"][i]
    for more, failed in ((0.0, ()), (1.0, ("half",))):
        got = want.copy()
        got[i] += (tolerance + more) * ulp
        finding = check(replaced(vectors, lambda got=got: [got]))
        assert finding.failed == failed and finding.worst_case == "half"
        assert finding.worst_ulp == tolerance + more


def replaced(vectors: VectorSet, results: Callable[[], list[Any]]) -> VectorSet:
    """The set with a stand-in for the kernel that returns what it is told."""
    subject = replace(vectors.subject, call=lambda function, *arrays: results())
    return replace(vectors, subject=subject)


def test_a_wrong_fold_is_named(sets: dict[str, VectorSet]) -> None:
    """The common mistake of octahedral code: sign(x) that is 0 at 0."""

    def encode(d: np.ndarray) -> np.ndarray:
        uv = d[:, :2] / np.abs(d).sum(axis=1, keepdims=True)
        folded = (1.0 - np.abs(uv[:, ::-1])) * np.sign(uv)
        return np.where(d[:, 2:] < 0.0, folded, uv)

    with np.errstate(invalid="ignore"):
        found = check(sets["octahedral_encode"], encode)
        right = check(
            sets["octahedral_encode"],
            lambda d: np.where(
                d[:, 2:] < 0.0,
                (1.0 - np.abs(d[:, 1::-1]) / np.abs(d).sum(axis=1, keepdims=True))
                * np.where(d[:, :2] >= 0.0, 1.0, -1.0),
                d[:, :2] / np.abs(d).sum(axis=1, keepdims=True),
            ),
        )
    assert "axis -z" in found.failed and "fold edge x = 0 below" in found.failed
    assert not any(name.startswith("sample") for name in found.failed)
    # The published form passes, but for infinities, which it does not look for.
    assert set(right.failed) <= {"inf gives NaN"}


# ---- The files -----------------------------------------------------------------------------------


def conforms(data: Any, schema: dict[str, Any], root: dict[str, Any], at: str = "") -> None:
    """The parts of JSON Schema that schema.json uses; an unknown keyword is an error."""
    known = {"$schema", "$defs", "title", "description", "type", "required", "properties", "items"}
    known |= {"additionalProperties", "enum", "const", "pattern", "minimum", "minItems", "oneOf"}
    assert set(schema) <= known | {"$ref"}, set(schema) - known
    if "$ref" in schema:
        return conforms(data, root["$defs"][schema["$ref"].removeprefix("#/$defs/")], root, at)
    if "oneOf" in schema:
        fits = 0
        for option in schema["oneOf"]:
            try:
                conforms(data, option, root, at)
                fits += 1
            except AssertionError:
                pass
        assert fits == 1, f"{at}: {fits} options fit"
    types = {"object": dict, "array": list, "string": str, "number": int | float, "integer": int}
    if "type" in schema:
        wanted = types.get(schema["type"], type(None))
        assert isinstance(data, wanted) and not isinstance(data, bool), f"{at}: {schema['type']}"
    assert "const" not in schema or data == schema["const"], at
    assert "enum" not in schema or data in schema["enum"], at
    assert "pattern" not in schema or re.search(schema["pattern"], data), f"{at}: {data}"
    assert "minimum" not in schema or data >= schema["minimum"], at
    if isinstance(data, dict):
        assert set(schema.get("required", ())) <= set(data), at
        for key, value in data.items():
            inner = schema.get("properties", {}).get(key, schema.get("additionalProperties", {}))
            assert inner is not False, f"{at}: unknown key {key}"
            conforms(value, inner, root, f"{at}/{key}")
    if isinstance(data, list):
        assert len(data) >= schema.get("minItems", 0), at
        for i, value in enumerate(data):
            conforms(value, schema.get("items", {}), root, f"{at}/{i}")
    return None


@pytest.mark.parametrize("name", NAMES)
def test_json_fits_the_schema_beside_it(folder: Path, name: str) -> None:
    schema = json.loads((folder / "schema.json").read_text())
    data = json.loads((folder / f"{name}.json").read_text())
    data["cases"] = data["cases"][::5]
    assert list(data) == sorted(data) and all(list(c) == sorted(c) for c in data["cases"])
    conforms(data, schema, schema)
    for broken in (
        {**data, "extra": 1},
        {**data, "schema_version": 2},
        {**data, "cases": [{**data["cases"][0], "condition": -1.0}]},
        {**data, "cases": [{**data["cases"][0], "inputs": {"x": {"decimal": 1.0, "hex": "1.0"}}}]},
    ):
        with pytest.raises(AssertionError):
            conforms(broken, schema, schema)


def leaves(value: Any) -> list[dict[str, Any]]:
    return [value] if isinstance(value, dict) else [leaf for part in value for leaf in leaves(part)]


@pytest.mark.parametrize("name", NAMES)
def test_the_three_files_hold_the_same_numbers(
    folder: Path, sets: dict[str, VectorSet], name: str
) -> None:
    """Hexadecimal and decimal text both give the very float, in JSON, CSV and NPZ."""
    vectors = sets[name]
    data = json.loads((folder / f"{name}.json").read_text())
    arrays = read_npz(folder / f"{name}.npz")
    rows = list(csv.DictReader((folder / f"{name}.csv").open()))
    assert [case["name"] for case in data["cases"]] == arrays["case"].tolist()
    assert [row["case"] for row in rows] == list(vectors.names)
    used = {"case", "condition", "tolerance.float32", "tolerance.float64"}
    columns = list(rows[0])[4:]
    for group, to in (("inputs", ""), ("outputs", "float32"), ("outputs", "float64")):
        for field in data[group]:
            key = f"in.{field['name']}" if not to else f"out.{field['name']}.{to}"
            array = arrays[key]
            used.add(key)
            assert list(array.shape[1:]) == field["shape"]
            want_type = {"float": to or "float32"}.get(field["type"], field["type"])
            assert array.dtype == want_type
            width = int(np.prod(field["shape"], dtype=int))
            mine, columns = columns[:width], columns[width:]
            assert all(c.startswith(field["name"]) and c.endswith(to) for c in mine)
            for i, case in enumerate(data["cases"]):
                value = case[group][to][field["name"]] if to else case[group][field["name"]]
                numbers = leaves(value)
                flat = array[i].ravel().tolist()
                cells = [rows[i][c] for c in mine]
                assert len(numbers) == len(flat) == width
                for number, x, cell in zip(numbers, flat, cells):
                    if isinstance(x, int):
                        assert number["decimal"] == int(number["hex"], 16) == int(cell) == x
                    elif np.isfinite(x):
                        assert float.fromhex(number["hex"]) == float.fromhex(cell) == x
                        assert number["decimal"] == x and isinstance(number["decimal"], float)
                    else:
                        kind = "nan" if np.isnan(x) else "+inf" if x > 0 else "-inf"
                        assert number["class"] == kind and number["hex"] == cell
                        assert float(cell) == x or np.isnan(x)
    assert columns == [] and used == set(arrays)
    for to in ("float32", "float64"):
        got = [case["tolerance_ulp"][to] for case in data["cases"]]
        assert [NAN if t is None else t for t in got] == pytest.approx(
            arrays[f"tolerance.{to}"].tolist(), nan_ok=True, rel=0, abs=0
        )
        assert [float(row[f"tolerance.{to}"]) for row in rows] == pytest.approx(
            arrays[f"tolerance.{to}"].tolist(), nan_ok=True, rel=0, abs=0
        )


def test_hexadecimal_is_c_s_and_comes_back() -> None:
    for x in (1.5, -0.0, 0.0, 5e-324, -1.7976931348623157e308, 0.1, 2.0**-149, 1.0, 2.0**40):
        text = hexadecimal(x)
        assert float.fromhex(text) == x and np.signbit(float.fromhex(text)) == np.signbit(x)
        assert not re.search(r"0p|\.p", text.replace("0x0p", ""))
    assert [hexadecimal(x) for x in (1.5, -0.0, INF, -INF, 10)] == [
        "0x1.8p+0",
        "-0x0p+0",
        "inf",
        "-inf",
        "0xa",
    ]
    assert hexadecimal(NAN) == "nan"


def test_the_manifest_has_the_hash_of_every_file(folder: Path) -> None:
    manifest = json.loads((folder / "manifest.json").read_text())
    names = {p.name for p in folder.iterdir()}
    assert set(manifest["files"]) == names - {"manifest.json"}
    assert {f"{n}.{e}" for n in NAMES for e in ("json", "csv", "npz")} < names
    assert {"README.txt", "schema.json"} < names
    for name, digest in manifest["files"].items():
        assert hashlib.sha256((folder / name).read_bytes()).hexdigest() == digest
    assert list(manifest["kernels"]) == sorted(NAMES)
    assert sum(p.stat().st_size for p in folder.iterdir()) < 8_000_000


def test_bytes_repeat_in_another_process(sets: dict[str, VectorSet], tmp_path: Path) -> None:
    """Another hash seed, another working folder, another clock."""
    names = ["two_sum", "reflect_published", "mirror_matrix", "dda_line", "linear_depth_reversed"]
    names += ["cube_face", "ball_uv", "srgb_encode", "edge_fade", "jitter"]
    here = write_vectors((sets[name] for name in names), tmp_path / "here")
    environment = {**os.environ, "PYTHONHASHSEED": "12345", "TZ": "Asia/Tokyo"}
    environment["PYTHONPATH"] = str(Path(__file__).parents[1])
    command = [sys.executable, "-m", "ssr_ref", "vectors", "-o", "again", "--json"]
    command += [word for name in reversed(names) for word in ("--kernel", name)]
    run = subprocess.run(command, cwd=tmp_path, env=environment, capture_output=True, text=True)
    assert run.returncode == 0, run.stderr
    assert {p.name for p in here.iterdir()} == {p.name for p in (tmp_path / "again").iterdir()}
    for path in here.iterdir():
        assert path.read_bytes() == (tmp_path / "again" / path.name).read_bytes(), path.name
    printed = json.loads(run.stdout)
    digest = hashlib.sha256((here / "manifest.json").read_bytes()).hexdigest()
    assert printed["manifest_sha256"] == digest
    assert [row["name"] for row in printed["kernels"]] == names


# ---- The command ---------------------------------------------------------------------------------


def test_the_command_selects_replaces_and_refuses(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    out = tmp_path / "v"
    line = ["vectors", "-o", str(out), "--kernel", "jitter", "--kernel", "pcg3d"]
    assert main(line) == 0
    text = capsys.readouterr().out
    assert "jitter" in text and "cases" in text and "srgb" not in text
    assert {p.stem for p in out.glob("*.csv")} == {"jitter", "pcg3d"}

    # It exists: refused, then replaced, then refused again because of a file of someone else.
    before = (out / "manifest.json").read_bytes()
    assert main(line) == 2
    message = capsys.readouterr().err
    assert message.startswith("error: output folder") and "--force" in message
    assert main([*line[:5], "--force"]) == 0
    assert {p.stem for p in out.glob("*.csv")} == {"jitter"}
    assert (out / "manifest.json").read_bytes() != before
    (out / "mine.txt").write_text("keep")
    assert main([*line, "--force"]) == 2
    assert "holds mine.txt, which is not the folder's; it is left" in capsys.readouterr().err
    assert (out / "mine.txt").read_text() == "keep"

    assert main(["vectors", "-o", str(tmp_path / "w"), "--kernel", "refelct"]) == 2
    assert "no kernel 'refelct'" in capsys.readouterr().err and not (tmp_path / "w").exists()
    assert [p.name for p in tmp_path.iterdir()] == ["v"]


def test_nothing_is_left_when_a_set_cannot_be_made(
    sets: dict[str, VectorSet], tmp_path: Path
) -> None:
    def failing() -> Any:
        yield sets["jitter"]
        raise MathsError("no oracle")

    with pytest.raises(MathsError):
        write_vectors(failing(), tmp_path / "a" / "v")
    assert list(tmp_path.iterdir()) == []
    (tmp_path / "file").write_text("x")
    with pytest.raises(FileError, match="is a file; expected a folder"):
        write_vectors([sets["jitter"]], tmp_path / "file")
