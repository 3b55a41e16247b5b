"""Small pictures of built-in scenes, for tests: who is seen, and who is seen in a mirror."""

from __future__ import annotations

from functools import cache

import numpy as np

from ssr_ref import scenes
from ssr_ref.buffers import Status
from ssr_ref.pipeline import Frame, render
from ssr_ref.scene import Scene
from ssr_ref.settings import Settings

SIZE = (96, 54)


@cache
def frame(name: str, tessellation: int = 6) -> Frame:
    """A small picture of a scene with the default settings."""
    return render(scenes.build(name, tessellation), settings=Settings(size=SIZE))


def objects(scene: Scene) -> dict[str, int]:
    return {node.name: i for i, node in enumerate(scene.nodes)}


def hit_objects(picture: Frame) -> np.ndarray:
    """(H, W) object that a pixel's ray hit, −1 where it hit nothing."""
    ids = picture.gbuffer.object_id
    assert ids is not None
    found = np.full(ids.shape, -1)
    hit = picture.hits.status == Status.HIT
    x, y = np.floor(picture.hits.hit_px[hit]).astype(int).T
    found[hit] = ids[np.minimum(y, ids.shape[0] - 1), np.minimum(x, ids.shape[1] - 1)]
    return found
