"""The sRGB transfer function, in strict arithmetic. Source: IEC 61966-2-1."""

from .._jit import kernel
from .elementary import pow as power


@kernel
def srgb_decode(encoded: float) -> float:
    """Linear light of an encoded value, both 0 to 1."""
    if encoded <= 0.04045:
        return encoded / 12.92
    return power((encoded + 0.055) / 1.055, 2.4)
