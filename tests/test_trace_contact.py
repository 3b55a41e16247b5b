"""Where an object stands on a mirror, its reflection touches it (cases.md 2); and a flat mirror
against the closed form: position, left and right, upside down.

Truth: a floor pixel's ray is turned over (y to −y) and met with the convex body, given as the
planes of its faces. A true hit is visible if its face looks at the eye.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
import pytest
from tracing import draw, flat, on_floor, resolved, to_view, turned, window_of

from ssr_ref import transforms
from ssr_ref.buffers import Status
from ssr_ref.camera import Camera, View, ViewParams, look_at
from ssr_ref.pipeline import render
from ssr_ref.scene import Lights, Material, Mesh, Node, Primitive, Scene
from ssr_ref.scenes import shapes
from ssr_ref.ssr.trace import trace

BALL = flat(shapes.sphere(0.5, 8))
BOX = shapes.box((-0.5, 0.0, -0.5), (0.5, 1.0, 0.5))


class Mirrored(NamedTuple):
    """Closed form of each pixel of a mirror floor: where its reflection shows the body."""

    px: np.ndarray  # (H, W, 2), NaN where the reflected ray misses the body
    visible: np.ndarray  # (H, W): met on a face that the camera sees


def mirrored(view: ViewParams, body: Primitive, pose: np.ndarray) -> Mirrored:
    """The reflection of a convex body in the plane y = 0."""
    x, y = np.meshgrid(np.arange(view.width) + 0.5, np.arange(view.height) + 0.5)
    axes = np.array(
        [
            [view.right_x, view.right_y, view.right_z],
            [view.up_x, view.up_y, view.up_z],
            [view.back_x, view.back_y, view.back_z],
        ]
    )
    ndc = np.stack([2 * x / view.width - 1, 1 - 2 * y / view.height], axis=2)
    offset, scale = np.array([view.offset_x, view.offset_y]), np.array([view.p00, view.p11])
    eye = np.array([view.eye_x, view.eye_y, view.eye_z])
    ones = np.ones((*x.shape, 1))
    if view.perspective:
        way = np.concatenate([(ndc + offset) / scale, -ones], axis=2) @ axes
        start = np.broadcast_to(eye, way.shape)
    else:
        way = np.broadcast_to(-axes[2], (*x.shape, 3))
        start = eye + np.concatenate([(ndc - offset) / scale, 0 * ones], axis=2) @ axes
    with np.errstate(all="ignore"):
        o = start - (start[..., 1:2] / way[..., 1:2]) * way
        r = way * [1, -1, 1]
        # Convex body: behind all planes n·p ≤ c. Entering at the last plane met from the front.
        p = body.positions.astype(float) @ pose[:3, :3].T + pose[:3, 3]
        a, b, c = (p[body.faces[:, i]] for i in range(3))
        n = np.cross(b - a, c - a)
        n /= np.linalg.norm(n, axis=1, keepdims=True)
        height = np.einsum("hwk,fk->hwf", o, n) - (n * a).sum(axis=1)
        slope = np.einsum("hwk,fk->hwf", r, n)
        t = -height / slope
        enter_t = np.where(slope < 0, t, -np.inf)
        entered = enter_t.argmax(axis=2)
        enter = enter_t.max(axis=2)
        leave = np.where(slope > 0, t, np.inf).min(axis=2)
        met = (enter > 0) & (enter < leave)
        hit = o + enter[..., None] * r
        seen_from = hit - eye if view.perspective else way
        facing = (n[entered] * seen_from).sum(axis=2) < 0
        px = np.where(met[..., None], window_of(view, to_view(view, hit)), np.nan)
        inside = (px >= 0).all(axis=2) & (px[..., 0] < view.width) & (px[..., 1] < view.height)
    return Mirrored(px, met & facing & inside)


def gaps(view: ViewParams, body: Primitive, pose: np.ndarray, **kw: Any) -> list[int]:
    """For each column: floor pixels below the body, with a visible reflection of it, before the
    first whose hit is within 1 px of the true one in x and in y."""
    gbuffer = draw(view, on_floor(body, pose))
    hits = trace(view, gbuffer, resolved((view.width, view.height), **kw))
    truth = mirrored(view, body, pose)
    with np.errstate(invalid="ignore"):
        good = (hits.status == Status.HIT) & (np.abs(hits.hit_px - truth.px).max(axis=2) <= 1.0)
    assert gbuffer.object_id is not None
    out = []
    for x in range(view.width):
        rows = np.flatnonzero(gbuffer.object_id[:, x] == 1)
        if not len(rows):
            continue
        below = np.arange(rows.max() + 1, view.height)
        below = below[(gbuffer.object_id[below, x] == 0) & truth.visible[below, x]]
        if len(below):
            first = np.flatnonzero(good[below, x])
            out.append(int(first[0]) if len(first) else len(below))
    return out


EYES = ((1.5, 0.08, 4.0), (2.5, 0.3, 4.0), (1.0, 1.2, 4.0), (2.0, 3.5, 3.0), (0.0, 0.9, 3.2))
WALKS: tuple[dict[str, Any], ...] = (
    {"tracer": "cells"},
    {"tracer": "cells", "thickness_from": "constant"},
    {"stride": 1},
    {"stride": 1, "thickness_from": "constant"},
    {"stride": 1, "jitter": True, "seed": 4},
    {"stride": 1, "interval": "cell"},
)


@pytest.mark.parametrize("orthographic", [False, True])
@pytest.mark.parametrize("body", ["box", "ball"])
def test_contact_gap_is_at_most_one_pixel(body: str, orthographic: bool) -> None:
    """Eyes from grazing (1° above the floor) to steep, three sizes, the box turned at random."""
    rng = np.random.default_rng(2)
    columns = worst = 0
    import collections
    tally = collections.Counter()
    for eye in EYES:
        for size in ((101, 67), (213, 121), (320, 181)):
            shape = BOX if body == "box" else BALL
            angle = rng.uniform(0, np.pi)
            pose = transforms.from_quaternion(0.0, float(np.sin(angle)), 0.0, float(np.cos(angle)))
            if body == "ball":
                pose[1, 3] = -float(shape.positions[:, 1].astype(float).min())
                pose = transforms.translation(0.0, pose[1, 3], 0.0)
            world = look_at(eye, (0.0, 0.3, 0.0))
            aspect = size[0] / size[1]
            if orthographic:
                camera = Camera.orthographic(world, 2.2, aspect, near=0.01)
            else:
                camera = Camera.perspective(world, 36.0, aspect, near=0.01)
            for kw in WALKS:
                found = gaps(camera.params(size), shape, pose, **kw)
                tally.update(found)
                if max(found)>1: print(eye,size,kw,found)
                columns += len(found)
    print(columns,tally)
