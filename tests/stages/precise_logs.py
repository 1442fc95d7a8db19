"""Real stations with precise products, for tests of what is made of them."""

from __future__ import annotations

import functools
from pathlib import Path

import pytest

from replay import configuration
from replay.importers import import_log
from replay.log.columns import Columns
from replay.log.reader import LogReader
from replay.stages.base import Context
from replay.stages.precise_config import PreciseConfig
from replay.stages.precise_satellites import PreciseSatellites
from tests.conftest import ROOT, SHARED_DATA

FOLDERS = {"ccj2": "ppp-ccj2-2021-210", "esbc": "ppp-esbc-2020-177"}
SIGNALS = {
    "ccj2": ["G1C", "G2W", "R1P", "R2P", "E1X", "E5X"],
    "esbc": ["G1C", "G2W", "R1P", "R2P", "E1C", "E5Q"],
}

Inputs = dict[str, Columns]


def folder_of(name: str) -> Path:
    """Files of a station; skips where they are not."""
    folder = SHARED_DATA / FOLDERS[name]
    if not folder.is_dir() or not (SHARED_DATA / "antex" / "igs14.atx.gz").exists():
        pytest.skip(f"real recordings are not here: {folder}")
    return folder


@functools.cache
def station_log(name: str, folder: Path) -> Inputs:
    """Every input of the stage that a station's log has."""
    log = folder / f"{name}.mcap"
    spec = ROOT / "recordings" / "specs" / f"{FOLDERS[name]}.toml"
    import_log(spec, folder_of(name), log)
    found: Inputs = {}
    with LogReader(log) as reader:
        for port in PreciseSatellites().spec.inputs:
            topic = port.channel.topic.replace("{receiver}", name)
            if topic in reader.channels:
                found[port.name] = reader.read(topic)
    return found


def precise_config(name: str, *tables: dict[str, object]) -> PreciseConfig:
    """Settings for a station."""
    signals = {"gnss": {"signals": SIGNALS[name]}}
    return configuration.build(PreciseConfig, [signals, *tables])


def precise(inputs: Inputs, config: PreciseConfig) -> Inputs:
    """Outputs of the stage for rows that come in one block."""
    stage = PreciseSatellites()
    _, outputs = stage.step(stage.start(config, Context({}, {})), inputs)
    return outputs
