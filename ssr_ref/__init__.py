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
    "Side": "buffers",
    "Truth": "buffers",
    "TruthClass": "buffers",
    "method_settings": "settings",
    "preset_settings": "presets",
    "trace_truth": "truth",
    "Frame": "pipeline",
    "render": "pipeline",
    "load": "fileio.load",
    "load_bundle": "fileio.bundle",
    "write_bundle": "fileio.bundle",
    "octahedral_encode": "maths.codes",
    "octahedral_decode": "maths.codes",
    "srgb_encode": "maths.codes",
    "srgb_decode": "maths.codes",
    "edge_fade": "maths.codes",
    "distance_fade": "maths.codes",
    "pcg3d": "maths.codes",
    "jitter": "maths.codes",
    "barycentrics": "maths.barycentric",
    "linear_depth": "maths.depth",
    "device_depth": "maths.depth",
    "depth_codes": "maths.depth",
    "stored_depth": "maths.depth",
    "ray_lengths": "maths.depth",
    "cube_face": "maths.directions",
    "cube_direction": "maths.directions",
    "cross_uv": "maths.directions",
    "cross_direction": "maths.directions",
    "latlong_uv": "maths.directions",
    "latlong_direction": "maths.directions",
    "ball_uv": "maths.directions",
    "ball_direction": "maths.directions",
    "SphereOutcome": "maths.sphere",
    "clip_ray": "maths.rays",
    "dda_line": "maths.lines",
    "difference_of_products": "maths.error_free",
    "intersect_sphere": "maths.sphere",
    "mirror_matrix": "maths.mirror",
    "ray_setup": "maths.rays",
    "reflect": "maths.mirror",
    "two_prod": "maths.error_free",
    "two_sum": "maths.error_free",
    "MathsError": "errors",
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
    "MathsError",
    "Mesh",
    "Node",
    "Primitive",
    "Resolved",
    "Scene",
    "Settings",
    "Side",
    "SphereOutcome",
    "SsrRefError",
    "SsrRefWarning",
    "Status",
    "Texture",
    "Truth",
    "TruthClass",
    "View",
    "__version__",
    "ball_direction",
    "ball_uv",
    "barycentrics",
    "clip_ray",
    "cross_direction",
    "cross_uv",
    "cube_direction",
    "cube_face",
    "dda_line",
    "depth_codes",
    "device_depth",
    "difference_of_products",
    "distance_fade",
    "edge_fade",
    "intersect_sphere",
    "jitter",
    "latlong_direction",
    "latlong_uv",
    "linear_depth",
    "load",
    "load_bundle",
    "look_at",
    "method_settings",
    "mirror_matrix",
    "octahedral_decode",
    "octahedral_encode",
    "pcg3d",
    "preset_settings",
    "ray_lengths",
    "ray_setup",
    "reflect",
    "render",
    "srgb_decode",
    "srgb_encode",
    "stored_depth",
    "trace_truth",
    "two_prod",
    "two_sum",
    "write_bundle",
]

if TYPE_CHECKING:
    from .buffers import End as End
    from .buffers import Flag as Flag
    from .buffers import GBuffer as GBuffer
    from .buffers import HitBuffer as HitBuffer
    from .buffers import Resolved as Resolved
    from .buffers import Side as Side
    from .buffers import Status as Status
    from .buffers import Truth as Truth
    from .buffers import TruthClass as TruthClass
    from .camera import Camera as Camera
    from .camera import View as View
    from .camera import look_at as look_at
    from .errors import MathsError as MathsError
    from .errors import SsrRefError as SsrRefError
    from .errors import SsrRefWarning as SsrRefWarning
    from .fileio.bundle import load_bundle as load_bundle
    from .fileio.bundle import write_bundle as write_bundle
    from .fileio.load import load as load
    from .maths.barycentric import barycentrics as barycentrics
    from .maths.codes import distance_fade as distance_fade
    from .maths.codes import edge_fade as edge_fade
    from .maths.codes import jitter as jitter
    from .maths.codes import octahedral_decode as octahedral_decode
    from .maths.codes import octahedral_encode as octahedral_encode
    from .maths.codes import pcg3d as pcg3d
    from .maths.codes import srgb_decode as srgb_decode
    from .maths.codes import srgb_encode as srgb_encode
    from .maths.depth import depth_codes as depth_codes
    from .maths.depth import device_depth as device_depth
    from .maths.depth import linear_depth as linear_depth
    from .maths.depth import ray_lengths as ray_lengths
    from .maths.depth import stored_depth as stored_depth
    from .maths.directions import ball_direction as ball_direction
    from .maths.directions import ball_uv as ball_uv
    from .maths.directions import cross_direction as cross_direction
    from .maths.directions import cross_uv as cross_uv
    from .maths.directions import cube_direction as cube_direction
    from .maths.directions import cube_face as cube_face
    from .maths.directions import latlong_direction as latlong_direction
    from .maths.directions import latlong_uv as latlong_uv
    from .maths.error_free import difference_of_products as difference_of_products
    from .maths.error_free import two_prod as two_prod
    from .maths.error_free import two_sum as two_sum
    from .maths.lines import dda_line as dda_line
    from .maths.mirror import mirror_matrix as mirror_matrix
    from .maths.mirror import reflect as reflect
    from .maths.rays import clip_ray as clip_ray
    from .maths.rays import ray_setup as ray_setup
    from .maths.sphere import SphereOutcome as SphereOutcome
    from .maths.sphere import intersect_sphere as intersect_sphere
    from .pipeline import Frame as Frame
    from .pipeline import render as render
    from .presets import preset_settings as preset_settings
    from .scene import DirectionalLight as DirectionalLight
    from .scene import Lights as Lights
    from .scene import Material as Material
    from .scene import Mesh as Mesh
    from .scene import Node as Node
    from .scene import Primitive as Primitive
    from .scene import Scene as Scene
    from .settings import Settings as Settings
    from .settings import method_settings as method_settings
    from .texture import Image as Image
    from .texture import Texture as Texture
    from .truth import trace_truth as trace_truth


def __getattr__(name: str) -> Any:
    where = _WHERE.get(name)
    if where is None:
        raise AttributeError(f"module 'ssr_ref' has no attribute '{name}'")
    value = getattr(importlib.import_module(f".{where}", __name__), name)
    globals()[name] = value
    return value


def __dir__() -> list[str]:
    return __all__
