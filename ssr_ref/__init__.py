"""A NumPy/Numba reference for screen-space reflection.

    scene = ssr_ref.load("teapot")                 # a built-in scene, or a mesh file
    frame = ssr_ref.render(scene)                  # Frame: G-buffer, hits, reflection, composite
    ssr_ref.write_bundle(frame, "teapot-golden")

Importing the package imports NumPy only; everything else on first use.
"""

from __future__ import annotations

import importlib
from typing import TYPE_CHECKING, Any

__version__ = "0.1.0"

_WHERE = {
    "Camera": "camera",
    "View": "camera",
    "look_at": "camera",
    "Image": "texture",
    "Texture": "texture",
    "DirectionalLight": "scene",
    "Lights": "scene",
    "Material": "scene",
    "Mesh": "scene",
    "Node": "scene",
    "Primitive": "scene",
    "Scene": "scene",
    "Settings": "settings",
    "End": "buffers",
    "Flag": "buffers",
    "Status": "buffers",
    "GBuffer": "buffers",
    "HitBuffer": "buffers",
    "Resolved": "buffers",
    "Frame": "pipeline",
    "render": "pipeline",
    "load": "fileio.load",
    "load_bundle": "fileio.bundle",
    "write_bundle": "fileio.bundle",
    "SsrRefError": "errors",
    "SsrRefWarning": "errors",
}

__all__ = [
    "Camera",
    "DirectionalLight",
    "End",
    "Flag",
    "Frame",
    "GBuffer",
    "HitBuffer",
    "Image",
    "Lights",
    "Material",
    "Mesh",
    "Node",
    "Primitive",
    "Resolved",
    "Scene",
    "Settings",
    "SsrRefError",
    "SsrRefWarning",
    "Status",
    "Texture",
    "View",
    "__version__",
    "load",
    "load_bundle",
    "look_at",
    "render",
    "write_bundle",
]

if TYPE_CHECKING:
    from .buffers import End as End
    from .buffers import Flag as Flag
    from .buffers import GBuffer as GBuffer
    from .buffers import HitBuffer as HitBuffer
    from .buffers import Resolved as Resolved
    from .buffers import Status as Status
    from .camera import Camera as Camera
    from .camera import View as View
    from .camera import look_at as look_at
    from .errors import SsrRefError as SsrRefError
    from .errors import SsrRefWarning as SsrRefWarning
    from .fileio.bundle import load_bundle as load_bundle
    from .fileio.bundle import write_bundle as write_bundle
    from .fileio.load import load as load
    from .pipeline import Frame as Frame
    from .pipeline import render as render
    from .scene import DirectionalLight as DirectionalLight
    from .scene import Lights as Lights
    from .scene import Material as Material
    from .scene import Mesh as Mesh
    from .scene import Node as Node
    from .scene import Primitive as Primitive
    from .scene import Scene as Scene
    from .settings import Settings as Settings
    from .texture import Image as Image
    from .texture import Texture as Texture


def __getattr__(name: str) -> Any:
    where = _WHERE.get(name)
    if where is None:
        raise AttributeError(f"module 'ssr_ref' has no attribute '{name}'")
    value = getattr(importlib.import_module(f".{where}", __name__), name)
    globals()[name] = value
    return value


def __dir__() -> list[str]:
    return __all__
