"""A vector measurement of up to three components: gate, record, update, feed back."""

from numba import njit

from replay.kernels.covariance import (
    ACCEL_BIAS,
    ACCEL_SCALE,
    ATTITUDE,
    GYRO_BIAS,
    GYRO_SCALE,
    POSITION,
    VELOCITY,
)
from replay.kernels.elementary import sqrt
from replay.kernels.kalman import (
    cholesky3,
    forward_square3,
    innovation_covariance,
    whitened_update,
)
from replay.kernels.rotation import (
    cross3,
    matrix_from_quaternion,
    quaternion_from_vector,
    quaternion_multiply,
    quaternion_normalize,
    rotate3,
)
from replay.kernels.transition import add_correction, open_node
from replay.kernels.types import Array, Record


@njit(cache=True)
def state_count(cfg: Record) -> int:
    """Number of error states of the inertial system and the vehicle."""
    return cfg["states"] + 2 * cfg["mounting"] + 2 * cfg["lever"] + cfg["squat"]


@njit(cache=True)
def total_count(s: Record, cfg: Record) -> int:
    """Number of error states at this moment, those of satellites and clocks included."""
    return state_count(cfg) + s["extra"]


@njit(cache=True)
def feed_back(s: Record, cfg: Record, dx: Array, scratch: Array) -> None:
    """Add a correction (truth minus estimate) to the filter's state."""
    nav = s["nav"]
    r, v, q = nav["r"], nav["v"], nav["q"]
    bg, ba = s["bg"], s["ba"]
    # The displacement summed so far was as wrong as the state is now known to have been.
    span = (s["t"] - s["moved_t"]) * 1e-9
    C, f, moved = nav["C"], nav["f_e"], s["moved"]
    a0, a1, a2 = cross3(f[0], f[1], f[2], dx[ATTITUDE], dx[ATTITUDE + 1], dx[ATTITUDE + 2])
    b0, b1, b2 = rotate3(C, dx[ACCEL_BIAS], dx[ACCEL_BIAS + 1], dx[ACCEL_BIAS + 2])
    moved[0] += span * (dx[VELOCITY] + 0.5 * span * (a0 + b0))
    moved[1] += span * (dx[VELOCITY + 1] + 0.5 * span * (a1 + b1))
    moved[2] += span * (dx[VELOCITY + 2] + 0.5 * span * (a2 + b2))
    for i in range(3):
        r[i] += dx[POSITION + i]
        v[i] += dx[VELOCITY + i]
        bg[i] += dx[GYRO_BIAS + i]
        ba[i] += dx[ACCEL_BIAS + i]
    if cfg["states"] == 21:
        sg, sa = s["sg"], s["sa"]
        for i in range(3):
            sg[i] += dx[GYRO_SCALE + i]
            sa[i] += dx[ACCEL_SCALE + i]
    if cfg["mounting"] == 1:
        mount = s["mount"]
        mount[0] += dx[cfg["states"]]
        mount[1] += dx[cfg["states"] + 1]
    if cfg["lever"] == 1:
        k = cfg["states"] + 2 * cfg["mounting"]
        point = s["point"]
        point[0] += dx[k]
        point[2] += dx[k + 1]
    if cfg["squat"] == 1:
        s["squat"] += dx[state_count(cfg) - 1]
    first, aux = state_count(cfg), s["aux"]
    for i in range(s["extra"]):
        aux[i] += dx[first + i]
    quaternion_from_vector(dx[ATTITUDE], dx[ATTITUDE + 1], dx[ATTITUDE + 2], scratch[0])
    quaternion_multiply(scratch[0], q, scratch[1])
    for i in range(4):
        q[i] = scratch[1, i]
    quaternion_normalize(q)
    matrix_from_quaternion(q, nav["C"])


@njit(cache=True)
def record_innovation(
    rows: Array,
    counts: Array,
    t: int,
    log_t: int,
    kind: int,
    axis: int,
    z: float,
    s: float,
    r: float,
    accepted: bool,
) -> None:
    """Append one row to the innovations."""
    row = rows[counts[2]]
    row["t"] = t
    row["log_t"] = log_t
    row["kind"] = kind
    row["axis"] = axis
    row["z"] = z
    row["s"] = s
    row["r"] = r
    row["accepted"] = accepted
    counts[2] += 1


@njit(cache=True)
def record_event(
    rows: Array, counts: Array, t: int, log_t: int, kind: int, value: float, note: int
) -> None:
    """Append one row to the events; beyond the room that there is, only count it."""
    if counts[3] < rows.shape[0]:
        row = rows[counts[3]]
        row["t"] = t
        row["log_t"] = log_t
        row["kind"] = kind
        row["value"] = value
        row["note"] = note
        counts[3] += 1
    else:
        counts[4] += 1


@njit(cache=True)
def update(
    s: Record,
    cfg: Record,
    work: Record,
    k: int,
    count: int,
    gate: float,
    force: bool,
    kind: int,
    axis: int,
    t: int,
    log_t: int,
    innovations: Array,
    counts: Array,
) -> bool:
    """Use the measurement that stands in `work`: H, index, z, R.

    Parameters
    ----------
    s : record of STATE_DTYPE
        Changed in place.
    cfg : record of CONFIG_DTYPE
    work : record of WORK_DTYPE
    k : int
        Components.
    count : int
        States that `work["index"]` names.
    gate : float
        Limit of the joint chi-square; zero or less lets everything in.
    force : bool
        Use it whatever the gate says.
    kind, axis : int
        What to record; axes count up from `axis`.
    t, log_t : int, ns
    innovations, counts
        Where to record.

    Returns
    -------
    bool
        Whether it was used.
    """
    P = s["P"]
    H, index, z, R = work["H"], work["index"], work["z"], work["R"]
    S, L = work["S"], work["L"]
    n = total_count(s, cfg)
    innovation_covariance(P, n, H, index, count, R, k, work["PH"], S)
    accepted = cholesky3(S, k, L)
    if accepted and gate > 0.0 and not force:
        accepted = forward_square3(L, z, k) <= gate
    for a in range(k):
        record_innovation(
            innovations,
            counts,
            t,
            log_t,
            kind,
            axis + a,
            z[a],
            sqrt(S[a, a]),
            sqrt(R[a, a]),
            accepted,
        )
    if not accepted:
        return False
    dx, trail = work["dx"], work["trail"]
    for i in range(n):
        dx[i] = 0.0
    if trail["on"] == 1:
        open_node(trail, P, n)
    if not whitened_update(
        P, n, H, index, count, z, R, k, dx, L, work["h"], work["b"], work["gain"]
    ):
        return False
    feed_back(s, cfg, dx, work["q"])
    if trail["on"] == 1:
        add_correction(trail, dx, n)
    return True


@njit(cache=True)
def fill_covariance(R: Array, c: Array, scale: float, floor: Array) -> None:
    """(3, 3) from an upper triangle, scaled, with the squares of `floor` (3) on the diagonal."""
    k = scale * scale
    R[0, 0] = k * c[0] + floor[0] * floor[0]
    R[0, 1] = k * c[1]
    R[0, 2] = k * c[2]
    R[1, 1] = k * c[3] + floor[1] * floor[1]
    R[1, 2] = k * c[4]
    R[2, 2] = k * c[5] + floor[2] * floor[2]
    R[1, 0] = R[0, 1]
    R[2, 0] = R[0, 2]
    R[2, 1] = R[1, 2]


@njit(cache=True)
def diagonal(R: Array, a: float, b: float, c: float) -> None:
    """(3, 3) diagonal matrix of three variances."""
    for i in range(3):
        for j in range(3):
            R[i, j] = 0.0
    R[0, 0] = a
    R[1, 1] = b
    R[2, 2] = c
