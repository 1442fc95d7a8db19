"""A log as a source: what was recorded in it, so that files can be added to it.

Products that come weeks after a drive, tides of a station's ground or maps of the ionosphere are
added so, to a log of any origin. Results of runs stay behind: they are of the log as it was.
"""

from __future__ import annotations

import tomllib
from collections.abc import Mapping
from pathlib import Path
from typing import Any, Final

from replay import channels
from replay.engine.manifest import DEFAULTS, MANIFEST
from replay.engine.run import JOB
from replay.importers.files import File
from replay.importers.findings import Findings
from replay.importers.spec import Stream
from replay.log.columns import Columns
from replay.log.reader import LogReader

FORMAT: Final = "log"
_TOML: Final = "toml"
_OF_RUNS: Final = (channels.TRACE, channels.CHECKPOINT)


def log_stream(file: File, findings: Findings, stream: Stream) -> dict[str, Columns]:
    """Rows of every channel that was recorded, as they are.

    Raises
    ------
    LogError
        Where it is no log, or damaged.
    """
    found: dict[str, Columns] = {}
    with LogReader(Path(file.name)) as reader:
        for topic, info in reader.channels.items():
            kind = channels.find(topic)
            if info.depth > 0 or kind in _OF_RUNS:
                text = f"{info.message_count} rows of {topic} stay behind: results of a run"
                findings.notes.append(f"{file.name}: {text}")
            elif kind is None or kind.message != info.schema_name or info.codec is None:
                findings.loss(
                    f"{topic} is no channel that is known here; left out",
                    file.name,
                    info.message_count,
                    "rows",
                    "leave it out of the log",
                )
            else:
                found[topic] = reader.read(topic)
    return {topic: columns for topic, columns in found.items() if len(columns)}


def log_metadata(path: Path) -> dict[str, dict[str, str]]:
    """What a log says of itself, but for what it was made by."""
    with LogReader(path) as reader:
        return {
            name: values for name, values in reader.metadata.items() if name not in (MANIFEST, JOB)
        }


def own_defaults(metadata: Mapping[str, Mapping[str, str]]) -> dict[str, dict[str, Any]]:
    """Settings of a log for the configuration of pipelines, section by section."""
    return tomllib.loads(metadata.get(DEFAULTS, {}).get(_TOML, ""))
