"""Planar mirrors: the scene drawn again by the camera's mirror image, clipped at the mirror.

The method that screen-space reflection replaces: exact for flat mirrors, at the price of one pass
over the scene for each of them, and without a meaning for curved ones.
"""

from .find import Mirrors as Mirrors
from .find import Refusal as Refusal
from .find import find_mirrors as find_mirrors
from .mirrors import PlanarMirror as PlanarMirror
from .mirrors import mirror_on_plane as mirror_on_plane
from .reflections import PlanarReflection as PlanarReflection
from .reflections import planar_reflections as planar_reflections
