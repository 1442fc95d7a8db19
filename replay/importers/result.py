"""What an import answers, and what it was expected to answer."""

from __future__ import annotations

import dataclasses
import re
import tomllib
from collections.abc import Mapping
from pathlib import Path
from typing import Final

from replay.configuration import literal
from replay.errors import ExitCode, LossReport
from replay.importers.canonical import toml_key
from replay.log.digest import ChannelDigest

_EXPECT: Final = re.compile(r"(?ms)^\[expect\][^\n]*\n.*?(?=^\[|\Z)")


@dataclasses.dataclass(frozen=True, slots=True)
class ImportResult:
    """An import that wrote a log.

    Attributes
    ----------
    out : Path
        The log.
    rows : mapping of topic to int
        Rows written.
    digests : mapping of topic to ChannelDigest
    topics : mapping of channel name to topic
        Which channels of the spec were used; those of a stream are called after
        the stream and the topic.
    losses : LossReport
        What was skipped, put in order or replaced.
    notes : tuple of str
        What was done, for a person.
    mismatches : tuple of str
        Channels whose digest is not the one that the spec expects.
    """

    out: Path
    rows: Mapping[str, int]
    digests: Mapping[str, ChannelDigest]
    topics: Mapping[str, str]
    losses: LossReport
    notes: tuple[str, ...]
    mismatches: tuple[str, ...]

    @property
    def exit_code(self) -> ExitCode:
        """1 where a digest is not the expected one, 3 where something was lost, else 0."""
        return ExitCode.FAILURE if self.mismatches else self.losses.exit_code


def compare_digests(
    expect: Mapping[str, str], topics: Mapping[str, str], digests: Mapping[str, ChannelDigest]
) -> tuple[str, ...]:
    """A sentence for each channel whose digest is not the expected one."""
    return tuple(
        f"{name} ({topic}): digest {digests[topic].sha256}, the spec expects {expect[name]}; "
        "the files, the spec or the importer changed: look, then update_expected"
        for name, topic in topics.items()
        if name in expect and digests[topic].sha256 != expect[name]
    )


def update_expected(spec_path: Path, result: ImportResult) -> None:
    """Write the digests of an import into the `[expect]` table of its spec.

    Channels that this import did not use keep their lines.

    Parameters
    ----------
    spec_path : Path
        The spec; the rest of its text stays as it is.
    result : ImportResult
        An import that was looked at and found right.
    """
    text = spec_path.read_text(encoding="utf-8")
    expect: dict[str, str] = dict(tomllib.loads(text).get("expect", {}))
    for name, topic in result.topics.items():
        expect[name] = result.digests[topic].sha256
    lines = "".join(f"{toml_key(name)} = {literal(expect[name])}\n" for name in sorted(expect))
    table = f"[expect]\n{lines}"
    if _EXPECT.search(text):
        text = _EXPECT.sub(lambda _: table, text, count=1)
    else:
        text = f"{text.rstrip()}\n\n{table}"
    spec_path.write_text(text, encoding="utf-8")
