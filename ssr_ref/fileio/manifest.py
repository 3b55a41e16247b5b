"""What a bundle holds: the arrays as stored, the EXR's channels, and manifest.json.

The contract is docs/bundle.md. A change of it needs a new SCHEMA_VERSION.
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Mapping
from dataclasses import asdict
from typing import TYPE_CHECKING, Any

import numpy as np

from .. import __version__
from ..buffers import End, Flag, Status
from ..errors import BundleError
from ..scene import Scene
from ..typed import AnyArray
from .npz import content_sha256

if TYPE_CHECKING:
    from ..pipeline import Frame

FORMAT = "ssr_ref golden bundle"
SCHEMA_VERSION = 1

NOT_WALKED = (
    Status.NOT_COMPUTED,
    Status.BACKGROUND,
    Status.NOT_REFLECTIVE,
    Status.INVALID_INPUT,
    Status.BELOW_SURFACE,
)
"""Statuses of pixels from which no ray was walked."""

CONVENTIONS = {
    "camera": "clip = clip_from_view * view_from_world * p, column vectors; matrices are written "
    "row by row; world_from_view is the camera's pose, its last column the eye",
    "clip": "OpenGL: z in [-1, 1], y up, w = view depth (orthographic: 1)",
    "color": "linear-light RGB, Rec. 709 primaries; previews are sRGB-encoded",
    "depth": "linear view depth -z_view in scene units, > 0; +inf where nothing was drawn",
    "hit": "hit_px in pixels, hit_uv = hit_px / (W, H); NaN where there is no hit",
    "ids": "golden.npz: -1 where nothing was drawn; golden.exr: id + 1, 0 where nothing was drawn",
    "image": "row 0 at the top, x right, y down, pixel (x, y) has its centre at (x + 0.5, y + 0.5)",
    "normals": "unit, view space; geo_normal_vs faces the eye; 0 where nothing was drawn",
    "uv": "origin at the top left corner of the image, v down",
    "view": "right-handed, looks down -Z, +Y up, +X right",
}
"""In words, so that nobody has to guess; also in every manifest."""

_RGB = (".R", ".G", ".B")
_XYZ = (".X", ".Y", ".Z")
CHANNELS: dict[str, tuple[str, ...]] = {
    "composite": ("R", "G", "B"),
    "depth": ("Z",),
    "normal_vs": tuple("normal" + c for c in _XYZ),
    "geo_normal_vs": tuple("geo_normal" + c for c in _XYZ),
    **{
        name: tuple(name + c for c in _RGB)
        for name in ("albedo", "radiance", "reflectivity", "reflection")
    },
    "hit_uv": ("hit.U", "hit.V"),
    "hit_px": (),
    "fade_px": ("fade.X", "fade.Y"),
}
"""EXR channels of an array's components; an array not named here has one channel of its name."""

ID_ARRAYS = ("triangle_id", "object_id", "material_id")


def stored_arrays(frame: Frame) -> dict[str, AnyArray]:
    """Every array of a frame as golden.npz holds it, and hit_uv; sorted by name.

    Floats are rounded once to float32 (float64 if settings.buffer_dtype says so), and every NaN
    becomes the same quiet NaN. Arrays of further methods are named "METHOD.array". Raises
    BundleError if two buffers share a name.
    """
    floats = np.float64 if frame.settings.buffer_dtype == "float64" else np.float32
    found: dict[str, AnyArray] = {}
    groups = [("", frame.gbuffer.arrays()), ("", _traced_arrays(frame, floats))]
    groups += [(name + ".", _traced_arrays(frame.of(name), floats)) for name in frame.more]
    for prefix, group in groups:
        for name, array in group.items():
            if prefix + name in found:
                raise BundleError(
                    f"two buffers are named {prefix + name}; expected names of their own"
                )
            found[prefix + name] = _stored(array, floats)
    return dict(sorted(found.items()))


def _traced_arrays(frame: Frame, floats: Any) -> dict[str, AnyArray]:
    """Hits, hit_uv and colours of a frame, as stored."""
    width, height = frame.settings.size
    uv = frame.hits.hit_px / np.array([width, height], np.float64)
    found = {
        name: _stored(array, floats)
        for group in (frame.hits.arrays(), frame.resolved.arrays(), {"hit_uv": uv})
        for name, array in group.items()
    }
    if floats is np.float32:
        _keep_in_texel(found["hit_px"], frame.hits.hit_px, (1, 1))
        _keep_in_texel(found["hit_uv"], frame.hits.hit_px, (width, height))
    return found


def _keep_in_texel(stored: AnyArray, hit_px: AnyArray, scale: tuple[int, int]) -> None:
    """Move float32 positions, in place, until floor(stored · scale) is the texel of hit_px.

    A hit an ulp before a pixel's border rounds onto the border, and who takes the texel from the
    file would read the neighbour. Both float32 and float64 products are made to agree; it takes a
    few float32 steps.
    """
    for axis in range(2):
        plane = stored[..., axis]
        texel = np.floor(hit_px[..., axis])
        at = np.nonzero(np.isfinite(texel))
        value, want = plane[at], texel[at]
        for _ in range(8):
            single = np.floor(value * np.float32(scale[axis]))
            double = np.floor(value.astype(np.float64) * scale[axis])
            high = np.maximum(single, double) > want
            low = np.minimum(single, double) < want
            if not (high.any() or low.any()):
                break
            value = np.where(high, np.nextafter(value, np.float32(-np.inf)), value)
            value = np.where(low, np.nextafter(value, np.float32(np.inf)), value)
        plane[at] = value


def _stored(array: AnyArray, floats: Any) -> AnyArray:
    if array.dtype.kind != "f" or (array.dtype == floats and not np.isnan(array).any()):
        return np.ascontiguousarray(array)
    with np.errstate(over="ignore", under="ignore", invalid="ignore"):
        out = np.array(array, floats, order="C")
    out[np.isnan(out)] = np.nan
    return out


def exr_channels(arrays: Mapping[str, AnyArray]) -> dict[str, AnyArray]:
    """The images of golden.exr: (H, W) float32, or uint32 for ids + 1, outcomes and counts."""
    channels: dict[str, AnyArray] = {}
    for name, array in arrays.items():
        for component, channel in enumerate(channel_names(name)):
            plane = array if array.ndim == 2 else array[..., component]
            if name in ID_ARRAYS:
                plane = (plane + np.int32(1)).astype(np.uint32)
            elif plane.dtype.kind == "f":
                plane = _stored(plane, np.float32)
            else:
                plane = plane.astype(np.uint32)
            channels[channel] = plane
    return channels


def channel_names(array_name: str) -> tuple[str, ...]:
    """The EXR channels of an array, one for each component.

    A further method's are in a layer of its name.
    """
    layer, dot, own = array_name.rpartition(".")
    return tuple(layer + dot + channel for channel in CHANNELS.get(own, (own,)))


def build(frame: Frame, arrays: Mapping[str, AnyArray], files: Mapping[str, str]) -> dict[str, Any]:
    """The manifest, all but its own hash. files: relative name to file_sha256."""
    report = frame.scene.report if isinstance(frame.scene, Scene) else None
    data: dict[str, Any] = {
        "format": FORMAT,
        "schema_version": SCHEMA_VERSION,
        "package": {"name": "ssr_ref", "version": __version__},
        "scene": {
            "name": frame.scene.name,
            "content_sha256": frame.scene.content_sha256(),
            "triangles": int(frame.scene.triangle_count),
            "objects": len(frame.scene.nodes),
            **({} if report is None else {"load": asdict(report)}),
        },
        "size": list(frame.settings.size),
        "camera": frame.camera.to_json(),
        "settings": frame.settings.to_json(),
        "conventions": CONVENTIONS,
        "names": {
            "status": {s.name: int(s) for s in Status},
            "end": {e.name: int(e) for e in End},
            "flags": {str(f.name): int(f) for f in Flag},
        },
        "statistics": statistics(frame),
        **({} if not frame.more else {"methods": _methods(frame)}),
        "warnings": list(frame.warnings),
        "arrays": {
            name: {
                "dtype": array.dtype.name,
                "shape": list(array.shape),
                "content_sha256": content_sha256(array),
            }
            for name, array in arrays.items()
        },
        "channels": {
            channel: {
                "array": name,
                "component": component,
                "dtype": "float32" if array.dtype.kind == "f" else "uint32",
                "plus": 1 if name in ID_ARRAYS else 0,
            }
            for name, array in arrays.items()
            for component, channel in enumerate(channel_names(name))
        },
        "files": dict(files),
    }
    return {**data, "content_sha256": identity(data)}


def statistics(frame: Frame) -> dict[str, Any]:
    """Numbers of pixels by outcome, and what the rasterizer met."""
    hits = frame.hits
    by_status = {s.name: int(np.count_nonzero(hits.status == s)) for s in Status}
    pixels = int(hits.status.size)
    return {
        "pixels": pixels,
        "rays": pixels - sum(by_status[s.name] for s in NOT_WALKED),
        "hits": by_status[Status.HIT.name],
        "status": by_status,
        "end": {e.name: int(np.count_nonzero(hits.end == e)) for e in End},
        "flags": {str(f.name): int(np.count_nonzero(hits.flags & np.uint8(f))) for f in Flag},
        "steps": int(hits.steps.sum(dtype=np.uint64)),
        "fetches": int(hits.fetches.sum(dtype=np.uint64)),
        "raster": {name: int(count) for name, count in asdict(frame.gbuffer.counts).items()},
    }


def _methods(frame: Frame) -> dict[str, Any]:
    """Numbers of every further method; what the rasterizer met is the same for all."""
    return {
        name: {k: v for k, v in statistics(frame.of(name)).items() if k != "raster"}
        for name in frame.more
    }


def identity(manifest: Mapping[str, Any]) -> str:
    """The golden's identity: SHA-256 of one line of text for each thing that fixes it.

    The lines, each ended by a newline: "array NAME HASH" sorted by name, "scene HASH",
    "camera.json HASH", "settings.json HASH", and "methods.json HASH" if there is one; the last
    three are hashes of the files.
    """
    files = manifest["files"]
    lines = [
        f"array {name} {manifest['arrays'][name]['content_sha256']}"
        for name in sorted(manifest["arrays"])
    ]
    lines.append(f"scene {manifest['scene']['content_sha256']}")
    parts = ("camera.json", "settings.json", "methods.json")
    lines += [f"{name} {files[name]}" for name in parts if name in files]
    return hashlib.sha256("".join(line + "\n" for line in lines).encode()).hexdigest()


def json_bytes(data: Any) -> bytes:
    """JSON as every file of a bundle holds it: sorted keys, ASCII, no NaN or Infinity."""
    return (json.dumps(data, sort_keys=True, indent=1, allow_nan=False) + "\n").encode("ascii")


_UNHASHED = "0" * 64


def encode(manifest: Mapping[str, Any]) -> bytes:
    """The bytes of manifest.json, with their own hash in manifest_sha256.

    That is the SHA-256 of these bytes with 64 zeros in the hash's place.
    """
    blank = json_bytes({**manifest, "manifest_sha256": _UNHASHED})
    key = b'"manifest_sha256": "'
    return blank.replace(key + _UNHASHED.encode(), key + hashlib.sha256(blank).hexdigest().encode())


def is_as_written(encoded: bytes, manifest: Mapping[str, Any]) -> bool:
    """Whether the bytes of manifest.json still have the hash that they name."""
    named = str(manifest.get("manifest_sha256", "")).encode()
    blank = encoded.replace(named, _UNHASHED.encode()) if len(named) == 64 else b""
    return hashlib.sha256(blank).hexdigest().encode() == named
