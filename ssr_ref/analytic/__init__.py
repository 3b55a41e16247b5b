"""Spheres, planes, discs and boxes with closed-form G-buffers and closed-form reflections.

No tessellation and no snapping: what a screen-space tracer finds is taken against an exact answer.
"""

from ..buffers import TruthClass as TruthClass
from .gbuffer import analytic_gbuffer as analytic_gbuffer
from .metrics import HitErrors as HitErrors
from .metrics import contact_gaps as contact_gaps
from .metrics import hit_errors as hit_errors
from .reflections import AnalyticReflections as AnalyticReflections
from .reflections import analytic_reflections as analytic_reflections
from .scene import AnalyticScene as AnalyticScene
from .shapes import Box as Box
from .shapes import Disc as Disc
from .shapes import Plane as Plane
from .shapes import Sphere as Sphere
