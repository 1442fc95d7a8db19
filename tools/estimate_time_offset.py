"""Offset between the times of inertial samples and those of a reference, from one log.

Run: `python tools/estimate_time_offset.py LOG [--reference TOPIC] [--span SECONDS]`. What is
printed is to be added to the times of the inertial samples.

Two estimates that do not share a sensor axis: turning (gyro about the vertical against the
course of the reference) and speeding up (accelerometer along the course against the speed).
Each compares changes over the intervals of the reference: with the inertial signal integrated
and moved by an offset, the changes are regressed on it and the offset that explains them best
is found between the steps by a parabola. A point before the axle that does not slip has a
course that runs ahead of the heading by its distance over the speed, just as an offset would
let it; that distance is a regressor of its own, told apart by the changing speed alone.

The uncertainty is that of the jackknife over blocks of time: neighbouring residuals are alike,
so their count says too little. Whatever it says, half a sampling interval is the floor.
"""

from __future__ import annotations

import argparse
import dataclasses
from collections.abc import Callable
from pathlib import Path

import numpy as np
import numpy.typing as npt
import pymap3d
import scipy.ndimage

from replay import channels
from replay.configuration import STANDARD_GRAVITY_M_S2
from replay.log.columns import Columns
from replay.log.reader import LogReader
from replay.schemas import gnss_pb2

BLOCKS = 10
STEP_S = 0.05
REACH_S = 0.1
INTERVAL_S = 1.0
SMOOTH_S = 0.1
LEAST_SPEED_M_S = 2.0
MOST_TURNING_RAD_S = 1.0  # what no car does is an error of the reference
MOST_FORCE_M_S2 = 8.0
DRIFT_TERMS = 4
TRIM = 5.0  # median absolute deviations

Float64 = npt.NDArray[np.float64]


@dataclasses.dataclass(frozen=True, slots=True)
class Reference:
    """Mean velocities over intervals of the reference.

    Attributes
    ----------
    times_s : float64 array (n,)
        Middle of each interval, or the epoch of a velocity.
    east_m_s, north_m_s : float64 array (n,)
    gap_s : float
        Longest step between two of them that is no gap.
    window_s : float
        Time over which each is a mean, as far as that is known.
    """

    times_s: Float64
    east_m_s: Float64
    north_m_s: Float64
    gap_s: float
    window_s: float


@dataclasses.dataclass(frozen=True, slots=True)
class Changes:
    """A quantity's change from one time to another.

    Attributes
    ----------
    begin_s, end_s, change, speed_begin, speed_end : float64 array (n,)
    """

    begin_s: Float64
    end_s: Float64
    change: Float64
    speed_begin: Float64
    speed_end: Float64

    def take(self, rows: npt.NDArray[np.bool_]) -> Changes:
        """Some of them."""
        return Changes(*(getattr(self, f.name)[rows] for f in dataclasses.fields(self)))


def reference_of(columns: Columns, start_ns: int, positions: bool) -> Reference:
    """Velocities that a truth or fix holds, or those between its positions."""
    times = (columns.valid_time_ns - start_ns) * 1e-9
    middle = np.median(columns["position_ecef_m"], axis=0)
    latitude, longitude, _ = pymap3d.ecef2geodetic(*middle)
    velocity = None
    if positions:
        pass
    elif "velocity_enu_m_s" in columns.values and columns.is_present("velocity_enu_m_s").any():
        velocity, has = columns["velocity_enu_m_s"], columns.is_present("velocity_enu_m_s")
        east, north = velocity[:, 0], velocity[:, 1]
    elif "velocity_ecef_m_s" in columns.values and columns.is_present("velocity_ecef_m_s").any():
        velocity, has = columns["velocity_ecef_m_s"], columns.is_present("velocity_ecef_m_s")
        east, north, _ = pymap3d.ecef2enuv(*velocity.T, latitude, longitude)
    step = float(np.median(np.diff(times)))
    if velocity is not None:
        return Reference(times[has], east[has], north[has], 1.5 * step, SMOOTH_S)
    difference = np.diff(columns["position_ecef_m"], axis=0) / np.diff(times)[:, None]
    east, north, _ = pymap3d.ecef2enuv(*difference.T, latitude, longitude)
    near = np.diff(times) < 1.5 * step
    middles = (0.5 * (times[1:] + times[:-1]))[near]
    return Reference(middles, east[near], north[near], 1.5 * step, max(step, SMOOTH_S))


def changes_of(
    reference: Reference, value: Float64, least_speed: float, most_rate: float
) -> Changes:
    """Changes of a value over intervals without gaps, slow parts and what no car can do."""
    speed = np.hypot(reference.east_m_s, reference.north_m_s)
    times = reference.times_s
    jumps = np.diff(times) > reference.gap_s
    jumps |= np.minimum(speed[1:], speed[:-1]) < least_speed
    jumps |= np.abs(np.diff(value)) > most_rate * np.diff(times)
    jumped = np.concatenate([[0], np.cumsum(jumps)])
    step = max(1, round(INTERVAL_S / float(np.median(np.diff(times)))))
    rows = np.flatnonzero(jumped[step:] == jumped[:-step])
    after = rows + step
    change = value[after] - value[rows]
    return Changes(times[rows], times[after], change, speed[rows], speed[after])


Model = Callable[[Changes, float], list[Float64]]


def turning_model(times_s: Float64, rate: Float64) -> Model:
    """Heading from the gyro, its bias, and the angle of course against heading, where small."""
    heading = integral(times_s, rate)

    def terms(changes: Changes, offset_s: float) -> list[Float64]:
        begin, end = changes.begin_s - offset_s, changes.end_s - offset_s
        moved = np.interp(end, times_s, heading) - np.interp(begin, times_s, heading)
        one, two = np.interp(begin, times_s, rate), np.interp(end, times_s, rate)
        ahead = two / changes.speed_end - one / changes.speed_begin
        slip = two * changes.speed_end - one * changes.speed_begin
        return [moved, ahead, slip, changes.end_s - changes.begin_s]

    return terms


def speed_model(times_s: Float64, force: Float64, pitch_rate: Float64) -> Model:
    """Speed from the accelerometer, gravity on the pitch from the gyro, and slow drift of both."""
    speed = integral(times_s, force)
    gravity = STANDARD_GRAVITY_M_S2 * integral(times_s, integral(times_s, pitch_rate))

    def terms(changes: Changes, offset_s: float) -> list[Float64]:
        begin, end = changes.begin_s - offset_s, changes.end_s - offset_s
        moved = [
            np.interp(end, times_s, one) - np.interp(begin, times_s, one)
            for one in (speed, gravity)
        ]
        middle = 0.5 * (begin + end) / times_s[-1]
        drift = [(end - begin) * middle**power for power in range(DRIFT_TERMS)]
        return [*moved, *drift]

    return terms


def integral(times_s: Float64, signal: Float64) -> Float64:
    """Of a signal from its start; a sample is the mean since the one before."""
    return np.concatenate([[0.0], np.cumsum(signal[1:] * np.diff(times_s))])


def smoothed(times_s: Float64, signal: Float64, window_s: float) -> Float64:
    """Mean of a signal over a window around each time.

    The reference is such a mean where it comes from positions. Without it, linear
    interpolation favours offsets of half a sample, where it averages the noise of two.
    """
    half = max(1, round(0.5 * window_s / float(np.median(np.diff(times_s)))))
    return np.asarray(scipy.ndimage.uniform_filter1d(signal, 2 * half + 1, axis=0))


def unexplained(changes: Changes, offset_s: float, model: Model) -> tuple[Float64, Float64]:
    """Residuals at an offset, and the regression's coefficients."""
    matrix = np.column_stack(model(changes, offset_s))
    found = np.linalg.lstsq(matrix, changes.change, rcond=None)[0]
    return changes.change - matrix @ found, found


def best_offset(work: Callable[[float], float], first_s: float) -> float:
    """Where a function is least, near a first guess.

    A parabola through many values, moved along twice: neighbouring offsets meet the
    sensor's noise differently, so that the least of them alone says little.
    """
    steps = np.linspace(-REACH_S, REACH_S, 21)
    for _ in range(3):
        values = [work(first_s + float(step)) for step in steps]
        curve, slope, _ = np.polyfit(steps, values, 2)
        move = -0.5 * slope / curve if curve > 0.0 else float(steps[int(np.argmin(values))])
        first_s += float(np.clip(move, -REACH_S, REACH_S))
    return first_s


def report(name: str, changes: Changes, span_s: float, times_s: Float64, model: Model) -> None:
    """Print one estimate with its jackknife."""
    inside = (changes.begin_s - span_s > times_s[0]) & (changes.end_s + span_s < times_s[-1])
    changes = changes.take(inside)
    if len(changes.change) < 10 * BLOCKS:
        print(f"{name}: only {len(changes.change)} changes; nothing can be said")
        return
    coarse = np.arange(-span_s, span_s, STEP_S)

    def squares(part: Changes, at: float) -> float:
        residual, _ = unexplained(part, at, model)
        return float(residual @ residual)

    count = len(changes.change)
    for _ in range(3):
        first = float(coarse[int(np.argmin([squares(changes, float(o)) for o in coarse]))])
        residual = np.abs(unexplained(changes, first, model)[0])
        changes = changes.take(residual < TRIM * np.median(residual))

    def estimate(part: Changes) -> float:
        return best_offset(lambda o: squares(part, o), first)

    offset = estimate(changes)
    residual, found = unexplained(changes, offset, model)
    explained = 1.0 - float(np.var(residual) / np.var(changes.change))
    block = np.arange(len(changes.change)) * BLOCKS // len(changes.change)
    without = np.array([estimate(changes.take(block != b)) for b in range(BLOCKS)])
    sigma = float(np.sqrt((BLOCKS - 1) * np.var(without)))
    others = ", ".join(f"{number:.4f}" for number in found[:3])
    print(
        f"{name}: {offset:+.4f} s, standard deviation {sigma:.4f} s; "
        f"{len(changes.change)} of {count} changes, "
        f"correlation {np.sqrt(max(explained, 0.0)):.4f}, first coefficients {others}"
    )


def main() -> None:
    """Print both estimates of a log."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("log", type=Path)
    parser.add_argument("--reference", default=channels.TRUTH.topic, help="topic of truth or fix")
    parser.add_argument("--positions", action="store_true", help="pass over its velocities")
    parser.add_argument("--span", type=float, default=2.0, help="largest offset, seconds")
    arguments = parser.parse_args()
    with LogReader(arguments.log) as log:
        imu, told = log.read(channels.IMU.topic), log.read(arguments.reference)
    fixed = told["quality"] == gnss_pb2.FIX_QUALITY_RTK_FIXED
    if np.mean(fixed) > 0.5:
        told = told.take(fixed)
    start = int(imu.valid_time_ns[0])
    times = (imu.valid_time_ns - start) * 1e-9
    reference = reference_of(told, start, arguments.positions)
    force, rates = (
        smoothed(times, imu[name], reference.window_s)
        for name in ("specific_force_body_m_s2", "angular_rate_body_rad_s")
    )
    down = -np.mean(force, axis=0)  # on the whole a car stands upright
    turning = rates @ (down / np.linalg.norm(down))
    course = np.unwrap(np.arctan2(reference.east_m_s, reference.north_m_s))
    speed = np.hypot(reference.east_m_s, reference.north_m_s)

    changes = changes_of(reference, course, LEAST_SPEED_M_S, MOST_TURNING_RAD_S)
    report("turning    ", changes, arguments.span, times, turning_model(times, turning))
    changes = changes_of(reference, speed, LEAST_SPEED_M_S, MOST_FORCE_M_S2)
    model = speed_model(times, force[:, 0], rates[:, 1])
    report("speeding up", changes, arguments.span, times, model)


if __name__ == "__main__":
    main()
