"""Breaks of carrier phases between one epoch and the one before.

What the receiver says (loss-of-lock bits, lock time), what is missing (a gap), and what
the phases themselves say: two frequencies against each other (Blewitt 1990, TurboEdit:
geometry-free and Melbourne-Wuebbena combinations), one frequency against its Doppler.

A receiver whose clock jumps does so in all its ranges alike. What all signals share is
taken off before a signal is judged: the median of code less phase, and of phase less
Doppler.
"""

from math import floor

from numba import njit

from replay.kernels.elementary import sin, sqrt
from replay.kernels.gnss_records import SLOTS
from replay.kernels.median import median
from replay.kernels.orbits import SPEED_OF_LIGHT_M_S
from replay.kernels.slip_records import (
    CONTINUOUS,
    DOPPLER,
    GAP,
    GEOMETRY_FREE,
    LOSS_OF_LOCK,
    NEW,
    PAIRS,
    SUSPECT,
    WIDE_LANE,
)
from replay.kernels.types import Array, Record

_NAN = float("nan")
_LEAST_COMMON = 3  # signals, of which a median is taken
_RATE_GAIN = 0.2  # of the running rate of the geometry-free phase
_FREE_TOLERANCE_M = 0.015  # to which whole cycles explain a geometry-free jump
_MS_M = SPEED_OF_LIGHT_M_S * 1e-3
_MS_TOLERANCE_M = 30.0
_WIDE_MEMORY = 300  # epochs that the running mean looks back


@njit(cache=True)
def _doppler_miss(s: Record, row: Record, slot: int, dt: float) -> float:
    """Change of the phase less the mean range rate times the interval (m); NaN if unknown."""
    sat = row["satellite"]
    mean = 0.5 * (row["range_rate"][slot] + s["range_rate"][sat, slot])
    return row["phase"][slot] - s["phase"][sat, slot] - mean * dt


@njit(cache=True)
def _common(
    s: Record, rows: Array, broken: Array, dt: float, buffer: Array
) -> tuple[float, float, int]:
    """Medians over all unbroken signals of what changed: code less phase, phase less Doppler.

    The third number is how many phases have a Doppler.
    """
    count = 0
    for k in range(rows.shape[0]):
        row = rows[k]
        sat = row["satellite"]
        for slot in range(SLOTS):
            if broken[k, slot] == CONTINUOUS:
                change = row["code"][slot] - s["code"][sat, slot]
                change -= row["phase"][slot] - s["phase"][sat, slot]
                if change == change:
                    buffer[count] = change
                    count += 1
    code = median(buffer, count) if count >= _LEAST_COMMON else 0.0
    count = 0
    for k in range(rows.shape[0]):
        for slot in range(SLOTS):
            if broken[k, slot] == CONTINUOUS:
                miss = _doppler_miss(s, rows[k], slot, dt)
                if miss == miss:
                    buffer[count] = miss
                    count += 1
    phase = median(buffer, count) if count >= _LEAST_COMMON else 0.0
    return code, phase, count


@njit(cache=True)
def append_slip(
    slips: Array,
    counts: Array,
    epoch: Record,
    row: Record,
    slot: int,
    detector: int,
    statistic: float,
    threshold: float,
    size: float,
) -> None:
    """Append one row; `counts[0]` is the number of rows."""
    out = slips[counts[0]]
    counts[0] += 1
    out["t"] = epoch["t"]
    out["log_t"] = epoch["log_t"]
    out["satellite"] = row["satellite"]
    out["signal"] = row["signal"][slot]
    out["detector"] = detector
    out["statistic"] = statistic
    out["threshold"] = threshold
    out["size"] = size
    out["repaired"] = 0


@njit(cache=True)
def wide_lane(row: Record, slot: int) -> float:
    """Melbourne-Wuebbena combination of slots 0 and `slot` (cycle of the wide lane)."""
    f0, f1 = row["frequency"][0], row["frequency"][slot]
    phase = (f0 * row["phase"][0] - f1 * row["phase"][slot]) / (f0 - f1)
    code = (f0 * row["code"][0] + f1 * row["code"][slot]) / (f0 + f1)
    return (phase - code) * (f0 - f1) / SPEED_OF_LIGHT_M_S


@njit(cache=True)
def pair_jumps(
    row: Record, slot: int, free: float, wide: float, wide_sigma: float
) -> tuple[bool, float, float]:
    """Whole cycles of both phases that explain the jumps of their combinations.

    Parameters
    ----------
    row : record of MEASURED_DTYPE
    slot : int
        The second phase; the first is slot 0.
    free : float, m
        Jump of the geometry-free phase.
    wide : float, cycle
        Jump of the Melbourne-Wuebbena combination.
    wide_sigma : float, cycle
        Its deviation.

    Returns
    -------
    known : bool
        Whether one pair of integers fits and no other within reach does.
    first, second : float, cycle
    """
    la = SPEED_OF_LIGHT_M_S / row["frequency"][0]
    lb = SPEED_OF_LIGHT_M_S / row["frequency"][slot]
    reach = max(1.0, 3.0 * wide_sigma)
    found = 0
    a = b = 0.0
    w = floor(wide - reach) + 1.0
    while w <= wide + reach:
        # la a - lb (a - w) = free
        n = floor((free - lb * w) / (la - lb) + 0.5)
        if abs(la * n - lb * (n - w) - free) <= _FREE_TOLERANCE_M:
            found += 1
            a, b = n, n - w
        w += 1.0
    return found == 1 and (a != 0.0 or b != 0.0), a, b


@njit(cache=True)
def _start_pair(s: Record, row: Record, pair: int) -> None:
    """Begin the combinations of a pair anew with this epoch."""
    sat = row["satellite"]
    slot = pair + 1
    s["free"][sat, pair] = row["phase"][0] - row["phase"][slot]
    s["free_rate"][sat, pair] = 0.0
    wide = wide_lane(row, slot)
    s["wide_count"][sat, pair] = 1 if wide == wide else 0
    s["wide_mean"][sat, pair] = wide if wide == wide else 0.0
    s["wide_variance"][sat, pair] = 0.0


@njit(cache=True)
def _judge_pair(
    s: Record,
    cfg: Record,
    epoch: Record,
    row: Record,
    pair: int,
    dt: float,
    broken: Array,
    slips: Array,
    counts: Array,
) -> None:
    """Test the combinations of slot 0 and another one, both unbroken so far; learn from them."""
    sat = row["satellite"]
    slot = pair + 1
    scale = max(0.3, sin(row["elevation"])) if row["seen"] == 1 else 0.5
    la = SPEED_OF_LIGHT_M_S / row["frequency"][0]
    free = row["phase"][0] - row["phase"][slot]
    miss = free - s["free"][sat, pair] - s["free_rate"][sat, pair] * dt
    limit = cfg["geometry_free"] / scale + cfg["geometry_free_rate"] * dt
    of_free = cfg["geometry_free"] > 0.0 and abs(miss) > limit
    wide = wide_lane(row, slot)
    count = s["wide_count"][sat, pair]
    # A young deviation is a poor one: the expected one counts as ten epochs of its own.
    prior = cfg["wide_lane_sigma"] / scale
    sigma = sqrt((10.0 * prior * prior + count * s["wide_variance"][sat, pair]) / (10.0 + count))
    off = wide - s["wide_mean"][sat, pair]
    wide_limit = max(cfg["wide_lane_least"], cfg["wide_lane"] * sigma)
    of_wide = cfg["wide_lane"] > 0.0 and count > 0 and abs(off) > wide_limit
    if of_free or of_wide:
        known, a, b = False, 0.0, 0.0
        if count > 0 and off == off:
            spread = sigma * sqrt(1.0 + 1.0 / count)
            known, a, b = pair_jumps(row, slot, miss, off, spread)
        for place in range(2):
            which = 0 if place == 0 else slot
            size = a if place == 0 else b
            if known and size == 0.0:
                continue
            if which == 0 and broken[0] != CONTINUOUS:
                continue
            broken[which] = SUSPECT
            told = size if known else _NAN
            if of_free:
                append_slip(
                    slips, counts, epoch, row, which, GEOMETRY_FREE, miss / la, limit / la, told
                )
            if of_wide:
                append_slip(slips, counts, epoch, row, which, WIDE_LANE, off, wide_limit, told)
        _start_pair(s, row, pair)
        return
    s["free_rate"][sat, pair] += _RATE_GAIN * miss / dt
    s["free"][sat, pair] = free
    if wide == wide:
        count = min(count + 1, _WIDE_MEMORY)
        s["wide_count"][sat, pair] = count
        s["wide_mean"][sat, pair] += off / count
        if count > 1:
            s["wide_variance"][sat, pair] += (off * off - s["wide_variance"][sat, pair]) / count


@njit(cache=True)
def _judge_receiver(
    s: Record,
    cfg: Record,
    epoch: Record,
    row: Record,
    slot: int,
    dt: float,
    slips: Array,
    counts: Array,
) -> int:
    """What the receiver says of a phase; CONTINUOUS, SUSPECT or NEW."""
    sat = row["satellite"]
    if s["slot_t"][sat, slot] < 0 or s["signal"][sat, slot] != row["signal"][slot]:
        return NEW
    away = (epoch["t"] - s["slot_t"][sat, slot]) * 1e-9
    if s["slot_t"][sat, slot] != s["t"] or away > cfg["gap"]:
        append_slip(slips, counts, epoch, row, slot, GAP, away, cfg["gap"], _NAN)
        return NEW
    bits = row["lock_lost"][slot]
    half = (bits // 2) % 2
    if (cfg["lock"] == 1 and bits % 2 == 1) or (cfg["half"] == 1 and half != s["half"][sat, slot]):
        append_slip(slips, counts, epoch, row, slot, LOSS_OF_LOCK, float(bits), 0.0, _NAN)
        return SUSPECT
    lock = row["lock_time"][slot]
    if cfg["lock_time"] == 1 and lock == lock:
        # Some receivers tell the least time that a counter stands for: at least half of it.
        least = 0.5 * dt
        if s["lock_time"][sat, slot] == s["lock_time"][sat, slot]:
            least = max(least, s["lock_time"][sat, slot] - 1e-3)
        if lock < least:
            append_slip(slips, counts, epoch, row, slot, LOSS_OF_LOCK, lock, least, _NAN)
            return SUSPECT
    return CONTINUOUS


@njit(cache=True)
def _judge_doppler(
    s: Record,
    cfg: Record,
    epoch: Record,
    row: Record,
    slot: int,
    dt: float,
    common: float,
    slips: Array,
    counts: Array,
) -> bool:
    """Whether a phase went another way than its Doppler."""
    miss = _doppler_miss(s, row, slot, dt) - common
    scale = max(0.2, sin(row["elevation"])) if row["seen"] == 1 else 0.5
    # Of two rates the mean is as good as one over the square root of two; the median too errs.
    sigma = cfg["doppler_sigma"] / scale
    limit = cfg["doppler"] * sigma * dt + cfg["jerk"] * dt * dt * dt / 12.0
    if not abs(miss) > limit:
        return False
    wave = SPEED_OF_LIGHT_M_S / row["frequency"][slot]
    append_slip(slips, counts, epoch, row, slot, DOPPLER, miss / wave, limit / wave, miss / wave)
    return True


@njit(cache=True)
def detect_slips(
    s: Record,
    cfg: Record,
    epoch: Record,
    rows: Array,
    broken: Array,
    slips: Array,
    counts: Array,
    buffer: Array,
) -> float:
    """Judge every phase of an epoch against the epoch before, and remember it.

    Parameters
    ----------
    s : record of SLIP_STATE_DTYPE
        Changed.
    cfg : record of SLIP_CONFIG_DTYPE
    epoch : record of EPOCH_DTYPE
        Its clock, where known, says how long the interval really was.
    rows : array (n,) of MEASURED_DTYPE
        Of this epoch.
    broken : int64 array (n, SLOTS)
        Filled: CONTINUOUS; SUSPECT where the phase may have jumped; NEW where there was
        none just before, or is none now.
    slips : array of SLIP_ROW_DTYPE
        Room for four more rows per phase.
    counts : int64 array (1,)
        Rows written so far; goes on.
    buffer : float64 array (SATELLITES * SLOTS,)
        Scratch.

    Returns
    -------
    float
        Jump of the receiver's clock (m), of code against phase or of both; 0 for none.
    """
    known_clock = epoch["placed"] == 1 and epoch["age"] == 0.0
    dt = (epoch["t"] - s["t"]) * 1e-9 if s["t"] >= 0 else 0.0
    if known_clock and s["clock"] == s["clock"]:
        dt -= (epoch["clock"] - s["clock"]) / SPEED_OF_LIGHT_M_S
    for k in range(rows.shape[0]):
        for slot in range(SLOTS):
            broken[k, slot] = NEW
            if rows[k]["phase"][slot] == rows[k]["phase"][slot]:
                broken[k, slot] = _judge_receiver(s, cfg, epoch, rows[k], slot, dt, slips, counts)
    code_jump, phase_jump, dopplers = 0.0, 0.0, 0
    if dt > 0.0:
        code_jump, phase_jump, dopplers = _common(s, rows, broken, dt, buffer)
    jump = 0.0
    if abs(phase_jump) > cfg["clock_jump"]:
        jump = phase_jump
    if abs(code_jump) > cfg["clock_jump"]:
        whole = floor(code_jump / _MS_M + 0.5) * _MS_M
        if abs(code_jump - whole) < _MS_TOLERANCE_M:
            code_jump = whole
        jump = code_jump
    else:
        code_jump = 0.0
    for k in range(rows.shape[0]):
        row = rows[k]
        sat = row["satellite"]
        for pair in range(PAIRS):
            slot = pair + 1
            both = row["phase"][0] == row["phase"][0] and row["phase"][slot] == row["phase"][slot]
            if not both:
                s["free"][sat, pair] = _NAN
                continue
            s["wide_mean"][sat, pair] -= (
                code_jump * (row["frequency"][0] - row["frequency"][slot]) / SPEED_OF_LIGHT_M_S
            )
            whole_pair = broken[k, 0] == CONTINUOUS and broken[k, slot] == CONTINUOUS
            if whole_pair and dt > 0.0 and s["free"][sat, pair] == s["free"][sat, pair]:
                _judge_pair(s, cfg, epoch, row, pair, dt, broken[k], slips, counts)
            else:
                _start_pair(s, row, pair)
        for slot in range(SLOTS):
            if row["phase"][slot] != row["phase"][slot]:
                continue
            if (
                broken[k, slot] == CONTINUOUS
                and cfg["doppler"] > 0.0
                and dopplers >= _LEAST_COMMON
                and _judge_doppler(s, cfg, epoch, row, slot, dt, phase_jump, slips, counts)
            ):
                broken[k, slot] = SUSPECT
            s["slot_t"][sat, slot] = epoch["t"]
            s["signal"][sat, slot] = row["signal"][slot]
            s["phase"][sat, slot] = row["phase"][slot]
            s["code"][sat, slot] = row["code"][slot]
            s["range_rate"][sat, slot] = row["range_rate"][slot]
            s["lock_time"][sat, slot] = row["lock_time"][slot]
            s["half"][sat, slot] = (row["lock_lost"][slot] // 2) % 2
    s["t"] = epoch["t"]
    s["clock"] = epoch["clock"] if known_clock else _NAN
    return jump
