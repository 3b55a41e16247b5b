"""Test vectors: arguments exact in float32, and the oracle's answers correctly rounded.

A `Subject` says how one kernel is called: what its arguments and results are, its oracle and its
cases. `make` turns it into a `VectorSet` of arrays, which `fileio/vectors.py` writes and `check`
holds an implementation against. `docs/vectors.md` is the contract.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass
from itertools import chain
from typing import Any, Literal

import mpmath
import numpy as np

from ..maths.registry import KernelInfo, Measure, kernels
from ..typed import AnyArray, F64Array
from .condition import Oracle, choice_is_near, condition_number
from .rounding import FLOAT32, FLOAT64, FORMATS, Format, correctly_rounded

Kind = Literal["float", "int", "uint"]
_DTYPE = {"float": np.float64, "int": np.int32, "uint": np.uint32}
CHOICE_MARGIN = 4
"""A choice must hold when an argument moves by 2⁴ u, else the case asks nothing at that format."""
_MOST = 2.0**-3
"""A tolerance of more than this share of the result asks nothing."""


@dataclass(frozen=True, slots=True)
class Field:
    """An argument or a result. shape: of one case, () for a number. kind "int" and "uint": 32 bits.

    measure : how a result's error is taken where it is not as the kernel's.
    """

    name: str
    shape: tuple[int, ...] = ()
    kind: Kind = "float"
    measure: Measure | None = None

    @property
    def size(self) -> int:
        """Numbers in it."""
        return int(np.prod(self.shape, dtype=np.int64))


@dataclass(frozen=True, slots=True)
class Case:
    """One argument list. outputs: given by hand where the oracle has no answer, as for NaN."""

    name: str
    inputs: tuple[Any, ...]
    outputs: tuple[Any, ...] | None = None


@dataclass(frozen=True, slots=True, kw_only=True)
class Subject:
    """How one kernel is asked.

    kernel, form : its name and formulation in the registry, whose bound gives the tolerance.
    name : of the vectors, kernel_form if empty.
    oracle : called with one argument a field (numbers, or tuples of numbers); returns numbers in
        any nesting, in the order of `outputs`; an int is a choice and must be met exactly.
    cases : makes the cases, names unique.
    call : (function, arrays of the inputs) to arrays of the outputs, where function(*arrays) is not
        that already.
    chooses_by_input : the kernel's branches compare arguments exactly as they are, so that also a
        case on the very border has one answer.
    safe_exponent : float32 arithmetic neither over- nor underflows while every argument is 0 or
        of a size between 2^∓ of this; other cases ask nothing of float32.
    by_format : the exact answer depends on the arithmetic, as for the error of a rounded sum: the
        oracle is also given `to`, a `Format`.
    conditioned : the tolerance grows with the condition number, so that plain formulas pass; not
        where the kernel is there to be right however much cancels.
    """

    kernel: str
    form: str = ""
    name: str = ""
    inputs: tuple[Field, ...]
    outputs: tuple[Field, ...]
    oracle: Callable[..., Any]
    cases: Callable[[], Iterable[Case]]
    call: Callable[..., Any] | None = None
    chooses_by_input: bool = True
    safe_exponent: int = 40
    by_format: bool = False
    conditioned: bool = True

    @property
    def title(self) -> str:
        """The name of the vectors and of their files."""
        return self.name or "_".join(filter(None, (self.kernel, self.form)))

    def info(self) -> KernelInfo:
        """Its entry in the registry."""
        return next(k for k in kernels() if (k.name, k.form) == (self.kernel, self.form))


@dataclass(frozen=True, eq=False)
class VectorSet:
    """The cases of one kernel as arrays of N rows.

    inputs : (N, *shape) float64 holding float32 numbers, or int32 or uint32.
    outputs : by format ("float32", "float64"), then by name; (N, *shape) float64, rounded to it.
    condition : (N,) as `condition_number`. tolerance : by format, (N,) in ulp; NaN asks nothing.
    """

    subject: Subject
    info: KernelInfo
    names: tuple[str, ...]
    inputs: dict[str, AnyArray]
    outputs: dict[str, dict[str, AnyArray]]
    condition: F64Array
    tolerance: dict[str, F64Array]

    def measure(self, field: Field) -> Measure:
        """How the error of an output is taken."""
        return "exact" if field.kind != "float" else field.measure or self.info.measure


def make(subject: Subject) -> VectorSet:
    """Ask the oracle every case of a subject. Raises ValueError for a case that is none."""
    info = subject.info()
    cases = list(subject.cases())
    names = tuple(case.name for case in cases)
    for name in names:
        if not name.isascii() or not name.isprintable() or set(name) & set(',"'):
            raise ValueError(f"{subject.title}: a case cannot be named {name!r}")
    if len(set(names)) != len(names):
        twice = next(name for name in names if names.count(name) > 1)
        raise ValueError(f"{subject.title}: two cases are named '{twice}'")
    blank = VectorSet(subject, info, names, {}, {}, np.empty(0), {})
    groups, start = [], 0
    for field in subject.outputs:
        groups.append((slice(start, start + field.size), blank.measure(field)))
        start += field.size

    given, conditions = [], []
    answers: dict[str, list[list[Any]]] = {to.name: [] for to in FORMATS}
    tolerance: dict[str, list[float]] = {to.name: [] for to in FORMATS}
    for case in cases:
        arguments = list(_flat(case.inputs))
        _require_inputs(subject, case, arguments)
        by_hand = None if case.outputs is None else list(_flat(case.outputs))
        oracles = _oracles(subject)
        condition = 0.0
        if by_hand is None:
            condition = condition_number(oracles[FLOAT64.name], arguments, groups)
        for to in FORMATS:
            oracle = oracles[to.name]
            answer = oracle(arguments) if by_hand is None else by_hand
            if len(answer) != start:
                raise ValueError(f"{subject.title}, {case.name}: {len(answer)} results of {start}")
            asked = by_hand is not None or _is_asked(subject, oracle, arguments, to)
            growth = 1.0 + condition if subject.conditioned else 1.0
            limit = _tolerance(info.bound * growth, {m for _, m in groups}, to)
            tolerance[to.name].append(limit if asked else float("nan"))
            answers[to.name].append(answer)
        given.append(arguments)
        conditions.append(condition)

    return VectorSet(
        subject=subject,
        info=info,
        names=names,
        inputs=_columns(given, subject.inputs, None),
        outputs={to.name: _columns(answers[to.name], subject.outputs, to) for to in FORMATS},
        condition=np.array(conditions),
        tolerance={name: np.array(values) for name, values in tolerance.items()},
    )


def _oracles(subject: Subject) -> dict[str, Oracle]:
    """By format, the oracle from flat numbers to flat numbers; it asks for nothing twice."""

    def remembering(extra: dict[str, Format]) -> Oracle:
        known: dict[tuple[Any, ...], list[Any]] = {}

        def call(arguments: list[Any]) -> list[Any]:
            key = tuple(arguments)
            if key not in known:
                answer = _flat(subject.oracle(*_nested(arguments, subject.inputs), **extra))
                # It may have a context of its own; its numbers are kept as they are.
                known[key] = [
                    mpmath.mp.make_mpf(x._mpf_) if hasattr(x, "_mpf_") else x for x in answer
                ]
            return known[key]

        return call

    if subject.by_format:
        return {to.name: remembering({"to": to}) for to in FORMATS}
    return dict.fromkeys((to.name for to in FORMATS), remembering({}))


def _require_inputs(subject: Subject, case: Case, arguments: list[Any]) -> None:
    """Every number of a case is one that float32, or 32 bits, can hold."""
    kinds = [field.kind for field in subject.inputs for _ in range(field.size)]
    if len(kinds) != len(arguments):
        raise ValueError(
            f"{subject.title}, {case.name}: {len(arguments)} arguments, not {len(kinds)}"
        )
    for kind, x in zip(kinds, arguments):
        whole = kind != "float"
        exact = whole or np.isnan(x) or float(np.float32(x)) == x
        if isinstance(x, int) != whole or not exact:
            raise ValueError(f"{subject.title}, {case.name}: {x!r} is no {kind}32")


def _is_asked(subject: Subject, oracle: Oracle, arguments: list[Any], to: Format) -> bool:
    """Whether rounding at every step, within the format, can still lead to the same choice."""
    numbers = [abs(x) for x in arguments if not isinstance(x, int) and 0 < abs(x) < np.inf]
    if to is FLOAT32 and numbers:
        safe = 2.0**subject.safe_exponent
        if not (min(numbers) * safe >= 1.0 and max(numbers) <= safe):
            return False
    if subject.chooses_by_input:
        return True
    return not choice_is_near(oracle, arguments, to.bits - CHOICE_MARGIN)


def _tolerance(units: float, measures: set[Measure], to: Format) -> float:
    """A bound in u as one in ulp, with ½ for the rounding of the answer; whole ulp upwards.

    u of a number is at most one ulp of it; of 1, the scale of absolute errors, it is half an ulp.
    """
    if measures == {"exact"}:
        return 0.0
    if not units * to.unit <= _MOST:
        return float("nan")
    return float(np.ceil((0.5 * units if measures <= {"exact", "absolute"} else units) + 0.5))


def _columns(
    rows: list[list[Any]], fields: tuple[Field, ...], to: Format | None
) -> dict[str, AnyArray]:
    """Rows of numbers as one array a field; results are rounded to a format."""
    found, start = {}, 0
    for field in fields:
        part = [row[start : start + field.size] for row in rows]
        if to is not None and field.kind == "float":
            part = [[correctly_rounded(x, to) for x in row] for row in part]
        array = np.array(part, _DTYPE[field.kind])
        found[field.name] = array.reshape(len(rows), *field.shape)
        start += field.size
    return found


def _flat(value: Any) -> Iterator[Any]:
    """The numbers of nested tuples, lists and arrays, in order."""
    if isinstance(value, tuple | list):
        for part in value:
            yield from _flat(part)
    elif isinstance(value, np.ndarray):
        yield from value.ravel().tolist()
    else:
        yield value.item() if isinstance(value, np.generic) else value


def _nested(arguments: list[Any], fields: tuple[Field, ...]) -> list[Any]:
    """One argument a field: a number, or a tuple of its numbers."""
    found, start = [], 0
    for field in fields:
        part = arguments[start : start + field.size]
        found.append(tuple(part) if field.shape else part[0])
        start += field.size
    return found


@dataclass(frozen=True, slots=True)
class Finding:
    """How an implementation did. worst: error / tolerance and its case; failed: names of cases."""

    name: str
    asked: int
    worst: float
    worst_case: str
    worst_ulp: float
    failed: tuple[str, ...]


def check(
    vectors: VectorSet,
    function: Callable[..., Any] | None = None,
    *,
    to: Format = FLOAT64,
) -> Finding:
    """Hold a vectorised implementation (default: the package's own) against the vectors.

    It is called once, with one array a field, and returns one array a field, in order.
    """
    subject = vectors.subject
    function = function or vectors.info.function
    arrays = [vectors.inputs[field.name] for field in subject.inputs]
    results = subject.call(function, *arrays) if subject.call else function(*arrays)
    if len(subject.outputs) == 1 and not isinstance(results, tuple | list):
        results = (results,)
    errors = np.zeros(len(vectors.names))
    for field, result in zip(subject.outputs, results, strict=True):
        want = vectors.outputs[to.name][field.name]
        got = np.broadcast_to(np.asarray(result), want.shape)
        errors = np.maximum(errors, ulp_errors(got, want, vectors.measure(field), to))
    tolerance = vectors.tolerance[to.name]
    asked = ~np.isnan(tolerance)
    bad = asked & ~(errors <= tolerance)
    share = np.where(asked, np.where(errors == 0.0, 0.0, errors / np.maximum(tolerance, 1e-9)), 0.0)
    at = int(np.argmax(share))
    return Finding(
        name=subject.title,
        asked=int(asked.sum()),
        worst=float(share[at]),
        worst_case=vectors.names[at],
        worst_ulp=float(errors[at]),
        failed=tuple(name for name, wrong in zip(vectors.names, bad) if wrong),
    )


def ulp_errors(got: AnyArray, want: AnyArray, measure: Measure, to: Format) -> F64Array:
    """(N,) the error of each case in ulp of the scale that the measure names.

    Where a NaN or an infinity is wanted anything else is an infinite error; zeros of either sign
    are equal.
    """
    n = want.shape[0]
    got, want = got.reshape(n, -1).astype(np.float64), want.reshape(n, -1).astype(np.float64)
    finite = np.isfinite(want)
    same = (got == want) | (np.isnan(got) & np.isnan(want))
    if measure == "exact":
        return np.where(same.all(axis=1), 0.0, np.inf)
    wrong = np.where(finite, ~np.isfinite(got), ~same).any(axis=1)
    with np.errstate(invalid="ignore", over="ignore"):
        off = np.where(finite & np.isfinite(got), np.abs(got - want), 0.0)
    if measure == "norm":
        off = _norms(off)
        scale = _norms(np.where(finite, want, 0.0))
    elif measure == "absolute":
        scale = np.ones_like(off)
    else:
        scale = np.where(finite, want, 0.0)
    ulp = np.array([to.ulp(float(x)) for x in scale.ravel()]).reshape(scale.shape)
    with np.errstate(over="ignore"):
        worst: F64Array = np.where(wrong, np.inf, (off / ulp).max(axis=1))
    return worst


def _norms(vectors: F64Array) -> F64Array:
    """(N, 1) lengths, scaled by the largest component so that no square over- or underflows."""
    most = vectors.max(axis=1, keepdims=True, initial=0.0)
    least = -vectors.min(axis=1, keepdims=True, initial=0.0)
    scale = np.maximum(most, least)
    scale = np.where(scale > 0.0, scale, 1.0)
    part = vectors / scale
    lengths: F64Array = scale * np.sqrt((part * part).sum(axis=1, keepdims=True))
    return lengths


def numbered(label: str, samples: Iterable[tuple[Any, ...]]) -> Iterator[Case]:
    """Cases of a sampler's argument lists: "label 0", "label 1", and so on."""
    return (Case(f"{label} {i}", tuple(inputs)) for i, inputs in enumerate(samples))


def joined(*parts: Iterable[Case]) -> Iterator[Case]:
    """The cases of several sources, in order."""
    return chain(*parts)
