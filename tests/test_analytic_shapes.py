"""Shapes and scenes as data: what is refused, bounds, numbers, JSON and hash."""

from __future__ import annotations

import json
from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
from closed_form import MATT, MIRROR, scene_of

from ssr_ref import SsrRefError, Texture, transforms
from ssr_ref.analytic import AnalyticScene, Box, Disc, Plane, Sphere
from ssr_ref.analytic.arrays import BOX, DISC, PLANE, SPHERE, shape_arrays
from ssr_ref.analytic.scene_json import scene_from_json, scene_to_json
from ssr_ref.analytic.scenes import SCENES, grazing_floor

TURN = transforms.from_quaternion(0.0, 0.6, 0.0, 0.8)
SKEWED = TURN.copy()
SKEWED[0, 0] += 1e-9


@pytest.mark.parametrize(
    ("make", "word"),
    [
        (lambda: Sphere((0, 0, np.nan), 1.0, name="s"), "'s' has center"),
        (lambda: Sphere((0, 0), 1.0), "three finite numbers"),  # type: ignore[arg-type]
        (lambda: Sphere((0, 0, 0), 0.0), "radius 0"),
        (lambda: Sphere((0, 0, 0), np.inf), "radius inf"),
        (lambda: Plane((0, 0, 0), (0, 0, 0)), "not zero"),
        (lambda: Plane((0, np.inf, 0), (0, 1, 0)), "point"),
        (lambda: Disc((0, 0, 0), (0, np.nan, 0), 1.0), "normal"),
        (lambda: Disc((0, 0, 0), (0, 1, 0), -1.0), "radius -1"),
        (lambda: Box((1, 0, 1)), "above 0"),
        (lambda: Box((1, 1, 1), np.eye(3)), "4 × 4"),
        (lambda: Box((1, 1, 1), 2.0 * np.eye(4)), "last row"),
        (lambda: Box((1, 1, 1), transforms.scaling(2.0, 1.0, 1.0)), "expected a rotation"),
        (lambda: Box((1, 1, 1), SKEWED), "expected a rotation"),
        (lambda: AnalyticScene(()), "no shape"),
        (lambda: AnalyticScene((MIRROR,)), "holds a Material"),  # type: ignore[arg-type]
        (lambda: scene_of(Sphere((0, 0, 0), 1.0, material=3)), "material 3 of 3"),
        (lambda: AnalyticScene((Plane((0, 0, 0), (0, 1, 0)),),
                               (replace(MATT, base_color_texture=Texture(0)),)), "texture"),
        (lambda: AnalyticScene((Plane((0, 0, 0), (0, 1, 0)),),
                               (replace(MATT, alpha_cutoff=0.5),)), "alpha mask"),
        (lambda: grazing_floor(90.0), "less than 90"),
        (lambda: scene_from_json({"format": "other"}), "not a closed-form scene"),
        (lambda: scene_from_json({**scene_to_json(scene_of(Sphere((0, 0, 0), 1.0))),
                                  "shapes": [{"type": "torus"}]}), "'torus'"),
        (lambda: scene_from_json({**scene_to_json(scene_of(Sphere((0, 0, 0), 1.0))),
                                  "shapes": [{"type": "sphere", "radios": 1}]}), "incomplete"),
    ],
)  # fmt: skip
def test_what_cannot_be_used_is_refused_in_one_line(make: Callable[[], object], word: str) -> None:
    with pytest.raises(SsrRefError) as caught:
        make()
    assert word in str(caught.value)
    assert "expected" in str(caught.value) or "use factors" in str(caught.value)
    assert "\n" not in str(caught.value)


def test_bounds() -> None:
    """By hand. The box is turned by the 3-4-5 angle: cos 0.28, sin 0.96 about y."""
    low, high = Sphere((1, 2, 3), 0.5).bounds()
    assert low.tolist() == [0.5, 1.5, 2.5] and high.tolist() == [1.5, 2.5, 3.5]
    low, high = Disc((1, 1, 1), (0, 0, 3), 2.0).bounds()
    assert low.tolist() == [-1, -1, 1] and high.tolist() == [3, 3, 1]
    low, high = Disc((0, 0, 0), (3, 4, 0), 5.0).bounds()  # reach r·√(1 − n²) = 4, 3, 5
    assert np.allclose(high, (4, 3, 5), rtol=1e-15) and np.array_equal(low, -high)
    low, high = Plane((1, 2, 3), (0, 1, 0)).bounds()
    assert low.tolist() == high.tolist() == [1, 2, 3]
    pose = transforms.multiply(transforms.translation(0, 0.5, 0), TURN)
    low, high = Box((0.5, 0.5, 0.25), pose).bounds()
    reach = (0.28 * 0.5 + 0.96 * 0.25, 0.5, 0.96 * 0.5 + 0.28 * 0.25)
    assert np.allclose(high, (reach[0], 1.0, reach[2]), rtol=1e-14)
    assert np.allclose(low, (-reach[0], 0.0, -reach[2]), rtol=1e-14, atol=1e-16)


def test_radius_is_the_power_of_two_nearest_to_half_the_diagonal() -> None:
    """√3 · 3 = 5.2: in log nearer to 4 than to 8. A lone plane counts as radius 1."""
    assert scene_of(Box((3, 3, 3))).radius() == 4.0
    assert scene_of(Plane((0, 5, 0), (0, 1, 0))).radius() == 1.0
    assert scene_of(Sphere((0, 0, 0), 0.5), Plane((0, -16, 0), (0, 1, 0))).radius() == 8.0


def test_surfaces_are_numbered_through_the_scene() -> None:
    shapes = (
        Plane((0, 0, 0), (0, 2, 0)),
        Box((1, 2, 3), TURN),
        Sphere((4, 5, 6), 7),
        Box((1, 1, 1)),
        Disc((0, 0, 0), (3, 0, 4), 2.0, 2),
    )
    scene = scene_of(*shapes)
    arrays = shape_arrays(scene.shapes, scene.materials)
    assert scene.triangle_count == 15
    assert arrays.kind.tolist() == [PLANE, BOX, SPHERE, BOX, DISC]
    assert arrays.surface.tolist() == [0, 1, 7, 8, 14]
    assert arrays.double_sided.tolist() == [False, False, False, False, True]
    assert arrays.size.tolist() == [[0, 0, 0], [1, 2, 3], [7, 0, 0], [1, 1, 1], [2, 0, 0]]
    assert arrays.axes[2].tolist() == [0, 1, 0]  # unit, though given with length 2
    assert np.allclose(arrays.axes[14], (0.6, 0, 0.8), rtol=1e-16)
    assert np.allclose(arrays.axes[3:6], TURN[:3, :3].T, rtol=1e-15, atol=0.0)


def test_between_gives_corners_back() -> None:
    low, high = Box.between((-1.0, 0.0, 2.0), (0.5, 3.0, 2.5)).bounds()
    assert low.tolist() == [-1.0, 0.0, 2.0] and high.tolist() == [0.5, 3.0, 2.5]


def test_a_scene_does_not_follow_its_caller_s_arrays() -> None:
    pose = np.eye(4)
    box = Box((1, 1, 1), pose)
    pose[0, 3] = 7.0
    assert box.world_from_box[0, 3] == 0.0
    with pytest.raises(ValueError, match="read-only"):
        box.world_from_box[0, 3] = 7.0


@pytest.mark.parametrize("name", SCENES)
def test_json_gives_the_same_bits_back(name: str) -> None:
    scene = SCENES[name]()
    text = json.dumps(scene_to_json(scene), allow_nan=False)
    again = scene_from_json(json.loads(text))
    assert again.content_sha256() == scene.content_sha256()
    assert json.dumps(scene_to_json(again)) == text


def test_json_keeps_a_materials_own_thickness() -> None:
    plain = scene_of(Sphere((0, 0, 0), 1.0))
    first = replace(plain.materials[0], thickness=0.1)
    scene = replace(plain, materials=(first, *plain.materials[1:]))
    again = scene_from_json(json.loads(json.dumps(scene_to_json(scene))))
    assert again.materials == scene.materials
    assert again.content_sha256() == scene.content_sha256() != plain.content_sha256()
    assert again.materials == scene.materials


def test_the_hash_sees_what_is_drawn_and_no_names() -> None:
    ball = Sphere((0.0, 0.0, 0.0), 1.0)
    scene = scene_of(ball)
    same = replace(scene, shapes=(replace(ball, name="other"),), name="other", notes=("a",))
    assert same.content_sha256() == scene.content_sha256()
    others = [
        replace(scene, shapes=(replace(ball, radius=np.nextafter(1.0, 2.0)),)),
        replace(scene, shapes=(replace(ball, material=1),)),
        replace(scene, shapes=(Disc((0, 0, 0), (0, 0, 1), 1.0),)),
        replace(scene, materials=(MATT, MATT, MATT)),
        scene.with_lights(replace(scene.lights, ambient=(0.5, 0.5, 0.5))),
    ]
    hashes = {s.content_sha256() for s in [scene, *others]}
    assert len(hashes) == 1 + len(others)
