"""The same 21-state filter as a person would write it with numpy: the peer of the kernel.

Dense matrices throughout: Phi = I + F dt, P = Phi P Phi' + Q at every sample, Joseph's
form at every fix. Errors are truth minus estimate in ECEF, in the order position,
velocity, attitude, gyro bias, accelerometer bias, gyro scale, accelerometer scale
(Groves 2e, section 14.3.2).
"""

from __future__ import annotations

import dataclasses

import numpy as np
import numpy.typing as npt

from replay.stages.loose_config import LooseConfig

Floats = npt.NDArray[np.float64]

STATES = 21
GM = 3.986004418e14  # m^3/s^2, WGS 84
J2 = 1.082629821e-3  # WGS 84
RADIUS_M = 6378137.0  # WGS 84
EARTH_RATE = np.array([0.0, 0.0, 7.292115e-5])  # rad/s, WGS 84
POSITION, VELOCITY, ATTITUDE, GYRO, ACCEL, GYRO_SCALE, ACCEL_SCALE = (
    slice(3 * i, 3 * i + 3) for i in range(7)
)


def skew(a: Floats) -> Floats:
    """Matrix of the cross product with a vector."""
    return np.array([[0.0, -a[2], a[1]], [a[2], 0.0, -a[0]], [-a[1], a[0], 0.0]])


def turned(angle: Floats) -> Floats:
    """Rotation matrix of a rotation vector."""
    size = float(np.linalg.norm(angle))
    if size == 0.0:
        return np.eye(3)
    k = skew(angle / size)
    return np.eye(3) + np.sin(size) * k + (1.0 - np.cos(size)) * (k @ k)


def gravity(r: Floats) -> Floats:
    """Gravity in ECEF with J2, centrifugal part included."""
    size = np.linalg.norm(r)
    z2 = 5.0 * (r[2] / size) ** 2
    oblate = 1.5 * J2 * (RADIUS_M / size) ** 2
    factors = 1.0 + oblate * np.array([1.0 - z2, 1.0 - z2, 3.0 - z2])
    spin = EARTH_RATE[2] ** 2 * np.array([r[0], r[1], 0.0])
    return -GM / size**3 * factors * r + spin


@dataclasses.dataclass(slots=True)
class NumpyFilter:
    """State and covariance.

    Parameters
    ----------
    config : LooseConfig
        Noise and biases are taken from it.
    r, v : float64 arrays (3,), m, m/s, ECEF
    C : float64 array (3, 3)
        Body to ECEF.
    """

    config: LooseConfig
    r: Floats
    v: Floats
    C: Floats
    x: Floats = dataclasses.field(default_factory=lambda: np.zeros(STATES))
    P: Floats = dataclasses.field(init=False)
    rate: Floats = dataclasses.field(default_factory=lambda: np.zeros(3))

    def __post_init__(self) -> None:
        own, start = self.config.filter, self.config.alignment
        sigmas = np.concatenate(
            [
                np.full(3, 0.1),
                np.full(3, 0.1),
                np.full(3, start.tilt_sigma),
                start.gyro_bias_sigma,
                start.accel_bias_sigma,
                own.gyro_scale_sigma,
                own.accel_scale_sigma,
            ]
        )
        self.P = np.diag(sigmas**2)

    def propagate(self, w_raw: Floats, f_raw: Floats, dt: float) -> None:
        """Carry state and covariance over a sample."""
        own = self.config.filter
        self.rate = w = (w_raw - self.x[GYRO]) / (1.0 + self.x[GYRO_SCALE])
        f = (f_raw - self.x[ACCEL]) / (1.0 + self.x[ACCEL_SCALE])
        spin = skew(EARTH_RATE)
        before = self.C
        self.C = turned(-EARTH_RATE * dt) @ before @ turned(w * dt)
        f_e = 0.5 * (before + self.C) @ f
        v = self.v + (f_e + gravity(self.r) - 2.0 * spin @ self.v) * dt
        self.r = self.r + 0.5 * (self.v + v) * dt
        self.v = v
        size = np.linalg.norm(self.r)
        F = np.zeros((STATES, STATES))
        F[POSITION, VELOCITY] = np.eye(3)
        up = self.r / size
        F[VELOCITY, POSITION] = GM / size**3 * (3.0 * np.outer(up, up) - np.eye(3))
        F[VELOCITY, VELOCITY] = -2.0 * spin
        F[VELOCITY, ATTITUDE] = -skew(f_e)
        F[VELOCITY, ACCEL] = -self.C
        F[VELOCITY, ACCEL_SCALE] = -self.C @ np.diag(f)
        F[ATTITUDE, ATTITUDE] = -spin
        F[ATTITUDE, GYRO] = -self.C
        F[ATTITUDE, GYRO_SCALE] = -self.C @ np.diag(w)
        Q = np.zeros((STATES, STATES))
        Q[VELOCITY, VELOCITY] = self.C @ np.diag(np.square(own.accel_noise) * dt) @ self.C.T
        Q[ATTITUDE, ATTITUDE] = self.C @ np.diag(np.square(own.gyro_noise) * dt) @ self.C.T
        Phi = np.eye(STATES) + F * dt
        for part, sigma, tau in (
            (GYRO, own.gyro_bias_sigma, own.gyro_bias_tau),
            (ACCEL, own.accel_bias_sigma, own.accel_bias_tau),
        ):
            decay = np.exp(-dt / tau) if tau > 0.0 else 1.0
            Phi[part, part] = decay * np.eye(3)
            Q[part, part] = np.diag(np.square(sigma) * (1.0 - decay * decay))
            self.x[part] *= decay
        self.P = Phi @ self.P @ Phi.T + Q

    def update(self, z: Floats, H: Floats, R: Floats) -> None:
        """Take a measurement of three components."""
        S = H @ self.P @ H.T + R
        K = np.linalg.solve(S, H @ self.P).T
        dx = K @ z
        A = np.eye(STATES) - K @ H
        self.P = A @ self.P @ A.T + K @ R @ K.T
        self.r = self.r + dx[POSITION]
        self.v = self.v + dx[VELOCITY]
        self.C = turned(dx[ATTITUDE]) @ self.C
        self.x[9:] += dx[9:]

    def fix(self, r: Floats, v: Floats, lever: Floats, R_r: Floats, R_v: Floats) -> None:
        """Take position and velocity of an antenna, covariances in ECEF."""
        arm = self.C @ lever
        H = np.zeros((3, STATES))
        H[:, POSITION] = np.eye(3)
        H[:, ATTITUDE] = -skew(arm)
        self.update(r - self.r - arm, H, R_r)
        swing = self.C @ np.cross(self.rate - self.C.T @ EARTH_RATE, lever)
        H = np.zeros((3, STATES))
        H[:, VELOCITY] = np.eye(3)
        H[:, ATTITUDE] = -skew(swing)
        self.update(v - self.v - swing, H, R_v)
