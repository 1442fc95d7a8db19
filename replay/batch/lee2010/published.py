"""Figures that Lee (2010) printed; the paper's signs of means are not told."""

from __future__ import annotations

from typing import Final

Pair = tuple[float, float]
Triple = tuple[Pair, Pair, Pair]

CASES: Final = ("case1", "case2", "case3")
TITLES: Final = {"case1": "Case 1", "case2": "Case 2", "case3": "Case 3"}
MODES: Final = ("single", "network")

# Table 1: success rate of ambiguity resolution, epoch by epoch [%].
SUCCESS: Final = {"case1": 99.7, "case2": 100.0, "case3": 99.0}

# Table 2: mean and standard deviation of northing, easting, height differences [cm].
POSITION_CM: Final[dict[str, dict[str, Triple]]] = {
    "case1": {
        "single": ((3.8, 16.5), (41.5, 17.1), (41.7, 23.8)),
        "network": ((0.3, 0.7), (0.1, 1.1), (1.1, 1.3)),
    },
    "case2": {
        "single": ((5.1, 11.4), (10.5, 32.8), (11.7, 34.7)),
        "network": ((0.0, 0.7), (0.5, 1.0), (0.6, 1.3)),
    },
    "case3": {
        "single": ((13.4, 17.5), (29.8, 26.3), (32.7, 31.6)),
        "network": ((0.1, 0.7), (0.1, 1.0), (0.1, 1.3)),
    },
}

# Table 3: the same of heading, pitch and roll [arc-minutes].
ATTITUDE_ARCMIN: Final[dict[str, dict[str, Triple]]] = {
    "case1": {
        "single": ((2.50, 2.50), (0.69, 0.72), (2.69, 1.32)),
        "network": ((1.92, 2.26), (0.53, 0.64), (2.67, 1.27)),
    },
    "case2": {
        "single": ((2.11, 2.61), (0.72, 0.77), (2.56, 1.33)),
        "network": ((1.88, 2.28), (0.53, 0.64), (2.66, 1.27)),
    },
    "case3": {
        "single": ((2.62, 2.71), (0.74, 0.77), (2.69, 1.32)),
        "network": ((1.93, 2.28), (0.53, 0.64), (2.68, 1.27)),
    },
}
