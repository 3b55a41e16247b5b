"""Multi-channel OpenEXR files: one part, scanlines, ZIP, float32 and uint32, nothing lost.

OpenEXR writes through a Python file: its own writer does not notice a full disk when the image is
small. The header holds no time and no host, and channels are sorted by
name, so the same arrays give the same bytes with the same OpenEXR version.
"""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

import numpy as np

from ..errors import FileError
from ..typed import AnyArray

CHANNEL_DTYPES = (np.dtype(np.float32), np.dtype(np.uint32))
"""What a channel can hold here. EXR has no int32, uint8 or float64; float16 would lose digits."""


def write_exr(path: Path, channels: Mapping[str, AnyArray]) -> None:
    """Write 2-D images of one size as the channels of one file.

    channels : name to (H, W) float32 or uint32; every bit of a float32 is kept, inf and NaN too.

    Raises FileError for a channel of another dtype or shape, OSError if the disk refuses.
    """
    import OpenEXR

    shapes = {array.shape for array in channels.values()}
    if len(shapes) != 1 or len(next(iter(shapes))) != 2 or 0 in next(iter(shapes)):
        raise FileError(f"EXR channels have the shapes {sorted(shapes)}; expected one (H, W)")
    for name, array in channels.items():
        if array.dtype not in CHANNEL_DTYPES:
            raise FileError(f"EXR channel {name} is {array.dtype}; expected float32 or uint32")
    # OpenEXR puts its own objects into the dictionary that it is given: hand it a new one.
    pixels = {name: np.ascontiguousarray(channels[name]) for name in sorted(channels)}
    header = {"compression": OpenEXR.ZIP_COMPRESSION, "type": OpenEXR.scanlineimage}
    try:
        with path.open("wb") as file:
            OpenEXR.File(header, pixels).write(file)
    except TypeError:
        raise FileError(
            f"OpenEXR {OpenEXR.__version__} cannot write to an open file; expected 3.5 or newer: "
            "pip install --upgrade OpenEXR"
        ) from None


def read_exr(path: str | Path) -> dict[str, AnyArray]:
    """The channels of the first part of an EXR file, name to (H, W) array.

    float32, float16 and uint32 as stored. Raises FileError for a file that is missing, damaged or
    not an EXR.
    """
    import OpenEXR

    path = Path(path)
    if not path.is_file():
        raise FileError(f"no file {path}; expected an OpenEXR image")
    try:
        with OpenEXR.File(str(path), separate_channels=True) as file:
            found = {name: np.array(channel.pixels) for name, channel in file.channels().items()}
    except (RuntimeError, ValueError) as error:
        raise FileError(
            f"{path} cannot be read as OpenEXR ({str(error).strip()}); expected a complete file"
        ) from None
    return dict(sorted(found.items()))
