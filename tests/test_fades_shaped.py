"""The fades of engines: each against its formula written out, alone and together."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from frames import made_up_frame

from ssr_ref.buffers import HitBuffer, Resolved, Status
from ssr_ref.camera import ViewParams
from ssr_ref.errors import SettingsError
from ssr_ref.settings import Settings
from ssr_ref.ssr.resolve import resolve

SIZE = (40, 24)
FRAME = made_up_frame(SIZE)
VIEW: ViewParams = FRAME.camera.params(SIZE)
RNG = np.random.default_rng(3)


def hits() -> HitBuffer:
    """A hit at every pixel, anywhere on the image: corners, borders and the middle too."""
    width, height = SIZE
    px = RNG.random((height, width, 2)) * [width, height]
    px[0, 0], px[0, 1], px[0, 2] = (0, 0), (width / 2, height / 2), (width, height)
    px[0, 3], px[0, 4] = (0, height / 2), (width - 0.5, 0.25)
    shape = (height, width)
    return replace(
        FRAME.hits,
        status=np.full(shape, Status.HIT, np.uint8),
        hit_px=px,
        length=RNG.random(shape) * 5.0,
        residual=RNG.random(shape) * 0.2,
        steps=RNG.integers(0, 80, shape).astype(np.uint32),
    )


HITS = hits()
NORMAL = RNG.normal(size=(*SIZE[::-1], 3))
GBUFFER = replace(FRAME.gbuffer, normal_vs=NORMAL.astype(np.float32))


def shown(**settings: Any) -> Resolved:
    given = {"edge_fade": False, "max_distance": 4.0, "thickness": 0.1, "buffer_dtype": "float64"}
    chosen = Settings(size=SIZE, **(given | settings)).resolved(1.0)
    g = replace(
        GBUFFER,
        **{name: image.astype(np.float64) for name, image in GBUFFER.arrays().items()
           if image.dtype == np.float32},
    )  # fmt: skip
    return resolve(VIEW, g, HITS, chosen)


def smoothstep(a: float, b: float, x: np.ndarray) -> np.ndarray:
    """GLSL 8.3."""
    t = np.clip((x - a) / (b - a), 0.0, 1.0)
    return t * t * (3.0 - 2.0 * t)


U, V = HITS.hit_px[..., 0] / SIZE[0], HITS.hit_px[..., 1] / SIZE[1]
NDC = np.maximum(abs(2 * U - 1), abs(2 * V - 1))
W, H = SIZE


def border(axis: str) -> np.ndarray:
    """Distance to the nearer border in pixels."""
    x, side = (U, W) if axis == "x" else (V, H)
    return side * np.minimum(x, 1.0 - x)


def babylon() -> np.ndarray:
    x, y = smoothstep(0.2, 0.6, abs(0.5 - U)), smoothstep(0.2, 0.6, abs(0.5 - V))
    return np.clip(1.0 - (x + y), 0.0, 1.0)


def filament() -> np.ndarray:
    r = 12.0
    fade = [np.maximum(r * abs(c - 0.5) - (r / 2 - 1), 0.0) for c in (U, V)]
    return np.clip(1.0 - (fade[0] ** 2 + fade[1] ** 2), 0.0, 1.0)


def ffx() -> np.ndarray:
    mx, my = 0.05 * H / W, 0.05
    x = smoothstep(0.0, mx, U) * (1.0 - smoothstep(1.0 - mx, 1.0, U))
    y = smoothstep(0.0, my, V) * (1.0 - smoothstep(1.0 - my, 1.0, V))
    return x * y


def wicked() -> np.ndarray:
    x, y = (np.clip(5.0 * abs(2 * c - 1) - 4.0, 0.0, 1.0) for c in (U, V))
    return np.clip(1.0 - (x * x + y * y), 0.0, 1.0)


def godot() -> np.ndarray:
    m = 0.05 * (W + H)
    return smoothstep(0.0, m * m, border("x") * border("y"))


EDGES: dict[str, tuple[dict[str, Any], Any]] = {
    "babylon": (
        {"edge_shape": "smoothstep", "edge_range": (0.4, 1.2), "edge_combine": "sum"}, babylon
    ),
    "filament": (
        {"edge_power": 2.0, "edge_range": (5 / 6, 1.0), "edge_combine": "sum"}, filament
    ),
    "ffx_sssr": (
        {"edge_shape": "smoothstep", "edge_range": (0.9, 1.0), "edge_unit": "height"}, ffx
    ),
    "wicked": ({"edge_power": 2.0, "edge_range": (0.8, 1.0), "edge_combine": "sum"}, wicked),
    "godot": (
        {"edge_shape": "smoothstep", "edge_range": (0.8, 1.0), "edge_unit": "mean",
         "edge_combine": "area"},
        godot,
    ),
    "kode80": (
        {"edge_power": 1.0, "edge_range": (0.75, 1.0), "edge_combine": "max"},
        lambda: 1.0 - np.clip((NDC - 0.75) / 0.25, 0.0, 1.0),
    ),
}  # fmt: skip


@pytest.mark.parametrize("name", EDGES)
def test_edge_fades_of_engines(name: str) -> None:
    settings, formula = EDGES[name]
    found = shown(edge_fade=True, **settings).edge_fade
    expected = formula()
    assert np.abs(found - expected).max() < 1e-12
    assert (expected < 0.5).any() and (expected > 0.9).any()
    assert found.min() >= 0.0 and found.max() <= 1.0


T = HITS.length / 4.0
G = HITS.steps / 64.0


def facing() -> tuple[np.ndarray, np.ndarray]:
    """−I·R and R.z of every pixel, by the mirror formula."""
    x, y = np.meshgrid(np.arange(W) + 0.5, np.arange(H) + 0.5)
    i = np.stack([(x - VIEW.cx) / VIEW.fx, (VIEW.cy - y) / VIEW.fy, -np.ones_like(x)], axis=2)
    i /= np.linalg.norm(i, axis=2, keepdims=True)
    n = GBUFFER.normal_vs.astype(np.float64)
    n /= np.linalg.norm(n, axis=2, keepdims=True)
    r = i - 2.0 * (i * n).sum(axis=2, keepdims=True) * n
    return -(i * r).sum(axis=2), r[..., 2]


BACK, AXIS = facing()
OTHERS: dict[str, tuple[dict[str, Any], str, np.ndarray]] = {
    "squared": ({"distance_fade": "squared"}, "distance_fade", np.clip(1 - T, 0, 1) ** 2),
    "4 - 4t": (
        {"distance_fade": "linear", "distance_start": 0.75}, "distance_fade",
        np.clip(4.0 - 4.0 * T, 0.0, 1.0),
    ),
    "steps": (
        {"steps_fade": "linear", "max_steps": 64}, "steps_fade", np.clip(1.0 - G, 0.0, 1.0)
    ),
    "steps of godot": (
        {"steps_fade": "power", "max_steps": 64, "steps_fade_out": 2.0, "steps_fade_in": 0.15},
        "steps_fade", np.clip(1.0 - G, 0.0, 1.0) ** 2 * np.clip(G, 0.0, 1.0) ** 0.15,
    ),
    "lettier": ({"facing_fade": "linear"}, "facing_fade", 1.0 - np.maximum(BACK, 0.0)),
    "babylon": (
        {"facing_fade": "smoothstep", "facing_range": (0.25, 0.5)}, "facing_fade",
        1.0 - smoothstep(0.25, 0.5, BACK),
    ),
    "filament": (
        {"facing_fade": "linear", "facing_measure": "axis"}, "facing_fade",
        1.0 - np.maximum(AXIS, 0.0),
    ),
    "ffx": (
        {"residual_fade": "smoothstep", "residual_end": 0.15, "residual_power": 2.0},
        "residual_fade", (1.0 - smoothstep(0.0, 0.15, HITS.residual)) ** 2,
    ),
    "linear": (
        {"residual_fade": "linear"}, "residual_fade", np.clip(1 - HITS.residual / 0.1, 0, 1)
    ),
}  # fmt: skip


@pytest.mark.parametrize("name", OTHERS)
def test_other_fades_of_engines(name: str) -> None:
    settings, buffer, expected = OTHERS[name]
    found = getattr(shown(**settings), buffer)
    assert np.abs(found - expected).max() < 1e-12
    assert (expected < 0.5).any() and (expected > 0.5).any()


ALL: dict[str, dict[str, Any]] = {
    "edge_fade": {"edge_fade": True},
    "distance_fade": {"distance_fade": "linear"},
    "steps_fade": {"steps_fade": "linear", "max_steps": 64},
    "facing_fade": {"facing_fade": "linear"},
    "residual_fade": {"residual_fade": "smoothstep"},
}


def test_each_is_switched_alone_and_confidence_is_their_product_in_order() -> None:
    everything = shown(**{k: v for change in ALL.values() for k, v in change.items()})
    product = np.ones(SIZE[::-1])
    for name, change in ALL.items():
        own = getattr(everything, name)
        alone = shown(**change)
        assert getattr(alone, name).tobytes() == own.tobytes(), name
        assert alone.confidence.tobytes() == own.tobytes(), name
        off = set(ALL) - {name, "edge_fade", "distance_fade"}
        assert all(getattr(alone, other) is None for other in off)
        product = product * own
    assert everything.confidence.tobytes() == product.tobytes()


def test_what_is_not_a_number_is_not_trusted() -> None:
    nan = replace(
        HITS,
        length=np.full_like(HITS.length, np.nan),
        residual=np.full_like(HITS.residual, np.nan),
    )
    settings = Settings(
        size=SIZE, max_distance=4.0, thickness=0.1, distance_fade="linear", facing_fade="linear",
        residual_fade="linear",
    ).resolved(1.0)  # fmt: skip
    normals = np.zeros_like(GBUFFER.normal_vs)
    found = resolve(VIEW, replace(GBUFFER, normal_vs=normals), nan, settings)
    for name in ("distance_fade", "facing_fade", "residual_fade", "confidence"):
        assert (getattr(found, name) == 0.0).all(), name


@pytest.mark.parametrize(
    ("settings", "words"),
    [
        ({"edge_range": (0.5, 0.5)}, "start below its end"),
        ({"edge_range": (0.1, np.inf)}, "edge_range"),
        ({"facing_range": 3}, "two numbers"),
        ({"distance_start": 1.0}, "0 to below 1"),
        ({"steps_fade": "linear"}, "without max_steps"),
        ({"residual_fade": "linear", "thickness_from": "relative"}, "residual_end"),
        ({"residual_power": 0.0}, "residual_power is 0"),
        ({"steps_fade_in": None}, "steps_fade_in is None"),
        ({"listing": True, "tracer": "march", "max_steps": 9, "edge_combine": "sum"}, "listing"),
    ],
)
def test_what_is_refused(settings: dict[str, Any], words: str) -> None:
    with pytest.raises(SettingsError, match=words):
        Settings(**settings)


def test_settings_travel_through_json() -> None:
    settings = Settings(edge_range=(0.2, 0.9), facing_range=(-1.0, 0.5)).resolved(1.0)
    assert Settings.from_json(settings.to_json()) == settings
