"""Images as files hold them, and how a material reads one. Data only."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal, get_args

import numpy as np

from .errors import SceneError
from .typed import AnyArray

WrapName = Literal["repeat", "mirror", "clamp"]
"""What lies beyond [0, 1): the image again, the image mirrored, or its border texel."""

MAX_IMAGE_SIDE = 16384
MAX_IMAGE_PIXELS = 2**26
"""An image of 8192 × 8192 is accepted; anything larger is refused before memory is taken."""


@dataclass(frozen=True, slots=True, eq=False)
class Image:
    """Level 0 of a texture: the file's own codes, not decoded.

    pixels : (H, W, 4) uint8 or uint16, RGBA, row 0 at v = 0; alpha is the greatest code where the
        file has none. Whether the codes are sRGB or linear follows from the use: base colour and
        emission are sRGB with linear alpha, metallic-roughness is linear.

    Raises SceneError for another shape or type, or a side of 0 or over the limits.
    """

    name: str
    pixels: AnyArray

    def __post_init__(self) -> None:
        pixels = np.array(self.pixels, order="C", copy=True)
        if pixels.dtype not in (np.uint8, np.uint16):
            raise SceneError(
                f"image '{self.name}' has {pixels.dtype} pixels; expected uint8 or uint16"
            )
        if pixels.ndim != 3 or pixels.shape[2] != 4:
            raise SceneError(f"image '{self.name}' has shape {pixels.shape}; expected (H, W, 4)")
        check_image_size(self.name, pixels.shape[1], pixels.shape[0])
        pixels.setflags(write=False)
        object.__setattr__(self, "pixels", pixels)

    @property
    def size(self) -> tuple[int, int]:
        """(W, H) in texels."""
        return self.pixels.shape[1], self.pixels.shape[0]


def check_image_size(name: str, width: int, height: int) -> None:
    """Raise SceneError unless an image of this size may be read."""
    good = 1 <= width <= MAX_IMAGE_SIDE and 1 <= height <= MAX_IMAGE_SIDE
    if not good or width * height > MAX_IMAGE_PIXELS:
        raise SceneError(
            f"image '{name}' is {width} × {height}; expected sides of 1 to {MAX_IMAGE_SIDE} and at "
            f"most {MAX_IMAGE_PIXELS} texels: scale it down"
        )


@dataclass(frozen=True, slots=True)
class Texture:
    """How a material reads an image.

    image : index into `Scene.images`.
    uv_set : 0 or 1, the primitive's `uv0` or `uv1`.
    wrap : along u and v.
    offset, rotation, scale : uv' = offset + R·(scale · uv), R turning uv by `rotation` radians
        counter-clockwise as seen with v down: (u, v) → (c·u + s·v, c·v − s·u).
        Source: the glTF extension KHR_texture_transform.

    Level 0 is filtered bilinearly between texel centres, each texel decoded first.
    """

    image: int
    uv_set: int = 0
    wrap: tuple[WrapName, WrapName] = ("repeat", "repeat")
    offset: tuple[float, float] = (0.0, 0.0)
    rotation: float = 0.0
    scale: tuple[float, float] = (1.0, 1.0)

    def __post_init__(self) -> None:
        if self.uv_set not in (0, 1):
            raise SceneError(f"uv_set is {self.uv_set}; expected 0 or 1")
        if len(self.wrap) != 2 or not all(name in get_args(WrapName) for name in self.wrap):
            raise SceneError(
                f"wrap is {self.wrap}; expected two of {', '.join(get_args(WrapName))}"
            )
        object.__setattr__(self, "wrap", tuple(self.wrap))
        for name in ("offset", "scale"):
            pair = tuple(float(v) for v in getattr(self, name))
            if len(pair) != 2 or not np.isfinite(pair).all():
                raise SceneError(f"texture {name} is {pair}; expected two finite numbers")
            object.__setattr__(self, name, pair)
        rotation = float(self.rotation)
        if not abs(rotation) <= 2.0**20:
            raise SceneError(f"texture rotation is {rotation:g}; expected a finite angle (radians)")
        object.__setattr__(self, "rotation", rotation)
