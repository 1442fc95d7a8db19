"""A drive with satellites in closed form: what a run over observations can hold.

An RTK run with float and fixed epochs and a gap, of an antenna: no attitude, no state.
"""

from __future__ import annotations

import numpy as np
from fake_run import ORIGIN, _ecef_origin, _motion, ns

from replay.log.columns import Columns, Ragged
from replay.schemas import filter_pb2, gnss_pb2, sights_pb2, solution_pb2

SINGLE = solution_pb2.SOLUTION_STATUS_SINGLE
FLOAT = solution_pb2.SOLUTION_STATUS_FLOAT
FIXED = solution_pb2.SOLUTION_STATUS_FIXED
GAP_S = (120.0, 131.0)
SATELLITES = ("C20", "C30", "E03", "E08", "E13", "G08", "G10", "G11", "G21", "G32")
LIGHT = 299_792_458.0
__all__ = ["GAP_S", "ORIGIN", "SATELLITES", "make_gnss"]


def _epochs(duration_s: float) -> np.ndarray:
    t = np.arange(0.0, duration_s, 1.0)
    return t[(t < GAP_S[0]) | (t > GAP_S[1])]


def make_gnss(
    duration_s: float = 200.0,
    *,
    run: str = "rtk",
    receiver: str = "rover",
    offset_m: tuple[float, float, float] = (0.0, 0.0, 0.0),
    sigma_m: float = 0.01,
    seed: int = 3,
) -> dict[str, Columns]:
    """Every channel of a run over observations, by topic."""
    rng = np.random.default_rng(seed)
    origin, axes = _ecef_origin()
    t = np.arange(0.0, duration_s, 1.0)
    out: dict[str, Columns] = {}
    out["/truth"] = Columns.build(
        ns(t),
        {
            "position_ecef_m": origin + _motion(t)[0] @ axes,
            "lever_arm_body_m": np.zeros((len(t), 3)),
            "quality": np.full(len(t), gnss_pb2.FIX_QUALITY_FUSED, dtype=np.int32),
            "velocity_enu_m_s": np.full((len(t), 3), np.nan),
            "attitude_rad": np.full((len(t), 3), np.nan),
        },
        present={
            "velocity_enu_m_s": np.zeros(len(t), dtype=bool),
            "attitude_rad": np.zeros(len(t), dtype=bool),
        },
    )
    out[f"/gnss/{receiver}/obs"] = _observations(t)
    t = _epochs(duration_s)
    n = len(t)
    status = np.where(np.mod(t, 60.0) < 10.0, FLOAT, FIXED)
    status[:3] = SINGLE
    noise = sigma_m * rng.standard_normal((n, 3))
    absent = {
        "velocity_enu_m_s": "velocity_enu_m_s",
        "attitude_rad": "attitude_rad",
        "angular_rate_body_rad_s": "angular_rate_body_rad_s",
        "velocity_std_enu_m_s": "velocity_std_enu_m_s",
        "attitude_std_rad": "attitude_std_rad",
    }
    out[f"/solution/{run}"] = Columns.build(
        ns(t),
        {
            "position_ecef_m": origin + (_motion(t)[0] + noise + np.asarray(offset_m)) @ axes,
            "position_covariance_enu_m2": np.tile(
                np.array([1.0, 0, 0, 1.0, 0, 1.0]) * sigma_m**2, (n, 1)
            ),
            "status": status.astype(np.int32),
            **{name: np.full((n, 3), np.nan) for name in absent},
        },
        present={name: np.zeros(n, dtype=bool) for name in absent},
    )
    out |= _filter(rng, t, run, status)
    out |= _receiver(rng, t, receiver)
    return out


def _observations(t: np.ndarray) -> Columns:
    count = len(SATELLITES)
    n = len(t) * count
    return Columns.build(
        np.repeat(ns(t), count),
        {
            "satellite": Ragged.from_texts(list(SATELLITES) * len(t)),
            "signal": Ragged.from_texts(["1C"] * n),
            "pseudorange_m": np.full(n, 2.2e7),
            "cn0_dbhz": np.full(n, 44.0),
        },
        present={"pseudorange_m": np.ones(n, dtype=bool), "cn0_dbhz": np.ones(n, dtype=bool)},
    )


def _filter(
    rng: np.random.Generator, t: np.ndarray, run: str, status: np.ndarray
) -> dict[str, Columns]:
    n = len(t)
    fewer = (t > 60) & (t < 80)
    counts = {
        "gps_count": np.where(fewer, 3, 5),
        "glonass_count": np.zeros(n),
        "galileo_count": np.where(fewer, 1, 3),
        "beidou_count": np.full(n, 2),
        "qzss_count": np.zeros(n),
    }
    dops = {"gdop": 2.5, "pdop": 2.0, "hdop": 1.0, "vdop": 1.7, "gps_pdop": 3.0}
    gps = ~fewer
    never = ("glonass_pdop", "galileo_pdop", "beidou_pdop")
    geometry = Columns.build(
        ns(t),
        {
            **{name: values.astype(np.uint32) for name, values in counts.items()},
            **{name: np.full(n, value) for name, value in dops.items()},
            **{name: np.full(n, np.nan) for name in never},
        },
        present={
            **{name: np.ones(n, dtype=bool) for name in dops if name != "gps_pdop"},
            "gps_pdop": gps,
            **{name: np.zeros(n, dtype=bool) for name in never},
        },
    )
    systems = ["G", "E", "C"]
    offset = np.repeat(3e5 + 30.0 * t, 3) + np.tile([0.0, 2.0, -5.0], n)
    clocks = Columns.build(
        np.repeat(ns(t), 3),
        {
            "system": Ragged.from_texts(systems * n),
            "offset_m": offset,
            "offset_std_m": np.ones(3 * n),
            "drift_m_s": np.full(3 * n, 30.0),
            "drift_std_m_s": np.ones(3 * n),
        },
        present={"drift_m_s": np.ones(3 * n, bool), "drift_std_m_s": np.ones(3 * n, bool)},
    )
    fixed = status == FIXED
    resolution = Columns.build(
        ns(t),
        {
            "candidate_count": np.full(n, 8, dtype=np.uint32),
            "fixed_count": np.where(fixed, 8, 0).astype(np.uint32),
            "ratio": np.where(fixed, 6.0, 1.5),
            "w_ratio": np.full(n, 3.0),
            "threshold": np.full(n, 3.0),
            "success_rate": np.full(n, 0.99),
            "status": np.where(fixed, 2, 3).astype(np.int32),
        },
    )
    others = [s for s in SATELLITES if s not in ("G32", "E08", "C20")]
    k = len(others)
    floats = np.tile(np.arange(k, dtype=float), n) + 0.03 * rng.standard_normal(n * k)
    ambiguities = Columns.build(
        np.repeat(ns(t), k),
        {
            "satellite": Ragged.from_texts(others * n),
            "reference": Ragged.from_texts(["G32"] * (n * k)),
            "signal": Ragged.from_texts(["1C"] * (n * k)),
            "float_cycles": floats,
            "float_std_cycles": np.full(n * k, 0.03),
            "integer_cycles": np.where(np.repeat(fixed, k), np.rint(floats), np.nan),
            "status": np.where(np.repeat(fixed, k), 2, 1).astype(np.int32),
        },
        present={"integer_cycles": np.repeat(fixed, k)},
    )
    return {
        f"/filter/{run}/innovations": _innovations(rng, t),
        f"/filter/{run}/clocks": clocks,
        f"/filter/{run}/geometry": geometry,
        f"/filter/{run}/ambiguities": ambiguities,
        f"/filter/{run}/resolution": resolution,
    }


def _innovations(rng: np.random.Generator, t: np.ndarray) -> Columns:
    count = len(SATELLITES)
    times, kinds, names, sigmas = [], [], [], []
    for kind, sigma in (
        (filter_pb2.MEASUREMENT_KIND_PSEUDORANGE, 0.6),
        (filter_pb2.MEASUREMENT_KIND_CARRIER_PHASE, 0.006),
    ):
        times.append(np.repeat(t, count))
        kinds.append(np.full(len(t) * count, kind))
        names += list(SATELLITES) * len(t)
        sigmas.append(np.full(len(t) * count, sigma))
    time, kind, sigma = (np.concatenate(x) for x in (times, kinds, sigmas))
    order = np.argsort(time, kind="stable")
    n = len(time)
    normalized = rng.standard_normal(n)
    return Columns.build(
        ns(time[order]),
        {
            "kind": kind[order].astype(np.int32),
            "axis": np.zeros(n, dtype=np.int32),
            "satellite": Ragged.from_texts(np.asarray(names)[order].tolist()),
            "signal": Ragged.from_texts(["1C"] * n),
            "innovation": normalized * sigma[order],
            "innovation_std": sigma[order],
            "measurement_std": sigma[order],
            "normalized": normalized,
            "accepted": np.abs(normalized) < 3.0,
        },
    )


def _receiver(rng: np.random.Generator, t: np.ndarray, receiver: str) -> dict[str, Columns]:
    count, n = len(SATELLITES), len(t) * len(SATELLITES)
    azimuth = np.tile(np.arange(count) * 2.0, len(t)) + np.repeat(t, count) * 1e-4
    elevation = np.tile(np.linspace(0.3, 1.4, count), len(t)) + np.repeat(t, count) * 5e-5
    names = Ragged.from_texts(list(SATELLITES) * len(t))
    satellites = Columns.build(
        np.repeat(ns(t), count),
        {
            "satellite": names,
            "position_ecef_m": np.zeros((n, 3)),
            "velocity_ecef_m_s": np.zeros((n, 3)),
            "clock_s": np.zeros(n),
            "clock_drift_s_s": np.zeros(n),
            "elevation_rad": elevation,
            "azimuth_rad": azimuth,
            "range_std_m": np.ones(n),
            "ephemeris_age_s": np.zeros(n),
            "issue": np.zeros(n, dtype=np.int32),
            "health": np.zeros(n, dtype=np.int32),
        },
    )
    corrections = Columns.build(
        np.repeat(ns(t), count),
        {
            "satellite": names,
            "signal": Ragged.from_texts(["1C"] * n),
            "distance_m": np.full(n, 2.2e7),
            "sagnac_m": np.full(n, 12.0),
            "satellite_clock_m": np.full(n, -1e5),
            "relativity_m": np.full(n, 1.0),
            "group_delay_m": np.zeros(n),
            "ionosphere_m": 2.0 / np.sin(elevation),
            "hydrostatic_m": 2.3 / np.sin(elevation),
            "wet_m": 0.1 / np.sin(elevation),
            "hydrostatic_mapping": 1.0 / np.sin(elevation),
            "wet_mapping": 1.0 / np.sin(elevation),
            "shapiro_m": np.full(n, np.nan),
        },
        present={"shapiro_m": np.zeros(n, dtype=bool)},
    )
    at = np.array([20.0, 20.0, 70.0])
    slips = Columns.build(
        ns(at),
        {
            "satellite": Ragged.from_texts(["G08", "C20", "E03"]),
            "signal": Ragged.from_texts(["1C", "1C", "1C"]),
            "detector": np.array(
                [
                    sights_pb2.SLIP_DETECTOR_LOSS_OF_LOCK,
                    sights_pb2.SLIP_DETECTOR_GEOMETRY_FREE,
                    sights_pb2.SLIP_DETECTOR_GEOMETRY_FREE,
                ],
                dtype=np.int32,
            ),
            "statistic": np.ones(3),
            "threshold": np.ones(3),
            "size_cycles": np.array([1.0, np.nan, 2.0]),
            "repaired": np.array([True, False, False]),
        },
        present={"size_cycles": np.array([True, False, True])},
    )
    displacement = Columns.build(
        ns(t[1:]),
        {
            "since_ns": ns(t[:-1]),
            "displacement_ecef_m": rng.standard_normal((len(t) - 1, 3)),
            "covariance_enu_m2": np.ones((len(t) - 1, 6)),
            "satellite_count": np.full(len(t) - 1, 9, dtype=np.uint32),
            "unit_weight_std": np.ones(len(t) - 1),
        },
    )
    events = Columns.build(
        ns(np.array([20.0])),
        {
            "kind": np.array([filter_pb2.EVENT_KIND_CYCLE_SLIP], dtype=np.int32),
            "value": np.array([1.0]),
            "detail": Ragged.from_texts(["G08 1C"]),
        },
    )
    return {
        f"/gnss/{receiver}/satellites": satellites,
        f"/gnss/{receiver}/corrections": corrections,
        f"/gnss/{receiver}/slips": slips,
        f"/gnss/{receiver}/displacement": displacement,
        f"/gnss/{receiver}/events": events,
    }
