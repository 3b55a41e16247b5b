"""The whole render, one line a stage; each stage returns named buffers."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field

from .buffers import GBuffer, HitBuffer, Resolved
from .camera import Camera
from .scene import Scene
from .settings import Settings

Progress = Callable[[str, float], None]
"""Called with a stage's name and the share of it that is done, 0 to 1."""


@dataclass(frozen=True, slots=True, eq=False)
class Frame:
    """One rendered image with everything that explains it.

    settings are resolved: no length is None. warnings: one line each. timings: seconds a stage.
    """

    scene: Scene
    camera: Camera
    settings: Settings
    gbuffer: GBuffer
    hits: HitBuffer
    resolved: Resolved
    warnings: tuple[str, ...] = ()
    timings: dict[str, float] = field(default_factory=dict)
