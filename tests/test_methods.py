"""Several methods on one G-buffer: each as if it had been rendered alone."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

import ssr_ref
from ssr_ref.errors import SettingsError
from ssr_ref.pipeline import render
from ssr_ref.settings import METHODS, Settings, method_settings

SIZE = (37, 23)


def test_each_method_is_what_it_gives_alone() -> None:
    scene = ssr_ref.load("teapot")
    base = Settings(size=SIZE, stride=3)
    named = {name: method_settings(name, base) for name in METHODS if name != "march"}
    named["thick"] = replace(base, thickness=1.0, thickness_from="constant")
    first, *rest = named
    frame = render(scene, settings=named[first], more={name: named[name] for name in rest})
    assert list(frame.more) == rest and {"trace exact", "resolve planes"} <= set(frame.timings)
    seen = set()
    for name, settings in named.items():
        alone = render(scene, settings=settings)
        own = frame if name == first else frame.of(name)
        assert own.settings == alone.settings
        for group in ("hits", "resolved"):
            for key, array in getattr(alone, group).arrays().items():
                assert array.tobytes() == getattr(own, group).arrays()[key].tobytes(), (name, key)
        seen.add(alone.hits.hit_px.tobytes())
    assert len(seen) == len(named)  # no two of them do the same


def test_names_stand_for_tracer_and_surface() -> None:
    base = Settings(surface="plane", stride=4)
    found = {name: method_settings(name, base) for name in METHODS}
    assert {n: (s.tracer, s.surface) for n, s in found.items()} == {
        "march": ("march", "constant"),
        "dda": ("dda", "plane"),
        "exact": ("cells", "constant"),
        "planes": ("cells", "plane"),
    }
    assert found["dda"] == base
    with pytest.raises(SettingsError, match="'hi-z'; expected one of march, dda, exact, planes"):
        method_settings("hi-z", base)


@pytest.mark.parametrize(
    ("name", "change", "words"),
    [
        ("other", {"size": (5, 3)}, "size"),
        ("other", {"buffer_dtype": "float64"}, "buffer_dtype"),
        ("other", {"thickness_from": "material"}, "thickness_from"),
        ("../up", {}, "named '../up'"),
        ("", {}, "named ''"),
    ],
)
def test_what_needs_another_gbuffer_or_name_is_refused(name, change, words) -> None:
    base = Settings(size=SIZE)
    with pytest.raises(SettingsError, match=words):
        render(ssr_ref.load("poles"), settings=base, more={name: replace(base, **change)})


def test_a_buffer_that_one_method_needs_is_there_and_changes_no_other() -> None:
    scene = ssr_ref.load("poles")
    thin = Settings(size=SIZE, thickness_from="constant")
    alone = render(scene, settings=thin)
    both = render(scene, settings=thin, more={"backs": Settings(size=SIZE)})
    assert alone.gbuffer.back_depth is None and both.gbuffer.back_depth is not None
    assert np.array_equal(alone.hits.status, both.hits.status)
    assert alone.resolved.composite.tobytes() == both.resolved.composite.tobytes()
