"""Records of relative positioning: settings, what a filter keeps, and what it writes.

A filter of one rover and one base keeps the rover's position, one single-difference
ambiguity (m) for each satellite and signal slot, and, where asked for, slant ionospheric
delays and zenith wet delays. Only what is in use has a place: states stand packed, and
these records say which state is where.
"""

from typing import Final

import numpy as np

from replay.kernels.gnss_records import SATELLITES, SLOTS, SYSTEMS

ROOM: Final = 250
"""States at most. Rows of 2000 bytes do not fall on the same cache lines."""
PAIRS: Final = 64
"""Satellites that both receivers see, at most."""

MEASURE_STATES: Final = 10
"""States that one measurement names, at most."""

STATIC: Final = 0
KINEMATIC: Final = 1
VELOCITY: Final = 2
ACCELERATION: Final = 3

INSTANTANEOUS: Final = 0
CONTINUOUS: Final = 1
HOLD: Final = 2
FLOAT_ONLY: Final = 3

TEST_RATIO: Final = 0
TEST_W_RATIO: Final = 1

PARTIAL_NONE: Final = 0
PARTIAL_ELEVATION: Final = 1
PARTIAL_SUCCESS: Final = 2

RTK_CONFIG_DTYPE: Final = np.dtype(
    [
        ("mask", "<f8"),  # rad
        ("cn0_mask", "<f8"),  # dB-Hz
        ("excluded", "<i8", SATELLITES),
        ("slots", "<i8"),  # signals of a satellite that are used
        ("weighting", "<i8"),
        ("code_sigma", "<f8", SLOTS),  # m, of one receiver in the zenith
        ("phase_sigma", "<f8", SLOTS),  # m
        ("system_scale", "<f8", SYSTEMS),  # on the code's deviation
        ("clock_stability", "<f8"),  # s/s, of a satellite's clock over the base's age
        ("baseline_noise", "<f8"),  # m per m of baseline
        ("dynamics", "<i8"),
        ("position_sigma", "<f8"),  # m, before the first measurement
        ("velocity_sigma", "<f8"),  # m/s
        ("acceleration_sigma", "<f8"),  # m/s^2
        ("process_noise", "<f8"),  # m/sqrt(s), (m/s)/sqrt(s) or (m/s^2)/sqrt(s) by dynamics
        ("ambiguity_sigma", "<f8"),  # m
        ("ambiguity_noise", "<f8"),  # m/sqrt(s)
        ("ionosphere", "<i8"),
        ("ionosphere_sigma", "<f8"),  # m per m of baseline
        ("ionosphere_noise", "<f8"),  # m/sqrt(s) per m of baseline
        ("troposphere", "<i8"),
        ("wet_sigma", "<f8"),  # m
        ("wet_noise", "<f8"),  # m/sqrt(s)
        ("gap", "<f8"),  # s without a phase after which its ambiguity is forgotten
        ("geometry_free", "<f8"),  # m between epochs
        ("code_gate", "<f8"),  # deviations of a residual
        ("phase_gate", "<f8"),
        ("rejections", "<i8"),  # in a row, after which an ambiguity starts anew
        ("mode", "<i8"),
        ("test", "<i8"),
        ("threshold", "<f8"),
        ("success", "<f8"),  # least bootstrapped success rate
        ("mask_resolve", "<f8"),  # rad
        ("lock", "<i8"),  # epochs that an ambiguity has been in use before it is tried
        ("least", "<i8"),  # ambiguities to fix
        ("partial", "<i8"),
        ("drops", "<i8"),  # satellites left out one after another, at most
        ("unit_weight", "<f8"),  # largest of the fixed phases' residuals
        ("apart", "<f8"),  # m between the fixed and the float position, beside its deviation
        ("confirm", "<i8"),  # epochs that other integers must last to replace proven ones
        ("proven", "<i8"),  # epochs after which integers count as proven
        ("hold_count", "<i8"),  # fixed epochs in a row before integers are held
        ("hold_sigma", "<f8"),  # cycle
        ("hold_mask", "<f8"),  # rad
        ("max_age", "<f8"),  # s, of a base epoch
        ("moving", "<i8"),
        ("length", "<f8"),  # m, known length of the baseline, 0 where unknown
        ("length_sigma", "<f8"),  # m
    ],
    align=True,
)

RTK_STATE_DTYPE: Final = np.dtype(
    [
        ("t", "<i8"),  # ns, the rover's clock at the last update, minus one before it
        ("n", "<i8"),  # states
        ("wet", "<i8"),  # first of the two wet delays, rover's and base's, or minus one
        ("slant", "<i8", SATELLITES),  # state of its ionospheric delay, or minus one
        ("amb", "<i8", (SATELLITES, SLOTS)),  # state of its ambiguity, or minus one
        ("used_t", "<i8", (SATELLITES, SLOTS)),  # ns, when its phase was there last
        ("lock", "<i8", (SATELLITES, SLOTS)),  # epochs in use since it began
        ("rejected", "<i8", (SATELLITES, SLOTS)),  # epochs in a row
        ("slip", "<i8", (SATELLITES, SLOTS)),  # 1 where a break was seen and not dealt with
        # Of the rover and of the base.
        ("half", "<i8", (2, SATELLITES, SLOTS)),  # half cycles open: 1, 0, or minus one
        ("signal", "<i8", (2, SATELLITES, SLOTS)),
        ("lock_time", "<f8", (2, SATELLITES, SLOTS)),  # s
        ("free", "<f8", (SATELLITES, SLOTS)),  # m, phase of the first slot less this one's
        ("free_t", "<i8", (SATELLITES, SLOTS)),  # ns
        ("integer", "<i8", (SATELLITES, SLOTS)),  # last fixed, less the reference's
        ("known", "<i8", (SATELLITES, SLOTS)),  # 1 where `integer` is valid
        ("fixed", "<i8"),  # epochs fixed in a row
        ("proof", "<i8"),  # epochs with the same integers
        ("doubt", "<i8"),  # epochs in a row with other integers than the proven ones
        ("status", "<i8"),
        ("base_t", "<i8"),  # ns, the base's last epoch that was looked at
        ("lost", "<i8"),  # 1 where the lack of a base has been told
    ],
    align=True,
)

# One single difference as the filter takes it.
MEASURE_DTYPE: Final = np.dtype(
    [
        ("kind", "<i8"),  # 0 code, 1 phase
        ("pair", "<i8"),
        ("slot", "<i8"),
        ("group", "<i8"),
        ("satellite", "<i8"),
        ("z", "<f8"),  # m, observed less computed of the predicted state
        ("r", "<f8"),  # m^2
        ("count", "<i8"),
        ("index", "<i8", MEASURE_STATES),
        ("h", "<f8", MEASURE_STATES),
        ("use", "<i8"),
        ("residual", "<f8"),  # m
        ("spread", "<f8"),  # m^2, variance of the residual
    ],
    align=True,
)

PAIR_DTYPE: Final = np.dtype(
    [
        ("rover", "<i8"),  # row
        ("base", "<i8"),
        ("satellite", "<i8"),
        ("system", "<i8"),
        ("elevation", "<f8"),
        ("computed", "<f8"),  # m, single difference of all that is modelled but the ionosphere
        ("u", "<f8", 3),  # sensitivity to the rover's position
    ],
    align=True,
)

AMBIGUITY_ROW_DTYPE: Final = np.dtype(
    [
        ("t", "<i8"),
        ("log_t", "<i8"),
        ("satellite", "<i8"),
        ("reference", "<i8"),
        ("signal", "<i8"),
        ("value", "<f8"),  # cycle
        ("sigma", "<f8"),  # cycle
        ("integer", "<f8"),  # cycle, NaN where there is none
        ("status", "<i8"),
    ],
    align=True,
)

RESOLUTION_ROW_DTYPE: Final = np.dtype(
    [
        ("t", "<i8"),
        ("log_t", "<i8"),
        ("candidates", "<i8"),
        ("fixed", "<i8"),
        ("ratio", "<f8"),
        ("w_ratio", "<f8"),
        ("threshold", "<f8"),
        ("success", "<f8"),
        ("status", "<i8"),
    ],
    align=True,
)

BASELINE_ROW_DTYPE: Final = np.dtype(
    [
        ("t", "<i8"),
        ("log_t", "<i8"),
        ("ecef", "<f8", 3),  # m, from the base to the rover
        ("enu", "<f8", 3),  # m, axes at the base
        ("cov", "<f8", 6),  # m^2, upper triangle, east north up
        ("length", "<f8"),
        ("length_sigma", "<f8"),
        ("heading", "<f8"),  # rad, from true north
        ("heading_sigma", "<f8"),
        ("pitch", "<f8"),  # rad, upwards
        ("pitch_sigma", "<f8"),
        ("age", "<f8"),  # s
        ("status", "<i8"),
    ],
    align=True,
)

# Values of `replay.SolutionStatus`.
SINGLE: Final = 4
DGNSS: Final = 5
FLOAT: Final = 6
FIXED: Final = 7
# Values of `replay.AmbiguityStatus`.
AMBIGUITY_FLOAT: Final = 1
AMBIGUITY_FIXED: Final = 2
AMBIGUITY_REJECTED: Final = 3
AMBIGUITY_HELD: Final = 4
# Values of `replay.EventKind`.
EVENT_EXCLUDED: Final = 12
EVENT_TOO_FEW: Final = 14
EVENT_SLIP: Final = 16
EVENT_FIXED: Final = 19
EVENT_FIX_LOST: Final = 20
EVENT_BASE_LOST: Final = 22


def new_rtk_state() -> np.ndarray:
    """One state record of a filter that has seen nothing."""
    state = np.zeros(1, dtype=RTK_STATE_DTYPE)
    for name in ("t", "base_t", "wet", "slant", "amb", "half"):
        state[name] = -1
    state["lock_time"] = np.nan
    state["free"] = np.nan
    return state
