"""Words and files of a command line as values; every error is one line."""

from __future__ import annotations

import json
import re
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeVar

from ..errors import CameraError, FileError, SettingsError, SsrRefError

if TYPE_CHECKING:
    from ..camera import Camera, View

T = TypeVar("T")


def parse_size(text: str) -> tuple[int, int]:
    """(W, H) of "960x540"; the range is checked by Settings. Raises SettingsError."""
    match = re.fullmatch(r"([0-9]{1,9})[xX×]([0-9]{1,9})", text.strip())
    if match is None:
        raise SettingsError(f"size is '{text}'; expected WIDTHxHEIGHT in pixels, such as 960x540")
    return int(match[1]), int(match[2])


def parse_scene(text: str | None) -> int | str | None:
    """A scene's index where the text is a whole number, else its name."""
    return int(text) if text is not None and re.fullmatch(r"[0-9]{1,9}", text) else text


def parse_color(text: str) -> tuple[float, float, float]:
    """(r, g, b) of "0.1,0.2,0.3"; the range is checked by Settings. Raises SettingsError."""
    try:
        r, g, b = (float(part) for part in text.split(","))
    except ValueError:
        raise SettingsError(
            f"fallback color is '{text}'; expected three numbers such as 0.1,0.2,0.3"
        ) from None
    return r, g, b


def parse_pair(text: str, name: str) -> tuple[float, float]:
    """(a, b) of "0.1,0.9"; the range is checked by Settings. Raises SettingsError."""
    try:
        a, b = (float(part) for part in text.split(","))
    except ValueError:
        raise SettingsError(f"{name} is '{text}'; expected two numbers such as 0.1,0.9") from None
    return a, b


def parse_camera(data: Any) -> Camera | View:
    """A camera from its matrices, or a view, which has an eye and a target instead."""
    from ..camera import Camera, View

    if not isinstance(data, dict):
        raise CameraError(f"camera is a {type(data).__name__}; expected a JSON object")
    matrices = "world_from_view" in data or "clip_from_view" in data
    return Camera.from_json(data) if matrices else View.from_json(data)


def read_json(path: Path, parse: Callable[[Any], T], kind: type[SsrRefError]) -> T:
    """Parse a JSON file; every error names the file. `kind`: of an error in its contents."""
    try:
        data = json.loads(path.read_bytes())
    except OSError as error:
        raise FileError(f"{path} cannot be read ({error.strerror}); expected a JSON file") from None
    except (ValueError, RecursionError) as error:
        raise FileError(f"{path} is not JSON ({error}); expected a JSON object") from None
    try:
        return parse(data)
    except SsrRefError as error:
        raise type(error)(f"{path}: {error}") from None
    except (KeyError, TypeError, ValueError, AttributeError) as error:
        raise kind(f"{path}: cannot be read ({error}); expected what a bundle holds") from None
