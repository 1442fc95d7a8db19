"""Records of a baseline between two reference stations: what is remembered, what is written."""

from typing import Final

import numpy as np

from replay.kernels.gnss_records import SATELLITES
from replay.kernels.rtk_records import RESOLUTION_ROW_DTYPE

WIDE_LANE_SIGNAL: Final = ord("W") + 256 * ord("L")
"""Number of the signal WL, as :mod:`replay.kernels.gnss_records` numbers signals."""

INTEGERS_CONFIG_DTYPE: Final = np.dtype(
    [
        ("test", "<i8"),  # as `rtk_records`
        ("threshold", "<f8"),
        ("success", "<f8"),
        ("mask", "<f8"),  # rad
        ("lock", "<i8"),  # epochs
        ("confirm", "<i8"),  # epochs
        ("doubt", "<i8"),  # epochs
        ("phase_scale", "<f8"),  # by which the filter's deviation of a phase is more than its own
        ("least", "<i8"),  # double differences of a search from nothing
    ],
    align=True,
)

# The integer of a satellite's single difference stands on a datum that its system shares;
# double differences are differences of them.
INTEGERS_STATE_DTYPE: Final = np.dtype(
    [
        ("known", "<i8", SATELLITES),
        ("first", "<i8", SATELLITES),  # cycles, first frequency
        ("second", "<i8", SATELLITES),
        # What was found lately and is not believed yet.
        ("pending", "<i8", SATELLITES),  # epochs in a row
        ("pending_first", "<i8", SATELLITES),
        ("pending_second", "<i8", SATELLITES),
        ("pending_reference", "<i8", SATELLITES),
        # Epochs in a row in which a search from nothing disagrees, and with what.
        ("doubt", "<i8", SATELLITES),
        ("doubt_first", "<i8", SATELLITES),
        ("doubt_second", "<i8", SATELLITES),
    ],
    align=True,
)

# A satellite whose integers are looked for, against a reference satellite.
INTEGER_DTYPE: Final = np.dtype(
    [
        ("satellite", "<i8"),
        ("reference", "<i8"),
        ("system", "<i8"),
        ("pair", "<i8"),
        ("reference_pair", "<i8"),
        ("elevation", "<f8"),  # rad
        ("age", "<i8"),  # epochs
        ("state", "<i8", 2),  # of its ambiguities on both frequencies
        ("base", "<i8", 2),  # of the reference's
        ("wavelength", "<f8", 2),  # m
        ("active", "<i8"),
        ("wide", "<i8"),  # cycle
        ("first", "<i8"),  # cycle
    ],
    align=True,
)

# One step of a search: what an attempt gave, of which signal, and what is known after it.
STEP_ROW_DTYPE: Final = np.dtype(
    [
        *((name, RESOLUTION_ROW_DTYPE[name]) for name in RESOLUTION_ROW_DTYPE.names or ()),
        ("signal", "<i8"),
        ("known", "<i8"),
    ],
    align=True,
)

RESIDUAL_ROW_DTYPE: Final = np.dtype(
    [
        ("t", "<i8"),
        ("log_t", "<i8"),
        ("satellite", "<i8"),
        ("reference", "<i8"),
        ("signal", "<i8"),
        ("residual", "<f8"),  # m
        ("sigma", "<f8"),  # m
    ],
    align=True,
)

# Values of `replay.EventKind`.
EVENT_INTEGER_REPAIRED: Final = 23
EVENT_STATION_LOST: Final = 24
EVENT_STATION_FOUND: Final = 25
