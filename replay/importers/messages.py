"""Tables to the fields of ImuSample, GnssFix and Truth."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Callable
from typing import Final

import numpy as np

from replay.errors import ConfigurationError
from replay.importers.geodesy import Places, gravity_reaction
from replay.importers.mounting import mounting_matrix, rotate
from replay.importers.spec import Channel, Value
from replay.importers.table import Int64, Mask, Table
from replay.importers.values import Picked, pick, pick_quality
from replay.log.columns import Array

_TURN: Final = 2.0 * math.pi
# Where RTKLIB's six signed roots (n, e, u, ne, eu, un) stand in xx, xy, xz, yy, yz, zz of ENU.
_RTKLIB_ORDER: Final = [1, 3, 4, 0, 5, 2]


@dataclasses.dataclass(slots=True)
class Rows:
    """Fields of a channel.

    Attributes
    ----------
    values, present : mapping of field name to column and mask
        As :class:`replay.log.columns.Columns` takes them.
    unusable : mapping of reason to bool array (n,)
        Rows that lack what every message must have.
    doubtful : mapping of reason to bool array (n,)
        Rows that are kept with less than the file said.
    """

    values: dict[str, Array] = dataclasses.field(default_factory=dict)
    present: dict[str, Mask] = dataclasses.field(default_factory=dict)
    unusable: dict[str, Mask] = dataclasses.field(default_factory=dict)
    doubtful: dict[str, Mask] = dataclasses.field(default_factory=dict)

    def require(self, name: str, picked: Picked) -> None:
        """Put a field that no row may lack."""
        self.values[name] = picked.values
        if not picked.present.all():
            self.unusable[f"{name} is empty or not finite; row skipped"] = ~picked.present

    def offer(self, name: str, values: Array, present: Mask) -> None:
        """Put a field that rows may lack."""
        self.values[name] = values
        self.present[name] = present


def build_rows(table: Table, times_ns: Int64, channel: Channel) -> Rows:
    """Fields of every row of a table.

    Raises
    ------
    ConfigurationError
        Where the spec of a field is incomplete or of the wrong unit.
    ForeignFileError
        Where a column is missing.
    """
    return _BUILDERS[channel.kind](table, times_ns, channel)


def _imu(table: Table, times_ns: Int64, channel: Channel) -> Rows:
    rows, fields = Rows(), channel.fields
    matrix = mounting_matrix(channel.mounting)
    for name, value, unit in (
        ("angular_rate_body_rad_s", fields.angular_rate_body_rad_s, "rad/s"),
        ("specific_force_body_m_s2", fields.specific_force_body_m_s2, "m/s^2"),
    ):
        picked = pick(table, times_ns, name, value, unit, 3)
        rows.require(name, Picked(rotate(matrix, picked.values), picked.present))
    gravity = channel.gravity_from_attitude
    if gravity.columns:
        tilt = pick(
            table,
            times_ns,
            "gravity_from_attitude",
            Value(columns=gravity.columns, unit=gravity.unit),
            "rad",
            2,
        )
        reaction = gravity_reaction(tilt.values[:, 0], tilt.values[:, 1], gravity.gravity)
        force = np.add(rows.values["specific_force_body_m_s2"], reaction)
        rows.values["specific_force_body_m_s2"] = force
        if not tilt.present.all():
            rows.unusable["no attitude to turn gravity by; row skipped"] = ~tilt.present
    if fields.temperature_c.given:
        degrees = pick(table, times_ns, "temperature_c", fields.temperature_c, "degC", 1)
        rows.offer("temperature_c", degrees.scalar, degrees.present)
    return rows


def _gnss_fix(table: Table, times_ns: Int64, channel: Channel) -> Rows:
    rows, fields = Rows(), channel.fields
    places = _position(rows, table, times_ns, channel)
    covariance = _covariance(
        table, times_ns, "position", fields.position_std_enu_m, fields.position_covariance_rtklib
    )
    if covariance is None:
        raise ConfigurationError(
            "a fix needs an uncertainty",
            where=table.file.name,
            mend="give position_std_enu_m or position_covariance_rtklib",
        )
    rows.require("position_covariance_enu_m2", covariance)
    rows.values["antenna_lever_arm_body_m"] = np.tile(channel.lever_arm, (len(table), 1))
    _quality(rows, table, channel)
    _fix_velocity(rows, table, times_ns, channel, places)
    if fields.satellite_count.given:
        count = pick(table, times_ns, "satellite_count", fields.satellite_count, "1", 1)
        whole = count.present & (count.scalar >= 0) & (count.scalar == np.floor(count.scalar))
        number = np.where(whole, count.scalar, 0.0).astype(np.uint32)
        rows.offer("satellite_count", number, whole)
    for name, value, unit in (
        ("differential_age_s", fields.differential_age_s, "s"),
        ("ambiguity_ratio", fields.ambiguity_ratio, "1"),
    ):
        if value.given:
            picked = pick(table, times_ns, name, value, unit, 1)
            rows.offer(name, picked.scalar, picked.present)
    return rows


def _truth(table: Table, times_ns: Int64, channel: Channel) -> Rows:
    rows, fields = Rows(), channel.fields
    _position(rows, table, times_ns, channel)
    rows.values["lever_arm_body_m"] = np.tile(channel.lever_arm, (len(table), 1))
    _quality(rows, table, channel)
    for name, value, unit in (
        ("velocity_enu_m_s", fields.velocity_enu_m_s, "m/s"),
        ("position_std_enu_m", fields.position_std_enu_m, "m"),
        ("attitude_rad", fields.attitude_rad, "rad"),
    ):
        if value.given:
            picked = pick(table, times_ns, name, value, unit, 3)
            if name == "attitude_rad":
                heading = np.mod(picked.values[:, 2], _TURN)
                # A tiny negative angle is rounded up to a whole turn, which is outside.
                picked.values[:, 2] = np.where(heading >= _TURN, 0.0, heading)
            rows.offer(name, picked.values, picked.present)
    return rows


_BUILDERS: Final[dict[str, Callable[[Table, Int64, Channel], Rows]]] = {
    "imu": _imu,
    "gnss_fix": _gnss_fix,
    "truth": _truth,
}


def _position(rows: Rows, table: Table, times_ns: Int64, channel: Channel) -> Places:
    fields = channel.fields
    if fields.position_geodetic.given == fields.position_ecef_m.given:
        raise ConfigurationError(
            "a position is given either as position_geodetic or as position_ecef_m",
            where=table.file.name,
            mend="give one of them, not both and not none",
        )
    if fields.position_ecef_m.given:
        picked = pick(table, times_ns, "position_ecef_m", fields.position_ecef_m, "m", 3)
        places = Places.from_ecef(picked.values)
    else:
        places, picked = _geodetic(table, times_ns, fields.position_geodetic)
    rows.require("position_ecef_m", Picked(places.ecef_m, picked.present))
    return places


def _geodetic(table: Table, times_ns: Int64, value: Value) -> tuple[Places, Picked]:
    """Latitude and longitude in the value's unit, height in metres."""
    name = "position_geodetic"
    if len(value.columns) != 3:
        raise ConfigurationError(
            f"{name} takes 3 columns, not {len(value.columns)}",
            where=table.file.name,
            mend="name latitude, longitude and height; `unit` is that of the angles",
        )
    # Absence is one rule of the whole field; the two units are two picks.
    angles = Value(
        columns=value.columns[:2],
        unit=value.unit,
        absent_when=value.absent_when,
        absent_before=value.absent_before,
    )
    flat = pick(table, times_ns, name, angles, "rad", 2)
    height = pick(table, times_ns, name, Value(columns=value.columns[2:], unit="m"), "m", 1)
    places = Places.from_geodetic(flat.values[:, 0], flat.values[:, 1], height.scalar)
    off = np.abs(flat.values[:, 0]) > 0.5 * math.pi
    return places, Picked(flat.values, flat.present & height.present & ~off)


def _covariance(
    table: Table, times_ns: Int64, what: str, std: Value, rtklib: Value
) -> Picked | None:
    """Upper triangle xx, xy, xz, yy, yz, zz of east, north, up."""
    unit = "m" if what == "position" else "m/s"
    if rtklib.given:
        roots = pick(table, times_ns, f"{what}_covariance_rtklib", rtklib, unit, 6)
        signed = np.copysign(roots.values * roots.values, roots.values)
        return Picked(signed[:, _RTKLIB_ORDER], roots.present)
    if std.given:
        deviation = pick(table, times_ns, f"{what}_std_enu", std, unit, 3)
        triangle = np.zeros((len(table), 6))
        triangle[:, [0, 3, 5]] = deviation.values * deviation.values
        return Picked(triangle, deviation.present)
    return None


def _fix_velocity(
    rows: Rows, table: Table, times_ns: Int64, channel: Channel, places: Places
) -> None:
    fields = channel.fields
    if fields.velocity_enu_m_s.given:
        picked = pick(table, times_ns, "velocity_enu_m_s", fields.velocity_enu_m_s, "m/s", 3)
        velocity = Picked(places.enu_to_ecef(picked.values), picked.present)
    elif fields.velocity_ecef_m_s.given:
        velocity = pick(table, times_ns, "velocity_ecef_m_s", fields.velocity_ecef_m_s, "m/s", 3)
    else:
        return
    rows.offer("velocity_ecef_m_s", velocity.values, velocity.present)
    covariance = _covariance(
        table,
        times_ns,
        "velocity",
        fields.velocity_std_enu_m_s,
        fields.velocity_covariance_rtklib,
    )
    if covariance is not None:
        present = covariance.present & velocity.present
        rows.offer("velocity_covariance_enu_m2_s2", covariance.values, present)


def _quality(rows: Rows, table: Table, channel: Channel) -> None:
    quality, unnamed = pick_quality(table, channel.quality)
    rows.values["quality"] = quality
    if unnamed.any():
        reason = f"{channel.quality.column} holds a code that the spec does not name; UNKNOWN"
        rows.doubtful[reason] = unnamed
