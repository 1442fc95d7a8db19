"""The stages of a GNSS pipeline over rows in memory, cut into blocks as a test likes."""

from __future__ import annotations

import dataclasses
from collections.abc import Iterable, Mapping
from typing import Any

import numpy as np

from replay import channels, configuration
from replay.configuration import Section
from replay.log import codec
from replay.log.columns import Columns, concatenate
from replay.stages.base import Context
from replay.stages.kfspp import FilteredSinglePoint
from replay.stages.satellites import Satellites
from replay.stages.spp import SinglePoint
from replay.stages.spp_config import KfsppConfig, SppConfig
from tests.engine.drives import content, cut

OBS, NAV, IONOSPHERE = (c.name for c in (channels.GNSS_OBS, channels.NAV, channels.NAV_IONOSPHERE))
SATELLITES, CORRECTIONS, COARSE, PROBLEMS = (
    c.name
    for c in (channels.SATELLITES, channels.CORRECTIONS, channels.COARSE, channels.GNSS_EVENTS)
)
SOLUTION, RESIDUALS, CLOCKS, GEOMETRY, EVENTS = (
    c.name
    for c in (
        channels.SOLUTION,
        channels.FILTER_INNOVATIONS,
        channels.FILTER_CLOCKS,
        channels.FILTER_GEOMETRY,
        channels.FILTER_EVENTS,
    )
)

TERMS = (
    "distance_m", "sagnac_m", "satellite_clock_m", "relativity_m", "group_delay_m",
    "ionosphere_m", "hydrostatic_m", "wet_m",
)  # fmt: skip

Inputs = dict[str, Columns]


def logged(name: str, columns: Columns) -> Columns:
    """Rows as a log gives them back: every field of the message is there."""
    spec = {s.name: s for s in channels.CHANNELS}[name]
    schema = codec.codec_for(spec.message)
    found = schema.decode(schema.encode(columns))
    assert not found.bad.any()
    return dataclasses.replace(columns, values=found.values, present=found.present, payloads=None)


def inputs_of(rows: Mapping[str, Columns], receiver: str = "rover") -> Inputs:
    """What the chain reads of a simulated log."""
    topics = {
        OBS: channels.GNSS_OBS.at(receiver=receiver),
        NAV: channels.NAV.topic,
        IONOSPHERE: channels.NAV_IONOSPHERE.topic,
    }
    return {name: logged(name, rows[topic]) for name, topic in topics.items()}


@dataclasses.dataclass
class Ran:
    """Outputs by port, the stage and its last state."""

    outputs: Inputs
    stage: Any
    state: Any

    def bytes(self) -> dict[str, tuple[bytes, ...]]:
        """Everything that was written."""
        return {name: content(name, columns) for name, columns in self.outputs.items()}


def run(
    stage: Any,
    config: Section,
    inputs: Inputs,
    edges: Iterable[int] = (),
    *,
    dump_at: int | None = None,
) -> Ran:
    """One stage; between blocks `dump_at` and the next it goes through a dump."""
    context = Context({}, {})
    state = stage.start(config, context)
    parts: dict[str, list[Columns]] = {}
    for number, block in enumerate(cut(inputs, edges)):
        if number == dump_at:
            dumped = stage.dump(state)
            stage = type(stage)()
            state = stage.restore(stage.start(config, context), dumped)
            assert stage.dump(state) == dumped
        state, outputs = stage.step(state, block)
        for name, columns in outputs.items():
            parts.setdefault(name, []).append(columns)
    for name, columns in stage.finish(state).items():
        parts.setdefault(name, []).append(columns)
    return Ran({name: concatenate(found) for name, found in parts.items()}, stage, state)


def spp_config(*tables: Mapping[str, Any]) -> SppConfig:
    """Settings of `spp`."""
    return configuration.build(SppConfig, list(tables))


def kfspp_config(*tables: Mapping[str, Any]) -> KfsppConfig:
    """Settings of `kfspp`."""
    return configuration.build(KfsppConfig, list(tables))


def with_sights(inputs: Inputs, config: Section) -> Inputs:
    """Observations with what the stage `satellites` says of them, as read from a log."""
    found = run(Satellites(), config, inputs).outputs
    return {
        OBS: inputs[OBS],
        **{name: logged(name, rows) for name, rows in found.items() if name != PROBLEMS},
    }


def solve(inputs: Inputs, config: SppConfig | KfsppConfig) -> Inputs:
    """Outputs of `spp`, or of `kfspp` where the settings are its own."""
    stage = FilteredSinglePoint() if isinstance(config, KfsppConfig) else SinglePoint()
    return run(stage, config, with_sights(inputs, config)).outputs


def edited(columns: Columns, **fields: np.ndarray) -> Columns:
    """Rows with whole columns replaced."""
    return dataclasses.replace(columns, values={**columns.values, **fields}, payloads=None)


def times_of(columns: Columns) -> np.ndarray:
    """Valid times, each once."""
    return np.unique(columns.valid_time_ns)


def satellites(inputs: Inputs, *tables: Mapping[str, Any]) -> Inputs:
    """Outputs of the stage `satellites`."""
    return run(Satellites(), spp_config(*tables), inputs).outputs


def keyed(
    columns: Columns, name: str, *, signal: bool = True
) -> dict[tuple[int, bytes, bytes], float]:
    """Values of a field by time, satellite and signal."""
    second = columns["signal"].tolist() if signal else [b""] * len(columns)
    keys = zip(columns.valid_time_ns.tolist(), columns["satellite"].tolist(), second, strict=True)
    return dict(zip(keys, columns[name].tolist(), strict=True))
