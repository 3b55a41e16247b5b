"""The line-drawing DDA: one pixel for each step along the longer axis, in all eight octants.

From pixel (x0, y0) to (x1, y1), both included, S = max(|Δx|, |Δy|):

    P(i) = (x0 + ½ + i·Δx/S, y0 + ½ + i·Δy/S),  pixel = floor P(i),  i = 0 … S

so the shorter axis is rounded to nearest, and a tie (exactly between two rows) goes to the higher
one on both axes, as everywhere here. Each position is a function of its own i, in integers: nothing
is accumulated and nothing drifts.
Source: Foley, van Dam, Feiner and Hughes, Computer Graphics: Principles and Practice, section
3.2.1, where increments are added up in floating point.
"""

from .._jit import kernel

MAX_COORDINATE = 2**29
"""Products of the kernel stay below 2⁶³ for |coordinates| up to this."""


@kernel
def line_steps(x0: int, y0: int, x1: int, y1: int) -> int:
    """S: the number of pixels less one."""
    return max(abs(x1 - x0), abs(y1 - y0))


@kernel
def line_pixel(x0: int, y0: int, x1: int, y1: int, i: int) -> tuple[int, int]:
    """Pixel i of the line, 0 ≤ i ≤ S."""
    steps = line_steps(x0, y0, x1, y1)
    if steps == 0:
        return x0, y0
    # floor(i·Δ/S + ½) in whole numbers.
    return (
        x0 + (2 * i * (x1 - x0) + steps) // (2 * steps),
        y0 + (2 * i * (y1 - y0) + steps) // (2 * steps),
    )
