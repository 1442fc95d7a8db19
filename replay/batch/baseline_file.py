"""The file `baseline.toml`: what is to be run over a recording, and what it gave.

A person writes the cases; what stands in their tables `recorded`, and the history,
is written by `replay baseline update`. A seal over each `recorded` shows edits.
"""

from __future__ import annotations

import hashlib
import tomllib
from collections.abc import Mapping
from pathlib import Path
from typing import Any, Final

import msgspec

from replay.batch.figures import Number
from replay.configuration import Section, literal
from replay.errors import ConfigurationError
from replay.importers.canonical import to_toml

NAME: Final = "baseline.toml"
_SEAL_DIGITS: Final = 16
_HEADER: Final = """\
# What runs over this recording gave. Cases are written by hand; their tables `recorded` and
# the history by `replay baseline update --reason TEXT`. See recordings/README.md.
"""


class Digest(Section, frozen=True, kw_only=True):
    """Content of a channel.

    Attributes
    ----------
    rows : int
    sha256 : str
    """

    rows: int
    sha256: str


class Recorded(Section, frozen=True, kw_only=True):
    """What a case gave.

    Attributes
    ----------
    seal : str
        Of everything else in here.
    package : str
        Version of this package.
    configuration : str
        Start of the digest of the whole configuration, defaults included.
    stages : dict of str to int
        Versions.
    inputs, outputs : dict of topic to Digest
    figures : dict of group to dict of name to number
        Empty where the recording has no truth.
    """

    seal: str = ""
    package: str
    configuration: str
    stages: dict[str, int]
    inputs: dict[str, Digest]
    outputs: dict[str, Digest]
    figures: dict[str, dict[str, Number]] = msgspec.field(default_factory=dict)

    @property
    def whole(self) -> bool:
        """Whether the seal is that of the content."""
        return self.seal == seal_of(self)


class Case(Section, frozen=True, kw_only=True):
    """A run over a recording.

    Attributes
    ----------
    about : str
        Why there is this case.
    pipeline : str
    settings : tuple of str
        Written `set`; `section.key=value`, over the defaults of the pipeline and of the log.
    degrade : tuple of str
        `START,SECONDS` of outages, from the first log time.
    every : float, s
        Each outage comes again after so long; 0 for once.
    leave_last : float, s
        With `every`: what stays whole at the end.
    recorded : Recorded or None
        None before the first update.
    """

    about: str = ""
    pipeline: str = "gnss-ins-lc"
    settings: tuple[str, ...] = msgspec.field(default=(), name="set")
    degrade: tuple[str, ...] = ()
    every: float = 0.0
    leave_last: float = 30.0
    recorded: Recorded | None = None


class Entry(Section, frozen=True, kw_only=True):
    """One update.

    Attributes
    ----------
    reason : str
    package : str
        Version of this package.
    cases : tuple of str
        Cases that it changed.
    """

    reason: str
    package: str
    cases: tuple[str, ...] = ()


class Baseline(Section, frozen=True, kw_only=True):
    """What is to be run over a recording, and what it gave.

    Attributes
    ----------
    about : str
    spec : str
        Import spec of a real recording, from the file's folder; empty for a simulated one.
    cases : dict of str to Case
    history : tuple of Entry
        Oldest first.
    """

    about: str = ""
    spec: str = ""
    cases: dict[str, Case]
    history: tuple[Entry, ...] = ()


def load_baseline(path: Path) -> Baseline:
    """Baseline of a file.

    Raises
    ------
    ConfigurationError
        Where it is no TOML, or has an unknown key or a wrong type.
    """
    try:
        return msgspec.convert(tomllib.loads(path.read_text(encoding="utf-8")), type=Baseline)
    except (tomllib.TOMLDecodeError, UnicodeDecodeError) as error:
        raise ConfigurationError(f"the baseline is no TOML: {error}", where=str(path)) from error
    except msgspec.ValidationError as error:
        raise ConfigurationError(
            f"the baseline is off: {error}",
            where=str(path),
            mend="take its case out and back in by hand, then `replay baseline update`",
        ) from error


def save_baseline(path: Path, baseline: Baseline) -> None:
    """Write a baseline, the same bytes for equal ones."""
    head = _given({"about": baseline.about, "spec": baseline.spec})
    parts = [_HEADER + to_toml(head)]
    for name, case in baseline.cases.items():
        written = {
            "about": case.about,
            "pipeline": case.pipeline,
            "set": case.settings,
            "degrade": case.degrade,
            "every": case.every,
            "leave_last": case.leave_last if case.every else 0.0,
        }
        parts.append(_table(("cases", name), _given(written)))
        if case.recorded is not None:
            parts.append(recorded_text(case.recorded, ("cases", name, "recorded")))
    for entry in baseline.history:
        given = {"reason": entry.reason, "package": entry.package, "cases": entry.cases}
        parts.append("[[history]]\n" + to_toml(_given(given)))
    path.write_text("\n".join(parts), encoding="utf-8")


def sealed(recorded: Recorded) -> Recorded:
    """The same with its seal."""
    return msgspec.structs.replace(recorded, seal=seal_of(recorded))


def seal_of(recorded: Recorded) -> str:
    """Seal of everything but the seal itself."""
    text = recorded_text(msgspec.structs.replace(recorded, seal=""), ())
    return hashlib.sha256(text.encode()).hexdigest()[:_SEAL_DIGITS]


def recorded_text(recorded: Recorded, path: tuple[str, ...]) -> str:
    """TOML of what a case gave, one line for each channel and each group of figures."""
    plain: dict[str, Any] = msgspec.to_builtins(recorded)
    parts = [_table(path, {key: plain[key] for key in ("seal", "package", "configuration")})]
    for section in ("stages", "inputs", "outputs", "figures"):
        if plain[section]:
            parts.append(_table((*path, section), plain[section]))
    return "\n".join(parts)


def _table(path: tuple[str, ...], table: Mapping[str, Any]) -> str:
    """A table whose own tables stand on one line each."""
    lines = [f"[{'.'.join(map(_key, path))}]"] if path else []
    for key, value in table.items():
        if isinstance(value, Mapping):
            inner = ", ".join(f"{_key(k)} = {literal(v)}" for k, v in value.items())
            lines.append(f"{_key(key)} = {{ {inner} }}")
        else:
            lines.append(f"{_key(key)} = {literal(value)}")
    return "\n".join(lines) + "\n"


def _given(values: Mapping[str, Any]) -> dict[str, Any]:
    """Values that say something."""
    return {key: list(v) if isinstance(v, tuple) else v for key, v in values.items() if v}


def _key(key: str) -> str:
    bare = key.isascii() and key.replace("-", "").replace("_", "").isalnum()
    return key if bare else literal(key)
