"""Records of precise point positioning: settings, what a filter keeps, and what it writes.

A filter keeps the antenna's position (and velocity), the receiver's clock (and drift), what
the other systems' clocks differ from it, the wet delay in the zenith and its gradients,
biases between the receiver's codes, one slant ionospheric delay for each satellite and one
ambiguity (m) for each of its phases. Only what is in use has a place: states stand packed,
and these records say which state is where.
"""

from typing import Final

import numpy as np

from replay.kernels.gnss_records import SATELLITES, SLOTS, SYSTEMS

ROOM: Final = 300
"""States at most."""
VIEWS: Final = 80
"""Satellites that are used together, at most."""
MEASURE_STATES: Final = 20
"""States that one measurement names, at most; some are room for those of an inertial system."""
MEASURES: Final = VIEWS * (3 * SLOTS + 1)
"""Measurements of an epoch, at most."""

STATIC: Final = 0
KINEMATIC: Final = 1
VELOCITY: Final = 2

IONOSPHERE_FREE: Final = 0
IONOSPHERE_CONSTRAINED: Final = 1
IONOSPHERE_COMBINATION: Final = 2

FLOAT_ONLY: Final = 3
HOLD: Final = 2

CODE: Final = 0
PHASE: Final = 1
IONOSPHERE: Final = 2
DOPPLER: Final = 3

PPP_CONFIG_DTYPE: Final = np.dtype(
    [
        ("mask", "<f8"),  # rad
        ("cn0_mask", "<f8"),  # dB-Hz
        ("excluded", "<i8", SATELLITES),
        ("slots", "<i8"),  # signals of a satellite that are used
        ("weighting", "<i8"),
        ("code_sigma", "<f8", SLOTS),  # m, in the zenith
        ("phase_sigma", "<f8", SLOTS),  # m, in the zenith
        ("doppler_sigma", "<f8"),  # m/s, in the zenith
        ("code_scale", "<f8", SYSTEMS),  # on the code's deviation
        ("phase_scale", "<f8", SYSTEMS),  # on the phase's deviation
        ("satellite_scale", "<f8", SATELLITES),  # on both
        ("range_scale", "<f8"),  # on what the products' deviation is more than usual
        ("range_usual", "<f8"),  # m, which the other deviations already stand for
        ("range_walk", "<f8"),  # share of that by which it walks in 1 s, 1/sqrt(s)
        ("code_gate", "<f8"),  # deviations of a residual
        ("phase_gate", "<f8"),
        ("rounds", "<i8"),  # measurements left out of an epoch, at most
        ("dynamics", "<i8"),
        ("position_sigma", "<f8"),  # m, before the first measurement
        ("velocity_sigma", "<f8"),  # m/s
        ("process_noise", "<f8"),  # m/sqrt(s) or (m/s)/sqrt(s) by dynamics
        ("clock_sigma", "<f8"),  # m, of every epoch's coarse clock
        ("drift_noise", "<f8"),  # (m/s)/sqrt(s)
        ("system_noise", "<f8"),  # m/sqrt(s), between the systems' clocks
        ("wet_sigma", "<f8"),  # m
        ("wet_noise", "<f8"),  # m/sqrt(s)
        ("gradients", "<i8"),
        ("gradient_sigma", "<f8"),  # m
        ("gradient_noise", "<f8"),  # m/sqrt(s)
        ("bias_sigma", "<f8"),  # m
        ("bias_noise", "<f8"),  # m/sqrt(s)
        ("ionosphere", "<i8"),
        ("ionosphere_sigma", "<f8"),  # m on L1, before the first measurement
        ("ionosphere_noise", "<f8"),  # m/sqrt(s) on L1 in the zenith; below zero: white
        ("constraint_sigma", "<f8"),  # m on L1 in the zenith, of the model
        ("constraint_time", "<f8"),  # s, that the model's error lasts
        ("ambiguity_sigma", "<f8"),  # m
        ("ambiguity_noise", "<f8"),  # m/sqrt(s)
        ("gap", "<f8"),  # s without a phase after which its ambiguity is forgotten
        ("geometry_free", "<f8"),  # m, jump of two phases' difference in the zenith
        ("geometry_free_rate", "<f8"),  # m/s, added
        ("wide_lane", "<f8"),  # cycle, jump of the Melbourne-Wuebbena combination in the zenith
        ("rejections", "<i8"),  # in a row, after which a satellite's ambiguities start anew
        ("failures", "<i8"),  # epochs in a row, after which the filter starts anew
        ("mode", "<i8"),
        ("test", "<i8"),
        ("threshold", "<f8"),
        ("success", "<f8"),  # least bootstrapped success rate
        ("mask_resolve", "<f8"),  # rad
        ("lock", "<i8"),  # epochs that an ambiguity has been in use before it is tried
        ("least", "<i8"),  # ambiguities to fix
        ("partial", "<i8"),
        ("drops", "<i8"),  # satellites left out one after another, at most
        ("apart", "<f8"),  # m between the fixed and the float position, beside its deviation
        ("confirm", "<i8"),  # epochs that other integers must last to replace proven ones
        ("proven", "<i8"),  # epochs after which integers count as proven
        ("agree", "<i8"),  # epochs in a row with the same integers before they are believed
        ("lane_sigma", "<f8"),  # m, of a wide lane beside what the filter knows
        ("hold_count", "<i8"),  # fixed epochs in a row before integers are held
        ("hold_sigma", "<f8"),  # cycle
        ("hold_mask", "<f8"),  # rad
    ],
    align=True,
)

PPP_STATE_DTYPE: Final = np.dtype(
    [
        ("t", "<i8"),  # ns, the receiver's clock at the last update, minus one before it
        ("n", "<i8"),  # states
        # Which state each one is, minus one for none.
        ("clock", "<i8"),
        ("drift", "<i8"),
        ("reference", "<i8"),  # system whose clock is the receiver's
        ("between", "<i8", SYSTEMS),  # of the other systems' clocks from it
        ("wet", "<i8"),
        ("gradient", "<i8"),  # first of two, north and east
        ("bias", "<i8", (SYSTEMS, SLOTS)),
        ("slant", "<i8", SATELLITES),
        ("amb", "<i8", (SATELLITES, SLOTS)),
        ("used_t", "<i8", (SATELLITES, SLOTS)),  # ns, when its phase was there last
        ("slant_t", "<i8", SATELLITES),  # ns, when the satellite was there last
        ("lock", "<i8", (SATELLITES, SLOTS)),  # epochs in use without a rejection
        ("age", "<i8", (SATELLITES, SLOTS)),  # epochs since it began
        ("rejected", "<i8", (SATELLITES, SLOTS)),  # epochs in a row
        ("slip", "<i8", (SATELLITES, SLOTS)),  # 1 where a break was seen and not dealt with
        ("half", "<i8", (1, SATELLITES, SLOTS)),  # half cycles open: 1, 0, or minus one
        ("signal", "<i8", (1, SATELLITES, SLOTS)),
        ("lock_time", "<f8", (1, SATELLITES, SLOTS)),  # s
        ("level", "<f8", SATELLITES),  # m, code less phase of the first slot
        ("level_t", "<i8", SATELLITES),  # ns
        ("free", "<f8", (SATELLITES, SLOTS)),  # m, phase of the first slot less this one's
        ("free_rate", "<f8", (SATELLITES, SLOTS)),  # m/s
        ("free_t", "<i8", (SATELLITES, SLOTS)),  # ns
        ("free_count", "<i8", (SATELLITES, SLOTS)),
        ("wide", "<f8", (SATELLITES, SLOTS)),  # cycle, mean of Melbourne-Wuebbena
        ("wide_count", "<i8", (SATELLITES, SLOTS)),
        # Of the last fixed epoch, differences to its references.
        ("integer", "<i8", (SATELLITES, SLOTS)),  # cycle
        ("known", "<i8", (SATELLITES, SLOTS)),  # 1 where `integer` is valid
        ("fixed", "<i8"),  # epochs fixed in a row
        ("proof", "<i8"),  # epochs with the same integers
        ("doubt", "<i8"),  # epochs in a row with other integers than the proven ones
        ("failed", "<i8"),  # epochs in a row that did not fit
        ("status", "<i8"),
    ],
    align=True,
)

# A satellite of an epoch that is used.
VIEW_DTYPE: Final = np.dtype(
    [
        ("rover", "<i8"),  # row
        ("satellite", "<i8"),
        ("system", "<i8"),
        ("elevation", "<f8"),
        ("computed", "<f8"),  # m, range and what the place's height changes in the delays
        ("u", "<f8", 3),  # sensitivity to the position
    ],
    align=True,
)

# One measurement as the filter takes it.
PPP_MEASURE_DTYPE: Final = np.dtype(
    [
        ("kind", "<i8"),  # CODE, PHASE, IONOSPHERE, DOPPLER
        ("pair", "<i8"),  # view
        ("slot", "<i8"),
        ("satellite", "<i8"),
        ("z", "<f8"),  # m or m/s, observed less computed of the predicted state
        ("r", "<f8"),  # variance
        ("count", "<i8"),
        ("index", "<i8", MEASURE_STATES),
        ("h", "<f8", MEASURE_STATES),
        ("use", "<i8"),
        ("residual", "<f8"),
        ("spread", "<f8"),  # variance of the residual
    ],
    align=True,
)

ZENITH_ROW_DTYPE: Final = np.dtype(
    [
        ("t", "<i8"),
        ("log_t", "<i8"),
        ("hydrostatic", "<f8"),  # m
        ("wet", "<f8"),  # m
        ("wet_sigma", "<f8"),
        ("gradient", "<f8", 2),  # m, north and east; NaN for none
        ("gradient_sigma", "<f8", 2),
    ],
    align=True,
)

SLANT_ROW_DTYPE: Final = np.dtype(
    [
        ("t", "<i8"),
        ("log_t", "<i8"),
        ("satellite", "<i8"),
        ("value", "<f8"),  # m
        ("sigma", "<f8"),
    ],
    align=True,
)

BIAS_ROW_DTYPE: Final = np.dtype(
    [
        ("t", "<i8"),
        ("log_t", "<i8"),
        ("system", "<i8"),
        ("signal", "<i8"),
        ("value", "<f8"),  # m
        ("sigma", "<f8"),
    ],
    align=True,
)

PHASE_ROW_DTYPE: Final = np.dtype(
    [
        ("t", "<i8"),
        ("log_t", "<i8"),
        ("satellite", "<i8"),
        ("signal", "<i8"),
        ("value", "<f8"),  # m
        ("sigma", "<f8"),
        ("age", "<i8"),  # epochs since it began
    ],
    align=True,
)

# Values of `replay.EventKind`.
EVENT_TIME_BACKWARD: Final = 9
EVENT_RESET: Final = 11
EVENT_TOO_FEW: Final = 14
EVENT_SLIP: Final = 16
EVENT_FIXED: Final = 19
EVENT_FIX_LOST: Final = 20
EVENT_CLOCK_JUMP: Final = 21


def new_ppp_state() -> np.ndarray:
    """One state record of a filter that has seen nothing."""
    state = np.zeros(1, dtype=PPP_STATE_DTYPE)
    for name in (
        *("t", "clock", "drift", "reference", "between", "wet", "gradient", "bias", "slant"),
        *("amb", "half"),
    ):
        state[name] = -1
    state["lock_time"] = np.nan
    state["free"] = np.nan
    state["level"] = np.nan
    return state
