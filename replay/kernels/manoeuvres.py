"""Manoeuvres of a simulated car, aircraft or walker, in local axes.

Speed, course, grade and the body's angles relative to the path are polynomials in
time, piece by piece: the rate of each goes from one value to another along a septic
smoothstep, so that rates are three times and values four times continuously
differentiable. Velocity and attitude are closed functions of them.
"""

import numpy as np
from numba import njit

from replay.kernels.elementary import atan, sincos
from replay.kernels.types import Array, Record

# One piece of the motion. The quantities are speed (m/s), course (rad, clockwise from
# north), grade (rad, up), and roll, pitch and yaw of the body relative to the path
# (rad); rates are theirs per second.
PIECE_DTYPE = np.dtype(
    [
        ("start", "<f8"),  # s
        ("duration", "<f8"),  # s, more than zero
        ("value", "<f8", 6),  # at the start
        ("rate", "<f8", 6),  # at the start
        ("change", "<f8", 6),  # of the rate until the end
    ],
    align=True,
)

# How the body follows its path.
BODY_DTYPE = np.dtype(
    [
        ("roll_per_lateral", "<f8"),  # rad per m/s^2, out of the turn
        ("pitch_per_forward", "<f8"),  # rad per m/s^2, nose up
        ("bank", "<f8"),  # 1/(m/s^2): one over gravity where turns are coordinated, else 0
        ("cadence", "<f8"),  # rad/s of steps; 0 where there are none
        # Amplitudes of what steps do, per m/s of speed.
        ("bounce", "<f8"),  # m/s up
        ("surge", "<f8"),  # m/s forward
        ("sway", "<f8"),  # m/s to the right, at half the cadence
        ("swing", "<f8", 3),  # rad: roll and yaw at half the cadence, pitch at the cadence
    ],
    align=True,
)

# Motion in local axes at one moment.
MOTION_DTYPE = np.dtype(
    [
        ("v", "<f8", 3),  # m/s, east, north, up
        ("a", "<f8", 3),  # m/s^2, derivative of the components of v
        ("angle", "<f8", 3),  # rad: roll, pitch, heading
        ("angle_rate", "<f8", 3),  # rad/s
        ("w", "<f8", 3),  # rad/s, body relative to inertial, body axes
        ("f", "<f8", 3),  # m/s^2, body axes
        ("C", "<f8", (3, 3)),  # body to north, east, down
        ("x", "<f8", 3),  # m, ECEF
    ],
    align=True,
)


@njit(cache=True)
def piece_at(pieces: Array, t: float, guess: int) -> int:
    """Number of the piece in which a time (s) lies, looking onward from a guess."""
    k = guess
    while k + 1 < pieces.shape[0] and pieces[k + 1]["start"] <= t:
        k += 1
    return k


@njit(cache=True)
def profile(piece: Record, t: float, i: int) -> tuple[float, float, float]:
    """Value, first and second derivative of quantity `i` at a time (s) of a piece."""
    elapsed = t - piece["start"]
    T = piece["duration"]
    x = min(1.0, max(0.0, elapsed / T))
    y = x * x
    y4 = y * y
    rise = y4 * (35.0 - x * (84.0 - x * (70.0 - x * 20.0)))
    integral = y4 * x * (7.0 - x * (14.0 - x * (10.0 - x * 2.5)))
    z = x * (1.0 - x)
    slope = 140.0 * z * z * z
    change = piece["change"][i]
    value = piece["value"][i] + piece["rate"][i] * elapsed + change * (T * integral)
    return value, piece["rate"][i] + change * rise, change * slope / T


@njit(cache=True)
def move(piece: Record, t: float, body: Record, m: Record) -> None:
    """Velocity, its derivative and attitude angles with their rates, in local axes.

    A body on springs rolls out of the turn and dives when it brakes; an aircraft
    banks into the turn until it feels no side force.

    Parameters
    ----------
    piece : record of PIECE_DTYPE
    t : float, s
    body : record of BODY_DTYPE
    m : record of MOTION_DTYPE
        `v`, `a`, `angle` and `angle_rate` are written.
    """
    speed, pace, pace_rate = profile(piece, t, 0)
    heading, turn, turn_rate = profile(piece, t, 1)
    grade, rise, _ = profile(piece, t, 2)
    sh, ch = sincos(heading)
    sg, cg = sincos(grade)
    v, a, angle, rate = m["v"], m["a"], m["angle"], m["angle_rate"]
    v[0] = speed * (cg * sh)
    v[1] = speed * (cg * ch)
    v[2] = speed * sg
    a[0] = pace * (cg * sh) + speed * (turn * (cg * ch) - rise * (sg * sh))
    a[1] = pace * (cg * ch) - speed * (turn * (cg * sh) + rise * (sg * ch))
    a[2] = pace * sg + speed * (rise * cg)
    roll, roll_rate, _ = profile(piece, t, 3)
    pitch, pitch_rate, _ = profile(piece, t, 4)
    yaw, yaw_rate, _ = profile(piece, t, 5)
    lean, dive = body["roll_per_lateral"], body["pitch_per_forward"]
    angle[0] = -(lean * (speed * turn) - roll)
    angle[1] = grade + dive * pace + pitch
    angle[2] = heading + yaw
    rate[0] = -(lean * (pace * turn + speed * turn_rate) - roll_rate)
    rate[1] = rise + dive * pace_rate + pitch_rate
    rate[2] = turn + yaw_rate
    if body["bank"] != 0.0:
        # Level flight: the tangent of the bank is the lateral acceleration over gravity.
        u = body["bank"] * (speed * turn)
        angle[0] += atan(u)
        rate[0] += body["bank"] * (pace * turn + speed * turn_rate) / (1.0 + u * u)
    if body["cadence"] != 0.0:
        _walk(speed, pace, turn, t, sh, ch, body, m)


@njit(cache=True)
def _walk(
    speed: float, pace: float, turn: float, t: float, sh: float, ch: float, body: Record, m: Record
) -> None:
    """Add what steps do: they bounce, surge and sway, the more the faster.

    Parameters
    ----------
    speed, pace, turn : float, m/s, m/s^2, rad/s
    t : float, s
        Since the start.
    sh, ch : float
        Sine and cosine of the course.
    body : record of BODY_DTYPE
    m : record of MOTION_DTYPE
        Added to.
    """
    v, a, angle, rate = m["v"], m["a"], m["angle"], m["angle_rate"]
    step = body["cadence"]
    stride = 0.5 * step  # left and right
    s1, c1 = sincos(step * t)
    s2, c2 = sincos(stride * t)
    forward = body["surge"] * (speed * c1)
    forward_rate = body["surge"] * (pace * c1 - speed * step * s1)
    right = body["sway"] * (speed * c2)
    right_rate = body["sway"] * (pace * c2 - speed * stride * s2)
    v[0] += forward * sh + right * ch
    v[1] += forward * ch - right * sh
    v[2] += body["bounce"] * (speed * s1)
    a[0] += forward_rate * sh + right_rate * ch + turn * (forward * ch - right * sh)
    a[1] += forward_rate * ch - right_rate * sh - turn * (forward * sh + right * ch)
    a[2] += body["bounce"] * (pace * s1 + speed * step * c1)
    swing = body["swing"]
    angle[0] += swing[0] * (speed * s2)
    angle[1] += swing[1] * (speed * c1)
    angle[2] += swing[2] * (speed * c2)
    rate[0] += swing[0] * (pace * s2 + speed * stride * c2)
    rate[1] += swing[1] * (pace * c1 - speed * step * s1)
    rate[2] += swing[2] * (pace * c2 - speed * stride * s2)
