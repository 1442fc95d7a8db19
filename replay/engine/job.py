"""What is to be run: a pipeline, its settings, a stretch of the log."""

from __future__ import annotations

import dataclasses
import tomllib
from collections.abc import Mapping, Sequence
from typing import Any

from replay import configuration
from replay.configuration import Section
from replay.engine.manifest import DEFAULTS
from replay.engine.pipelines import find_pipeline
from replay.log.reader import LogReader


@dataclasses.dataclass(frozen=True, slots=True)
class Job:
    """What is to be run.

    Attributes
    ----------
    pipeline : str
    config : Section
    start_ns, end_ns : int or None, GPS ns
        Log times from (included) and to (not included); None for the log's own.
    checkpoint_every_s : int
        Seconds of log time between checkpoints; 0 for none.
    """

    pipeline: str
    config: Section
    start_ns: int | None = None
    end_ns: int | None = None
    checkpoint_every_s: int = 0

    def text(self) -> str:
        """Everything that decides the outputs besides the input, as canonical TOML."""
        lines = ["[replay]", f"pipeline = {configuration.literal(self.pipeline)}"]
        if self.start_ns is not None:
            lines.append(f"start_ns = {self.start_ns}")
        if self.end_ns is not None:
            lines.append(f"end_ns = {self.end_ns}")
        lines.append(f"checkpoint_every_s = {self.checkpoint_every_s}")
        return configuration.to_toml(self.config) + "\n" + "\n".join(lines) + "\n"

    @classmethod
    def from_text(cls, text: str) -> Job:
        """The job of a manifest."""
        table = tomllib.loads(text)
        replay = table.pop("replay")
        return cls(
            replay["pipeline"],
            configuration.build(find_pipeline(replay["pipeline"]).config, [table]),
            replay.get("start_ns"),
            replay.get("end_ns"),
            replay["checkpoint_every_s"],
        )


def make_job(
    reader: LogReader,
    pipeline_name: str,
    *,
    tables: Sequence[Mapping[str, Any]],
    start_ns: int | None = None,
    end_ns: int | None = None,
    checkpoint_every_s: int = 0,
) -> Job:
    """A job over a log: built-in defaults, then the log's own, then `tables`.

    Where an inertial unit is chosen by its name, what the log says of that goes over the rest
    of its own.

    Raises
    ------
    UsageError
        For an unknown pipeline or key.
    """
    pipeline = find_pipeline(pipeline_name)
    text = reader.metadata.get(DEFAULTS, {}).get("toml", "")
    own = configuration.known_part(pipeline.config, tomllib.loads(text))
    config = configuration.build(pipeline.config, [own, *tables])
    unit = getattr(getattr(config, "imu", None), "name", "")
    if unit:
        text = reader.metadata.get(f"{DEFAULTS}.{unit}", {}).get("toml", "")
        of_unit = configuration.known_part(pipeline.config, tomllib.loads(text))
        config = configuration.build(pipeline.config, [own, of_unit, *tables])
    return Job(pipeline_name, config, start_ns, end_ns, checkpoint_every_s)
