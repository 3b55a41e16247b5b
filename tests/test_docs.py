"""The documentation agrees with the code: numbers, listings, worked examples, links.

`python tests/test_docs.py` writes the worked examples anew into the pages that hold them.
"""

from __future__ import annotations

import math
import re
import sys
from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

import ssr_ref
from ssr_ref import (
    Camera,
    Image,
    Material,
    Mesh,
    Node,
    Primitive,
    Scene,
    Settings,
    Texture,
    View,
    camera,
    settings,
    transforms,
)
from ssr_ref._jit import _fma_exact
from ssr_ref.buffers import STATUS_OF_END, End, Flag, GBuffer, Status
from ssr_ref.fileio.manifest import SCHEMA_VERSION
from ssr_ref.pipeline import Frame
from ssr_ref.raster import attributes, clip, coverage, geometry
from ssr_ref.scenes import build
from ssr_ref.ssr import fade, march_cells
from ssr_ref.ssr.trace import trace
from ssr_ref.vecmath.elementary import pow as power
from ssr_ref.vecmath.elementary import sincos_host
from ssr_ref.vecmath.noise import jitter, pcg3d

ROOT = Path(__file__).parents[1]
DOCS = ROOT / "docs"
Space = dict[str, Any]


def page(name: str) -> str:
    return (DOCS / name).read_text(encoding="utf-8")


def rows(text: str, heading: str) -> list[list[str]]:
    """The cells of the first table after a heading, without its own two head lines."""
    after = text.split(heading, 1)[1].lstrip("\n").split("\n")
    start = next(i for i, line in enumerate(after) if line.startswith("|"))
    found = []
    for line in after[start + 2 :]:
        if not line.startswith("|"):
            break
        found.append([cell.strip() for cell in line.strip("|").split("|")])
    return found


def python_blocks(name: str) -> list[str]:
    return re.findall(r"```python\n(.*?)```", page(name), re.DOTALL)


def listings(name: str, first: str) -> Space:
    """Run a page's Python listings, from the one that holds `first` on, in one namespace."""
    blocks = python_blocks(name)
    start = next(i for i, block in enumerate(blocks) if first in block)
    space: Space = {"fma": _fma_exact, "f32": lambda x: float(np.float32(x)), "power": power}
    space |= {n: getattr(math, n) for n in ("inf", "isfinite", "isinf", "nextafter", "sqrt")}
    space |= {"floor": math.floor, "HIT": int(Status.HIT), "sincos": sincos_host}
    space |= {n: int(Status[n]) for n in ("BACKGROUND", "NOT_REFLECTIVE")}
    exec(compile("\n".join(blocks[start:]), name, "exec"), space)
    return space


# ---- Numbers -----------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("heading", "numbers"), [("## Status", Status), ("## End", End), ("## Flags", Flag)]
)
def test_tables_of_numbers_are_the_enums(heading: str, numbers: Any) -> None:
    table = [(int(row[0]), row[1]) for row in rows(page("statuses.md"), heading)]
    assert table == [(int(member), str(member.name)) for member in numbers]


def test_status_of_an_end() -> None:
    assert f"status = end + {int(STATUS_OF_END)}" in page("statuses.md")
    for end in End:
        if end != End.NONE:
            assert Status(end + STATUS_OF_END).name == end.name


def test_constants_are_those_of_the_code() -> None:
    table = {row[0].strip("`"): row[1] for row in rows(page("specification.md"), "Constants:")}
    for name, text in table.items():
        modules = (camera, clip, coverage, march_cells, attributes, fade, settings)
        found = {getattr(module, name) for module in modules if hasattr(module, name)}
        base, _, exponent = text.partition("^")
        assert found == {float(base) ** int(exponent or 1)}, name


def test_schema_version() -> None:
    assert f"`schema_version` {SCHEMA_VERSION}." in page("specification.md")


def test_jitter_values() -> None:
    """Sixteen values: the page's listing, Python's integers and the kernel agree."""
    listed = rows(page("dda.md"), "## Jitter")
    assert len(listed) == 16
    text = listings("dda.md", "def trace_pixel")
    for x, y, seed, word, j in listed:
        at = (int(x), int(y), int(seed))
        assert int(word.strip("`"), 16) == text["pcg3d"](*at)[0] == pcg3d(*at)[0]
        assert float(j) == text["jitter"](*at) == jitter(*at)


# ---- The tracer's listing ----------------------------------------------------------------------


def trace_by_listing(space: Space, frame: Frame) -> list[list[Any]]:
    """Every pixel of a frame's G-buffer traced by dda.md's listing."""
    chosen, g = frame.settings, frame.gbuffer
    assert g.normal_vs is not None
    assert g.geo_normal_vs is not None
    assert g.reflectivity is not None
    view = frame.camera.params(chosen.size)
    from_back_faces = chosen.thickness_from == "back_faces" and g.back_depth is not None
    buffers = SimpleNamespace(
        depth=g.depth.tolist(),
        normal=g.normal_vs.tolist(),
        geo_normal=g.geo_normal_vs.tolist(),
        reflectivity=g.reflectivity.tolist(),
        back=g.back_depth.tolist() if from_back_faces and g.back_depth is not None else None,
    )
    values = listing_settings(frame)
    if chosen.surface == "plane":
        planes = space["prepare_planes"](view, values, buffers)
        return [
            [space["trace_planes"](view, buffers, planes, values, x, y) for x in range(view.width)]
            for y in range(view.height)
        ]
    front = space["prepare_targets"](view, buffers.depth, buffers.geo_normal)
    return [
        [space["trace_pixel"](view, buffers, front, values, x, y) for x in range(view.width)]
        for y in range(view.height)
    ]


def listing_settings(frame: Frame) -> SimpleNamespace:
    chosen, thickness = frame.settings, frame.gbuffer.thickness
    return SimpleNamespace(
        tracer=chosen.tracer,
        stride=chosen.stride,
        step=chosen.step,
        growth=chosen.growth,
        refine_steps=chosen.refine_steps,
        jitter=chosen.jitter,
        seed=chosen.seed,
        refine=chosen.refinement,
        interval=chosen.interval,
        max_steps=math.inf if chosen.max_steps is None else chosen.max_steps,
        max_distance=chosen.max_distance,
        thickness=chosen.thickness,
        bias=chosen.bias,
        rounding=2.0**-53 if frame.gbuffer.depth.dtype == np.float64 else 2.0**-24,
        reject_self=chosen.self_rejection == "plane",
        slope_bias=chosen.self_rejection == "slope_bias",
        facing_test=chosen.facing_test,
        model=chosen.thickness_from,
        most=chosen.thickness if chosen.thickness_from in FRONT_PLUS_CONSTANT else math.inf,
        thickness_of=None if thickness is None else thickness.tolist(),
    )


FRONT_PLUS_CONSTANT = ("constant", "back_faces")

ORTHOGRAPHIC = View((0.8, 1.2, 3.75), (0.08, 0.2, 0.0), orthographic_height=2.6, far=5.0)
INSIDE = View((0.3, 0.4, 0.5), (0.08, 0.2, 0.0), fov_y_degrees=100.0, near=0.3)
SHIFTED = View((0.8, 1.2, 3.75), (0.08, 0.2, 0.0), fov_y_degrees=36.0, jitter=(0.3, -0.2))

TRACES: list[tuple[View | None, dict[str, Any]]] = [
    (None, {}),
    (None, {"tracer": "cells"}),
    (SHIFTED, {"stride": 4, "jitter": True, "seed": 7}),
    (None, {"stride": 3, "refine": "none", "interval": "cell", "thickness_from": "constant"}),
    (None, {"max_distance": math.inf, "max_steps": 5, "self_rejection": "none", "bias": 0.01}),
    (INSIDE, {"max_distance": 0.4, "refine": "rewalk"}),
    (ORTHOGRAPHIC, {"stride": 2}),
    (ORTHOGRAPHIC, {"tracer": "cells", "max_distance": math.inf}),
    (None, {"interval": "point", "facing_test": True, "thickness_from": "slope"}),
    (None, {"interval": "published", "thickness_from": "relative", "thickness": 0.01}),
    (SHIFTED, {"stride": 5, "refine": "bisect", "jitter": True, "thickness_from": "material"}),
    (ORTHOGRAPHIC, {"stride": 7, "refine": "bisect", "thickness_from": "slope"}),
    (None, {"self_rejection": "slope_bias", "tracer": "cells", "thickness_from": "slope"}),
    (ORTHOGRAPHIC, {"self_rejection": "slope_bias", "stride": 3, "refine": "bisect"}),
    (None, {"surface": "plane"}),
    (None, {"surface": "plane", "tracer": "cells", "max_steps": 9}),
    (SHIFTED, {"surface": "plane", "stride": 4, "jitter": True}),
    (INSIDE, {"surface": "plane", "thickness_from": "constant", "max_distance": 0.4}),
    (None, {"surface": "plane", "thickness_from": "slope", "tracer": "cells"}),
    (SHIFTED, {"surface": "plane", "thickness_from": "material", "stride": 3}),
    (ORTHOGRAPHIC, {"surface": "plane", "thickness_from": "relative", "thickness": 0.01}),
    (ORTHOGRAPHIC, {"surface": "plane", "jitter": True, "max_distance": math.inf}),
    (ORTHOGRAPHIC, {"surface": "plane", "tracer": "cells"}),
    (ORTHOGRAPHIC, {"surface": "plane", "stride": 3, "self_rejection": "none"}),
]


@pytest.mark.parametrize(("view", "options"), TRACES)
def test_the_listing_of_the_tracer_gives_the_same_bytes(
    view: View | None, options: dict[str, Any]
) -> None:
    scene = build("teapot", 3)
    materials = tuple(
        replace(m, thickness=(None, 0.25, math.inf)[i % 3]) for i, m in enumerate(scene.materials)
    )
    settings = Settings(size=(37, 23), **options)
    frame = ssr_ref.render(replace(scene, materials=materials), view, settings)
    assert (frame.hits.status == Status.HIT).sum() > 10
    check_trace(frame)


def check_trace(frame: Frame, space: Space | None = None) -> None:
    if space is None:
        space = listings("dda.md", "def trace_pixel")
        exec("\n".join(re.findall(r"```python\n(.*?)```", page("planes.md"), re.DOTALL)), space)
    traced = trace_by_listing(space, frame)
    for name, expected in frame.hits.arrays().items():
        got = np.array([[getattr(out, name) for out in row] for row in traced], expected.dtype)
        assert got.tobytes() == expected.tobytes(), name


MARCHES: list[tuple[View | None, dict[str, Any]]] = [
    (None, {"jitter": True, "seed": 4}),
    (SHIFTED, {"growth": "constant", "refine": "secant", "refine_steps": 3, "bias": 0.01}),
    (ORTHOGRAPHIC, {"thickness_from": "constant", "jitter": True, "refine": "none"}),
    (INSIDE, {"max_distance": math.inf, "max_steps": 12, "refine": "secant", "step": 0.02}),
    (None, {"self_rejection": "slope_bias", "refine": "secant", "jitter": True}),
]


@pytest.mark.parametrize(("view", "options"), MARCHES)
def test_the_listing_of_the_march_gives_the_same_bytes(
    view: View | None, options: dict[str, Any]
) -> None:
    settings = Settings(size=(37, 23), tracer="march", **options)
    frame = ssr_ref.render(build("teapot", 3), view, settings)
    assert (frame.hits.status == Status.HIT).sum() > 10
    space = listings("dda.md", "def trace_pixel")
    block = next(b for b in python_blocks("specification.md") if "def march_pixel" in b)
    exec(block, space)
    space["trace_pixel"] = space["march_pixel"]
    check_trace(frame, space)


def nearly_tangent_rays(frame: Frame, seed: int) -> Frame:
    """The frame with rays that barely leave their surface, and depths off by about rule 4.5's ε."""
    rng = np.random.default_rng(seed)
    g = frame.gbuffer
    assert g.geo_normal_vs is not None
    view = frame.camera.params(frame.settings.size)
    px = np.stack(np.meshgrid(*(np.arange(n) + 0.5 for n in frame.settings.size)), axis=2)
    d = np.stack([(px[..., 0] - view.cx) / view.fx, (view.cy - px[..., 1]) / view.fy], axis=2)
    d = np.concatenate([d, -np.ones((*d.shape[:2], 1))], axis=2)
    if not view.perspective:
        d[..., :2] = 0.0
    n = g.geo_normal_vs.astype(np.float64)
    along = np.cross(n, rng.normal(size=n.shape))
    along = unit(along) + n * 2.0 ** rng.uniform(-16, -4, (*n.shape[:2], 1))
    normal = np.where(n.any(axis=2, keepdims=True), unit(unit(along) - unit(d)), 0.0)
    scale = 1.0 + rng.normal(size=g.depth.shape) * 2.0 ** rng.uniform(-16, -6, g.depth.shape)
    dtype = g.depth.dtype
    ones = np.ones_like(normal, dtype)
    changed = replace(
        g,
        depth=(g.depth * scale).astype(dtype),
        normal_vs=normal.astype(dtype),
        reflectivity=ones,
    )
    return replace(frame, gbuffer=changed, hits=trace(view, changed, frame.settings))


def unit(v: np.ndarray) -> np.ndarray:
    squared: np.ndarray = (v * v).sum(axis=2, keepdims=True)
    return v / np.sqrt(np.where(squared > 0.0, squared, 1.0))


def diagonal_rays(seed: int, **options: Any) -> Frame:
    """Orthographic, every ray at 45° across the pixels: it passes through their corners."""
    rng = np.random.default_rng(seed)
    shape = (17, 17)
    chosen = Settings(size=shape, max_distance=6.0, thickness=0.25, **options)
    cam = Camera.orthographic(transforms.identity(), 17.0, 1.0, near=0.5, far=9.0)
    up = np.zeros((*shape, 3), np.float32)
    up[..., 2] = 1.0
    tilt = np.empty((*shape, 3), np.float32)
    tilt[..., :2] = rng.choice([-0.5, 0.5], (*shape, 2))
    tilt[..., 2] = rng.choice([0.75, 1.0, 4.0], shape)
    tilt[rng.random(shape) < 0.1] = (0.0, 0.0, 1.0)  # back along the view axis
    depth = np.where(rng.random(shape) < 0.1, np.inf, 2.5 - rng.random(shape))
    back = np.where(rng.random(shape) < 0.5, np.inf, depth + 0.2)
    g = GBuffer(
        depth=depth.astype(np.float32),
        triangle_id=np.zeros(shape, np.int32),
        back_depth=back.astype(np.float32),
        geo_normal_vs=up,
        normal_vs=tilt,
        reflectivity=np.ones((*shape, 3), np.float32),
    )
    hits = trace(cam.params(shape), g, chosen)
    return SimpleNamespace(settings=chosen, camera=cam, gbuffer=g, hits=hits)  # type: ignore


@pytest.mark.parametrize("view", [None, ORTHOGRAPHIC])
def test_the_listing_gives_the_same_bytes_for_nearly_tangent_rays(view: View | None) -> None:
    options = {"thickness": 2.0**-8, "thickness_from": "constant"}
    frame = ssr_ref.render(build("teapot", 3), view, Settings(size=(37, 23), **options))
    frame = nearly_tangent_rays(frame, seed=3)
    rejected = (frame.hits.flags & np.uint8(Flag.SELF_REJECTED)) != 0
    assert rejected.sum() > 20
    assert (frame.hits.status == Status.HIT).sum() > 20
    check_trace(frame)


@pytest.mark.parametrize("options", [{"tracer": "cells"}, {"interval": "cell"}, {"stride": 3}])
def test_the_listing_gives_the_same_bytes_on_diagonals(options: dict[str, Any]) -> None:
    frame = diagonal_rays(5, **options)
    assert (frame.hits.status == Status.HIT).sum() > 30
    check_trace(frame)


# ---- The specification's listings --------------------------------------------------------------


class PlainGeometry:
    """A flattened scene as the specification's listings read it."""

    def __init__(self, space: Space, scene: Scene, view: Any) -> None:
        flat = geometry.flatten(scene)
        self.positions_ws = [tuple(p) for p in flat.positions_ws.tolist()]
        self.positions_vs = [space["to_view"](view, p) for p in self.positions_ws]
        self.faces = flat.faces.tolist()
        self.object = flat.triangle_object.tolist()
        self.material = [scene.materials[m] for m in flat.triangle_material]
        self.double_sided = [bool(f & geometry.DOUBLE_SIDED) for f in flat.triangle_flags]
        self._flags = flat.triangle_flags
        self._normals = [tuple(n) for n in flat.normals_ws.tolist()]
        self._colors = [tuple(c) for c in flat.colors.tolist()]
        self._images = scene.images
        placed = [p for node in scene.nodes for p in scene.meshes[node.mesh].primitives]
        self._optional: dict[str, list[Any]] = {
            name: [
                None if values is None else tuple(np.atleast_1d(values[i]).tolist())
                for p in placed
                for values in (getattr(p, name),)
                for i in range(len(p.positions))
            ]
            for name in ("uv0", "uv1", "alphas")
        }

    def corners_vs(self, t: int) -> list[Any]:
        return [self.positions_vs[i] for i in self.faces[t]]

    def corners_ws(self, t: int) -> list[Any]:
        return [self.positions_ws[i] for i in self.faces[t]]

    def vertex_normals(self, t: int) -> list[Any] | None:
        has = self._flags[t] & geometry.HAS_NORMALS
        return [self._normals[i] for i in self.faces[t]] if has else None

    def vertex_colors(self, t: int) -> list[Any] | None:
        has = self._flags[t] & geometry.HAS_COLORS
        return [self._colors[i] for i in self.faces[t]] if has else None

    def _rows(self, name: str, t: int) -> list[Any] | None:
        found = [self._optional[name][i] for i in self.faces[t]]
        return None if found[0] is None else found

    def vertex_uv(self, t: int, uv_set: int) -> list[Any] | None:
        return self._rows(f"uv{uv_set}", t)

    def vertex_alphas(self, t: int) -> list[Any] | None:
        return self._rows("alphas", t)

    def image(self, texture: Any) -> tuple[Any, int]:
        pixels = self._images[texture.image].pixels
        return pixels.tolist(), int(np.iinfo(pixels.dtype).max)

    def varies(self, t: int) -> bool:
        attributes_of_t = (self.vertex_normals(t), self.vertex_colors(t))
        if any(texture is not None for texture in self.material[t].textures):
            return True
        return any(r is not None and not (r[0] == r[1] == r[2]) for r in attributes_of_t)


def draw_by_listing(space: Space, frame: Frame) -> dict[str, Any]:
    """The G-buffer of a frame, unrounded, by specification.md's listings."""
    chosen, scene = frame.settings, frame.scene
    view = frame.camera.params(chosen.size)
    shapes = PlainGeometry(space, scene, view)
    gpu = chosen.snap == "gpu_vertices"
    depth, triangle, back = space["draw"](view, shapes, gpu, chosen.back_any_object)
    lights = [
        (tuple(-c for c in transforms.normalized3(light.direction_ws)), light.color)
        for light in scene.lights.directional
    ]
    names = ("geo_normal_vs", "normal_vs", "albedo", "reflectivity", "radiance")
    images: dict[str, Any] = {
        name: [[(0.0, 0.0, 0.0)] * view.width for _ in range(view.height)] for name in names
    }
    for y, x, t in visible(triangle):
        geo, behind = space["geometric_normal"](view, shapes, t)
        b = space["weights"](view, shapes, t, x, y) if shapes.varies(t) else (1.0, 0.0, 0.0)
        n_ws = space["shading_normal_ws"](shapes, t, b, behind)
        albedo = space["base_color"](shapes, t, b)
        material = shapes.material[t]
        lit = space["flat_normal_ws"](shapes, t, behind) if n_ws is None else n_ws
        emissive = space["emission"](shapes, t, b)
        metallic, rough = space["metallic_roughness"](shapes, t, b)
        radiance = albedo
        if not material.unlit:
            radiance = space["diffuse"](albedo, lit, emissive, scene.lights.ambient, lights)
        values = (
            geo,
            geo if n_ws is None else space["rotate_to_view"](view, n_ws),
            albedo,
            space["normal_reflectivity"](
                material, albedo, metallic, rough, chosen.fresnel, chosen.max_roughness
            ),
            radiance,
        )
        for name, value in zip(names, values):
            images[name][y][x] = value
    return {"depth": depth, "triangle_id": triangle, "back_depth": back, **images}


def visible(triangle: list[list[int]]) -> Iterator[tuple[int, int, int]]:
    for y, row in enumerate(triangle):
        for x, t in enumerate(row):
            if t >= 0:
                yield y, x, t


def resolve_by_listing(space: Space, frame: Frame) -> dict[str, Any]:
    """What `resolve` gives, unrounded, by specification.md's listings."""
    g, hits = frame.gbuffer, frame.hits
    assert g.radiance is not None
    assert g.reflectivity is not None
    assert g.normal_vs is not None
    view = frame.camera.params(frame.settings.size)
    buffers = SimpleNamespace(
        radiance=g.radiance.tolist(),
        reflectivity=g.reflectivity.tolist(),
        normal=g.normal_vs.tolist(),
    )
    status, hit_px, length = hits.status.tolist(), hits.hit_px.tolist(), hits.length.tolist()
    values = [
        [
            space["resolve_pixel"](
                view, x, y, status[y][x], hit_px[y][x], length[y][x], buffers, frame.settings
            )
            for x in range(view.width)
        ]
        for y in range(view.height)
    ]
    names = ("edge_fade", "distance_fade", "confidence", "reflection", "composite")
    return {name: [[v[i] for v in row] for row in values] for i, name in enumerate(names)}


def varied_scene() -> Scene:
    """The teapot scene with vertex colours, double-sided materials and a mirroring node."""
    scene = build("teapot", 2)
    rng = np.random.default_rng(1)
    colored = {"ball", "block", "left wall"}
    meshes = tuple(
        Mesh(
            mesh.name,
            tuple(
                replace(p, colors=rng.random(p.positions.shape).astype(np.float32))
                if mesh.name in colored
                else p
                for p in mesh.primitives
            ),
        )
        for mesh in scene.meshes
    )
    materials = tuple(
        replace(m, double_sided=m.name in ("ceramic", "red wall")) for m in scene.materials
    )
    nodes = list(scene.nodes)
    place = np.array(nodes[2].world_from_mesh)
    place[:3, 0] *= -1.5
    nodes[2] = Node("ball", 2, place)
    return replace(scene, meshes=meshes, materials=materials, nodes=tuple(nodes))


def textured_scene() -> Scene:
    """Every kind of texture, both uv sets, both depths, all wraps, masks; a mirroring node."""
    scene = varied_scene()
    rng = np.random.default_rng(4)
    images = (
        Image("eight", rng.integers(0, 256, (5, 7, 4), dtype=np.uint8)),
        Image("sixteen", rng.integers(0, 65536, (4, 3, 4), dtype=np.uint16)),
        Image("one", rng.integers(0, 256, (1, 1, 4), dtype=np.uint8)),
    )

    def dressed(p: Primitive) -> Primitive:
        n = len(p.positions)
        return replace(
            p,
            uv0=rng.uniform(-2, 3, (n, 2)).astype(np.float32),
            uv1=rng.uniform(-1, 1, (n, 2)).astype(np.float32) if n % 2 == 0 else None,
            alphas=rng.uniform(0.4, 1, n).astype(np.float32),
        )

    turned = Texture(0, 0, ("mirror", "clamp"), (0.25, -0.5), 0.7, (1.5, -0.75))
    looks: list[dict[str, Any]] = [
        {"base_color_texture": Texture(0), "alpha_cutoff": 0.3, "alpha": 0.9},
        {"base_color_texture": turned, "metallic_roughness_texture": Texture(1, 1)},
        {"emissive_texture": Texture(1, wrap=("clamp", "mirror")), "emissive": (1.0, 0.5, 2.0)},
        {"base_color_texture": Texture(2, 1), "unlit": True},
        {"alpha_cutoff": 0.7, "double_sided": True},
    ]
    materials = tuple(replace(m, **looks[i % 5]) for i, m in enumerate(scene.materials))
    meshes = tuple(Mesh(m.name, tuple(dressed(p) for p in m.primitives)) for m in scene.meshes)
    return replace(scene, meshes=meshes, materials=materials, images=images)


def soup(seed: int) -> Scene:
    """Small, steep and large triangles; half of the vertices lie on pixel centres of FLAT."""
    rng = np.random.default_rng(seed)
    count = 240
    size = 2.0 ** rng.uniform(-3, 3, (count, 1, 1))
    positions = rng.uniform(-9, 9, (count, 1, 3)) + size * rng.normal(size=(count, 3, 3))
    positions[:, :, 2] = positions[:, :, 2] / 4 - 3
    positions[: count // 2, :, :2] = np.floor(positions[: count // 2, :, :2])
    positions[: count // 4, :, 2] = np.round(positions[: count // 4, :, 2])
    positions[20:40] = positions[:20]  # coplanar: the lower id is seen
    # Steep slivers that snapping moves onto a pixel centre, which they miss: a depth is clamped.
    thin = positions[-40:]
    thin[:, :, :2] = np.floor(rng.uniform(-9, 9, (40, 1, 2)))
    thin[:, :, 0] += [0.0006, 0.004, 0.0006]
    thin[:, :, 1] += [-2.0, -2.0, 3.0]
    thin[:, :, 2] = rng.uniform(-2, -1, (40, 1)) - [0.0, 5.0, 0.0]
    colors = rng.random((count, 3, 3))
    colors[::2] = colors[::2, :1]
    normals = rng.normal(size=(count, 3, 3))
    normals[::3] = normals[::3, :1]
    parts = [
        Primitive(
            p.reshape(-1, 3).astype(np.float32),
            np.arange(3 * len(p), dtype=np.int32).reshape(-1, 3),
            i % 2,
            normals=n.reshape(-1, 3).astype(np.float32) if i != 1 else None,
            colors=c.reshape(-1, 3).astype(np.float32) if i != 2 else None,
        )
        for i, (p, n, c) in enumerate(
            zip(np.split(positions, 4), np.split(normals, 4), np.split(colors, 4))
        )
    ]
    materials = (
        Material("one", metallic=0.5, double_sided=True, roughness=0.0),
        Material("two", reflectivity=(0.5, 0.0, 1.0), emissive=(0.1, 0.0, 0.0)),
    )
    nodes = (Node("a", 0), Node("b", 1), Node("c", 2), Node("d", 3))
    return Scene(tuple(Mesh(n.name, (p,)) for n, p in zip(nodes, parts)), nodes, materials)


FLAT = View((0.0, 0.0, 0.0), (0.0, 0.0, -1.0), orthographic_height=19.0, near=0.5)
DEEP = View((0.0, 0.5, 2.0), (0.3, 0.0, -3.0), fov_y_degrees=120.0, near=3.0, far=7.0)

RENDERS: list[tuple[Callable[[], Scene], View | None, dict[str, Any]]] = [
    (lambda: build("teapot", 2), None, {}),
    (
        varied_scene,
        None,
        {
            "snap": "gpu_vertices",
            "fresnel": True,
            "fallback": "constant",
            "fallback_color": (0.1, 0.2, 0.3),
            "distance_fade": "linear",
        },
    ),
    (varied_scene, ORTHOGRAPHIC, {"back_any_object": True, "edge_fade": False}),
    (varied_scene, INSIDE, {"distance_fade": "published", "edge_power": 1.5, "fresnel": True}),
    (lambda: build("poles", 2), View((1.5, 1.0, 2.0), (0.0, 0.3, 0.0), far=3.5), {}),
    (textured_scene, None, {"buffer_dtype": "float64"}),
    (textured_scene, ORTHOGRAPHIC, {"buffer_dtype": "float64", "fresnel": True}),
    (lambda: soup(1), FLAT, {"buffer_dtype": "float64"}),
    (lambda: soup(2), DEEP, {"buffer_dtype": "float64", "back_any_object": True}),
]


@pytest.mark.parametrize(("scene", "view", "options"), RENDERS)
def test_the_listings_of_the_specification_give_the_same_bytes(
    scene: Callable[[], Scene], view: View | None, options: dict[str, Any]
) -> None:
    frame = ssr_ref.render(scene(), view, Settings(size=(33, 19), **options))
    space = listings("specification.md", "def to_view")
    if view in (FLAT, DEEP):
        assert frame.gbuffer.counts.zero_area > 0
        assert (frame.gbuffer.counts.clamped_depths > 0) == (view is FLAT)
    images = draw_by_listing(space, frame) | resolve_by_listing(space, frame)
    stored = frame.gbuffer.arrays() | frame.resolved.arrays()
    for name, image in images.items():
        assert np.array(image, stored[name].dtype).tobytes() == stored[name].tobytes(), name


def test_the_listings_of_transforms() -> None:
    """World positions and normals of every vertex, one node mirrored and sheared by its scale."""
    scene = varied_scene()
    flat = geometry.flatten(scene)
    space = listings("specification.md", "def to_view")
    v = 0
    for node in scene.nodes:
        m = node.world_from_mesh.tolist()
        for primitive in scene.meshes[node.mesh].primitives:
            for i, p in enumerate(primitive.positions.tolist()):
                assert space["transform"](m, p) == tuple(flat.positions_ws[v + i])
                if primitive.normals is not None:
                    n = primitive.normals[i].tolist()
                    assert space["vertex_normal_ws"](m, n) == tuple(flat.normals_ws[v + i])
            v += len(primitive.positions)


# ---- Worked examples ---------------------------------------------------------------------------


def number(value: float) -> str:
    return f"{value:.10g}"


def vector(values: Any) -> str:
    return "(" + ", ".join(number(float(v)) for v in values) + ")"


def matrix(m: Any) -> list[str]:
    return ["    [" + ", ".join(f"{number(float(v)):>13}" for v in row) + "]" for row in m]


def conventions_example() -> str:
    """One world point through the camera, by the package and by matrices."""
    size = (64, 36)
    pose = camera.look_at((0.0, 3.0, 4.0), (0.0, 0.0, 0.0))
    cam = Camera.physical(pose, 24.0, 24.0, 64 / 36, near=0.125)
    view = cam.params(size)
    space = listings("specification.md", "def to_view")
    p_ws = (0.5, 0.25, -0.75)
    p_vs = space["to_view"](view, p_ws)
    x, y, w = space["clip_xyw"](view, p_vs)
    px = view.width * 0.5 + x / w * (view.width * 0.5)
    py = view.height * 0.5 - y / w * (view.height * 0.5)

    view_from_world = transforms.rigid_inverse(pose)
    clip_from_world = transforms.multiply(cam.clip_from_view, view_from_world)
    homogeneous = [
        row[0] * p_ws[0] + row[1] * p_ws[1] + row[2] * p_ws[2] + row[3]
        for row in clip_from_world.tolist()
    ]
    ndc = [v / homogeneous[3] for v in homogeneous[:3]]
    by_matrix = ((0.5 + ndc[0] * 0.5) * size[0], (0.5 - ndc[1] * 0.5) * size[1])
    assert np.allclose(by_matrix, (px, py), rtol=0.0, atol=1e-12)

    d3d = cam.clip_from_view.copy()
    d3d[2] = (d3d[2] + d3d[3]) / 2.0
    reversed_z = d3d.copy()
    reversed_z[2] = d3d[3] - d3d[2]
    device = [float(m[2, 2] * p_vs[2] + m[2, 3]) / w for m in (d3d, reversed_z)]
    assert np.allclose((cam.near / (1.0 - device[0]), cam.near / device[1]), w, rtol=1e-12)
    accepted = Camera.from_matrices(pose, reversed_z * 3.0, near=cam.near)
    assert np.allclose(accepted.clip_from_view, cam.clip_from_view, rtol=1e-15)

    lines = [
        "world_from_view (camera.json)",
        *matrix(pose),
        "clip_from_view (camera.json)",
        *matrix(cam.clip_from_view),
        f"fx, fy, cx, cy      {vector((view.fx, view.fy, view.cx, view.cy))} px",
        "",
        "by the package",
        f"  p_ws              {vector(p_ws)}",
        f"  p_vs = R(p - eye) {vector(p_vs)}",
        f"  depth = -z        {number(-p_vs[2])}",
        f"  clip (x, y, w)    {vector((x, y, w))}",
        f"  ndc (x, y)        {vector((x / w, y / w))}",
        f"  px                {vector((px, py))}",
        f"  snapped, 1/256 px {space['snap'](view, False, x, y, w)}",
        f"  pixel             ({math.floor(px)}, {math.floor(py)})",
        f"  uv                {vector((px / size[0], py / size[1]))}",
        "",
        "by a GL-style matrix",
        "view_from_world",
        *matrix(view_from_world),
        "clip_from_world = clip_from_view view_from_world",
        *matrix(clip_from_world),
        f"  clip (x, y, z, w) {vector(homogeneous)}",
        f"  ndc (x, y, z)     {vector(ndc)}",
        f"  px                {vector(by_matrix)}",
        "",
        "device depth of the point",
        f"  OpenGL z_ndc      {number(ndc[2])}    depth = 2 near / (1 - z_ndc)",
        f"  [0, 1]            {number(device[0])}    depth = near / (1 - d)",
        f"  reversed          {number(device[1])}    depth = near / d",
    ]
    return "\n".join(lines)


class Reads(list[Any]):
    """A row of the front depths that notes which columns are read."""

    def __init__(self, row: list[float], y: int, events: list[Any]) -> None:
        super().__init__(row)
        self.y, self.events = y, events

    def __getitem__(self, x: Any) -> Any:
        self.events.append(("pixel", x, self.y))
        return super().__getitem__(x)


PIXEL = (10, 26)


def dda_example() -> str:
    """One pixel's walk: DDA at stride 1, exact cells, DDA at stride 4 with its re-walk."""
    scene = build("teapot")
    frame = ssr_ref.render(scene, None, Settings(size=(64, 36)))
    x, y = PIXEL
    space = listings("dda.md", "def trace_pixel")
    g, view = frame.gbuffer, frame.camera.params((64, 36))
    assert g.normal_vs is not None
    assert g.geo_normal_vs is not None
    assert g.back_depth is not None
    assert g.object_id is not None
    normal, geo = g.normal_vs[y, x].tolist(), g.geo_normal_vs[y, x].tolist()
    depth = float(g.depth[y, x])
    chosen = frame.settings
    _, ray = space["set_up_ray"](view, x, y, depth, normal, geo, chosen.max_distance)
    d = space["ray_through"](view, x + 0.5, y + 0.5)
    r = space["normalize"](space["reflect"](space["normalize"](d), space["normalize"](normal)))
    lines = [
        f"camera    fx = fy = {number(view.fx)}, cx = {number(view.cx)}, cy = {number(view.cy)}, "
        f"near = {number(view.near)}",
        f"settings  thickness = {number(chosen.thickness or 0.0)}, bias = {number(chosen.bias)}, "
        f"max_distance = {number(chosen.max_distance or 0.0)}",
        "",
        f"pixel     {PIXEL}, P0 = {vector((ray.p0_x, ray.p0_y))}, "
        f"object {int(g.object_id[y, x])} ({scene.nodes[int(g.object_id[y, x])].name})",
        f"depth     {depth!r}",
        f"normal    {vector(normal)} = geometric normal",
        f"d         {vector(d)}",
        f"O         {vector(ray.origin)}",
        f"R         {vector(r)}",
        f"bound     {End(ray.end).name}, S = {number(ray.s_end)}",
        f"dP        {vector((ray.dp_x, ray.dp_y))}",
        f"k0, dk    {ray.k0!r}, {ray.dk!r}",
    ]
    for title, options in (
        ("DDA, stride 1", {}),
        ("exact cells", {"tracer": "cells"}),
        ("DDA, stride 4: the first interval is re-walked", {"stride": 4}),
    ):
        lines += ["", title, *walk_lines(scene, space, options)]
    return "\n".join(lines)


def walk_lines(scene: Scene, space: Space, options: dict[str, Any]) -> list[str]:
    """A table of every slab test of one walk, and its outcome as the package gives it."""
    x, y = PIXEL
    frame = ssr_ref.render(scene, None, Settings(size=(64, 36), **options))
    g, hits = frame.gbuffer, frame.hits
    assert g.geo_normal_vs is not None
    assert g.normal_vs is not None
    assert g.back_depth is not None
    assert g.reflectivity is not None
    view = frame.camera.params((64, 36))
    events: list[Any] = []
    noted = dict(space)
    for block in re.findall(r"```python\n(.*?)```", page("dda.md"), re.DOTALL):
        if "def trace_pixel" in block:
            exec(block, noted)
    depth_at, compare = noted["depth_at"], noted["compare_with_slab"]

    def noted_depth_at(ray: Any, s: float) -> Any:
        events.append(("s", s))
        return depth_at(ray, s)

    def noted_compare(z_a: float, z_b: float, low: float, back: float) -> Any:
        verdict = compare(z_a, z_b, low, back)
        (a, b) = [event[1] for event in events if event[0] == "s"][-2:]
        cell = [event[1:] for event in events if event[0] == "pixel"][-1]
        events.append(("test", cell, a, b, z_a, z_b, low, back, verdict))
        return verdict

    noted["depth_at"], noted["compare_with_slab"] = noted_depth_at, noted_compare
    buffers = SimpleNamespace(
        depth=g.depth.tolist(),
        normal=g.normal_vs.tolist(),
        geo_normal=g.geo_normal_vs.tolist(),
        reflectivity=g.reflectivity.tolist(),
        back=g.back_depth.tolist(),
    )
    front = noted["prepare_targets"](view, buffers.depth, buffers.geo_normal)
    front = [Reads(row, i, events) for i, row in enumerate(front)]
    out = noted["trace_pixel"](view, buffers, front, listing_settings(frame), x, y)

    columns = ("pixel", "s from", "s to", "ray depth", "ray depth", "front", "back")
    lines = ["  " + "".join(f"{c:>13}" for c in columns) + "  verdict"]
    for event in events:
        if event[0] == "test":
            _, cell, a, b, z_a, z_b, low, back, verdict = event
            shown = [f"{v:.8f}" for v in (a, b, z_a, z_b, low)]
            shown.append("none" if math.isinf(buffers.back[cell[1]][cell[0]]) else f"{back:.8f}")
            name = ("miss", "behind", "in slab")[verdict]
            lines.append("  " + "".join(f"{c:>13}" for c in (str(cell), *shown)) + f"  {name}")
    assert (out.hit_px, out.steps, out.fetches) == (
        tuple(hits.hit_px[y, x]),
        hits.steps[y, x],
        hits.fetches[y, x],
    )
    lines += [
        f"  {Status(int(hits.status[y, x])).name}, flags {int(hits.flags[y, x])}, "
        f"steps {int(hits.steps[y, x])}, fetches {int(hits.fetches[y, x])}",
        f"  hit_px ({float(hits.hit_px[y, x, 0])!r}, {float(hits.hit_px[y, x, 1])!r})",
        f"  hit_depth {float(hits.hit_depth[y, x])!r}, residual "
        f"{float(hits.residual[y, x])!r}, length {float(hits.length[y, x])!r}",
    ]
    return lines


EXAMPLES: dict[str, tuple[str, Callable[[], str]]] = {
    "conventions": ("conventions.md", conventions_example),
    "dda": ("dda.md", dda_example),
}


def example_pattern(name: str) -> re.Pattern[str]:
    return re.compile(rf"(<!-- example: {name} -->\n```text\n)(.*?)(\n?```)", re.DOTALL)


@pytest.mark.parametrize("name", sorted(EXAMPLES))
def test_worked_examples(name: str) -> None:
    where, make = EXAMPLES[name]
    found = example_pattern(name).search(page(where))
    assert found is not None
    assert found.group(2) == make(), "python tests/test_docs.py writes the examples anew"


# ---- Links -------------------------------------------------------------------------------------


def test_relative_links_point_to_files() -> None:
    pages = [*sorted(DOCS.glob("*.md")), *(p for p in [ROOT / "README.md"] if p.exists())]
    assert len(pages) >= 6
    for path in pages:
        for target in re.findall(r"\]\(([^)\s]+)\)", path.read_text(encoding="utf-8")):
            if not re.match(r"[a-z]+:", target):
                assert (path.parent / target.split("#")[0]).exists(), f"{path.name}: {target}"


def test_the_index_names_every_page() -> None:
    index = page("README.md")
    for path in DOCS.glob("*.md"):
        assert path.name == "README.md" or f"]({path.name})" in index, path.name


def write_examples() -> None:
    for name, (where, make) in EXAMPLES.items():
        text = make()
        body = example_pattern(name).sub(lambda m, t=text: m[1] + t + "\n```", page(where))
        (DOCS / where).write_text(body, encoding="utf-8")
        print(f"{where}:\n{text}\n")


if __name__ == "__main__":
    sys.exit(write_examples())
