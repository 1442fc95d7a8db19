"""Records of precise point positioning on an inertial system: what it has beside both.

Error states after those of the inertial system and the vehicle are those of
:mod:`replay.kernels.ppp_states` but the antenna's motion, which the inertial system has:
the receiver's clock first, then its drift.
"""

from typing import Final

import numpy as np

from replay.kernels.ppp_records import ROOM
from replay.kernels.records import MAX_STATES

LEAD: Final = 6
"""States of the antenna's motion, position and velocity, of the filter without inertial sensors."""
PPP_TIGHT_STATES: Final = MAX_STATES + ROOM - LEAD
"""Error states at most."""

WHITE: Final = 0
WALK: Final = 1

TIGHT_PPP_CONFIG_DTYPE: Final = np.dtype(
    [
        ("lever", "<f8", 3),  # m, body, IMU to antenna
        ("clock", "<i8"),  # WALK: the clock goes on by its drift; WHITE: it begins anew
        ("doppler", "<i8"),  # 1: range rates are used
        ("clock_noise", "<f8"),  # m^2/s
        ("drift_noise", "<f8"),  # m^2/s^3
        ("jump", "<f8"),  # m by which a clock has been set
        ("wind_up", "<i8"),  # 1: phases are rid of what turning the antenna adds
    ],
    align=True,
)

TIGHT_PPP_STATE_DTYPE: Final = np.dtype(
    [
        ("clock_t", "<i8"),  # ns, filter time to which the clock was carried
        ("heading", "<f8"),  # rad, at the epoch before
        ("turn", "<f8"),  # rad, since the unit was aligned
    ],
    align=True,
)


def new_tight_ppp_state() -> "np.ndarray[tuple[int], np.dtype[np.void]]":
    """One state record of a filter that has met no satellite."""
    state = np.zeros(1, dtype=TIGHT_PPP_STATE_DTYPE)
    state["clock_t"] = -1
    return state
