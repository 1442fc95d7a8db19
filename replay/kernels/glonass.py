"""Motion of a GLONASS satellite between broadcast states, in rotating PZ-90 axes.

GLONASS ICD, edition 5.1 (2008), section A.3.1.2: the broadcast position and velocity
are carried to another time by the fourth-order Runge-Kutta method under the central
field, the second zonal harmonic, the lunisolar acceleration of the message (constant)
and the terms of the Earth's rotation. PZ-90.11 is within a few centimetres of WGS-84;
no transformation is made.
"""

from numba import njit

from replay.kernels.elementary import sqrt
from replay.kernels.types import Array, Record

MU_M3_S2 = 3.9860044e14  # ICD 5.1, A.3.1.2 (table 3.2: 3.986004418e14; 7 mm after two hours)
RADIUS_M = 6378136.0  # ICD 5.1, table 3.2
J2 = 1.0826257e-3  # ICD 5.1, table 3.2, 1082625.75e-9
OMEGA_E_RAD_S = 7.292115e-5  # ICD 5.1, table 3.2
STEP_S = 60.0


@njit(cache=True)
def acceleration(
    x: float, y: float, z: float, vx: float, vy: float, ax: float, ay: float, az: float
) -> tuple[float, float, float]:
    """Acceleration in rotating axes.

    Parameters
    ----------
    x, y, z : float, m
        Position, PZ-90.
    vx, vy : float, m/s
        Velocity in the plane of the equator, PZ-90.
    ax, ay, az : float, m/s^2
        Lunisolar acceleration of the message.

    Returns
    -------
    tuple of three floats, m/s^2, PZ-90
    """
    r2 = x * x + y * y + z * z
    r3 = r2 * sqrt(r2)
    a = 1.5 * J2 * MU_M3_S2 * (RADIUS_M * RADIUS_M) / (r2 * r3)
    c = -MU_M3_S2 / r3 - a * (1.0 - 5.0 * z * z / r2)
    w2 = OMEGA_E_RAD_S * OMEGA_E_RAD_S
    return (
        (c + w2) * x + 2.0 * OMEGA_E_RAD_S * vy + ax,
        (c + w2) * y - 2.0 * OMEGA_E_RAD_S * vx + ay,
        (c - 2.0 * a) * z + az,
    )


@njit(cache=True)
def runge_kutta_step(h: float, lunisolar: Array, state: Array) -> None:
    """One classical fourth-order step in place.

    Parameters
    ----------
    h : float, s
        Step, may be negative.
    lunisolar : array (3,), m/s^2
    state : array (6 or more,), m and m/s, PZ-90
        Position and velocity; further elements stay.
    """
    bx, by, bz = lunisolar[0], lunisolar[1], lunisolar[2]
    x, y, z = state[0], state[1], state[2]
    u, v, w = state[3], state[4], state[5]
    h2 = 0.5 * h
    a1, b1, c1 = acceleration(x, y, z, u, v, bx, by, bz)
    u2, v2, w2 = u + h2 * a1, v + h2 * b1, w + h2 * c1
    a2, b2, c2 = acceleration(x + h2 * u, y + h2 * v, z + h2 * w, u2, v2, bx, by, bz)
    u3, v3, w3 = u + h2 * a2, v + h2 * b2, w + h2 * c2
    a3, b3, c3 = acceleration(x + h2 * u2, y + h2 * v2, z + h2 * w2, u3, v3, bx, by, bz)
    u4, v4, w4 = u + h * a3, v + h * b3, w + h * c3
    a4, b4, c4 = acceleration(x + h * u3, y + h * v3, z + h * w3, u4, v4, bx, by, bz)
    s = h / 6.0
    state[0] = x + s * (u + 2.0 * u2 + 2.0 * u3 + u4)
    state[1] = y + s * (v + 2.0 * v2 + 2.0 * v3 + v4)
    state[2] = z + s * (w + 2.0 * w2 + 2.0 * w3 + w4)
    state[3] = u + s * (a1 + 2.0 * a2 + 2.0 * a3 + a4)
    state[4] = v + s * (b1 + 2.0 * b2 + 2.0 * b3 + b4)
    state[5] = w + s * (c1 + 2.0 * c2 + 2.0 * c3 + c4)


@njit(cache=True)
def integrate(record: Record, tk: float, out: Array) -> None:
    """Position and velocity `tk` seconds after the reference time of the message.

    Whole steps of 60 s, then one of what is left, whatever the state.

    Parameters
    ----------
    record : Record of `EPHEMERIS_DTYPE`
    tk : float, s
        May be negative. The message is meant for a quarter of an hour either way.
    out : array (6 or more,), m and m/s, PZ-90
        Position and velocity.
    """
    for i in range(3):
        out[i] = record["position_m"][i]
        out[3 + i] = record["velocity_m_s"][i]
    h = STEP_S if tk >= 0.0 else -STEP_S
    left = tk
    while left * h >= STEP_S * STEP_S:
        runge_kutta_step(h, record["acceleration_m_s2"], out)
        left -= h
    if left != 0.0:
        runge_kutta_step(left, record["acceleration_m_s2"], out)
