"""Epochs of a receiver among satellites that move on smooth lines, exact to the last bit.

Positions are told in ECEF at reception, as the kernels want them: what is put into a
phase is the distance to them, clocks, delays and an integer number of cycles.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Callable

import numpy as np

from replay.kernels.gnss_records import EPOCH_DTYPE, FIRST, MEASURED_DTYPE
from replay.stages.slip_columns import slip_config
from replay.stages.tdcp import tdcp_config
from replay.stages.tdcp_config import Slips, TdcpConfig

C = 299792458.0
HERE = np.array([-2267800.0, 5009350.0, 3220980.0])
F1, F2 = 1575.42e6, 1227.60e6
NS = 1_000_000_000
START = 1_290_000_000 * NS
UP = HERE / np.linalg.norm(HERE)
EAST = np.cross([0.0, 0.0, 1.0], UP) / np.linalg.norm(np.cross([0.0, 0.0, 1.0], UP))
NORTH = np.cross(UP, EAST)


@dataclasses.dataclass
class Scene:
    """What is seen, and by whom."""

    satellites: int = 9
    frequencies: tuple[float, ...] = (F1, F2)
    step: float = 1.0
    seed: int = 3
    phase_noise: float = 0.0
    code_noise: float = 0.0
    place: Callable[[float], np.ndarray] = lambda t: HERE + EAST * (12.0 * t + 0.4 * t * t)
    clock: Callable[[float], float] = lambda t: 3.0e4 + 55.0 * t
    coarse_error: tuple[float, float, float] = (0.0, 0.0, 0.0)

    def __post_init__(self) -> None:
        made = np.random.default_rng(self.seed)
        n = self.satellites
        azimuth = np.linspace(0.0, 2 * np.pi, n, endpoint=False) + made.uniform(0, 0.3, n)
        self.elevation = made.uniform(0.35, 1.4, n)
        self.azimuth = azimuth
        level = np.outer(np.sin(azimuth), EAST) + np.outer(np.cos(azimuth), NORTH)
        self.direction = np.cos(self.elevation)[:, None] * level + np.outer(
            np.sin(self.elevation), UP
        )
        self.velocity = made.normal(0.0, 1500.0, (n, 3))
        self.bend = made.normal(0.0, 0.2, (n, 3))
        self.cycles = made.integers(-(10**7), 10**7, (n, 3))
        self.satellite_clock = made.uniform(-1e5, 1e5, n)
        self.noise = made

    def satellite(self, k: int, t: float) -> np.ndarray:
        """ECEF at reception (m)."""
        return HERE + 2.2e7 * self.direction[k] + self.velocity[k] * t + self.bend[k] * t * t

    def reach(self, k: int, t: float) -> float:
        """Range, clocks and troposphere (m)."""
        distance = np.linalg.norm(self.satellite(k, t) - self.place(t))
        return float(distance + self.clock(t) - self.satellite_clock[k] - 0.4 * t + 5.0)

    def epochs(self, count: int) -> tuple[np.ndarray, np.ndarray]:
        """Records of so many epochs."""
        n = self.satellites
        epochs = np.zeros(count, dtype=EPOCH_DTYPE)
        rows = np.zeros(count * n, dtype=MEASURED_DTYPE)
        for name in ("code", "phase", "range_rate", "cn0", "lock_time"):
            rows[name] = np.nan
        for e in range(count):
            t = e * self.step
            epoch = epochs[e]
            epoch["t"] = epoch["log_t"] = START + round(t * NS)
            epoch["first"], epoch["count"] = e * n, n
            epoch["placed"] = 1
            epoch["x"] = self.place(t) + self.coarse_error
            epoch["clock"] = self.clock(t)
            for k in range(n):
                row = rows[e * n + k]
                row["satellite"], row["prn"] = FIRST[0] + k, k + 1
                row["seen"] = 1
                row["position"] = self.satellite(k, t)
                row["velocity"] = self.velocity[k] + 2 * self.bend[k] * t
                row["clock"] = self.satellite_clock[k] + 0.4 * t
                row["drift"] = 0.4
                row["elevation"], row["azimuth"] = self.elevation[k], self.azimuth[k]
                row["hydrostatic"] = 5.0
                row["issue"] = 7
                row["age"] = t - 900.0
                reach = self.reach(k, t)
                rate = (self.reach(k, t + 1e-3) - self.reach(k, t - 1e-3)) / 2e-3
                for slot, frequency in enumerate(self.frequencies):
                    delay = 3.0 * (F1 / frequency) ** 2
                    row["signal"][slot] = ord("1") + slot + 256 * ord("C")
                    row["frequency"][slot] = frequency
                    row["ionosphere"][slot] = delay
                    row["code"][slot] = reach + delay + self.noise.normal() * self.code_noise
                    row["phase"][slot] = (
                        reach
                        - delay
                        + self.cycles[k, slot] * C / frequency
                        + self.noise.normal() * self.phase_noise
                    )
                    row["range_rate"][slot] = rate
                    row["lock_time"][slot] = 100.0 + t
                    row["cn0"][slot] = 45.0
        return epochs, rows


def slip(rows: np.ndarray, satellite: int, slot: int, since: int, cycles: float, n: int) -> None:
    """Let a phase jump from an epoch on."""
    chosen = rows[satellite + since * n :: n]
    chosen["phase"][:, slot] += cycles * C / chosen["frequency"][:, slot]


def slip_settings(**keys: object) -> np.ndarray:
    """Record of the detectors' settings."""
    return slip_config(Slips(**keys))  # type: ignore[arg-type]


def tdcp_settings(**keys: object) -> np.ndarray:
    """Record of the settings of displacements."""
    config = TdcpConfig()
    return tdcp_config(config.gnss, type(config.tdcp)(**keys))  # type: ignore[arg-type]
