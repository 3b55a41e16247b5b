"""MTL material libraries: Kd, Ke, Pm, Pr, d and their maps as metallic-roughness materials.

Numbers are linear RGB as they stand (MTL defines no encoding) and multiply their maps; a map alone
has the factor 1. A texture coordinate keeps the file's v up: v is turned round in the texture's
transform, so the float32 coordinates of the file stay. With `-s` and `-o`, u' = s·u + o.

`map_d` makes a cut-out: alpha mode MASK at ½, since it is how OBJ says leaves and fences; `d` alone
(glass) would need blending and is drawn opaque, reported. Scalar maps are read from the channel
that `-imfchan` names, else red; `map_d` from alpha where the image has any.

What has no place in the shading model (Ka, Ks, Ns, Ni, Tf, illum, sharpness) is ignored.

Source: Alias/Wavefront, "MTL material format", with the PBR keys Pr, Pm, Ke by Exocortex.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TypeAlias

import numpy as np

from ..errors import FileError
from ..scene import Material
from ..texture import Image, Texture
from ..typed import Rgb
from .beside import read_beside
from .building import WHITE, Findings, without_path
from .mtl_maps import Map, MapImages, is_number, parse_statement, plain_reference
from .options import LoadOptions

Plane: TypeAlias = tuple[int, int] | None
"""An image's number and one of its channels."""

ALPHA_CUTOFF = 0.5
"""Alpha below it is cut out where a material has a map_d."""

_MAPS = ("map_kd", "map_ke", "map_d", "map_pm", "map_pr")
_NOT_DRAWN = ("map_", "bump", "norm", "disp", "decal", "refl", "ps", "pc", "pcr", "aniso", "anisor")


class MtlLibrary:
    """The materials that an OBJ file's libraries define; images are read when they are used."""

    def __init__(
        self, path: Path, libraries: list[str], options: LoadOptions, findings: Findings
    ) -> None:
        self._maps = MapImages(path, options)
        self._path = path
        self._options = options
        self._findings = findings
        self._entries: dict[str, dict[str, str]] = {}
        self._read: set[str] = set()
        self._made: dict[tuple[str, bool], Material | None] = {}
        for rest in dict.fromkeys(libraries):
            for text in self._texts(rest):
                self._parse(text)

    @property
    def images(self) -> list[Image]:
        """Every image read or made so far."""
        return self._maps.images

    def _texts(self, rest: str) -> list[str]:
        """The libraries of one mtllib statement: one name with spaces, or several without."""
        found = []
        names = [rest] if _exists(self._path, rest) else rest.split() or [rest]
        for name in names:
            reference = plain_reference(name)
            if reference in self._read:
                continue
            self._read.add(reference)
            try:
                data = read_beside(self._path, reference, self._options)
            except FileError as error:
                self._fall_back("materials", f"mtllib {without_path(self._path, error)}")
                continue
            found.append(data.decode("utf-8-sig", "replace"))
        return found

    def _parse(self, text: str) -> None:
        entry: dict[str, str] = {}
        for line in text.replace("\\\r\n", " ").replace("\\\n", " ").splitlines():
            keyword, _, rest = line.strip().partition(" ")
            if "\t" in keyword:
                keyword, _, rest = line.strip().partition("\t")
            rest = rest.strip()
            if keyword == "newmtl":
                entry = self._entries.setdefault(rest, {})
                entry.clear()
            elif keyword and not keyword.startswith("#"):
                entry[keyword.lower()] = rest

    def _fall_back(self, name: str, reason: str) -> None:
        self._findings.fallbacks.append(f"{name}: {reason}")

    def material(self, name: str | None, *, has_uv: bool) -> Material | None:
        """The material of this name for faces with or without texture coordinates.

        None where there is none of this name: reported, if a name was given.
        """
        if name is None:
            return None
        key = (name, has_uv)
        if key not in self._made:
            entry = self._entries.get(name)
            if entry is None and (name, not has_uv) not in self._made:
                self._fall_back(name, "in no .mtl file, the default is used")
            self._made[key] = None if entry is None else self._material(name, entry, has_uv)
        return self._made[key]

    def _material(self, name: str, entry: dict[str, str], has_uv: bool) -> Material:
        maps: dict[str, Map] = {}
        named = [key for key in _MAPS if key in entry]
        if has_uv:
            for key in named:
                found = self._map(name, key, entry[key])
                if found is not None:
                    maps[key] = found
        elif named:
            self._fall_back(name, f"{', '.join(named)} on faces without texture coordinates")
        self._note_unsupported(name, entry)
        default = Material()
        base, cutoff = self._base_and_alpha(name, maps)
        alpha = _number(entry.get("d"), 1.0 - _number(entry.get("tr"), 0.0))
        if alpha < 1.0 and cutoff is None:
            self._unsupported(f"{name}: d {alpha:g}, drawn opaque")
        one = WHITE if "map_kd" in maps else default.base_color
        glow = WHITE if "map_ke" in maps else default.emissive
        return Material(
            name,
            base_color=self._rgb(name, entry, "kd", one),
            metallic=_number(entry.get("pm"), 1.0 if "map_pm" in maps else default.metallic),
            roughness=_number(entry.get("pr"), 1.0 if "map_pr" in maps else default.roughness),
            emissive=self._rgb(name, entry, "ke", glow),
            alpha=alpha,
            alpha_cutoff=cutoff,
            base_color_texture=base,
            metallic_roughness_texture=self._metallic_roughness(name, maps),
            emissive_texture=maps["map_ke"].texture() if "map_ke" in maps else None,
        )

    def _rgb(self, name: str, entry: dict[str, str], key: str, default: Rgb) -> Rgb:
        """Three numbers, or one for all channels."""
        if key not in entry:
            return default
        try:
            numbers = [float(word) for word in entry[key].partition("#")[0].split()]
        except ValueError:
            numbers = []
        if len(numbers) == 1:
            numbers *= 3
        if len(numbers) < 3 or not all(np.isfinite(v) and v >= 0.0 for v in numbers):
            self._fall_back(name, f"{key.capitalize()} {entry[key][:40]}")
            return default
        return (numbers[0], numbers[1], numbers[2])

    def _note_unsupported(self, name: str, entry: dict[str, str]) -> None:
        keys = [k for k in entry if k.startswith(_NOT_DRAWN) and k not in _MAPS]
        if keys:
            self._unsupported(f"{name}: {', '.join(sorted(keys))}")

    def _unsupported(self, line: str) -> None:
        if line not in self._findings.unsupported:
            self._findings.unsupported.append(line)

    def _map(self, name: str, key: str, rest: str) -> Map | None:
        """The map of one statement; None where its image cannot be used: reported."""
        found = parse_statement(rest)
        if found.ignored:
            self._unsupported(f"{name}: {key} with {', '.join(found.ignored)}")
        try:
            image = self._maps.read(found.reference)
        except FileError as error:
            self._fall_back(name, f"{key} {without_path(self._path, error)}")
            return None
        return Map(image, found.wrap, found.offset, found.scale, found.channel)

    def _pack(self, name: str, layout: Map, planes: Sequence[Plane]) -> Texture | None:
        try:
            return layout.texture(self._maps.pack(planes))
        except FileError as error:
            self._fall_back(name, without_path(self._path, error))
            return None

    def _base_and_alpha(
        self, name: str, maps: dict[str, Map]
    ) -> tuple[Texture | None, float | None]:
        color, alpha = maps.get("map_kd"), maps.get("map_d")
        if alpha is None:
            return (None if color is None else color.texture()), None
        channel = alpha.channel
        if channel is None:
            channel = 3 if self._maps.has_alpha(alpha.image) else 0
        plane = (alpha.image, channel)
        if color is None:
            texture = self._pack(name, alpha, (None, None, None, plane))
        elif plane == (color.image, 3) and self._maps.same_layout(color, alpha):
            texture = color.texture()
        elif self._maps.same_layout(color, alpha):
            rgb = [(color.image, k) for k in range(3)]
            texture = self._pack(name, color, (*rgb, plane))
        else:
            self._fall_back(name, "map_d differs in size or layout from map_Kd")
            return color.texture(), None
        return texture, None if texture is None else ALPHA_CUTOFF

    def _metallic_roughness(self, name: str, maps: dict[str, Map]) -> Texture | None:
        """Roughness in green, metallic in blue; a map that is missing is 1."""
        metallic, roughness = maps.get("map_pm"), maps.get("map_pr")
        if metallic is not None and roughness is not None:
            if not self._maps.same_layout(roughness, metallic):
                self._fall_back(name, "map_Pm differs in size or layout from map_Pr")
                metallic = None
        layout = roughness or metallic
        if layout is None:
            return None
        return self._pack(name, layout, (None, _scalar(roughness), _scalar(metallic), None))


def _scalar(found: Map | None) -> Plane:
    return None if found is None else (found.image, found.channel or 0)


def _exists(path: Path, name: str) -> bool:
    try:
        return (path.parent / name.replace("\\", "/")).is_file()
    except (OSError, ValueError):
        return False


def _number(text: str | None, default: float) -> float:
    """The last number of a statement (`d -halo 0.5` has an option before), if it is ≥ 0."""
    words = (text or "").partition("#")[0].split()
    if not words or not is_number(words[-1]) or float(words[-1]) < 0.0:
        return default
    return float(words[-1])
