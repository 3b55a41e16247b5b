"""Primitives of a glTF mesh: triangle lists, strips and fans with their vertex attributes.

Source: glTF 2.0, section 3.7.2 (geometry, topology types); KHR_mesh_quantization.
"""

from __future__ import annotations

from collections import Counter
from typing import Any, NamedTuple

import numpy as np

from ..scene import Material, Primitive
from ..typed import AnyArray, BoolArray, F32Array, I32Array
from .gltf_accessors import DRACO, QUANTIZATION, UNSIGNED, Accessors, as_float32
from .gltf_json import Gltf

TRIANGLES, STRIP, FAN = 4, 5, 6
"""Primitive modes that are drawn; 0 to 3 are points and lines."""

COLOR_KEY = "ssr_ref_color"
"""Key in a primitive's `extras`: what COLOR_0 holds, "a" or "rgba", whatever the alpha mode."""

_QUANTISED = "i1 i1n u1 u1n i2 i2n u2 u2n"


class _Colors(NamedTuple):
    colors: F32Array | None
    alphas: F32Array | None


class Primitives:
    """Reads primitives. counts: oddities that were found, by a short name."""

    def __init__(self, gltf: Gltf, accessors: Accessors) -> None:
        self._gltf = gltf
        self._accessors = accessors
        self._quantised = gltf.declares(QUANTIZATION)
        self.counts: Counter[str] = Counter()

    def is_drawn(self, entry: dict[str, Any], where: str) -> bool:
        """Whether a primitive holds triangles; points and lines do not."""
        mode = self._gltf.whole(entry, "mode", where, TRIANGLES)
        if mode > FAN:
            raise self._gltf.error(f"{where}.mode is {mode}; expected 0 to 6: export again")
        return mode >= TRIANGLES

    def read(self, entry: dict[str, Any], where: str, material: int, look: Material) -> Primitive:
        """One primitive, with its material's index in the scene and that material."""
        gltf, accessors = self._gltf, self._accessors
        attributes = gltf.object(entry, "attributes", where)
        if "POSITION" not in attributes:
            raise gltf.error(f"{where} has no POSITION; expected one for each vertex: export again")
        self._refuse_draco(entry, attributes, where)
        quantised = self._quantised
        positions = accessors.vertices(
            attributes["POSITION"], f"{where} POSITION", (3,), _QUANTISED if quantised else ""
        )
        normals = None
        if "NORMAL" in attributes:
            normals = accessors.vertices(
                attributes["NORMAL"], f"{where} NORMAL", (3,), "i1n i2n" if quantised else ""
            )
        uvs = [
            self._uvs(attributes[name], f"{where} {name}") if name in attributes else None
            for name in ("TEXCOORD_0", "TEXCOORD_1")
        ]
        colors, alphas = self._colors(entry, attributes, look, where)
        self.counts["morph targets"] += bool(gltf.listed(entry, "targets", where))
        used = {texture.uv_set for texture in look.textures if texture is not None}
        self.counts["without uv"] += any(uvs[uv_set] is None for uv_set in used)
        faces = self._faces(entry, len(positions), where)
        return Primitive(positions, faces, material, normals, colors, uvs[0], uvs[1], alphas)

    def _refuse_draco(self, entry: dict[str, Any], attributes: dict[str, Any], where: str) -> None:
        """Draco data beside plain data is left alone; without plain data it is refused."""
        gltf = self._gltf
        if gltf.extension(entry, DRACO, where) is None:
            return
        indices = [entry["indices"]] if "indices" in entry else []
        for index in (*attributes.values(), *indices):
            if not {"bufferView", "sparse"} & gltf.item("accessors", index).keys():
                raise gltf.error(
                    f"{where} is compressed with {DRACO}; expected plain geometry: export without "
                    "Draco compression"
                )

    def _uvs(self, index: Any, where: str) -> F32Array:
        allowed = _QUANTISED if self._quantised else "u1n u2n"
        uvs = self._accessors.vertices(index, where, (2,), allowed)
        finite = np.isfinite(uvs)
        if not finite.all():
            self.counts["nan uvs"] += int((~finite.all(axis=1)).sum())
            uvs = np.where(finite, uvs, np.float32(0.0))
        return uvs

    def _colors(
        self, entry: dict[str, Any], attributes: dict[str, Any], look: Material, where: str
    ) -> _Colors:
        """Linear colours and alphas; integers are normalised whether they say so or not."""
        if "COLOR_0" not in attributes:
            return _Colors(None, None)
        values, _ = self._accessors.raw(attributes["COLOR_0"], f"{where} COLOR_0")
        if values.shape[1] not in (3, 4) or values.dtype.str not in ("|u1", "<u2", "<f4"):
            raise self._gltf.error(
                f"{where} COLOR_0 is {values.shape[1]} × {values.dtype}; expected VEC3 or VEC4 of "
                "float32, uint8 or uint16: export again"
            )
        extras = entry.get("extras")
        own = extras.get(COLOR_KEY) if isinstance(extras, dict) else None
        rgba = as_float32(values, normalized=True)
        broken: BoolArray = np.asarray(~np.isfinite(rgba).all(axis=1))
        if broken.any():
            self.counts["nan colors"] += int(broken.sum())
            rgba = np.where(broken[:, None], np.float32(1.0), rgba)
        masked = look.alpha_cutoff is not None or own in ("a", "rgba")
        alphas = rgba[:, 3] if rgba.shape[1] == 4 and masked else None
        if own == "a":
            return _Colors(None, alphas)
        self.counts["bright colors"] += int((rgba[:, :3] > 1.0).any(axis=1).sum())
        return _Colors(rgba[:, :3], alphas)

    # ---------------------------------------------------------------------- faces

    def _faces(self, entry: dict[str, Any], vertices: int, where: str) -> I32Array:
        gltf = self._gltf
        if "indices" not in entry:
            corners: AnyArray = np.arange(vertices, dtype=np.int32)
        else:
            values, _ = self._accessors.raw(entry["indices"], f"{where} indices", UNSIGNED)
            if values.shape[1] != 1:
                raise gltf.error(f"{where} indices are vectors; expected SCALAR: export again")
            corners = values[:, 0]
            if len(corners) and corners.max() >= vertices:
                raise gltf.error(
                    f"{where} refers to vertex {corners.max()} of {vertices}; expected 0 to "
                    f"{vertices - 1}: the file is damaged, export it again"
                )
            corners = corners.astype(np.int32)
        mode = entry.get("mode", TRIANGLES)
        if mode in (STRIP, FAN):
            self._accessors.spend(12 * len(corners), where)  # a triangle for each corner
        if mode == STRIP:
            return _strip(corners)
        if mode == FAN:
            return _fan(corners)
        if len(corners) % 3:
            raise gltf.error(
                f"{where} has {len(corners)} corners; expected a multiple of 3: export again"
            )
        return corners.reshape(-1, 3)


def _strip(corners: I32Array) -> I32Array:
    """Triangle i is (v_i, v_{i+1+i mod 2}, v_{i+2−i mod 2}), so that all wind alike."""
    i = np.arange(max(0, len(corners) - 2))
    odd = i % 2
    return np.stack([corners[i], corners[i + 1 + odd], corners[i + 2 - odd]], axis=1)


def _fan(corners: I32Array) -> I32Array:
    """Triangle i is (v_{i+1}, v_{i+2}, v_0)."""
    i = np.arange(max(0, len(corners) - 2))
    return np.stack([corners[i + 1], corners[i + 2], corners[0 * i]], axis=1)
