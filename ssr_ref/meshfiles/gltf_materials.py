"""Materials of a glTF file: factors, textures, alpha, and the list of what is not drawn.

Source: glTF 2.0, section 3.9; KHR_materials_emissive_strength, KHR_materials_unlit.
"""

from __future__ import annotations

from collections import Counter
from dataclasses import replace
from typing import Any

import numpy as np

from ..scene import Material
from ..texture import Texture
from ..typed import Rgb
from .gltf_json import Gltf
from .gltf_textures import TextureProblem, Textures

REFLECTIVITY_KEY = "ssr_ref_reflectivity"
"""Key in a material's `extras` that holds the reflectivity [r, g, b] of `Material`."""

ALPHA_KEY = "ssr_ref_alpha"
"""Key in a material's `extras`: `Material.alpha` of a material that is not masked."""

EMISSIVE_KEY = "ssr_ref_emissive"
"""Key in a material's `extras`: an emission that is not exactly factor times strength."""

UNLIT_KEY = "ssr_ref_unlit"
"""Key in a material's `extras`, true: an unlit material keeps its other factors and textures."""

THICKNESS_KEY = "ssr_ref_thickness"
"""Key in a material's `extras` that holds `Material.thickness`, "inf" for an infinite one."""

DEFAULT_CUTOFF = 0.5

DRAWN = (
    "KHR_materials_emissive_strength",
    "KHR_materials_unlit",
    "KHR_materials_variants",
)
"""Material extensions that are drawn as they say; of variants, the default."""


class Materials:
    """Reads a file's materials on demand, each once; `index(None)` is the default material.

    features : names of what used materials ask for and is not drawn, counted. notes : one line for
    each texture that cannot be drawn. fallbacks : the names of their materials.
    """

    def __init__(self, gltf: Gltf, textures: Textures) -> None:
        self._gltf = gltf
        self._textures = textures
        count = len(gltf.items("materials"))
        self._materials = [self._factors(i) for i in range(count)]
        self._used: set[int] = set()
        self._default: int | None = None
        self.features: Counter[str] = Counter()
        self.blended = 0
        self.notes: list[str] = []
        self.fallbacks: list[str] = []

    @property
    def all(self) -> tuple[Material, ...]:
        """Every material of the file, then the default if it is used."""
        return tuple(self._materials)

    def look(self, index: int) -> Material:
        """Material `index` of `all`."""
        return self._materials[index]

    def use(self, index: Any) -> int:
        """Index into `all` of a primitive's material (None: the default), textures read."""
        if index is None:
            if self._default is None:
                # Section 3.9.6: every factor of the default material is 1, emission 0.
                self._default = len(self._materials)
                self._materials.append(
                    Material("default", base_color=(1.0, 1.0, 1.0), metallic=1.0, roughness=1.0)
                )
            return self._default
        entry = self._gltf.item("materials", index)
        assert isinstance(index, int)
        if index not in self._used:
            self._used.add(index)
            self._materials[index] = self._textured(entry, index)
            self._list_features(entry, index)
        return index

    # -------------------------------------------------------------------- factors

    def _factors(self, index: int) -> Material:
        """Material `index` from its factors (linear); glTF's defaults are white, metal, rough."""
        gltf = self._gltf
        entry = gltf.item("materials", index)
        where = f"materials[{index}]"
        pbr = gltf.object(entry, "pbrMetallicRoughness", where)
        base = gltf.numbers(pbr.get("baseColorFactor", [1.0] * 4), 4, f"{where}.baseColorFactor")
        extras = entry.get("extras")
        extras = extras if isinstance(extras, dict) else {}
        reflectivity: Rgb | None = None
        if REFLECTIVITY_KEY in extras:
            r, g, b = gltf.numbers(
                extras[REFLECTIVITY_KEY], 3, f"{where}.extras.{REFLECTIVITY_KEY}"
            )
            reflectivity = (r, g, b)
        cutoff, alpha = None, 1.0
        if entry.get("alphaMode") == "MASK":
            cutoff = gltf.number(entry.get("alphaCutoff", DEFAULT_CUTOFF), f"{where}.alphaCutoff")
            alpha = base[3]
        elif ALPHA_KEY in extras:
            alpha = gltf.number(extras[ALPHA_KEY], f"{where}.extras.{ALPHA_KEY}")
        thickness: float | None = None
        if THICKNESS_KEY in extras:
            value = extras[THICKNESS_KEY]
            name = f"{where}.extras.{THICKNESS_KEY}"
            thickness = np.inf if value == "inf" else gltf.number(value, name)
        unlit = gltf.extension(entry, "KHR_materials_unlit", where) is not None
        bare = _bare(entry)
        metallic = gltf.number(pbr.get("metallicFactor", 1.0), f"{where}.metallicFactor")
        roughness = gltf.number(pbr.get("roughnessFactor", 1.0), f"{where}.roughnessFactor")
        return Material(
            name=str(entry.get("name") or f"material {index}"),
            base_color=(base[0], base[1], base[2]),
            # An unlit material has a colour only: it neither reflects nor emits.
            metallic=0.0 if bare else metallic,
            roughness=1.0 if bare else roughness,
            emissive=(0.0, 0.0, 0.0) if bare else self._emission(entry, where),
            reflectivity=reflectivity,
            thickness=thickness,
            double_sided=entry.get("doubleSided", False) is True,
            alpha=alpha,
            alpha_cutoff=cutoff,
            unlit=unlit,
        )

    def _emission(self, entry: dict[str, Any], where: str) -> Rgb:
        gltf = self._gltf
        extras = entry.get("extras")
        if isinstance(extras, dict) and EMISSIVE_KEY in extras:
            r, g, b = gltf.numbers(extras[EMISSIVE_KEY], 3, f"{where}.extras.{EMISSIVE_KEY}")
            return (r, g, b)
        r, g, b = gltf.numbers(entry.get("emissiveFactor", [0.0] * 3), 3, f"{where}.emissiveFactor")
        extension = gltf.extension(entry, "KHR_materials_emissive_strength", where) or {}
        strength = gltf.number(extension.get("emissiveStrength", 1.0), f"{where}.emissiveStrength")
        return (r * strength, g * strength, b * strength)

    # ------------------------------------------------------------------- textures

    def _textured(self, entry: dict[str, Any], index: int) -> Material:
        material = self._materials[index]
        pbr = self._gltf.object(entry, "pbrMetallicRoughness", f"materials[{index}]")
        base = self._texture(pbr, "baseColorTexture", index)
        if _bare(entry):
            return replace(material, base_color_texture=base)
        emission = self._texture(entry, "emissiveTexture", index)
        # The factor alone, mostly white, would make the whole surface glow.
        dark = emission is None and "emissiveTexture" in entry
        return replace(
            material,
            base_color_texture=base,
            metallic_roughness_texture=self._texture(pbr, "metallicRoughnessTexture", index),
            emissive_texture=emission,
            emissive=(0.0, 0.0, 0.0) if dark else material.emissive,
        )

    def _texture(self, owner: dict[str, Any], key: str, index: int) -> Texture | None:
        if key not in owner:
            return None
        name = self._materials[index].name
        where = f"materials[{index}].{key}"
        try:
            return self._textures.texture(self._gltf.object(owner, key, where), where)
        except TextureProblem as problem:
            instead = "nothing" if key == "emissiveTexture" else "its factor"
            self.notes.append(f"material '{name}': {instead} is used for {key}: {problem}")
            self.fallbacks.append(name)
            return None

    # ------------------------------------------------------------ what is not drawn

    def _list_features(self, entry: dict[str, Any], index: int) -> None:
        for key in ("normalTexture", "occlusionTexture"):
            self.features[key] += key in entry
        for name in self._gltf.object(entry, "extensions", f"materials[{index}]"):
            self.features[str(name)] += name not in DRAWN
        self.blended += entry.get("alphaMode") == "BLEND"


def _bare(entry: dict[str, Any]) -> bool:
    """Whether a material is unlit and nothing but its colour counts."""
    extensions, extras = entry.get("extensions"), entry.get("extras")
    unlit = isinstance(extensions, dict) and "KHR_materials_unlit" in extensions
    return unlit and not (isinstance(extras, dict) and extras.get(UNLIT_KEY) is True)
