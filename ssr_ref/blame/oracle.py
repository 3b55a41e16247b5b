"""The oracle: exact cells on the same rays, buffers, slab or planes, bias and max_distance.

Where it differs from the truth the depth buffer is to blame, where a method differs from it the
method is. Its rays are reflected here, by a formula written apart from the tracers': a wrong sign
in theirs must not move the oracle along with them. Where both are right the directions have the
same bits. Clipping, projection and the slab test are shared: they are the model that is measured.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from ..buffers import GBuffer, HitBuffer
from ..camera import ViewParams
from ..settings import Settings
from ..ssr.trace import Prepared, prepare
from ..typed import F64Array, FloatArray


def trace_oracle(view: ViewParams, gbuffer: GBuffer, settings: Settings) -> HitBuffer:
    """What exact cells find in the G-buffer; settings must be resolved. One trace."""
    assert gbuffer.normal_vs is not None
    prepared = prepare(view, gbuffer, oracle_settings(settings))
    directions = mirror_directions(view, gbuffer.normal_vs)
    inputs = prepared.inputs._replace(direction=directions)
    return run(view, prepared._replace(inputs=inputs))


def oracle_settings(settings: Settings) -> Settings:
    """The same solids, rays and fades, walked by exact cells without a limit on steps."""
    return replace(
        settings,
        tracer="cells",
        stride=1,
        jitter=False,
        interval="column",
        refine="auto",
        max_steps=None,
        listing=False,
    )


def run(view: ViewParams, prepared: Prepared) -> HitBuffer:
    """All rows of a prepared trace."""
    prepared.rows(view, 0, view.height, *prepared.fixed, prepared.inputs, prepared.out)
    return prepared.hits


def mirror_directions(view: ViewParams, normal: FloatArray) -> F64Array:
    """(H, W, 3) unit view-space directions of the reflected rays; NaN where a normal is unusable.

    d − 2·(d·n)·n of the unit ray d through the pixel's centre and the unit normal n.
    """
    d = np.empty((view.height, view.width, 3))
    d[..., 0] = ((np.arange(view.width) + 0.5) - view.cx) / view.fx if view.perspective else 0.0
    d[..., 1] = (
        ((view.cy - (np.arange(view.height) + 0.5)) / view.fy)[:, None] if view.perspective else 0.0
    )
    d[..., 2] = -1.0
    with np.errstate(all="ignore"):
        d, n = _unit(d), _unit(normal.astype(np.float64))
        twice = 2.0 * ((d[..., 0] * n[..., 0] + d[..., 1] * n[..., 1]) + d[..., 2] * n[..., 2])
        return _unit(d - twice[..., None] * n)


def _unit(v: F64Array) -> F64Array:
    square = (v[..., 0] * v[..., 0] + v[..., 1] * v[..., 1]) + v[..., 2] * v[..., 2]
    out: F64Array = v / np.sqrt(square)[..., None]
    return out
