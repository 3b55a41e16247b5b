"""Planar mirrors: which triangles become mirrors, and what is refused with which reason."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from raster_drawing import objects, quad
from tracing import MATT, MIRROR

from ssr_ref import Material, Primitive, Scene, transforms
from ssr_ref.planar import find_mirrors
from ssr_ref.planar.find import MAX_MIRRORS
from ssr_ref.raster.geometry import flatten
from ssr_ref.scenes import build, shapes


def found_in(scene: Scene, **options: Any) -> Any:
    return find_mirrors(scene, flatten(scene), **options)


def test_a_box_is_six_mirrors_and_its_split_faces_are_one_each() -> None:
    scene = objects([(shapes.box((-1, -2, -3), (1, 2, 3)), None)], (MIRROR,))
    found = found_in(scene)
    assert not found.refused
    assert [tuple(m.triangles) for m in found.mirrors] == [
        (0, 1), (2, 3), (4, 5), (6, 7), (8, 9), (10, 11)
    ]  # fmt: skip  # by area: ±x 4·6, ±y 2·6, ±z 2·4
    normals = np.abs([m.normal_ws for m in found.mirrors])
    np.testing.assert_array_equal(normals.max(axis=1), 1.0)


def test_one_plane_over_several_objects_is_one_mirror() -> None:
    tile = quad((0, 0, 0), (1, 0, 0), (1, 0, -1), (0, 0, -1))
    places = [transforms.translation(x, 0.5, 0) for x in (0, 1, 3)]
    places[1] = transforms.multiply(places[1], transforms.scaling(2, 1, 1))  # the largest
    higher = transforms.translation(0, 0.5 + 2.0**-16, 5)
    scene = objects([(tile, p) for p in [*places, higher]], (MIRROR,))
    first, second = found_in(scene).mirrors
    assert tuple(first.triangles) == (0, 1, 2, 3, 4, 5)
    assert tuple(second.triangles) == (6, 7)
    assert first.point_ws[1] == 0.5 and first.normal_ws == (0.0, 1.0, 0.0) and first.offset == -0.5


@pytest.mark.parametrize(
    ("material", "reflects"),
    [
        (MIRROR, True),
        (MATT, False),
        (replace(MIRROR, roughness=0.5), True),
        (replace(MIRROR, roughness=0.51), False),
        (replace(MATT, reflectivity=(0.0, 0.1, 0.0), roughness=0.0), True),
        (replace(MIRROR, reflectivity=(0.0, 0.0, 0.0)), False),
        (replace(MIRROR, base_color=(0.0, 0.0, 0.0)), False),
    ],
)
def test_only_what_reflects_is_a_mirror(material: Material, reflects: bool) -> None:
    tile = quad((0, 0, 0), (1, 0, 0), (1, 0, -1), (0, 0, -1))
    scene = objects([(tile, None)], (material,))
    assert len(found_in(scene).mirrors) == reflects
    smooth = replace(material, roughness=min(material.roughness, 0.5), reflectivity=None)
    assert len(found_in(objects([(tile, None)], (smooth,)), fresnel=True).mirrors) == 1


def test_a_curved_object_is_refused_with_its_price() -> None:
    """A prism of 17 sides and 3 other objects: 17 planes, 17 × 4 draws; 16 sides are mirrors."""
    tile = quad((9, 0, 0), (10, 0, 0), (10, 0, -1), (9, 0, -1))

    def scene(sides: int) -> Scene:
        angle = 2 * np.pi * np.arange(sides + 1) / sides
        x, z = np.cos(angle), np.sin(angle)
        quads = [
            quad((x[i], 0, z[i]), (x[i], 1, z[i]), (x[i + 1], 1, z[i + 1]), (x[i + 1], 0, z[i + 1]))
            for i in range(sides)
        ]
        matt = replace(tile, material=1)
        return objects([(quads, None), (matt, None), (matt, None), (matt, None)], (MIRROR, MATT))

    assert len(found_in(scene(15)).mirrors) == 15
    assert len(found_in(scene(16)).mirrors) == MAX_MIRRORS
    found = found_in(scene(17))
    assert found.mirrors == ()
    (refusal,) = found.refused
    assert (refusal.object_id, refusal.triangles, refusal.planes) == (0, 34, 17)
    assert refusal.draws == 17 * 4
    assert "curved or faceted" in refusal.reason and "17 × 4 = 68 draws" in refusal.reason
    assert len(found_in(scene(17), max_mirrors=17).mirrors) == 17


def test_the_teapot_is_refused_and_its_floor_is_not() -> None:
    found = found_in(build("teapot", 4))
    assert len(found.mirrors) >= 1
    assert all("curved" in r.reason for r in found.refused)


def test_bent_shading_normals_are_refused() -> None:
    """Flat, but one vertex normal leans by 1e-3: its two triangles are left out, the rest stay."""
    p = np.array([(x, 0, -z) for z in range(3) for x in range(3)], np.float32)
    faces = shapes.split_quads([[0, 1, 4, 3], [1, 2, 5, 4], [3, 4, 7, 6], [4, 5, 8, 7]])
    up = np.tile(np.array([0, 1, 0], np.float32), (9, 1))
    down = -up
    bent = up.copy()
    bent[0] = (1e-3, 1, 0)  # a corner: of triangles 0 and 1
    for normals, kept in ((up, 8), (down, 8), (bent, 6)):
        found = found_in(objects([(Primitive(p, faces, 0, normals=normals), None)], (MIRROR,)))
        (mirror,) = found.mirrors
        assert len(mirror.triangles) == kept
        assert len(found.refused) == (kept < 8)
    assert found.refused[0].triangles == 2 and "shading normals" in found.refused[0].reason


def test_vertices_off_the_plane() -> None:
    """Within 2⁻²⁰ of the radius a quad is flat, beyond it is two planes; the radius, half the
    diagonal 4·√2 as a power of two, is 8.
    """
    for lift, planes in ((2.0**-18, 1), (2.0**-16, 2)):
        tile = quad((-4, 0, 4), (4, 0, 4), (4, lift, -4), (-4, 0, -4))
        assert len(found_in(objects([(tile, None)], (MIRROR,))).mirrors) == planes


def test_triangles_that_cannot_be_seen_are_no_mirrors() -> None:
    bad = quad((np.nan, 0, 0), (1, 0, 0), (1, 0, -1), (0, 0, -1))
    line = quad((0, 0, 0), (1, 0, 0), (2, 0, 0), (3, 0, 0))
    good = quad((0, 1, 0), (1, 1, 0), (1, 1, -1), (0, 1, -1))
    scene = objects([((bad, line, good), None)], (MIRROR,))
    (mirror,) = found_in(scene).mirrors
    assert tuple(mirror.triangles) == (4, 5)
