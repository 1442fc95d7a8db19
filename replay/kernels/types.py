"""Names for what kernels take; numba finds the real types itself at the first call."""

from typing import Any, TypeAlias

import numpy as np

Array: TypeAlias = np.ndarray[Any, np.dtype[Any]]
"""A numpy array; shape, unit and frame stand in the docstring."""

Record: TypeAlias = Any
"""One element of a structured array of :mod:`replay.kernels.records` or `strapdown`."""
