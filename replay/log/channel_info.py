"""Channels of a log by topic."""

from __future__ import annotations

import dataclasses
import functools
from collections.abc import Callable, Mapping

from replay.errors import SchemaError
from replay.log import records, schema
from replay.log.codec import Codec
from replay.log.names import DEPTH_KEY
from replay.log.structure import Structure


@dataclasses.dataclass(frozen=True, slots=True, eq=False)
class ChannelInfo:
    """A channel of a log.

    Attributes
    ----------
    topic : str
    schema_name, schema_encoding, message_encoding : str
        Empty where the log has no schema for the channel.
    schema_data : bytes
    depth : int
        Depth of the stage that made it, 0 for what was recorded.
    metadata : mapping of str to str
        Texts of the channel record, but for the depth.
    message_count : int
    ids : tuple of int
        Channel ids; several where a foreign log gives a topic several.
    codec : Codec or None
        None where rows come as payloads only; `undecodable` then says why.
    undecodable : str
    """

    topic: str
    schema_name: str
    schema_encoding: str
    schema_data: bytes = dataclasses.field(repr=False)
    message_encoding: str
    depth: int
    metadata: Mapping[str, str]
    message_count: int
    ids: tuple[int, ...]
    codec: Codec | None = dataclasses.field(repr=False)
    undecodable: str


def describe_channels(
    structure: Structure, lose: Callable[[str, int], None]
) -> dict[str, ChannelInfo]:
    """Channels of a log, in the order of topics.

    Parameters
    ----------
    structure : Structure
        Of the log.
    lose : callable
        Called with a topic that carries a second kind of message, and how many messages
        of it there are; the first kind is kept.
    """
    by_topic: dict[str, list[records.Channel]] = {}
    for _, channel in sorted(structure.definitions.channels.items()):
        by_topic.setdefault(channel.topic, []).append(channel)
    found = {}
    for topic in sorted(by_topic):
        first = _kind(structure, by_topic[topic][0])
        same = [c for c in by_topic[topic] if _kind(structure, c) == first]
        others = [c for c in by_topic[topic] if _kind(structure, c) != first]
        if others:
            lose(topic, sum(structure.message_counts.get(c.id, 0) for c in others))
        found[topic] = _info(structure, same)
    return found


def _kind(structure: Structure, channel: records.Channel) -> tuple[str, str, bytes, str]:
    none = records.Schema(0, "", "", b"")
    described = structure.definitions.schemas.get(channel.schema_id, none)
    return described.name, described.encoding, described.data, channel.message_encoding


def _info(structure: Structure, same: list[records.Channel]) -> ChannelInfo:
    kind = _kind(structure, same[0])
    metadata = dict(same[0].metadata)
    depth = metadata.pop(DEPTH_KEY, "0")
    ids = tuple(channel.id for channel in same)
    return ChannelInfo(
        same[0].topic,
        *kind,
        int(depth) if depth.isdecimal() else 0,
        metadata,
        sum(structure.message_counts.get(i, 0) for i in ids),
        ids,
        *_codec(*kind),
    )


@functools.lru_cache(maxsize=256)
def _codec(
    name: str, encoding: str, data: bytes, message_encoding: str
) -> tuple[Codec | None, str]:
    """Codec of a channel by its own schema, or None and why there is none."""
    if message_encoding != schema.PROTOBUF or encoding != schema.PROTOBUF:
        return None, f"its messages are {message_encoding or 'of no known encoding'}"
    try:
        return Codec(schema.foreign_descriptor(name, data)), ""
    except SchemaError as error:
        return None, str(error)
