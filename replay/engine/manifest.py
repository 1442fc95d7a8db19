"""The manifest: what a log was made from, kept as JSON in its metadata."""

from __future__ import annotations

import functools
import hashlib
import importlib.metadata
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Final

from google.protobuf import json_format

from replay.errors import IncomparableError
from replay.log.digest import ChannelDigest
from replay.schemas import replay_pb2

MANIFEST: Final = "replay.manifest"
DEFAULTS: Final = "replay.defaults"
_JSON: Final = "json"
_CODE_DIGITS: Final = 16


def package_version() -> str:
    """Version of this package."""
    return importlib.metadata.version("gnss-ins-replay")


@functools.cache
def code_digest() -> str:
    """Digest of this package's modules, in hex: between versions the code moves on too."""
    package = Path(__file__).resolve().parents[1]
    digest = hashlib.sha256()
    for path in sorted(package.rglob("*.py")):
        digest.update(path.relative_to(package).as_posix().encode() + b"\0")
        digest.update(hashlib.sha256(path.read_bytes()).digest())
    return digest.hexdigest()[:_CODE_DIGITS]


def digest_messages(digests: Mapping[str, ChannelDigest]) -> list[replay_pb2.ChannelDigest]:
    """Channel digests for a manifest, by topic."""
    return [
        replay_pb2.ChannelDigest(
            topic=topic, schema=d.schema, message_count=d.message_count, sha256=d.sha256
        )
        for topic, d in sorted(digests.items())
    ]


def make_manifest(
    *,
    command: str,
    configuration: str,
    outputs: Mapping[str, ChannelDigest],
    inputs: Mapping[str, ChannelDigest] | None = None,
    pipeline: str = "",
    stages: Sequence[replay_pb2.StageRecord] = (),
    notes: Sequence[str] = (),
) -> replay_pb2.Manifest:
    """Manifest of a log that is about to be closed."""
    return replay_pb2.Manifest(
        command=command,
        package_version=package_version(),
        pipeline=pipeline,
        configuration=configuration,
        stages=stages,
        inputs=digest_messages(inputs or {}),
        outputs=digest_messages(outputs),
        notes=notes,
    )


def manifest_metadata(manifest: replay_pb2.Manifest) -> dict[str, str]:
    """Values of the metadata record that holds a manifest."""
    return {_JSON: json_format.MessageToJson(manifest, preserving_proto_field_name=True)}


def read_manifest(metadata: Mapping[str, Mapping[str, str]], where: str) -> replay_pb2.Manifest:
    """Manifest of a log.

    Raises
    ------
    IncomparableError
        Where the log has none, or one that cannot be read.
    """
    record = metadata.get(MANIFEST)
    if record is None or _JSON not in record:
        raise IncomparableError(
            "the log has no manifest",
            where=where,
            mend="only a log that `replay run` closed whole has one; run it again",
        )
    try:
        return json_format.Parse(record[_JSON], replay_pb2.Manifest(), ignore_unknown_fields=True)
    except json_format.ParseError as error:
        raise IncomparableError(
            f"the log's manifest cannot be read: {error}", where=where
        ) from error
