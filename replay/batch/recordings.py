"""Recordings: folders whose input log can be made again, with the cases to run over each."""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence
from pathlib import Path
from typing import Final

from replay.batch.baseline_file import NAME, Baseline, Case, load_baseline
from replay.engine.degrade import plan_outages, remove_fixes
from replay.errors import ConfigurationError, UsageError
from replay.importers import import_log, load_spec
from replay.simulate import simulate

SCENARIO: Final = "scenario.toml"
_DRIVES: Final = "drives"


@dataclasses.dataclass(frozen=True, slots=True)
class Recording:
    """A folder with a scenario, or with a baseline that names an import spec.

    Attributes
    ----------
    folder : Path
    baseline : Baseline
        With one case of default settings where there is no file yet.
    """

    folder: Path
    baseline: Baseline

    @property
    def name(self) -> str:
        """Name of the folder."""
        return self.folder.name

    @property
    def path(self) -> Path:
        """The baseline's file."""
        return self.folder / NAME

    @property
    def spec(self) -> Path | None:
        """Import spec of a real recording."""
        return self.folder / self.baseline.spec if self.baseline.spec else None


def find_recordings(root: Path, only: Sequence[str] = ()) -> tuple[Recording, ...]:
    """Recordings below a folder, by path.

    Parameters
    ----------
    root : Path
    only : sequence of str
        Names of those that are wanted; none for all.

    Raises
    ------
    UsageError
        Where there is none, or a name is unknown.
    ConfigurationError
        Where a baseline cannot be read or has neither scenario nor spec.
    """
    folders = sorted({path.parent for name in (NAME, SCENARIO) for path in root.rglob(name)})
    if not folders:
        raise UsageError(
            f"no {SCENARIO} and no {NAME} below the folder",
            where=str(root),
            mend="go to the checkout, or say --recordings DIR",
        )
    known = [folder.name for folder in folders]
    for name in only:
        if name not in known:
            raise UsageError(f"no recording {name!r}", mend=f"known: {', '.join(known)}")
    return tuple(_recording(folder) for folder in folders if not only or folder.name in only)


def _recording(folder: Path) -> Recording:
    path = folder / NAME
    baseline = load_baseline(path) if path.exists() else Baseline(cases={"default": Case()})
    if bool(baseline.spec) == (folder / SCENARIO).exists():
        raise ConfigurationError(
            f"a recording has either a {SCENARIO} or a spec",
            where=str(path),
            mend='name the import spec: spec = "../../specs/NAME.toml"',
        )
    return Recording(folder, baseline)


def why_not(recording: Recording, data: Path | None) -> str:
    """Why the input log cannot be made; empty where it can."""
    if recording.spec is None:
        return ""
    if data is None:
        return "its files are not part of the repository; say where they are with --data DIR"
    if _files(recording, data) is None:
        name = recording.spec.stem
        origin = load_spec(recording.spec).origin
        return f"no folder {name} in {data} nor in {data / _DRIVES}; it comes from {origin}"
    return ""


def make_input(recording: Recording, data: Path | None, out: Path) -> None:
    """Simulate or import the input log.

    Raises
    ------
    UsageError
        Where :func:`why_not` gives a reason.
    ReplayError
        Where the simulation or the import fails.
    """
    reason = why_not(recording, data)
    if reason:
        raise UsageError(f"{recording.name} cannot be made", mend=reason)
    spec = recording.spec
    files = None if data is None else _files(recording, data)
    if spec is None or files is None:
        simulate(recording.folder / SCENARIO, out)
    else:
        import_log(spec, files, out)


def _files(recording: Recording, data: Path) -> Path | None:
    """Folder of a real recording's files."""
    if recording.spec is None:
        return None
    name = recording.spec.stem
    return next((path for path in (data / name, data / _DRIVES / name) if path.is_dir()), None)


def degrade_input(case: Case, source: Path, out: Path) -> Path:
    """The log that a case runs over: `source` itself, or `out` without fixes in its outages.

    Raises
    ------
    ConfigurationError
        Where an outage is not `START,SECONDS`.
    UsageError
        Where an outage takes nothing away.
    """
    if not case.degrade:
        return source
    try:
        outages = plan_outages(
            source, case.degrade, every_s=case.every, leave_last_s=case.leave_last
        )
    except UsageError as error:
        raise ConfigurationError(
            f"degrade: {error.what}", mend='write degrade = ["40,15"]: START,SECONDS'
        ) from error
    remove_fixes(source, out, outages)
    return out
