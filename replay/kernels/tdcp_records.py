"""Records of a chain of displacements: what it keeps, and what it writes."""

from typing import Final

import numpy as np

from replay.kernels.gnss_records import SATELLITES, SLOTS
from replay.kernels.slip_records import SLIP_STATE_DTYPE, new_slip_state

KIND_TIME_DIFFERENCED: Final = 10
EVENT_CYCLE_SLIP: Final = 16
EVENT_SLIP_REPAIRED: Final = 17
EVENT_CHAIN_BROKEN: Final = 18
EVENT_CLOCK_JUMP: Final = 21
STATUS_PREDICTED: Final = 1
STATUS_SINGLE: Final = 4
STATUS_CHAINED: Final = 8
_NAN = float("nan")

TDCP_STATE_DTYPE: Final = np.dtype(
    [
        ("slips", SLIP_STATE_DTYPE),
        # The reference: the last epoch whose place is known.
        ("t", "<i8"),  # ns, as the receiver read it; minus one for none
        ("true_t", "<i8"),  # ns
        ("x", "<f8", 3),  # m, ECEF
        ("phase", "<f8", (SATELLITES, SLOTS)),  # m, less what is modelled; NaN for none
        ("signal", "<i8", (SATELLITES, SLOTS)),
        ("broken", "<i8", (SATELLITES, SLOTS)),  # since then
        ("range", "<f8", SATELLITES),  # m, from `x`
        ("rate", "<f8", SATELLITES),  # m/s, modelled, satellite's clock taken off, at rest
        ("toe", "<f8", SATELLITES),  # s since the GPS epoch, of the message
        ("issue", "<i8", SATELLITES),
        # The chain.
        ("begin_t", "<i8"),  # ns, true time of its first epoch
        ("solved_t", "<i8"),  # ns, true time of its last displacement
        ("place", "<f8", 3),  # m, ECEF
        ("P", "<f8", (3, 3)),  # m^2, ECEF
        ("v", "<f8", 3),  # m/s, ECEF: mean over the last displacement
        ("moving", "<i8"),  # 1 where `v` is known
    ],
    align=True,
)

DISPLACEMENT_DTYPE: Final = np.dtype(
    [
        ("t", "<i8"),  # ns, true time
        ("log_t", "<i8"),
        ("since", "<i8"),  # ns, true time
        ("d", "<f8", 3),  # m, ECEF
        ("cov", "<f8", 6),  # m^2, upper triangle, east north up
        ("count", "<i8"),
        ("unit", "<f8"),
    ],
    align=True,
)


def new_tdcp_state() -> np.ndarray:
    """One state record of a chain that has not begun."""
    state = np.zeros(1, dtype=TDCP_STATE_DTYPE)
    state["slips"] = new_slip_state()
    state["t"] = -1
    state["phase"] = _NAN
    return state
