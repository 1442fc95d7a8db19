"""Records of the detectors of cycle slips."""

from typing import Final

import numpy as np

from replay.kernels.gnss_records import SATELLITES, SLOTS

PAIRS: Final = SLOTS - 1
"""Pairs of slot 0 with each other slot."""

LOSS_OF_LOCK: Final = 1
GAP: Final = 2
GEOMETRY_FREE: Final = 3
WIDE_LANE: Final = 4
DOPPLER: Final = 5
TIME_DIFFERENCE: Final = 6

CONTINUOUS: Final = 0
SUSPECT: Final = 1
NEW: Final = 2
SLIP_CONFIG_DTYPE: Final = np.dtype(
    [
        ("lock", "<i8"),  # 1: believe the receiver's loss-of-lock bit
        ("lock_time", "<i8"),  # 1: believe its lock time
        ("half", "<i8"),  # 1: a change of the half-cycle bit is a break
        ("gap", "<f8"),  # s without a phase, from which it is a new one
        ("geometry_free", "<f8"),  # m; 0 leaves the test out
        ("geometry_free_rate", "<f8"),  # m/s, added
        ("wide_lane", "<f8"),  # deviations of the running mean; 0 leaves the test out
        ("wide_lane_least", "<f8"),  # cycle, below which nothing is a slip
        ("wide_lane_sigma", "<f8"),  # cycle, before there is an own deviation
        ("doppler", "<f8"),  # deviations; 0 leaves the test out
        ("doppler_sigma", "<f8"),  # m/s in the zenith
        ("jerk", "<f8"),  # m/s^3 of the antenna
        ("clock_jump", "<f8"),  # m
    ],
    align=True,
)
SLIP_STATE_DTYPE: Final = np.dtype(
    [
        ("t", "<i8"),  # ns of the epoch before; minus one before the first
        ("clock", "<f8"),  # m, NaN where unknown
        ("slot_t", "<i8", (SATELLITES, SLOTS)),  # ns of the last phase; minus one for none
        ("signal", "<i8", (SATELLITES, SLOTS)),
        ("phase", "<f8", (SATELLITES, SLOTS)),  # m
        ("code", "<f8", (SATELLITES, SLOTS)),  # m
        ("range_rate", "<f8", (SATELLITES, SLOTS)),  # m/s
        ("lock_time", "<f8", (SATELLITES, SLOTS)),  # s
        ("half", "<i8", (SATELLITES, SLOTS)),
        ("free", "<f8", (SATELLITES, PAIRS)),  # m, geometry-free phase; NaN for none
        ("free_rate", "<f8", (SATELLITES, PAIRS)),  # m/s
        ("wide_mean", "<f8", (SATELLITES, PAIRS)),  # cycle of the wide lane
        ("wide_variance", "<f8", (SATELLITES, PAIRS)),  # cycle^2
        ("wide_count", "<i8", (SATELLITES, PAIRS)),
    ],
    align=True,
)
SLIP_ROW_DTYPE: Final = np.dtype(
    [
        ("t", "<i8"),
        ("log_t", "<i8"),
        ("satellite", "<i8"),
        ("signal", "<i8"),
        ("detector", "<i8"),
        ("statistic", "<f8"),  # cycle; of a gap or a lock time: s
        ("threshold", "<f8"),  # as the statistic
        ("size", "<f8"),  # cycle, NaN where unknown
        ("repaired", "<i8"),
    ],
    align=True,
)


def new_slip_state() -> np.ndarray:
    """One state record of a detector that has seen nothing."""
    state = np.zeros(1, dtype=SLIP_STATE_DTYPE)
    state["t"] = -1
    state["slot_t"] = -1
    state["clock"] = np.nan
    state["free"] = np.nan
    return state
