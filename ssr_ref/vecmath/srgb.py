"""The sRGB transfer functions: linear light to code and back.

Source: IEC 61966-2-1:1999, section 5.2, with its rounded constants: a line near black, a shifted
power above. Because they are rounded the two pieces do not quite meet: at its threshold the curve
of `srgb_encode` lies 2.9e-8 under the line, that of `srgb_decode` 2.3e-9 over it.

Differs here: nothing is clamped. Below the threshold, negative numbers included, the line goes on;
above 1 the power does. Who wants [0, 1] clamps first, as a GPU's unorm target does.
"""

from __future__ import annotations

from .._jit import kernel
from .elementary import pow as power

LINEAR_THRESHOLD = 0.0031308
CODE_THRESHOLD = 0.04045
SLOPE = 12.92
OFFSET = 0.055
SCALE = 1.055
EXPONENT = 2.4


@kernel
def srgb_encode(linear: float) -> float:
    """Code of linear light; NaN gives NaN, ±inf gives ±inf."""
    if linear <= LINEAR_THRESHOLD:
        return SLOPE * linear
    return SCALE * power(linear, 1.0 / EXPONENT) - OFFSET


@kernel
def srgb_decode(code: float) -> float:
    """Linear light of a code; NaN gives NaN, ±inf gives ±inf."""
    if code <= CODE_THRESHOLD:
        return code / SLOPE
    return power((code + OFFSET) / SCALE, EXPONENT)
