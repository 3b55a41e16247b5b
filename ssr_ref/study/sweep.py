"""The settings that `bench` compares: every method over what changes its cost and its error."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field
from typing import Any

from ..errors import SettingsError
from ..settings import METHODS, Settings, method_settings

MARCH_STEPS = (4, 5, 6, 7, 8, 9)
"""Steps of the march are 2⁻ⁿ of the scene's radius for these n."""
DDA_STRIDES = (1, 2, 4, 8, 16)
THICKNESSES = ("back_faces", "constant")


@dataclass(frozen=True, slots=True)
class Case:
    """One method with its settings. changes: what it sets on top of the base."""

    method: str
    settings: Settings
    changes: dict[str, Any] = field(default_factory=dict)

    @property
    def label(self) -> str:
        """Method and changes in words, such as "dda stride=4 jitter"."""
        words = [self.method]
        for name, value in self.changes.items():
            if isinstance(value, bool):
                words.append(name if value else f"no {name}")
            else:
                words.append(
                    f"{name}={value:.4g}" if isinstance(value, float) else f"{name}={value}"
                )
        return " ".join(words)


def sweep(base: Settings, radius: float, methods: tuple[str, ...] = tuple(METHODS)) -> list[Case]:
    """Every case of the methods, by name of `METHODS`.

    march: step × refinement at constant growth. dda: stride × refinement × jitter × thickness, and
    planes at each stride. exact, planes: × thickness. radius: the scene's, for steps.
    Raises SettingsError for an unknown method.
    """
    cases = []
    for method in methods:
        if method not in METHODS:
            raise SettingsError(f"method is '{method}'; expected one of {', '.join(METHODS)}")
        for changes in _changes(method, radius):
            cases.append(Case(method, method_settings(method, base, **changes), changes))
    return cases


def _changes(method: str, radius: float) -> Iterator[dict[str, Any]]:
    if method == "march":
        for n in MARCH_STEPS:
            for refine in ("none", "bisect", "secant"):
                yield {"step": radius * 2.0**-n, "growth": "constant", "refine": refine}
    elif method == "dda":
        for thickness in THICKNESSES:
            yield {"stride": 1, "thickness_from": thickness}
            yield {"stride": 1, "jitter": True, "thickness_from": thickness}
            for stride in DDA_STRIDES[1:]:
                for refine in ("rewalk", "bisect", "none"):
                    for jitter in (False, True):
                        yield {
                            "stride": stride,
                            "refine": refine,
                            **({"jitter": True} if jitter else {}),
                            "thickness_from": thickness,
                        }
        for stride in DDA_STRIDES:
            yield {"stride": stride, "surface": "plane"}
    else:
        for thickness in THICKNESSES:
            yield {"thickness_from": thickness}
