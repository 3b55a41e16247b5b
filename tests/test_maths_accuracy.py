"""Every formula of the registry keeps the bound it states, on inputs that are hard on purpose."""

from __future__ import annotations

import json
import sys
from pathlib import Path

import numpy as np
import pytest

from benchmarks import kernels as benchmark
from ssr_ref import MathsError
from ssr_ref.maths.registry import KernelInfo, kernels
from ssr_ref.study.accuracy import case, errors
from ssr_ref.study.sampling import condition_number, examples, oracle

CASES, MANY = 30, 400
ALL = kernels()


@pytest.mark.parametrize("cases", [CASES, pytest.param(MANY, marks=pytest.mark.slow)])
@pytest.mark.parametrize("info", ALL, ids=lambda info: info.key)
def test_measured_error_stays_below_the_stated_bound(info: KernelInfo, cases: int) -> None:
    found = errors(info, examples(info.key, cases, 31))
    assert found.shape == (cases,)
    if np.isfinite(info.bound):
        assert found.max() <= info.bound
    elif cases == MANY:
        assert found.max() > 1e3, "a form without a bound is expected to show it"


def test_keys_are_unique_and_every_bound_has_a_reason() -> None:
    assert len({info.key for info in ALL}) == len(ALL)
    for info in ALL:
        assert info.why and info.source
        assert (info.measure == "exact") == (info.bound == 0.0)


def test_a_wrong_result_is_seen() -> None:
    """The measurement itself: one ulp more than the bound, a swapped vector, a NaN."""
    info = next(k for k in ALL if k.key == "difference_of_products")
    arguments = examples(info.key, 20, 1)

    def off(*args: np.ndarray) -> np.ndarray:
        return np.asarray(info.function(*args)) * (1.0 + 2.0**-50)

    def bad(*args: np.ndarray) -> np.ndarray:
        return np.where(np.arange(20) == 7, np.nan, info.function(*args))

    for function, limit in ((off, info.bound), (bad, 1e300)):
        broken = KernelInfo(
            name=info.name, function=function, measure="component", bound=2.0, why="x", source="x"
        )
        assert errors(broken, arguments).max() > limit


def test_examples_repeat_and_unknown_keys_are_refused() -> None:
    for info in ALL:
        for a, b in zip(examples(info.key, 30, 2), examples(info.key, 30, 2)):
            assert np.array_equal(a, b) and a.shape[0] == 30
    for call in (lambda: examples("nothing", 3), lambda: oracle("nothing")):
        with pytest.raises(MathsError, match="'nothing'"):
            call()
    assert condition_number("two_sum") is None


def test_numeric_condition_number_against_the_formula() -> None:
    """Of a·b − c·d it is 2(|ab| + |cd|)/|ab − cd|."""
    from ssr_ref.study.oracle_ray import condition, difference_of_products

    for i in range(10):
        args = case(examples("difference_of_products", 10, 3), i)
        a, b, c, d = args
        exact = difference_of_products(*args)[0]
        want = 2 * (abs(a * b) + abs(c * d)) / abs(exact)
        assert abs(condition(difference_of_products, args)[0] / want - 1) < 1e-12


def test_the_benchmark_works_from_the_registry(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """One formula, few cases; without matplotlib it says so and writes the numbers all the same."""
    monkeypatch.setitem(sys.modules, "matplotlib", None)
    arguments = ["kernels", "--only", "dda_line", "--cases", "10", "-o", str(tmp_path / "out")]
    monkeypatch.setattr(sys, "argv", arguments)
    monkeypatch.setattr(benchmark, "SIZE", 50)
    benchmark.main()
    printed = capsys.readouterr().out
    assert "| `dda_line` | float64 |" in printed and "matplotlib is not installed" in printed
    content = json.loads((tmp_path / "out" / "kernels.json").read_text())
    assert [row["key"] for row in content["kernels"]] == ["dda_line"]
    assert (tmp_path / "out" / "kernels.csv").read_text().startswith("key,precision,ns,error,bound")
