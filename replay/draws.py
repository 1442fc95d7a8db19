"""Random numbers that are the same on every machine: a stream by name."""

from __future__ import annotations

import hashlib
from typing import Final

import numpy as np

_KEY_BYTES: Final = 16


def stream(name: str) -> np.random.Generator:
    """Generator of the stream that a name stands for.

    Only its uniform numbers are to be taken: they are made of integers, while numpy makes
    normal ones with a library's logarithm (see :func:`replay.kernels.noise.normals`).
    """
    key = hashlib.sha256(name.encode()).digest()[:_KEY_BYTES]
    return np.random.Generator(np.random.Philox(key=int.from_bytes(key, "little")))
