"""What a truth point is to the camera: its class, and the side that it lies off screen on.

One order for meshes and closed forms: OFF_SCREEN, then BACK_FACING, then OCCLUDED, then VISIBLE.
How the last two differ is the caller's: triangles are looked up in the G-buffer, closed forms cast
a ray.
"""

from __future__ import annotations

from .._jit import kernel
from ..buffers import Side, TruthClass
from ..camera import ViewParams

NONE, BEHIND, BEYOND = int(Side.NONE), int(Side.BEHIND), int(Side.BEYOND)
LEFT, RIGHT, TOP, BOTTOM = int(Side.LEFT), int(Side.RIGHT), int(Side.TOP), int(Side.BOTTOM)

NO_RAY, NOTHING = int(TruthClass.NO_RAY), int(TruthClass.NOTHING)
OFF_SCREEN, BACK_FACING = int(TruthClass.OFF_SCREEN), int(TruthClass.BACK_FACING)
OCCLUDED, VISIBLE = int(TruthClass.OCCLUDED), int(TruthClass.VISIBLE)


@kernel
def side_of(view: ViewParams, px: float, py: float, depth: float) -> int:
    """`Side` of a point at pixel coordinates (px, py) and view depth; NONE if it is on screen.

    Depth decides first: behind the eye there are no pixel coordinates. An integer coordinate
    belongs to the higher pixel, so W and H are outside.
    """
    if not depth >= view.near:
        return BEHIND
    if depth > view.far:
        return BEYOND
    if px < 0.0:
        return LEFT
    if not px < view.width:
        return RIGHT
    if py < 0.0:
        return TOP
    return NONE if py < view.height else BOTTOM


@kernel
def class_of(side: int, faces_away: bool, seen: bool) -> int:
    """`TruthClass` of a point that a ray met."""
    if side != NONE:
        return OFF_SCREEN
    if faces_away:
        return BACK_FACING
    return VISIBLE if seen else OCCLUDED
