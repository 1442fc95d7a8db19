"""Carrier phases of an epoch less those of the reference, every modelled term taken off.

Both ranges are between Earth-fixed points and satellites told in ECEF at reception, so
that the Earth's rotation is in them. The place at the reference is that of the coarse
position: an error of some metres there tilts lines of sight by what they turned since,
less than a millimetre in a second.

Where a satellite's broadcast message changed in between, its orbit and clock step; the
step is the change of the modelled range beyond the mean modelled rate, and is taken off.
"""

from numba import njit

from replay.kernels.elementary import sin
from replay.kernels.gnss_records import SATELLITES, SLOTS
from replay.kernels.least_squares import geometric_range, reduced_phase
from replay.kernels.orbits import SPEED_OF_LIGHT_M_S
from replay.kernels.single_solve import predicted_range_rate
from replay.kernels.slip_records import CONTINUOUS, NEW
from replay.kernels.tdcp_adjust import SUSPECTED, USED
from replay.kernels.types import Array, Record
from replay.kernels.weighting import noise_factor

_NAN = float("nan")


@njit(cache=True)
def _toe(epoch: Record, row: Record) -> float:
    return epoch["t"] * 1e-9 - row["age"]


@njit(cache=True)
def usable_phase(row: Record, slot: int, cfg: Record) -> bool:
    """Whether a phase is there, and may be used."""
    return (
        row["seen"] == 1
        and cfg["excluded"][row["satellite"]] == 0
        and row["elevation"] >= cfg["mask"]
        and not row["cn0"][slot] < cfg["cn0_mask"]
        and row["phase"][slot] == row["phase"][slot]
    )


@njit(cache=True)
def _message_step(
    s: Record, row: Record, epoch: Record, dt: float, nought: Array, u: Array
) -> float:
    """What a change of the broadcast message did to range less satellite clock (m)."""
    sat = row["satellite"]
    changed = abs(_toe(epoch, row) - s["toe"][sat]) > 1.0 or row["issue"] != s["issue"][sat]
    if not changed:
        return 0.0
    rate = predicted_range_rate(row, s["x"], nought, u) - row["drift"]
    now = geometric_range(row, s["x"], u) - row["clock"]
    return now - s["range"][sat] - 0.5 * (rate + s["rate"][sat]) * dt


@njit(cache=True)
def differences(
    s: Record,
    cfg: Record,
    epoch: Record,
    rows: Array,
    dt: float,
    phases: Array,
    nought: Array,
    u: Array,
) -> int:
    """Fill `phases` with every phase that is at both epochs; how many there are."""
    count = 0
    for k in range(rows.shape[0]):
        row = rows[k]
        sat = row["satellite"]
        stepped, step = False, 0.0
        for slot in range(SLOTS):
            if (
                not usable_phase(row, slot, cfg)
                or s["broken"][sat, slot] == NEW
                or s["signal"][sat, slot] != row["signal"][slot]
                or s["phase"][sat, slot] != s["phase"][sat, slot]
            ):
                continue
            if not stepped:
                step = _message_step(s, row, epoch, dt, nought, u)
                stepped = True
            p = phases[count]
            count += 1
            p["row"] = k
            p["slot"] = slot
            p["system"] = row["system"]
            p["wavelength"] = SPEED_OF_LIGHT_M_S / row["frequency"][slot]
            p["z"] = reduced_phase(row, slot) - s["phase"][sat, slot] + step
            noise = cfg["phase_sigma"] * cfg["phase_sigma"]
            noise *= 2.0 * noise_factor(cfg["weight"]["model"], row["elevation"], row["cn0"][slot])
            drift = cfg["drift_sigma"] * dt / sin(row["elevation"])
            p["variance"] = noise + drift * drift
            p["state"] = USED if s["broken"][sat, slot] == CONTINUOUS else SUSPECTED
    return count


@njit(cache=True)
def refer(s: Record, epoch: Record, rows: Array, true_t: int, nought: Array, u: Array) -> None:
    """Make this epoch the reference; `s["x"]` is its place."""
    s["t"] = epoch["t"]
    s["true_t"] = true_t
    for sat in range(SATELLITES):
        for slot in range(SLOTS):
            s["phase"][sat, slot] = _NAN
            s["broken"][sat, slot] = CONTINUOUS
    for k in range(rows.shape[0]):
        row = rows[k]
        if row["seen"] == 0:
            continue
        sat = row["satellite"]
        distance = geometric_range(row, s["x"], u)
        s["range"][sat] = distance - row["clock"]
        s["rate"][sat] = predicted_range_rate(row, s["x"], nought, u) - row["drift"]
        s["toe"][sat] = _toe(epoch, row)
        s["issue"][sat] = row["issue"]
        for slot in range(SLOTS):
            if row["phase"][slot] == row["phase"][slot]:
                s["phase"][sat, slot] = reduced_phase(row, slot) - distance
                s["signal"][sat, slot] = row["signal"][slot]
