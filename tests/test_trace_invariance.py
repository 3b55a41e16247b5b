"""What must not change a trace: units, place, handedness, threads, chunks, the way back.

Scales by powers of two and moves on the grid keep every byte (spec 2.1, 2.5).
"""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numba
import numpy as np
import pytest
from tracing import MATT, MIRROR, PROJECTIONS, draw, noise_buffers, resolved, same_hits, view_of

from ssr_ref import transforms
from ssr_ref.buffers import Status
from ssr_ref.camera import Camera, View, look_at
from ssr_ref.pipeline import Frame, render
from ssr_ref.scene import Material, Mesh, Node, Scene
from ssr_ref.scenes import shapes
from ssr_ref.settings import Settings
from ssr_ref.ssr.trace import row_chunks, trace

SIZE = (97, 61)
EXACT = ("status", "end", "flags", "steps", "fetches", "hit_px")
LENGTHS = ("hit_depth", "residual", "length")
WALKS: tuple[dict[str, Any], ...] = (
    {"tracer": "cells", "distance_fade": "linear"},
    {"stride": 1, "jitter": True, "distance_fade": "published", "bias": 2.0**-8},
    {"stride": 4, "thickness_from": "constant", "fresnel": True},
)


def small_scene() -> Scene:
    """Boxes and a ball on and above a mirror floor; all coordinates are multiples of 2⁻¹²."""

    def snap(v: np.ndarray) -> np.ndarray:
        return (np.rint(v * 4096) / 4096).astype(np.float32)

    ball = shapes.sphere(0.5, 3, material=2)
    ball = replace(ball, positions=snap(ball.positions), normals=None)
    meshes = (
        Mesh("floor", (shapes.box((-3.0, -0.25, -3.0), (3.0, 0.0, 3.0), material=0),)),
        Mesh("box", (shapes.box((-0.5, 0.0, -0.25), (0.375, 0.8125, 0.25), material=1),)),
        Mesh("ball", (ball,)),
    )
    nodes = (
        Node("floor", 0),
        Node("box", 1, transforms.translation(-0.75, 0.0, 0.125)),
        Node("box", 1, transforms.translation(1.25, 0.25, -1.5)),
        Node("ball", 2, transforms.translation(0.5, 0.5625, 0.5)),
    )
    green = Material("green mirror", (0.2, 0.8, 0.3), metallic=0.5, roughness=0.0)
    return Scene(meshes, nodes, (MIRROR, MATT, green))


EYE, TARGET = (1.0, 1.625, 3.75), (0.125, 0.25, 0.0)


def view(scale: float = 1.0, move: tuple[float, float, float] = (0, 0, 0), **lens: Any) -> View:
    """The eye that looks at `small_scene`, scaled or moved with it."""
    eye = tuple(scale * v + m for v, m in zip(EYE, move))
    target = tuple(scale * v + m for v, m in zip(TARGET, move))
    lens = lens or {"fov_y_degrees": 45.0}
    return View(eye, target, near=scale * 2.0**-6, **lens)  # type: ignore[arg-type]


def frame(scene: Scene, at: View, scale: float = 1.0, **kw: Any) -> Frame:
    """A render with all lengths in the scene's unit."""
    lengths = {"thickness": 0.125, "max_distance": 6.0, "bias": 0.0} | {
        k: v for k, v in kw.items() if k == "bias"
    }
    scaled = {k: v * scale for k, v in lengths.items()}
    return render(scene, at, Settings(**({"size": SIZE} | kw | scaled)))


def placed(scene: Scene, m: np.ndarray) -> Scene:
    """The scene with every node's transform multiplied by m."""
    nodes = tuple(
        replace(n, world_from_mesh=transforms.multiply(m, n.world_from_mesh)) for n in scene.nodes
    )
    return replace(scene, nodes=nodes)


def same_images(a: Frame, b: Frame) -> None:
    """Confidence, fades, reflection and composite keep every byte."""
    for name, array in a.resolved.arrays().items():
        assert array.tobytes() == b.resolved.arrays()[name].tobytes(), name


@pytest.mark.parametrize("walk", WALKS)
@pytest.mark.parametrize("orthographic", [False, True])
def test_scaling_by_a_power_of_two(walk: dict[str, Any], orthographic: bool) -> None:
    def lens(scale: float) -> dict[str, float]:
        return {"orthographic_height": 3.5 * scale} if orthographic else {"fov_y_degrees": 45.0}

    scene = small_scene()
    one = frame(scene, view(**lens(1.0)), **walk)
    assert (one.hits.status == Status.HIT).sum() > 300
    for k in (-40, -7, 1, 40):
        scale = 2.0**k
        big = placed(scene, transforms.scaling(scale, scale, scale))
        other = frame(big, view(scale, **lens(scale)), scale, **walk)
        assert (one.gbuffer.depth * np.float32(scale)).tobytes() == other.gbuffer.depth.tobytes()
        same_hits(one.hits, other.hits, EXACT)
        same_images(one, other)
        for name in LENGTHS:
            scaled = getattr(one.hits, name) * scale
            assert scaled.tobytes() == getattr(other.hits, name).tobytes(), (k, name)


@pytest.mark.parametrize("move", [(2.0**20, -(2.0**20), 2.0**20), (-(2.0**30), 2.0**30, 2.0**30)])
@pytest.mark.parametrize("walk", WALKS[:2])
def test_moving_on_the_grid(walk: dict[str, Any], move: tuple[float, float, float]) -> None:
    """Every byte of every buffer, for a scene whose coordinates are multiples of 2⁻¹²."""
    scene = small_scene()
    one = frame(scene, view(), **walk)
    # The camera's rotation comes from eye − target, which is exact on the grid.
    other = frame(placed(scene, transforms.translation(*move)), view(move=move), **walk)
    for name, array in one.gbuffer.arrays().items():
        assert array.tobytes() == other.gbuffer.arrays()[name].tobytes(), name
    same_hits(one.hits, other.hits)
    same_images(one, other)


@pytest.mark.parametrize("orthographic", [False, True])
@pytest.mark.parametrize("walk", [{"tracer": "cells"}, {"stride": 1}, {"stride": 4}])
def test_mirror_flip(walk: dict[str, Any], orthographic: bool) -> None:
    """The scene and camera mirrored in x give the mirrored image, left for right (spec 7).

    Off ties. One kind is common: above stride 1 the sample in the middle of a ray's rest may lie
    exactly on a border, which belongs to the higher pixel in both images (4 of 3,600 rays here).
    """
    scene = small_scene()
    tilt = transforms.from_quaternion(0.0, 0.6, 0.0, 0.8)
    turned = placed(scene, tilt)
    flip = transforms.scaling(-1.0, 1.0, 1.0)
    lens = {"orthographic_height": 3.5} if orthographic else {"fov_y_degrees": 45.0}
    a = frame(turned, replace(view(**lens), eye=(0.3, 1.7, 3.9), target=(0.1, 0.2, 0.0)), **walk)
    b = frame(
        placed(turned, flip),
        replace(view(**lens), eye=(-0.3, 1.7, 3.9), target=(-0.1, 0.2, 0.0)),
        **walk,
    )
    assert np.array_equal(a.gbuffer.object_id, b.gbuffer.object_id[:, ::-1])  # type: ignore[index]
    # Depths of both come from the same plane with x mirrored: rounding alone differs.
    swap = np.arange(17)
    swap[[10, 11]] = swap[[11, 10]]  # LEFT_SCREEN_L and _R
    same = a.hits.status == swap[b.hits.status[:, ::-1]]
    assert (~same).sum() <= (4 if walk.get("stride") == 4 else 0), np.argwhere(~same)
    hit = same & (a.hits.status == Status.HIT)
    assert hit.sum() > 300
    mirrored = [SIZE[0], 0] + b.hits.hit_px[:, ::-1] * [-1, 1]
    # float32 depths and normals may differ in their last bit: 1e-3 px here, at 97 pixels.
    error = np.abs(a.hits.hit_px - mirrored)[hit]
    assert (error < 1e-3).all(axis=1).mean() > 0.998
    if walk.get("stride") != 4:
        assert np.array_equal(a.hits.steps, b.hits.steps[:, ::-1])


def test_an_orthographic_camera_may_move_back_along_its_axis() -> None:
    """The incident direction is (0, 0, −1) everywhere; nothing moves on screen."""
    scene = small_scene()
    pose = look_at(EYE, TARGET)
    frames = []
    for back in (0.0, 4.0, 1000.0):
        moved = pose.copy()
        moved[:3, 3] += back * pose[:3, 2]
        # The near plane is where it was, or rays towards the eye would go on.
        camera = Camera.orthographic(moved, 3.5, SIZE[0] / SIZE[1], near=2.0**-6 + back)
        params = camera.params(SIZE)
        frames.append(trace(params, draw(params, scene), resolved(SIZE)))
    for other in frames[1:]:
        # Depths are rounded to float32 near `back`: 2⁻²⁴ · 1000 = 6e-5 units, 1e-3 px.
        same = frames[0].status == other.status
        assert same.mean() > 0.995
        hit = same & (other.status == Status.HIT)
        assert hit.sum() > 300
        close = np.abs(frames[0].hit_px - other.hit_px)[hit].max(axis=1) < 0.05
        assert close.mean() > 0.99


@pytest.mark.parametrize("projection", PROJECTIONS)
@pytest.mark.parametrize("walk", WALKS)
def test_threads_and_chunks_keep_every_byte(projection: str, walk: dict[str, Any]) -> None:
    """One thread, two, and rows in 32 chunks with a progress callback."""
    at = view_of(projection, SIZE)
    gbuffer = noise_buffers(at, 31)
    settings = resolved(SIZE, **walk)
    threads = numba.get_num_threads()
    try:
        numba.set_num_threads(1)
        one = trace(at, gbuffer, settings)
        numba.set_num_threads(min(2, numba.config.NUMBA_NUM_THREADS))
        two = trace(at, gbuffer, settings)
    finally:
        numba.set_num_threads(threads)
    shares: list[float] = []
    chunked = trace(at, gbuffer, settings, shares.append)
    same_hits(one, two)
    same_hits(one, chunked)
    assert shares == sorted(shares) and shares[-1] == 1.0 and len(shares) > 20


def test_chunks_cover_every_row_once() -> None:
    for height in (1, 2, 31, 32, 33, 64, 1081):
        for chunks in (1, 2, 32, 2000):
            runs = row_chunks(height, chunks)
            assert [y for a, b in runs for y in range(a, b)] == list(range(height))
            assert len(runs) <= chunks
