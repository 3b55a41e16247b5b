"""Array aliases used in signatures: dtype only; shapes are stated in docstrings."""

from typing import Any, TypeAlias

import numpy as np
import numpy.typing as npt

F64Array: TypeAlias = npt.NDArray[np.float64]
F32Array: TypeAlias = npt.NDArray[np.float32]
FloatArray: TypeAlias = npt.NDArray[np.floating[Any]]
I32Array: TypeAlias = npt.NDArray[np.int32]
I64Array: TypeAlias = npt.NDArray[np.int64]
U8Array: TypeAlias = npt.NDArray[np.uint8]
U32Array: TypeAlias = npt.NDArray[np.uint32]
BoolArray: TypeAlias = npt.NDArray[np.bool_]
AnyArray: TypeAlias = npt.NDArray[Any]
Rgb: TypeAlias = tuple[float, float, float]
Size: TypeAlias = tuple[int, int]
