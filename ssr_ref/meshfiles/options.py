"""How a mesh file is read: what the file does not say itself, and what the reader may do."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal, get_args

from ..errors import FileError, SettingsError
from ..scene import LoadReport

NormalsName = Literal["authored", "flat", "smooth", "crease"]
UpName = Literal["y", "z"]

UNITS: dict[str, float] = {"m": 1.0, "cm": 0.01, "mm": 0.001, "inch": 0.0254, "foot": 0.3048}
"""Metres in one unit of the file."""


@dataclass(frozen=True, slots=True, kw_only=True)
class LoadOptions:
    """Options of one load. Raises SettingsError for a value that is not listed.

    normals : "authored" (what the file has; without: glTF is flat, other formats as "crease"),
        "crease" (sharp beyond 30°), "smooth" or "flat" whatever the file has.
    up : the file's upward axis; a scene is y up.
    unit : what one unit of the file is, "m", "cm", "mm", "inch" or "foot"; a scene is in metres.
        None: what the file says (3MF does), else metres.
    strict : refuse a file of which anything is skipped, replaced or not drawn as it says.
    allow_outside : let a file refer to files outside its own folder.
    scene : of a glTF file with several, by index or name; None: its default.
    """

    normals: NormalsName = "authored"
    up: UpName = "y"
    unit: str | None = None
    strict: bool = False
    allow_outside: bool = False
    scene: int | str | None = None

    def __post_init__(self) -> None:
        _choice("normals", self.normals, get_args(NormalsName))
        _choice("up", self.up, get_args(UpName))
        if self.unit is not None:
            _choice("unit", self.unit, tuple(UNITS))
        for name in ("strict", "allow_outside"):
            if not isinstance(getattr(self, name), bool):
                raise SettingsError(f"{name} is {getattr(self, name)!r}; expected True or False")
        good = self.scene is None or (
            isinstance(self.scene, int | str) and not isinstance(self.scene, bool)
        )
        if not good or (isinstance(self.scene, int) and self.scene < 0):
            raise SettingsError(
                f"scene is {self.scene!r}; expected None, an index from 0, or a scene's name"
            )


def _choice(name: str, value: Any, choices: tuple[str, ...]) -> None:
    if not isinstance(value, str) or value not in choices:
        raise SettingsError(f"{name} is {value!r}; expected one of {', '.join(choices)}")


def check_strict(path: Path, report: LoadReport, options: LoadOptions) -> None:
    """Raise FileError if `options.strict` and the report names anything not drawn as it stands."""
    for what, found in (
        ("skips", report.skipped),
        ("replaces", report.fallbacks),
        ("does not draw", report.unsupported),
    ):
        if options.strict and found:
            listed = "; ".join(found[:3]) + (f" and {len(found) - 3} more" * (len(found) > 3))
            raise FileError(
                " ".join(f"{path}: strict loading: the reader {what} {listed}".split())
                + "; expected a file of which everything is drawn: change it, or load without "
                "strict"
            )
