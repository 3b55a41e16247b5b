"""Textures as kernels read them: level 0, bilinear between texel centres, decoded before filtering.

    x = u'·W − ½,  i = ⌊x⌋,  f = x − i;  value = lerp over f_x of the upper row, of the lower row,
    then over f_y;  lerp(a, b, f) = a + f·(b − a)

so an image of one colour gives that colour in every bit. Images are packed on demand: only those of
the materials that a pass needs. Texels stay the file's codes; a table decodes them, exactly.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from .._jit import driver, inlined, kernel
from ..scene import Scene
from ..texture import Texture
from ..typed import AnyArray, BoolArray, F32Array, F64Array, I32Array, I64Array
from ..vecmath.elementary import sincos_host
from ..vecmath.srgb import srgb_decode
from .geometry import Geometry
from .surface import Barycentric

REPEAT, MIRROR, CLAMP = 0, 1, 2
_WRAP = {"repeat": REPEAT, "mirror": MIRROR, "clamp": CLAMP}

BASE, METALLIC_ROUGHNESS, EMISSIVE = 0, 1, 2
"""Columns of `Textures.material_slot`; the order of `Material.textures`."""

# Columns of `Textures.slots`.
FIRST, WIDTH, HEIGHT, WRAP_U, WRAP_V, UV_SET, DECODE_RGB, DECODE_ALPHA = range(8)

# Parts of the decoding table: 8 bits linear, 8 bits sRGB, then the same for 16 bits.
_LINEAR_8, _SRGB_8, _LINEAR_16, _SRGB_16 = 0, 256, 512, 512 + 65536


class Textures(NamedTuple):
    """The packed textures of some materials; a slot is one texture of one material.

    A material that was not packed has no slots, and no cutoff.
    """

    texels: AnyArray  # (n, 4) uint16 codes, RGBA, image after image
    decode: F64Array  # (m,) value of each code
    slots: I64Array  # (ns, 8): first texel, W, H, wraps, uv set, offsets into `decode`
    affine: F64Array  # (ns, 6): u' = a0·u + a1·v + a2, v' = a3·u + a4·v + a5
    material_slot: I32Array  # (nm, 3), −1: none
    alpha: F64Array  # (nm,) the factor
    cutoff: F64Array  # (nm,) NaN: not masked
    uv0: F32Array  # (nv, 2), or no rows
    uv1: F32Array  # (nv, 2), or no rows
    alphas: F32Array  # (nv,), or none


class Texel(NamedTuple):
    """A filtered texel, each channel 0 to 1."""

    r: float
    g: float
    b: float
    a: float


# ------------------------------------------------------------------------ host


class TextureStore:
    """A scene's textures, packed for the materials that are asked for."""

    def __init__(self, scene: Scene) -> None:
        self._scene = scene
        self.textured = np.array(
            [any(t is not None for t in m.textures) for m in scene.materials], np.bool_
        )
        self.masked = np.array([m.alpha_cutoff is not None for m in scene.materials], np.bool_)
        self._packed: dict[bytes, Textures] = {}

    def pack(self, geometry: Geometry, materials: BoolArray) -> Textures | None:
        """What kernels need for these materials (nm,); None if none has a texture or a mask."""
        chosen = materials & (self.textured | self.masked)
        if not chosen.any():
            return None
        key = chosen.tobytes()
        if key not in self._packed:
            self._packed = {key: self._pack(geometry, chosen)}  # one set at a time is kept
        return self._packed[key]

    def _pack(self, geometry: Geometry, chosen: BoolArray) -> Textures:
        scene = self._scene
        images: dict[int, int] = {}
        blocks: list[AnyArray] = []
        slots: list[tuple[int, ...]] = []
        affine: list[tuple[float, ...]] = []
        material_slot = np.full((len(chosen), 3), -1, np.int32)
        texels = 0
        for m in np.flatnonzero(chosen):
            for kind, texture in enumerate(scene.materials[m].textures):
                if texture is None:
                    continue
                pixels = scene.images[texture.image].pixels
                height, width = pixels.shape[:2]
                if texture.image not in images:
                    images[texture.image] = texels
                    blocks.append(pixels.reshape(-1, 4).astype(np.uint16))
                    texels += width * height
                wide = pixels.dtype == np.uint16
                linear = _LINEAR_16 if wide else _LINEAR_8
                color = (_SRGB_16 if wide else _SRGB_8) if kind != METALLIC_ROUGHNESS else linear
                wraps = (_WRAP[texture.wrap[0]], _WRAP[texture.wrap[1]])
                first = images[texture.image]
                material_slot[m, kind] = len(slots)
                slots.append((first, width, height, *wraps, texture.uv_set, color, linear))
                affine.append(_affine(texture))
        wide = any(scene.images[i].pixels.dtype == np.uint16 for i in images)
        used = {slot[UV_SET] for slot in slots}
        masked = chosen & self.masked
        cutoffs = [np.nan if m.alpha_cutoff is None else m.alpha_cutoff for m in scene.materials]
        return Textures(
            texels=np.concatenate(blocks) if blocks else np.zeros((0, 4), np.uint16),
            decode=_decoding_table(wide),
            slots=np.array(slots, np.int64).reshape(-1, 8),
            affine=np.array(affine, np.float64).reshape(-1, 6),
            material_slot=material_slot,
            alpha=np.array([m.alpha for m in scene.materials], np.float64),
            cutoff=np.where(masked, np.array(cutoffs, np.float64), np.nan),
            uv0=self._vertices("uv0", geometry, 0 in used, (2,), 0.0),
            uv1=self._vertices("uv1", geometry, 1 in used, (2,), 0.0),
            alphas=self._vertices("alphas", geometry, bool(masked.any()), (), 1.0),
        )

    def _vertices(
        self, name: str, geometry: Geometry, wanted: bool, shape: tuple[int, ...], default: float
    ) -> F32Array:
        """An attribute in the geometry's vertex order; no rows if no primitive has it."""
        placed = [p for node in self._scene.nodes for p in self._scene.meshes[node.mesh].primitives]
        if not wanted or all(getattr(p, name) is None for p in placed):
            return np.empty((0, *shape), np.float32)
        out = np.full((len(geometry.positions_ws), *shape), default, np.float32)
        v = 0
        for p in placed:
            end = v + len(p.positions)
            if getattr(p, name) is not None:
                out[v:end] = getattr(p, name)
            v = end
        return out


def texture_store(scene: Scene) -> TextureStore | None:
    """A scene's store, or None if no material has a texture or a mask."""
    store = TextureStore(scene)
    return store if store.textured.any() or store.masked.any() else None


def _affine(texture: Texture) -> tuple[float, ...]:
    """Rows of offset + R·scale."""
    s, c = sincos_host(texture.rotation)
    (su, sv), (ou, ov) = texture.scale, texture.offset
    return (c * su, s * sv, ou, -(s * su), c * sv, ov)


def _decoding_table(wide: bool) -> F64Array:
    """Linear and sRGB values of 8-bit codes, and of 16-bit codes if some image has them."""
    table = np.empty(_SRGB_16 + 65536 if wide else _LINEAR_16)
    _fill_decoding(table[_LINEAR_8:_SRGB_8], table[_SRGB_8:_LINEAR_16])
    if wide:
        _fill_decoding(table[_LINEAR_16:_SRGB_16], table[_SRGB_16:])
    return table


@driver(parallel=False)
def _fill_decoding(linear: F64Array, srgb: F64Array) -> None:
    """Value of each code of n: code/(n − 1), and its sRGB decoding."""
    last = linear.shape[0] - 1
    for code in range(linear.shape[0]):
        linear[code] = code / last
        srgb[code] = srgb_decode(code / last)


# --------------------------------------------------------------------- kernels


@kernel
def wrap_coordinate(u: float, mode: int) -> float:
    """u brought into [0, 1]; what overflowed becomes 0."""
    if not np.isfinite(u):
        return 0.0
    if mode == REPEAT:
        return u - np.floor(u)
    if mode == MIRROR:
        half = u * 0.5
        u = (half - np.floor(half)) * 2.0
        return 2.0 - u if u > 1.0 else u
    return min(max(u, 0.0), 1.0)


@kernel
def wrap_index(i: int, size: int, mode: int) -> int:
    """Texel index of i = −1 … size."""
    if i < 0:
        return size - 1 if mode == REPEAT else 0
    if i >= size:
        return 0 if mode == REPEAT else size - 1
    return i


@inlined
def lerp(a: float, b: float, f: float) -> float:
    """a + f·(b − a); a if they are equal."""
    return a + f * (b - a)


@kernel
def sample(
    texels: AnyArray,
    decode: F64Array,
    slots: I64Array,
    affine: F64Array,
    s: int,
    u: float,
    v: float,
) -> Texel:
    """Texture s at texture coordinates (u, v), before the texture's own transform.

    A coordinate that is NaN or infinite reads as 0.
    """
    if not np.isfinite(u):
        u = 0.0
    if not np.isfinite(v):
        v = 0.0
    width, height = slots[s, WIDTH], slots[s, HEIGHT]
    wrap_u, wrap_v = slots[s, WRAP_U], slots[s, WRAP_V]
    tu = affine[s, 0] * u + affine[s, 1] * v + affine[s, 2]
    tv = affine[s, 3] * u + affine[s, 4] * v + affine[s, 5]
    x = wrap_coordinate(tu, wrap_u) * width - 0.5
    y = wrap_coordinate(tv, wrap_v) * height - 0.5
    ix, iy = np.floor(x), np.floor(y)
    fx, fy = x - ix, y - iy
    x0, x1 = wrap_index(int(ix), width, wrap_u), wrap_index(int(ix) + 1, width, wrap_u)
    y0, y1 = wrap_index(int(iy), height, wrap_v), wrap_index(int(iy) + 1, height, wrap_v)
    p00 = slots[s, FIRST] + y0 * width + x0
    p10 = slots[s, FIRST] + y0 * width + x1
    p01 = slots[s, FIRST] + y1 * width + x0
    p11 = slots[s, FIRST] + y1 * width + x1
    rgb, alpha = slots[s, DECODE_RGB], slots[s, DECODE_ALPHA]
    return Texel(
        _filter(texels, decode, rgb, 0, p00, p10, p01, p11, fx, fy),
        _filter(texels, decode, rgb, 1, p00, p10, p01, p11, fx, fy),
        _filter(texels, decode, rgb, 2, p00, p10, p01, p11, fx, fy),
        _filter(texels, decode, alpha, 3, p00, p10, p01, p11, fx, fy),
    )


@kernel
def _filter(
    texels: AnyArray,
    decode: F64Array,
    table: int,
    channel: int,
    p00: int,
    p10: int,
    p01: int,
    p11: int,
    fx: float,
    fy: float,
) -> float:
    """One channel of four texels, decoded and then mixed along u, then along v."""
    upper = lerp(
        decode[table + np.int64(texels[p00, channel])],
        decode[table + np.int64(texels[p10, channel])],
        fx,
    )
    lower = lerp(
        decode[table + np.int64(texels[p01, channel])],
        decode[table + np.int64(texels[p11, channel])],
        fx,
    )
    return lerp(upper, lower, fy)


@inlined
def mix_scalar(a0: float, a1: float, a2: float, b: Barycentric) -> float:
    """Weighted sum of three numbers; equal ones are returned unchanged."""
    if a0 == a1 and a0 == a2:
        return a0
    return b.b0 * a0 + b.b1 * a1 + b.b2 * a2


@kernel
def sample_material(
    textures: Textures, faces: I32Array, t: int, m: int, kind: int, b: Barycentric
) -> Texel:
    """Texture `kind` of material m on triangle t; all ones if the material has none."""
    s = textures.material_slot[m, kind]
    if s < 0:
        return Texel(1.0, 1.0, 1.0, 1.0)
    u = 0.0
    v = 0.0
    uv = textures.uv1 if textures.slots[s, UV_SET] == 1 else textures.uv0
    if uv.shape[0] > 0:
        i0, i1, i2 = faces[t, 0], faces[t, 1], faces[t, 2]
        u = mix_scalar(np.float64(uv[i0, 0]), np.float64(uv[i1, 0]), np.float64(uv[i2, 0]), b)
        v = mix_scalar(np.float64(uv[i0, 1]), np.float64(uv[i1, 1]), np.float64(uv[i2, 1]), b)
    return sample(textures.texels, textures.decode, textures.slots, textures.affine, s, u, v)


@kernel
def passes_mask(textures: Textures, faces: I32Array, t: int, m: int, b: Barycentric) -> bool:
    """Whether a masked material's alpha reaches its cutoff: factor · texture · vertex."""
    alpha = textures.alpha[m] * sample_material(textures, faces, t, m, BASE, b).a
    vertex = textures.alphas
    if vertex.shape[0] > 0:
        alpha *= mix_scalar(
            np.float64(vertex[faces[t, 0]]),
            np.float64(vertex[faces[t, 1]]),
            np.float64(vertex[faces[t, 2]]),
            b,
        )
    return alpha >= textures.cutoff[m]
