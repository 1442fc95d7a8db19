"""The motion of a scenario, from its segments or from the truth of a log."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Mapping
from typing import Final

import numpy as np

from replay import time
from replay.configuration import STANDARD_GRAVITY_M_S2
from replay.errors import ConfigurationError, DataError
from replay.log.digest import ChannelDigest
from replay.simulate.noise import Floats
from replay.simulate.planning import plan
from replay.simulate.recorded import read_motion
from replay.simulate.scenario import Scenario
from replay.simulate.settings import Recorded, Settings
from replay.simulate.trajectory import Manoeuvres, Motion, Records, Trajectory, ecef_of, make_body

_LARGEST_FORCE_M_S2: Final = 30.0  # beyond, recorded rows jump rather than move


@dataclasses.dataclass(frozen=True, slots=True, eq=False)
class Moved:
    """A trajectory in time.

    Attributes
    ----------
    trajectory : Trajectory
    start_ns : int, ns
        GPS time.
    period_ns : int, ns
        Between inertial samples.
    notes : tuple of str
        For the manifest.
    inputs : mapping of topic to ChannelDigest
        What the motion was read from.
    """

    trajectory: Trajectory
    start_ns: int
    period_ns: int
    notes: tuple[str, ...]
    inputs: Mapping[str, ChannelDigest]

    @property
    def origin(self) -> Floats:
        """Position (3,), m, ECEF at the start."""
        return np.asarray(self.trajectory.positions[0])


def move(scenario: Scenario) -> Moved:
    """Trajectory of a scenario.

    Raises
    ------
    ConfigurationError
        Where a manoeuvre cannot be driven, or the drive is too short for a sample.
    LogError, DataError
        Where the log of a recorded motion does not serve.
    """
    settings = scenario.settings
    # Periods are whole nanoseconds, so that times are exact however long the log is.
    period_ns = round(time.NS_PER_S / settings.imu.rate)
    motion: Motion
    notes: tuple[str, ...] = ()
    inputs: Mapping[str, ChannelDigest] = {}
    if settings.trajectory.log:
        recording = read_motion(settings.trajectory, scenario.folder)
        motion, start_ns, span_ns = recording.motion, recording.start_ns, recording.span_ns
        notes, inputs = (recording.note,), recording.digests
    else:
        start = settings.start
        pieces, duration_s = plan(scenario.segments, start.heading, settings.repeat, start.speed)
        origin = ecef_of(start.latitude, start.longitude, start.height)
        motion = Manoeuvres(pieces, body_of(settings), origin)
        start_ns = time.parse_calendar(start.time)
        span_ns = int(duration_s * time.NS_PER_S)
    samples = span_ns // period_ns
    if samples < 1:
        raise ConfigurationError("the drive is shorter than one sample", mend="add segments")
    trajectory = Trajectory.follow(motion, period_ns / time.NS_PER_S, samples)
    if settings.trajectory.log:
        _check_forces(trajectory, settings.trajectory)
    return Moved(trajectory, start_ns, period_ns, notes, inputs)


def _check_forces(trajectory: Trajectory, recorded: Recorded) -> None:
    squares = trajectory.forces * trajectory.forces
    force = np.sqrt(squares[:, 0] + squares[:, 1] + squares[:, 2])
    worst = int(np.argmax(force))
    if force[worst] > _LARGEST_FORCE_M_S2:
        raise DataError(
            f"the truth jumps: to follow it takes {force[worst]:.0f} m/s^2 at "
            f"{recorded.begin + worst * trajectory.interval_s:.0f} s",
            where=recorded.log,
            mend="take a span without the jump (trajectory.begin, trajectory.end), or more "
            "trajectory.spacing",
        )


def body_of(settings: Settings) -> Records:
    """How the body of a scenario follows its path, array (1,) of BODY_DTYPE."""
    vehicle, gait = settings.vehicle, settings.gait
    fields: dict[str, object] = {
        "roll_per_lateral": vehicle.roll_per_g / STANDARD_GRAVITY_M_S2,
        "pitch_per_forward": vehicle.pitch_per_g / STANDARD_GRAVITY_M_S2,
    }
    if vehicle.kind == "air":
        fields["bank"] = 1.0 / STANDARD_GRAVITY_M_S2
    if vehicle.kind == "foot":
        step = 2.0 * math.pi * gait.cadence
        fields |= {
            "cadence": step,
            "bounce": gait.bounce * step / gait.speed,
            "surge": gait.surge * step / gait.speed,
            "sway": gait.sway * (0.5 * step) / gait.speed,
            "swing": [gait.roll / gait.speed, gait.pitch / gait.speed, gait.yaw / gait.speed],
        }
    return make_body(**fields)
