"""Textures of a glTF file: which image, which sampler, which transform. Only used images are read.

Source: glTF 2.0, sections 3.8 (textures, images, samplers) and 3.9.2; KHR_texture_transform,
EXT_texture_webp, KHR_texture_basisu, MSFT_texture_dds.
"""

from __future__ import annotations

from collections.abc import Hashable
from pathlib import PurePosixPath
from typing import Any
from urllib.parse import unquote

from ..errors import FileError
from ..texture import Image, Texture, WrapName
from .gltf_accessors import Accessors
from .gltf_json import Gltf
from .images import NoRoomError, read_image

_WRAPS: dict[Any, WrapName] = {10497: "repeat", 33648: "mirror", 33071: "clamp"}
_NEAREST = 9728

_PLAIN_SOURCES = ("EXT_texture_webp",)
_OTHER_SOURCES = ("KHR_texture_basisu", "MSFT_texture_dds", "EXT_texture_avif")

_BUDGET, _BUDGET_PER_BYTE = 2**28, 64
"""Bytes of decoded images at most: this, and so many times the bytes that they are decoded from."""

_MAX_ROTATION = 2.0**20


class TextureProblem(Exception):
    """Why a texture cannot be drawn: one line for a note; the material's factor is used."""


class Textures:
    """Reads a file's textures; `images` holds what has been read so far."""

    def __init__(self, gltf: Gltf, accessors: Accessors) -> None:
        self._gltf = gltf
        self._accessors = accessors
        self.images: list[Image] = []
        self.nearest: set[int] = set()
        self._places: dict[Hashable, int | TextureProblem] = {}
        self._encoded = self._decoded = 0

    def texture(self, info: dict[str, Any], where: str) -> Texture:
        """The texture of a textureInfo object.

        Raises TextureProblem if its image cannot be drawn, FileError if the file is damaged.
        """
        gltf = self._gltf
        entry = gltf.item("textures", info.get("index"))
        wrap = self._wrap(entry, info["index"])
        uv_set = gltf.whole(info, "texCoord", where, 0)
        values: dict[str, Any] = {}
        transform = gltf.extension(info, "KHR_texture_transform", where)
        if transform is not None:
            where = f"{where} KHR_texture_transform"
            uv_set = gltf.whole(transform, "texCoord", where, uv_set)
            for key in ("offset", "scale"):
                if key in transform:
                    u, v = gltf.numbers(transform[key], 2, f"{where}.{key}")
                    values[key] = (u, v)
            values["rotation"] = gltf.number(transform.get("rotation", 0.0), f"{where}.rotation")
            if abs(values["rotation"]) > _MAX_ROTATION:
                raise gltf.error(f"{where}.rotation is too large; expected radians: export again")
        if uv_set > 1:
            raise TextureProblem(f"it reads texture coordinates {uv_set} (0 and 1 are read)")
        return Texture(self._image(entry), uv_set, wrap, **values)

    def _wrap(self, entry: dict[str, Any], index: int) -> tuple[WrapName, WrapName]:
        gltf = self._gltf
        if "sampler" not in entry:
            return ("repeat", "repeat")
        sampler = gltf.item("samplers", entry["sampler"])
        if sampler.get("magFilter") == _NEAREST:
            self.nearest.add(index)
        found: list[WrapName] = []
        for key in ("wrapS", "wrapT"):
            code = sampler.get(key, 10497)
            if not isinstance(code, int) or code not in _WRAPS:
                raise gltf.error(
                    f"samplers[{entry['sampler']}].{key} is {str(code)[:20]}; expected 10497, 33648"
                    " or 33071: export again"
                )
            found.append(_WRAPS[code])
        return (found[0], found[1])

    def _image(self, entry: dict[str, Any]) -> int:
        """Index into `images` of the first source that can be read: the core one, then WebP."""
        gltf = self._gltf
        sources = [entry["source"]] if "source" in entry else []
        others = []
        for name in (*_PLAIN_SOURCES, *_OTHER_SOURCES):
            extension = gltf.extension(entry, name, "texture")
            if extension is not None and name in _PLAIN_SOURCES:
                sources.append(extension.get("source"))
            elif extension is not None:
                others.append(name)
        if not sources:
            raise TextureProblem(f"its image is in {others[0]} only" if others else "no image")
        return self._place(sources[0])

    def _place(self, index: Any) -> int:
        entry = self._gltf.item("images", index)
        if "bufferView" in entry:
            key: Hashable = ("view", str(entry["bufferView"]))
        else:
            key = ("uri", str(entry.get("uri")))
        if key not in self._places:
            try:
                self._places[key] = self._read(entry, index)
            except TextureProblem as problem:
                self._places[key] = problem
        place = self._places[key]
        if isinstance(place, TextureProblem):
            raise place
        return place

    def _read(self, entry: dict[str, Any], index: int) -> int:
        uri = entry.get("uri")
        name = entry.get("name")
        if not name and isinstance(uri, str) and not uri.startswith("data:"):
            name = PurePosixPath(unquote(uri)).name
        name = str(name or f"image {index}")
        if "bufferView" in entry:
            data = bytes(self._accessors.view(entry["bufferView"], f"images[{index}]"))
        elif isinstance(uri, str):
            try:
                data = bytes(self._accessors.resource(uri))
            except FileError as error:
                raise self._problem(error) from None
        else:
            raise self._gltf.error(f"images[{index}] has no data; expected a uri: export again")
        self._encoded += len(data)
        room = _BUDGET + _BUDGET_PER_BYTE * self._encoded - self._decoded
        try:
            image = read_image(name, data, room=room)
        except NoRoomError as error:
            raise self._gltf.error(str(error)) from None
        except FileError as error:
            raise self._problem(error) from None
        self._decoded += image.pixels.nbytes
        self.images.append(image)
        return len(self.images) - 1

    def _problem(self, error: FileError) -> TextureProblem:
        """A problem for a note; under strict loading it ends the load."""
        text = str(error).removeprefix(f"{self._gltf.path}: ")
        if self._gltf.options.strict:
            raise self._gltf.error(text)
        return TextureProblem(text)
