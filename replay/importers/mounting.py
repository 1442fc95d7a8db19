"""Sensor axes to body axes, as a list of named rotations.

The steps are applied to a measured vector from the first to the last:
v_body = S_n … S_2 S_1 v_sensor. A step is one of

* `"axes forward-left-up"`: where the sensor's x, y and z point; the vector is
  written in forward, right, down instead;
* `"roll 3.2 deg"`, `"pitch …"`, `"yaw …"`: the vector is turned by the angle about
  the present x, y or z axis, right-handed.

A turn by +a is the transpose of the frame rotation R1, R2 or R3 (a) of Groves and
of Farrell. Multiples of 90 degrees are exact.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final

import numpy as np

from replay.configuration import to_si
from replay.errors import ConfigurationError
from replay.importers.table import Float64
from replay.kernels.elementary import sincos

_DIRECTIONS: Final = {
    "forward": (1.0, 0.0, 0.0),
    "back": (-1.0, 0.0, 0.0),
    "right": (0.0, 1.0, 0.0),
    "left": (0.0, -1.0, 0.0),
    "down": (0.0, 0.0, 1.0),
    "up": (0.0, 0.0, -1.0),
}
_TURNS: Final = {"roll": (1, 2), "pitch": (2, 0), "yaw": (0, 1)}
_QUARTER: Final = {0: (0.0, 1.0), 90: (1.0, 0.0), 180: (0.0, -1.0), 270: (-1.0, 0.0)}


def mounting_matrix(steps: Sequence[str]) -> Float64:
    """Matrix (3, 3) from sensor to body components.

    Raises
    ------
    ConfigurationError
        Where a step is none of the known ones, or axes are not right-handed.
    """
    total = np.eye(3)
    for step in steps:
        word, _, rest = step.strip().partition(" ")
        if word == "axes":
            total = _product(_axes(rest.strip(), step), total)
        elif word in _TURNS:
            total = _product(_turn(word, rest.strip(), step), total)
        else:
            raise ConfigurationError(
                f"mounting step {step!r} is unknown",
                mend=f"known are axes A-B-C, and {', '.join(_TURNS)} with an angle",
            )
    return total


def rotate(matrix: Float64, vectors: Float64) -> Float64:
    """Matrix times each row (n, 3), in a written order: the same bits everywhere."""
    x, y, z = vectors[:, 0], vectors[:, 1], vectors[:, 2]
    return np.stack([row[0] * x + row[1] * y + row[2] * z for row in matrix], axis=1)


def _axes(text: str, step: str) -> Float64:
    names = text.split("-")
    if len(names) != 3 or any(name not in _DIRECTIONS for name in names):
        raise ConfigurationError(
            f"mounting step {step!r} does not name three directions",
            mend=f"write axes X-Y-Z with words out of {', '.join(_DIRECTIONS)}",
        )
    columns = [_DIRECTIONS[name] for name in names]
    if tuple(np.cross(columns[0], columns[1])) != columns[2]:
        raise ConfigurationError(
            f"the axes of mounting step {step!r} are not right-handed",
            mend="x cross y has to be z; negate a column (`-name`) of a left-handed sensor",
        )
    return np.array(columns).T


def _turn(word: str, text: str, step: str) -> Float64:
    first, second = _TURNS[word]
    sine, cosine = _sine_cosine(text, step)
    matrix = np.eye(3)
    matrix[first, first] = matrix[second, second] = cosine
    matrix[first, second] = -sine
    matrix[second, first] = sine
    return matrix


def _sine_cosine(text: str, step: str) -> tuple[float, float]:
    number, _, unit = text.partition(" ")
    try:
        degrees = float(number) if unit == "deg" else None
    except ValueError:
        degrees = None
    if degrees is not None and degrees % 90.0 == 0.0:
        return _QUARTER[int(degrees % 360.0)]
    if not unit:
        raise ConfigurationError(
            f"the angle of mounting step {step!r} has no unit", mend="write for example 3.2 deg"
        )
    sine, cosine = sincos(to_si(text, "rad", f"mounting step {step!r}"))
    return float(sine), float(cosine)


def _product(a: Float64, b: Float64) -> Float64:
    return rotate(a, np.ascontiguousarray(b.T)).T
