"""Records of the tightly coupled filter: what it has beside an inertial system.

Error states after those of the inertial system and the vehicle, in this order: a clock
for each system and one drift (m, m/s); where carrier phases are differenced in time,
the antenna's position at the epoch before (m, ECEF) and the clock's change since (m).
"""

from typing import Final

import numpy as np

from replay.kernels.gnss_records import SATELLITES, SLOTS, SYSTEMS
from replay.kernels.records import MAX_STATES
from replay.kernels.single_records import SINGLE_CONFIG_DTYPE

CLOCK: Final = 0
DRIFT: Final = SYSTEMS
CLONE: Final = SYSTEMS + 1
CHANGE: Final = CLONE + 3
PLAIN_EXTRA: Final = SYSTEMS + 1
PHASE_EXTRA: Final = CHANGE + 1

TIGHT_STATES: Final = MAX_STATES + PHASE_EXTRA
"""Error states at most."""

TIGHT_CONFIG_DTYPE: Final = np.dtype(
    [
        ("single", SINGLE_CONFIG_DTYPE),
        ("lever", "<f8", 3),  # m, body, IMU to antenna
        ("code", "<i8"),  # 1: pseudoranges are used
        ("doppler", "<i8"),
        ("phase", "<i8"),  # 1: carrier phases differenced in time
        ("phase_sigma", "<f8"),  # m, of one phase in the zenith
        ("phase_gap", "<f8"),  # s between epochs that are differenced, at most
        ("clock_noise", "<f8"),  # m^2/s
        ("drift_noise", "<f8"),  # m^2/s^3
        ("code_gate", "<f8"),  # innovation over its deviation
        ("doppler_gate", "<f8"),
        ("phase_gate", "<f8"),
        ("jump", "<f8"),  # m by which a clock has been set
        ("rejections", "<i8"),  # epochs in a row, most of whose ranges are refused
    ],
    align=True,
)

# A satellite at the epoch before.
EARLIER_DTYPE: Final = np.dtype(
    [
        ("t", "<i8"),  # ns, as the receiver's clock read it; minus one where there is none
        ("signal", "<i8", SLOTS),
        ("phase", "<f8", SLOTS),  # m, every modelled term but range and clock taken off
        ("position", "<f8", 3),  # m, ECEF at reception
    ],
    align=True,
)

TIGHT_STATE_DTYPE: Final = np.dtype(
    [
        ("epoch_t", "<i8"),  # ns, of the last epoch as the receiver's clock read it
        ("clock_t", "<i8"),  # ns, filter time to which the clocks were carried
        ("clone_t", "<i8"),  # ns, filter time of the cloned position, minus one for none
        ("known", "<i8", SYSTEMS),  # whether a system's clock has been met
        ("drift_known", "<i8"),
        ("refused", "<i8"),  # epochs in a row
        ("earlier", EARLIER_DTYPE, SATELLITES),
    ],
    align=True,
)

KIND_TIME_DIFFERENCE: Final = 10


def new_tight_state() -> "np.ndarray[tuple[int], np.dtype[np.void]]":
    """One state record of a filter that has met no satellite."""
    state = np.zeros(1, dtype=TIGHT_STATE_DTYPE)
    state["epoch_t"] = -1
    state["clock_t"] = -1
    state["clone_t"] = -1
    state["earlier"]["t"] = -1
    return state
