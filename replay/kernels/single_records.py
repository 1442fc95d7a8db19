"""Records of single-point positioning: settings, solutions, residuals."""

from typing import Final

import numpy as np

from replay.kernels.gnss_records import SATELLITES, SYSTEMS
from replay.kernels.weighting import WEIGHT_DTYPE

SINGLE_CONFIG_DTYPE: Final = np.dtype(
    [
        ("mask", "<f8"),  # rad
        ("cn0_mask", "<f8"),  # dB-Hz
        ("excluded", "<i8", SATELLITES),
        ("code_sigma", "<f8"),  # m
        ("system_scale", "<f8", SYSTEMS),  # on the deviation, by system
        ("doppler_sigma", "<f8"),  # m/s
        ("weight", WEIGHT_DTYPE),
        ("free", "<i8"),  # 1: ionosphere-free pair of slot 0 and the next that has a range
        ("robust", "<i8"),
        ("raim", "<i8"),
        ("confidence", "<f8"),  # probability that a good epoch passes
        ("exclusions", "<i8"),  # at most
        ("velocity", "<i8"),
        ("pdop", "<f8"),  # largest that is believed
    ],
    align=True,
)
SINGLE_STATE_DTYPE: Final = np.dtype([("x", "<f8", 3), ("clock", "<f8", SYSTEMS)], align=True)
SINGLE_ROW_DTYPE: Final = np.dtype(
    [
        ("t", "<i8"),  # ns, the receiver's clock taken off
        ("epoch_t", "<i8"),  # ns, as the receiver's clock read it
        ("log_t", "<i8"),
        ("r", "<f8", 3),
        ("cov", "<f8", 6),  # m^2, upper triangle, east north up
        ("has_v", "<i8"),
        ("v_enu", "<f8", 3),
        ("v_std", "<f8", 3),
        ("clock", "<f8", SYSTEMS),  # m, NaN where the system is not used
        ("clock_std", "<f8", SYSTEMS),
        ("drift", "<f8"),  # m/s, NaN where unknown
        ("drift_std", "<f8"),
        ("count", "<i8", SYSTEMS),
        ("dop", "<f8", 4),  # GDOP, PDOP, HDOP, VDOP
        ("system_pdop", "<f8", SYSTEMS),  # NaN where it cannot be had
        ("status", "<i8"),
    ],
    align=True,
)
RESIDUAL_DTYPE: Final = np.dtype(
    [
        ("t", "<i8"),
        ("log_t", "<i8"),
        ("kind", "<i8"),
        ("satellite", "<i8"),
        ("signal", "<i8"),
        ("z", "<f8"),
        ("s", "<f8"),
        ("r", "<f8"),
        ("accepted", "<i8"),
    ],
    align=True,
)
KIND_PSEUDORANGE: Final = 7
KIND_DOPPLER: Final = 9
EVENT_EXCLUDED: Final = 12
EVENT_TOO_FEW: Final = 14
EVENT_NOT_CONVERGED: Final = 15
