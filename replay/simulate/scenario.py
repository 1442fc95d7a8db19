"""A scenario: what is driven, with which sensors, from which seed. Read from TOML."""

from __future__ import annotations

import dataclasses
import difflib
import tomllib
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any

from replay.configuration import Table, build, literal, merge, to_toml
from replay.errors import ConfigurationError, UsageError
from replay.simulate import gnss, imu
from replay.simulate.segments import Segment, read_segments
from replay.simulate.settings import Gnss, Imu, Settings, Unit, check, check_units
from replay.simulate.setup_tables import read_many, take_setup
from replay.simulate.sky import Setup, table_lines


@dataclasses.dataclass(frozen=True, slots=True)
class Scenario:
    """Settings and manoeuvres.

    Attributes
    ----------
    settings : Settings
    segments : tuple of Segment
    units : tuple of Unit
        Inertial units beside the first.
    setup : Setup
        Satellites and receivers that observe them.
    defaults : Table
        Sections of pipelines' configurations that go over those that fit the sensors.
    folder : Path
        What paths in it are relative to.
    """

    settings: Settings
    segments: tuple[Segment, ...]
    setup: Setup = dataclasses.field(default_factory=Setup)
    units: tuple[Unit, ...] = ()
    defaults: Table = dataclasses.field(default_factory=dict)
    folder: Path = dataclasses.field(default=Path(), compare=False)

    def to_toml(self) -> str:
        """Canonical TOML; reading it gives an equal scenario."""
        parts = [to_toml(self.settings)]
        for unit in self.units:
            parts.append("\n".join(table_lines("[[imus]]", "imus", unit)))
        for segment in self.segments:
            keys = (f"{k} = {literal(getattr(segment, k))}" for k in segment.__struct_fields__)
            parts.append("\n".join(("[[segments]]", *keys)) + "\n")
        if self.setup.receivers:
            parts.append(self.setup.to_toml())
        if self.defaults:
            parts.append(tables_toml({"defaults": self.defaults}))
        return "\n".join(parts)


def tables_toml(tables: Mapping[str, Any], path: tuple[str, ...] = ()) -> str:
    """TOML of tables in tables."""
    lines = [f"{k} = {literal(v)}" for k, v in tables.items() if not isinstance(v, Mapping)]
    text = "\n".join([f"[{'.'.join(path)}]", *lines]) + "\n" if path and lines else ""
    inner = [tables_toml(v, (*path, k)) for k, v in tables.items() if isinstance(v, Mapping)]
    return "\n".join(part for part in (text, *inner) if part)


def load_scenario(path: Path, tables: Iterable[Mapping[str, Any]] = ()) -> Scenario:
    """Scenario of a TOML file.

    Parameters
    ----------
    path : Path
    tables : iterable of mapping
        Go over the file's, key by key. The file's own go over those of the files that
        its `include` names.

    Raises
    ------
    UsageError
        Where the file cannot be read.
    ConfigurationError
        For an unknown key, a wrong type, an impossible value.
    """
    table = _read_file(path)
    for over in tables:
        merge(table, over)
    try:
        return read_scenario(table, path.parent)
    except ConfigurationError as error:
        where = f"{path}, {error.where}" if error.where else str(path)
        raise ConfigurationError(error.what, where=where, mend=error.mend) from error


def _read_file(path: Path) -> Table:
    """Table of a file, over those of the files that its `include` names."""
    try:
        own = tomllib.loads(path.read_text(encoding="utf-8"))
    except OSError as error:
        raise UsageError(f"the scenario cannot be read: {error}", where=str(path)) from error
    except (tomllib.TOMLDecodeError, UnicodeDecodeError) as error:
        raise ConfigurationError(f"the scenario is no TOML: {error}", where=str(path)) from error
    included = own.pop("include", [])
    if not isinstance(included, list) or not all(isinstance(name, str) for name in included):
        raise ConfigurationError(
            "include is no list of files", where=str(path), mend='write include = ["sky.toml"]'
        )
    table: Table = {}
    for name in included:
        if (path.parent / name).resolve() == path.resolve():
            raise ConfigurationError("a scenario includes itself", where=str(path))
        merge(table, _read_file(path.parent / name))
    merge(table, own)
    return table


def read_scenario(table: Mapping[str, Any], folder: Path = Path()) -> Scenario:
    """Scenario of a table, whose paths are relative to a folder.

    Raises
    ------
    ConfigurationError
        For an unknown key, a wrong type, an impossible value.
    """
    rest: Table = {}
    merge(rest, table)
    tables = rest.pop("segments", None)
    setup = take_setup(rest, folder)
    units = _take_units(rest)
    defaults = rest.pop("defaults", {})
    if not isinstance(defaults, dict):
        raise ConfigurationError("defaults is no table", mend="write [defaults.SECTION]")
    _apply_grade(rest, "imu", Imu().grade, imu.IMU_GRADES)
    _apply_grade(rest, "gnss", Gnss().grade, gnss.GNSS_GRADES)
    settings = build(Settings, [rest])
    check(settings)
    if settings.trajectory.log and tables is not None:
        raise ConfigurationError(
            "a scenario has segments or trajectory.log, not both", mend="leave one of them out"
        )
    segments = () if settings.trajectory.log else read_segments(tables)
    return Scenario(settings, segments, setup, units, defaults, folder)


def _take_units(table: Table) -> tuple[Unit, ...]:
    """Take the further inertial units out of a scenario's table."""
    given = table.pop("imus", [])
    wrapped = []
    for one in given if isinstance(given, list) else []:
        inner: Table = {"imus": {**one} if isinstance(one, Mapping) else one}
        _apply_grade(inner, "imus", "navigation", imu.IMU_GRADES)
        wrapped.append(inner["imus"])
    units = read_many(Unit, wrapped if isinstance(given, list) else given, "imus")
    check_units(units)
    return units


def _apply_grade(
    table: Table, section: str, default: str, grades: Mapping[str, Mapping[str, Any]]
) -> None:
    """Put the errors of a sensor's grade under those that the table gives."""
    given = table.setdefault(section, {})
    if not isinstance(given, dict):
        return  # told by `build`
    grade = given.get("grade", default)
    if grade not in grades:
        near = difflib.get_close_matches(str(grade), grades, n=1, cutoff=0.5)
        hint = f"did you mean {near[0]!r}? " if near else ""
        raise ConfigurationError(
            f"{section}.grade: no grade {grade!r}", mend=f"{hint}known: {', '.join(grades)}"
        )
    errors: Table = dict(grades[grade])
    over = given.get("errors", {})
    if isinstance(over, Mapping):
        merge(errors, over)
        given["errors"] = errors
