"""Reading an import spec, and whether what it says holds together."""

from __future__ import annotations

import tomllib
from pathlib import Path
from typing import Any, TypeVar

import msgspec

from replay import configuration
from replay.configuration import Section
from replay.errors import ConfigurationError, UsageError
from replay.importers.spec import FIELDS_OF, Channel, Source, Spec, Stream

SectionT = TypeVar("SectionT", bound=Section)


class _Head(Section, frozen=True):
    title: str
    origin: str
    licence: str
    sources: dict[str, dict[str, Any]]
    channels: dict[str, dict[str, Any]] = msgspec.field(default_factory=dict)
    streams: dict[str, dict[str, Any]] = msgspec.field(default_factory=dict)
    notes: tuple[str, ...] = ()
    defaults: dict[str, dict[str, Any]] = msgspec.field(default_factory=dict)
    expect: dict[str, str] = msgspec.field(default_factory=dict)


def load_spec(path: Path) -> Spec:
    """Read and check a spec.

    Raises
    ------
    ConfigurationError
        For an unknown key or a value that cannot be, with the table's name.
    UsageError
        Where the file cannot be read or is no TOML.
    """
    try:
        table = tomllib.loads(path.read_text(encoding="utf-8"))
    except OSError as error:
        raise UsageError(f"the import spec cannot be read: {error}", where=str(path)) from error
    except (tomllib.TOMLDecodeError, UnicodeDecodeError) as error:
        raise UsageError(f"the import spec is no TOML: {error}", where=str(path)) from error
    head = _section(_Head, table, str(path))
    spec = Spec(
        path=path,
        title=head.title,
        origin=head.origin,
        licence=head.licence,
        notes=head.notes,
        sources={
            name: _section(Source, part, f"{path}, [sources.{name}]")
            for name, part in head.sources.items()
        },
        channels={
            name: _section(Channel, part, f"{path}, [channels.{name}]")
            for name, part in head.channels.items()
        },
        streams={
            name: _section(Stream, part, f"{path}, [streams.{name}]")
            for name, part in head.streams.items()
        },
        defaults=head.defaults,
        expect=head.expect,
        table=table,
    )
    for name, channel in spec.channels.items():
        _check(spec, name, channel)
        _check_fallback(spec, name)
    _check_topics(spec)
    for name, stream in spec.streams.items():
        _check_stream(spec, name, stream)
    for name in spec.expect:
        if name not in spec.channels and name.partition(" ")[0] not in spec.streams:
            known = [*spec.channels, *(f"{stream} TOPIC" for stream in spec.streams)]
            raise ConfigurationError(
                f"the spec expects a digest of {name!r}, which is no channel",
                where=f"{path}, [expect]",
                mend=f"known: {', '.join(known)}",
            )
    return spec


def _section(cls: type[SectionT], table: dict[str, Any], where: str) -> SectionT:
    try:
        return configuration.build(cls, [table])
    except ConfigurationError as error:
        what = error.what.removeprefix("configuration: ")
        # The hint on a wrong type speaks of pipelines; here the spec's format is what helps.
        wrong_type = what != error.what
        mend = "the docstring of replay.importers.spec shows the format"
        raise ConfigurationError(
            what, where=where, mend=mend if wrong_type else error.mend
        ) from error


def _check(spec: Spec, name: str, channel: Channel) -> None:
    where = f"{spec.path}, [channels.{name}]"
    _check_sources(spec, (channel.source, *channel.join), where)
    if len(channel.lever_arm) != 3:
        raise ConfigurationError(
            f"lever_arm has {len(channel.lever_arm)} numbers", where=where, mend="write three"
        )
    for field in channel.fields.__struct_fields__:
        if getattr(channel.fields, field).given and field not in FIELDS_OF[channel.kind]:
            raise ConfigurationError(
                f"a channel of kind {channel.kind} has no field {field}",
                where=where,
                mend=f"its fields are {', '.join(sorted(FIELDS_OF[channel.kind]))}",
            )


def _check_sources(spec: Spec, names: tuple[str, ...], where: str) -> None:
    for source in names:
        if source not in spec.sources:
            known = ", ".join(spec.sources)
            raise ConfigurationError(f"no source {source!r}", where=where, mend=f"known: {known}")


def _check_stream(spec: Spec, name: str, stream: Stream) -> None:
    where = f"{spec.path}, [streams.{name}]"
    _check_sources(spec, stream.sources, where)
    if name in spec.channels or not name or " " in name:
        raise ConfigurationError(
            f"a stream cannot be called {name!r}",
            where=where,
            mend="take a name without blanks that no channel has",
        )
    if not stream.sources:
        raise ConfigurationError("the stream has no source", where=where, mend="name one")
    if len(stream.position_ecef_m) not in (0, 3):
        count = len(stream.position_ecef_m)
        raise ConfigurationError(
            f"position_ecef_m has {count} numbers", where=where, mend="write three"
        )


def _check_fallback(spec: Spec, name: str) -> None:
    where = f"{spec.path}, [channels.{name}]"
    known = f"known: {', '.join(spec.channels)}"
    seen, topic = {name}, spec.channels[name].topic
    while name := spec.channels[name].fallback:
        if name not in spec.channels:
            raise ConfigurationError(
                f"no channel {name!r} to fall back to", where=where, mend=known
            )
        if spec.channels[name].topic != topic:
            raise ConfigurationError(f"the fallback {name!r} is not of {topic}", where=where)
        if name in seen:
            raise ConfigurationError(f"the fallback {name!r} leads back to itself", where=where)
        seen.add(name)


def _check_topics(spec: Spec) -> None:
    topics: dict[str, str] = {}
    for name, channel in spec.primary().items():
        if channel.topic in topics:
            raise ConfigurationError(
                f"channels {topics[channel.topic]} and {name} are both {channel.topic}",
                where=str(spec.path),
                mend="give one another receiver, or make it the fallback of the other",
            )
        topics[channel.topic] = name
