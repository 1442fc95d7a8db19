"""Panels of what the filter believes of its sensors and how its measurements fit."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping
from typing import Final

import numpy as np
import numpy.typing as npt
from scipy import stats

from replay.configuration import STANDARD_GRAVITY_M_S2
from replay.evaluate.geometry import Floats
from replay.log.columns import Columns
from replay.view.fields import doubles, integers
from replay.view.gather import Run, RunData
from replay.view.labels import (
    BODY_AXES,
    BOUNDS,
    SIGMA,
    measurement_axis,
    measurement_kind,
    measurement_unit,
)
from replay.view.palette import BOUND, REJECTED, TRUTH, run_ink
from replay.view.panels import Curve, Panel, Section, Shape, finite_curve, panel, sigma_band

_DEG_H: Final = np.degrees(1.0) * 3600.0
_MG: Final = 1e3 / STANDARD_GRAVITY_M_S2
_XYZ: Final = (("_x",), ("_y",), ("_z",))
NIS_CONFIDENCE: Final = 0.95
_LEAST_LIMIT: Final = 5.0  # standard deviations
_ROOM: Final = 1.15


@dataclasses.dataclass(frozen=True, slots=True)
class _SensorState:
    section: Section
    key: str
    field: str  # of FilterState
    sigma_prefix: str  # of names of covariance states
    unit: str
    factor: float
    axes: tuple[str, ...] = BODY_AXES
    suffixes: tuple[tuple[str, ...], ...] = _XYZ
    truth_field: str = ""


_SENSOR_STATES: Final = (
    _SensorState(
        Section.GYRO_BIAS, "gyro_bias", "gyro_bias_body_rad_s", "gyro_bias", "deg/h", _DEG_H,
        truth_field="gyro_bias_body_rad_s",
    ),
    _SensorState(
        Section.ACCEL_BIAS, "accel_bias", "accel_bias_body_m_s2", "accel_bias", "mg", _MG,
        truth_field="accel_bias_body_m_s2",
    ),
    _SensorState(
        Section.GYRO_SCALE, "gyro_scale", "gyro_scale_factor", "gyro_scale", "ppm", 1e6
    ),
    _SensorState(
        Section.ACCEL_SCALE, "accel_scale", "accel_scale_factor", "accel_scale", "ppm", 1e6
    ),
    _SensorState(
        Section.MOUNTING, "mounting", "mounting_angles_rad", "mounting", "deg", np.degrees(1.0),
        axes=("roll", "pitch", "yaw"),
        suffixes=(("_roll", "_x"), ("_pitch", "_y"), ("_yaw", "_z")),
    ),
    _SensorState(
        Section.NON_SLIP, "non_slip_point", "non_slip_point_body_m", "non_slip_point", "m", 1.0,
        suffixes=(("_forward", "_x"), ("_right", "_y"), ("_down", "_z")),
    ),
    _SensorState(
        Section.SQUAT, "squat", "squat_rad_s2_m", "squat", "mrad/(m/s^2)", 1e3,
        axes=("pitch",), suffixes=(("",),),
    ),
)  # fmt: skip


def sensor_panels(data: RunData) -> list[Panel]:
    """Estimates with three standard deviations to each side, and truth where it is known."""
    panels: list[Panel] = []
    for item in _SENSOR_STATES:
        for axis, name in enumerate(item.axes):
            curves: list[Curve] = []
            for index, run in enumerate(data.runs):
                curves += _sensor_curves(item, run, index, axis)
            if curves and data.truth is not None:
                curves += _sensor_truth(item, data.truth, axis)
            title = f"{item.section.value} {name}, {BOUNDS}"
            panels += panel(item.section, f"{item.key}/{name.split()[0]}", title, item.unit, curves)
    return panels


def _sensor_curves(item: _SensorState, run: Run, index: int, axis: int) -> list[Curve]:
    if run.state is None or item.field not in run.state.values:
        return []
    times = run.state.valid_time_ns
    values = doubles(run.state, item.field).reshape(len(times), -1)[:, axis] * item.factor
    sigma = np.full(len(times), np.nan)
    if run.sigmas is not None:
        sigma = run.sigmas.at(times, item.sigma_prefix, item.suffixes[axis]) * item.factor
    if not np.isfinite(sigma).any() and np.ptp(values) == 0.0:
        return []  # not estimated
    ink = run_ink(index)
    return [
        sigma_band(f"{run.name}/bound", f"{run.name} {BOUNDS}", times, values, sigma, ink),
        finite_curve(Curve(f"{run.name}/estimate", run.name, times, values, ink)),
    ]


def _sensor_truth(item: _SensorState, truth: Columns, axis: int) -> list[Curve]:
    if not item.truth_field or item.truth_field not in truth.values:
        return []
    known = truth.take(truth.is_present(item.truth_field))
    values = doubles(known, item.truth_field)[:, axis] * item.factor
    return [finite_curve(Curve("truth", "truth", known.valid_time_ns, values, TRUTH))]


def innovation_panels(data: RunData) -> list[Panel]:
    """Each kind and axis against its bound of three standard deviations, then the NIS."""
    panels: list[Panel] = []
    several = len([run for run in data.runs if run.innovations is not None]) > 1
    for index, run in enumerate(data.runs):
        if run.innovations is None:
            continue
        kinds, axes = integers(run.innovations, "kind"), integers(run.innovations, "axis")
        for kind, axis in np.unique(np.column_stack([kinds, axes]), axis=0).tolist():
            rows = run.innovations.take((kinds == kind) & (axes == axis))
            panels += _innovation_panel(rows, kind, axis, run.name, index, several)
        panels += _nis_panel(run, index, several)
    return panels


def _innovation_panel(
    rows: Columns, kind: int, axis: int, run: str, index: int, several: bool
) -> list[Panel]:
    words = measurement_kind(kind)
    side = measurement_axis(axis)
    times = rows.valid_time_ns
    # Several satellites at one time have a bound each; divided by it they share one.
    shared = len(np.unique(times)) < len(times)
    values = doubles(rows, "normalized" if shared else "innovation")
    unit = "1" if shared else measurement_unit(kind)
    sigma = np.ones(len(rows)) if shared else doubles(rows, "innovation_std")
    accepted = rows["accepted"].astype(np.bool_)
    ink = run_ink(index)
    title = " ".join(filter(None, [
        run if several else "", words, side, "innovation", f"over its {SIGMA}" if shared else "",
    ]))  # fmt: skip
    curves = [
        sigma_band("bound", BOUNDS, times, np.zeros(len(times)), sigma, BOUND),
        finite_curve(
            Curve("accepted", "accepted", times[accepted], values[accepted], ink, Shape.DOTS)
        ),
        finite_curve(
            Curve("rejected", "rejected", times[~accepted], values[~accepted], REJECTED,
                  Shape.CROSSES)
        ),
    ]  # fmt: skip
    key = f"innovations/{run}/{words}/{side or 'scalar'}".replace(" ", "_").replace("-", "_")
    row = f"{run}/{words}"
    # Satellites are left out at any size: the axis is that of what was used, and the bound.
    limit = max(_LEAST_LIMIT, _ROOM * float(np.max(np.abs(values[accepted]), initial=0.0)))
    limits = (-limit, limit) if shared else None
    title = title[0].upper() + title[1:]
    return panel(Section.INNOVATIONS, key, title, unit, curves, row=row, limits=limits)


@dataclasses.dataclass(frozen=True, slots=True, eq=False)
class Nis:
    """Normalised innovation squared per epoch.

    Attributes
    ----------
    times_ns : int64 array (n,), GPS ns
    values : array (n,)
        Sum of squares of the normalised innovations that were accepted.
    degrees : int64 array (n,)
        How many there are.
    """

    times_ns: npt.NDArray[np.int64]
    values: Floats
    degrees: npt.NDArray[np.int64]

    def bounds(self) -> Floats:
        """Both ends (n, 2) of the two-sided 95 % interval of chi squared."""
        tail = (1.0 - NIS_CONFIDENCE) / 2.0
        ends = {
            int(k): (stats.chi2.ppf(tail, k), stats.chi2.ppf(1.0 - tail, k))
            for k in np.unique(self.degrees)
        }
        return np.asarray([ends[int(k)] for k in self.degrees], dtype=np.float64).reshape(-1, 2)


def nis_of(innovations: Columns) -> Nis:
    """NIS per epoch; valid as a sum because measurements are used one after the other."""
    normalized = doubles(innovations, "normalized")
    kept = innovations["accepted"].astype(np.bool_) & np.isfinite(normalized)
    times, place = np.unique(innovations.valid_time_ns[kept], return_inverse=True)
    values = np.bincount(place, normalized[kept] ** 2, minlength=len(times)).astype(np.float64)
    return Nis(times, values, np.bincount(place, minlength=len(times)).astype(np.int64))


def _nis_panel(run: Run, index: int, several: bool) -> list[Panel]:
    assert run.innovations is not None
    nis = nis_of(run.innovations)
    if len(nis.times_ns) == 0:
        return []
    per_degree = nis.degrees[:, None].astype(np.float64)
    curves = [
        Curve("bound", "95 % interval", nis.times_ns, nis.bounds() / per_degree, BOUND,
              Shape.BAND),
        Curve("nis", "NIS", nis.times_ns, nis.values / per_degree[:, 0], run_ink(index),
              Shape.DOTS),
    ]  # fmt: skip
    title = (f"{run.name} " if several else "") + "NIS per degree of freedom, accepted, 95 %"
    return panel(Section.NIS, f"nis/{run.name}", title, "1", curves)


def innovation_groups(innovations: Columns) -> Mapping[str, Floats]:
    """Accepted and rejected normalised innovations by kind, finite, in the order of kinds."""
    kinds = integers(innovations, "kind")
    normalized = doubles(innovations, "normalized")
    finite = np.isfinite(normalized)
    return {
        measurement_kind(int(kind)): normalized[(kinds == kind) & finite]
        for kind in np.unique(kinds)
    }
