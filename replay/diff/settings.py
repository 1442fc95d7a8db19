"""What two runs were told: configuration, versions, inputs, key by key."""

from __future__ import annotations

import json
import tomllib
from collections.abc import Iterator, Mapping

from replay.diff.result import SettingChange
from replay.errors import DataError
from replay.schemas.replay_pb2 import Manifest


def configuration_changes(a: Manifest, b: Manifest) -> list[SettingChange]:
    """Keys of the configurations whose values differ, as `section.key`."""
    return changes(_settings(a), _settings(b))


def version_changes(a: Manifest, b: Manifest) -> list[SettingChange]:
    """Pipeline, package and stage versions that differ."""
    return changes(_versions(a), _versions(b))


def input_changes(a: Manifest, b: Manifest) -> list[SettingChange]:
    """Input channels whose recorded digests differ, by topic."""
    return changes(*({d.topic: d.sha256 for d in manifest.inputs} for manifest in (a, b)))


def changes(a: Mapping[str, str], b: Mapping[str, str]) -> list[SettingChange]:
    """Keys of two tables that differ or stand in one of them only, sorted."""
    return [
        SettingChange(key=key, a=a.get(key), b=b.get(key))
        for key in sorted({**a, **b})
        if a.get(key) != b.get(key)
    ]


def _versions(manifest: Manifest) -> dict[str, str]:
    found = {"package": manifest.package_version, "pipeline": manifest.pipeline}
    return found | {f"stage {stage.name}": str(stage.version) for stage in manifest.stages}


def _settings(manifest: Manifest) -> dict[str, str]:
    try:
        table = tomllib.loads(manifest.configuration)
    except tomllib.TOMLDecodeError as error:
        raise DataError(
            f"the manifest's configuration is no TOML: {error}",
            where='metadata "replay.manifest"',
            mend="record the run again with this version",
        ) from error
    return dict(_flat("", table))


def _flat(prefix: str, table: Mapping[str, object]) -> Iterator[tuple[str, str]]:
    for key, value in table.items():
        path = f"{prefix}.{key}" if prefix else key
        if isinstance(value, dict):
            yield from _flat(path, value)
        else:
            yield path, json.dumps(value, default=str)
