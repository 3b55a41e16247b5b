"""Named settings with the defaults of public engines, as far as their kind of tracer is covered.

Facts as read in their public sources in November 2026. Lengths are the engine's own numbers in its
own units (metres or scene units): scale them to your scene. What a preset leaves out it says.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from .errors import SettingsError
from .settings import Settings


@dataclass(frozen=True, slots=True)
class Preset:
    """changes: to `Settings`. covers, not_covered: in words. source: project and version."""

    description: str
    changes: Mapping[str, Any]
    covers: tuple[str, ...]
    not_covered: tuple[str, ...]
    source: str


_DDA = {"tracer": "dda", "self_rejection": "none", "refine": "none"}
_CONSTANT = {"thickness_from": "constant"}
_MARCH = {"tracer": "march", "growth": "constant", "self_rejection": "none"}
_EXACT = {"tracer": "cells", "self_rejection": "none"}
_HI_Z = "the pyramid: exact cells are what it finds without a cap on iterations"
_GODOT_EDGE = {
    "edge_shape": "smoothstep",
    "edge_unit": "mean",
    "edge_combine": "area",
    "edge_range": (0.8, 1.0),
}

PRESETS: dict[str, Preset] = {
    "mcguire_mara": Preset(
        "the paper's DDA in a port's usual form, without fades",
        {**_DDA, **_CONSTANT, "interval": "published", "edge_fade": False},
        ("one pixel a step, 1/w linear", "interval from the end of the one before"),
        ("thickness, distance, stride and jitter are the caller's",
         "slips of the listing: --listing"),
        "McGuire and Mara, JCGT 3(4), 2014, and its ports",
    ),
    "babylon": Preset(
        "Babylon.js screen space reflections 2",
        {
            **_DDA, **_CONSTANT, "interval": "published", "thickness": 0.5, "max_steps": 1000,
            "max_distance": 1000.0, "edge_shape": "smoothstep", "edge_range": (0.4, 1.2),
            "edge_combine": "sum", "distance_fade": "linear", "steps_fade": "linear",
        },
        ("step 1, 1000 steps, distance 1000", "thickness 0.5", "own pixel skipped once",
         "edge, distance and step fades"),
        ("jitter ((x + y)/4) mod 1", "roughness blur", "cube map with box parallax behind a miss",
         "Schlick-GGX, off by default"),
        "Babylon.js, SSR2 rendering pipeline",
    ),
    "filament": Preset(
        "Filament's screen-space reflections",
        {
            **_DDA, **_CONSTANT, "interval": "published", "stride": 2, "thickness": 0.1,
            "max_distance": 3.0, "edge_power": 2.0, "edge_range": (5.0 / 6.0, 1.0),
            "edge_combine": "sum", "distance_fade": "linear", "distance_start": 0.75,
            "facing_fade": "linear", "facing_measure": "axis",
        },
        ("stride 2, distance 3, thickness 0.1", "edge fade of r = 12", "distance fade 4 - 4t",
         "fade of rays that come back (newer versions)"),
        ("interleaved gradient noise", "bias 0.01 along the ray", "steps capped by max(W, H)",
         "reprojected history, IBL behind a miss"),
        "Filament, surface_light_reflections",
    ),
    "kode80": Preset(
        "kode80's SSR for Unity",
        {
            **_DDA, "thickness_from": "back_faces", "back_any_object": True, "thickness": 0.1,
            "interval": "published", "max_steps": 20, "max_distance": 10.0, "edge_power": 1.0,
            "edge_range": (0.75, 1.0), "edge_combine": "max", "distance_fade": "linear",
            "steps_fade": "linear", "facing_fade": "linear", "facing_measure": "axis",
        },
        ("stride 1, 20 steps, distance 10", "back faces of any object", "all four fades"),
        ("the offset 0.1 is added to back faces too", "stride relaxed by the origin's depth",
         "jitter", "screen blur of 8 px"),
        "kode80SSR",
    ),
    "three_ssrpass": Preset(
        "three.js SSRPass",
        {
            **_DDA, **_CONSTANT, "interval": "point", "thickness": 0.018, "max_distance": 180.0,
            "facing_test": True, "edge_fade": False, "distance_fade": "squared",
        },
        ("one pixel a step, depth of the sample alone", "faces met from behind are passed",
         "distance fade (1 - d/max)^2"),
        ("thickness grows with 3 px of width, and is measured from point to line",
         "the own pixel is tested first", "distance divided by -I.N", "d is the plane's distance",
         "its Fresnel, (I.R + 1)/2"),
        "three.js, examples/jsm/postprocessing/SSRPass",
    ),
    "three_ssrnode": Preset(
        "three.js SSRNode in its blurred mode",
        {
            **_DDA, **_CONSTANT, "interval": "point", "stride": 2, "thickness": 0.1,
            "max_distance": 1.0, "facing_test": True, "edge_fade": False,
        },
        ("half as many samples as pixels", "distance 1, thickness 0.1",
         "faces met from behind are passed"),
        ("edge fade: smoothstep twice, to the power 1/8", "thickness from point to line",
         "stochastic mode", "five blurred levels"),
        "three.js, examples/jsm/tsl/display/SSRNode",
    ),
    "godot_4_5": Preset(
        "Godot up to 4.5",
        {
            **_DDA, **_CONSTANT, **_GODOT_EDGE, "interval": "point", "thickness": 0.2,
            "max_steps": 64, "facing_test": True, "steps_fade": "power", "steps_fade_out": 2.0,
            "steps_fade_in": 0.15,
        },
        ("one pixel a step, 64 steps", "tolerance 0.2", "own pixel skipped, hit must face the ray",
         "edge fade over 0.05 (W + H) px", "fades in and out with the steps"),
        ("the hit's normal is compared with 0.001, not 0", "cone blur by roughness", "half size"),
        "Godot 4.5, screen_space_reflection",
    ),
    "lettier": Preset(
        "lettier's 3D game shaders for beginners",
        {
            **_DDA, **_CONSTANT, "interval": "point", "stride": 3, "refine": "bisect",
            "thickness": 0.5, "edge_fade": False, "facing_fade": "linear",
        },
        ("0.3 samples a pixel, as stride 3", "thickness 0.5", "fade of rays that come back"),
        ("bisection of 5 steps: here down to half a pixel", "filtered depth",
         "a hit that is never cleared"),
        "3d-game-shaders-for-beginners, screen space reflection",
    ),
    "zerobeqz": Preset(
        "0beqz' screen-space-reflections",
        {
            **_MARCH, **_CONSTANT, "max_steps": 20, "refine": "bisect", "refine_steps": 5,
            "thickness": 10.0, "jitter": True, "edge_power": 1.0, "edge_range": (0.9, 1.0),
            "edge_combine": "max",
        },
        ("20 steps in view space, 5 halvings", "thickness 10", "edge fade over the last tenth"),
        ("its step: ours is radius/128 unless given", "another hash for the noise",
         "temporal accumulation"),
        "0beqz/screen-space-reflections",
    ),
    "realism_effects": Preset(
        "realism-effects",
        {
            **_MARCH, **_CONSTANT, "max_steps": 20, "refine": "bisect", "refine_steps": 5,
            "thickness": 10.0, "jitter": True, "edge_shape": "smoothstep",
            "edge_range": (0.7, 1.0),
        },
        ("20 steps in view space, 5 halvings", "thickness 10", "edge fade over 0.15 of uv"),
        ("first steps 1 - exp(-i^2/4)", "blue noise", "the square root of the edge fade",
         "depth is not checked after the halvings", "GGX sampling and denoiser"),
        "realism-effects",
    ),
    "ffx_sssr": Preset(
        "the limit of AMD FidelityFX SSSR for mirrors",
        {
            **_EXACT, **_CONSTANT, "thickness": np.inf, "facing_test": True,
            "edge_shape": "smoothstep", "edge_unit": "height", "edge_range": (0.9, 1.0),
            "residual_fade": "smoothstep", "residual_end": 0.015, "residual_power": 2.0,
        },
        ("any cell behind a surface ends the walk", "confidence (1 - smoothstep(0, 0.015, d))^2",
         "edge fade over 0.05 of the height"),
        (_HI_Z, "d is a distance in 3-D there, a depth here", "iterations, 128",
         "sky and thickness are looked up in mip 1", "hits within 2 px are refused"),
        "FidelityFX SSSR 1",
    ),
    "wicked": Preset(
        "the limit of Wicked Engine's Hi-Z path for mirrors",
        {
            **_EXACT, **_CONSTANT, "thickness": np.inf, "edge_power": 2.0,
            "edge_range": (0.8, 1.0), "edge_combine": "sum", "residual_fade": "smoothstep",
            "residual_end": 1.5,
        },
        ("any cell behind a surface ends the walk", "confidence 1 - smoothstep(0, 1.5, d)",
         "edge fade over the last fifth"),
        (_HI_Z, "d is a distance in 3-D there, a depth here", "iterations, 64",
         "the edge fade of the frame before"),
        "Wicked Engine, ssr_raytraceCS",
    ),
    "unity_hdrp": Preset(
        "the limit of Unity HDRP's Hi-Z tracer for mirrors",
        {**_EXACT, "thickness_from": "relative", "thickness": 0.01, "edge_fade": False},
        ("thickness grows with depth, (1 + 0.01) z",),
        (_HI_Z, "iterations, 64", "the hit is moved to the pixel's centre", "edge fade of 0.1",
         "colour of the frame before"),
        "Unity HDRP, ScreenSpaceReflections",
    ),
}  # fmt: skip
"""By name; `preset_settings` applies one."""


def preset_settings(name: str, base: Settings | None = None) -> Settings:
    """The base, or the defaults, with a preset's changes. Raises SettingsError for no such name."""
    if name not in PRESETS:
        raise SettingsError(f"preset is '{name}'; expected one of {', '.join(PRESETS)}")
    return replace(base or Settings(), **PRESETS[name].changes)
