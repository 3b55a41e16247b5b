"""Truth by ray tracing: where every reflected ray really goes, and whether the camera sees it."""

from __future__ import annotations

from typing import TYPE_CHECKING

from ..buffers import GBuffer, Truth
from ..camera import Camera
from ..scene import Scene
from ..settings import Settings

if TYPE_CHECKING:
    from ..analytic.scene import AnalyticScene


def trace_truth(
    scene: Scene | AnalyticScene, camera: Camera, settings: Settings, gbuffer: GBuffer
) -> Truth:
    """The first hit of every reflective pixel's ray in the scene itself, by its closed form if it
    has one.

    settings: of the render that made `gbuffer`; only size and max_distance are read (None: by the
    scene's radius). Raises SettingsError for a G-buffer that is not of this scene and size.
    """
    settings = settings.resolved(scene.radius())
    assert settings.max_distance is not None
    arguments = (camera, settings.size, gbuffer, settings.max_distance)
    if isinstance(scene, Scene):
        from .reflections import mesh_reflections

        return mesh_reflections(scene, *arguments)
    from .closed_form import analytic_truth

    return analytic_truth(scene, *arguments)
