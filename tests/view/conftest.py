"""A fake run, once recorded and once read back."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from pathlib import Path

import fake_run
import pytest
from view_recordings import Entity, read_back

from replay.log.columns import Columns
from replay.view.recording import record


@pytest.fixture(scope="session")
def channels() -> dict[str, Columns]:
    return fake_run.make_channels(150.0, imu_hz=50)


@pytest.fixture(scope="session")
def metadata() -> dict[str, dict[str, str]]:
    return fake_run.make_metadata()


@pytest.fixture(scope="session")
def recorded(
    channels: dict[str, Columns],
    metadata: dict[str, dict[str, str]],
    tmp_path_factory: pytest.TempPathFactory,
) -> Path:
    out = tmp_path_factory.mktemp("view") / "run.rrd"
    record(fake_run.in_batches(channels), metadata, out, name="run")
    return out


@pytest.fixture(scope="session")
def entities(recorded: Path) -> dict[str, Entity]:
    return read_back(recorded)


@pytest.fixture
def reduced(
    tmp_path: Path,
) -> Callable[[Mapping[str, Columns], Mapping[str, Mapping[str, str]]], dict[str, Entity]]:
    """Record other channels and read them back."""

    def make(
        channels: Mapping[str, Columns], metadata: Mapping[str, Mapping[str, str]]
    ) -> dict[str, Entity]:
        out = tmp_path / "reduced.rrd"
        record(fake_run.in_batches(dict(channels)), metadata, out, name="reduced")
        return read_back(out)

    return make
