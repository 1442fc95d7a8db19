"""A station that converges, in closed form: what a run of precise point positioning can hold."""

from __future__ import annotations

import numpy as np
from fake_gnss import FIXED, FLOAT, SATELLITES, make_gnss
from fake_run import _ecef_origin, ns

from replay.log.columns import Columns, Ragged

STEP_S = 30.0
TAU_S = 600.0
FIX_S = 5400.0
SIGNALS = ("1C", "2W")
REARMED_S = 3600.0  # G08 begins anew
ADDED = {
    "satellite_antenna_m": 1.3,
    "solid_tide_m": 0.1,
    "wind_up_m": 0.05,
    "phase_bias_m": 0.02,
}  # m
ZENITH_M = 0.12


def make_ppp(duration_s: float = 7200.0, *, run: str = "ppp") -> dict[str, Columns]:
    """Every channel of a static run over observations with precise products, by topic."""
    origin, axes = _ecef_origin()
    t = np.arange(0.0, duration_s, STEP_S)
    n = len(t)
    rows = make_gnss(duration_s, run=run)
    kept = {
        topic: columns.take(np.isin(columns.valid_time_ns, ns(t)))
        for topic, columns in rows.items()
        if topic.startswith(("/gnss", "/filter")) and not topic.endswith("/displacement")
    }
    out = {topic: columns for topic, columns in kept.items() if len(columns)}
    enu = errors(t)
    sigma = 0.5 * np.exp(-t / TAU_S) + 0.004
    packed = np.zeros((n, 6))
    packed[:, [0, 3, 5]] = np.square(np.column_stack([sigma, sigma, 2.0 * sigma]))
    absent = (
        "velocity_enu_m_s", "attitude_rad", "angular_rate_body_rad_s", "velocity_std_enu_m_s",
        "attitude_std_rad",
    )  # fmt: skip
    out[f"/solution/{run}"] = Columns.build(
        ns(t),
        {
            "position_ecef_m": origin + enu @ axes,
            "position_covariance_enu_m2": packed,
            "status": np.where(t < FIX_S, FLOAT, FIXED).astype(np.int32),
            **{name: np.full((n, 3), np.nan) for name in absent},
        },
        present={name: np.zeros(n, dtype=bool) for name in absent},
    )
    out["/truth"] = Columns.build(
        ns(t),
        {
            "position_ecef_m": np.tile(origin, (n, 1)),
            "lever_arm_body_m": np.zeros((n, 3)),
            "quality": np.zeros(n, dtype=np.int32),
        },
    )
    out |= _estimates(t, run)
    topic = "/gnss/rover/corrections"
    terms = out[topic]
    out[topic] = Columns.build(
        terms.valid_time_ns,
        {**terms.values, **{name: np.full(len(terms), v) for name, v in ADDED.items()}},
        present={
            "shapiro_m": np.zeros(len(terms), dtype=bool),
            **{name: np.ones(len(terms), dtype=bool) for name in ADDED},
        },
    )
    return out


def errors(t: np.ndarray) -> np.ndarray:
    """East, north, up (n, 3), m: exponentials of half a metre, and millimetres that stay."""
    fall = np.exp(-t / TAU_S)[:, None] * np.array([0.5, -0.4, 0.9])
    wave = np.sin(t[:, None] / np.array([700.0, 900.0, 1100.0])) * np.array([3e-3, 3e-3, 8e-3])
    return fall + wave


def _estimates(t: np.ndarray, run: str) -> dict[str, Columns]:
    n, k = len(t), len(SATELLITES)
    sigma = 0.1 * np.exp(-t / TAU_S) + 0.004
    gradient = 5e-4 * np.sin(t / 3000.0)
    troposphere = Columns.build(
        ns(t),
        {
            "hydrostatic_m": np.full(n, 2.28),
            "wet_m": ZENITH_M + 0.01 * t / 7200.0 + 0.2 * np.exp(-t / TAU_S),
            "wet_std_m": sigma,
            "gradient_north_m": gradient,
            "gradient_north_std_m": np.full(n, 2e-4),
            "gradient_east_m": -gradient,
            "gradient_east_std_m": np.full(n, 2e-4),
        },
        present={
            f"gradient_{side}{std}_m": np.ones(n, dtype=bool)
            for side in ("north", "east")
            for std in ("", "_std")
        },
    )
    each = np.repeat(ns(t), k)
    number = np.tile(np.arange(k), n)
    late = np.repeat(t, k)
    ionosphere = Columns.build(
        each,
        {
            "satellite": Ragged.from_texts(list(SATELLITES) * n),
            "delay_m": 2.0 + 0.5 * number + 0.3 * np.sin(late / 2000.0 + number),
            "delay_std_m": np.exp(-late / TAU_S) + 0.05,
        },
    )
    biases = Columns.build(
        np.repeat(ns(t), 2),
        {
            "system": Ragged.from_texts(["E", "G"] * n),
            "signal": Ragged.from_texts(["5Q", "2W"] * n),
            "bias_m": np.tile([1.5, -0.7], n),
            "bias_std_m": np.repeat(np.exp(-t / TAU_S) + 0.02, 2),
        },
    )
    width = k * len(SIGNALS)
    names = [name for name in SATELLITES for _ in SIGNALS]
    count = np.repeat(np.arange(1, n + 1), width)
    anew = np.tile(np.array([name == "G08" for name in names]), n) & (
        np.repeat(t, width) >= REARMED_S
    )
    count = np.where(anew, count - int(REARMED_S / STEP_S), count)
    age = (count - 1) * STEP_S
    phases = Columns.build(
        np.repeat(ns(t), width),
        {
            "satellite": Ragged.from_texts(names * n),
            "signal": Ragged.from_texts(list(SIGNALS) * (k * n)),
            "ambiguity_m": 1e6 + np.where(anew, 300.0, 0.0) + np.exp(-age / TAU_S),
            "ambiguity_std_m": np.exp(-age / TAU_S) + 0.01,
            "epoch_count": count.astype(np.uint32),
        },
    )
    return {
        f"/filter/{run}/troposphere": troposphere,
        f"/filter/{run}/ionosphere": ionosphere,
        f"/filter/{run}/receiver_biases": biases,
        f"/filter/{run}/phases": phases,
    }
