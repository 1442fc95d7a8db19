"""Whether this process computes as IEEE 754 says.

A library that was linked with fast-math start-up code sets flush-to-zero for the
whole process; results then depend on what else was imported.
"""

from __future__ import annotations

import sys

from replay.errors import DeterminismError


def require_ieee_arithmetic() -> None:
    """Raise where subnormal numbers are flushed to zero.

    Raises
    ------
    DeterminismError
    """
    smallest = sys.float_info.min
    if smallest / 2.0 == 0.0 or (smallest / 2.0) * 2.0 != smallest:
        raise DeterminismError(
            "this process flushes subnormal numbers to zero",
            mend="find the imported library that was built with -Ofast or -ffast-math",
        )
