"""Every kernel that has test vectors, group by group."""

from __future__ import annotations

from collections.abc import Sequence

from ..errors import MathsError
from . import cases_codes, cases_maps, cases_ray
from .vectors import Subject

SUBJECTS: tuple[Subject, ...] = (
    *cases_ray.SUBJECTS,
    *cases_maps.SUBJECTS,
    *cases_codes.SUBJECTS,
)


def select(names: Sequence[str] = ()) -> tuple[Subject, ...]:
    """The subjects of these kernels or with these titles; all of them for no name.

    Raises MathsError for a name that is neither.
    """
    known = list(dict.fromkeys(subject.kernel for subject in SUBJECTS))
    for name in names:
        if not any(name in (s.kernel, s.title) for s in SUBJECTS):
            raise MathsError(f"no kernel '{name}' has test vectors; expected {', '.join(known)}")
    return tuple(s for s in SUBJECTS if not names or {s.kernel, s.title} & set(names))
