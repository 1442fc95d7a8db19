"""Which channel of B answers a channel of A, runs being named as their makers chose."""

from __future__ import annotations

import dataclasses
from collections.abc import Iterable, Mapping

from replay.channels import ChannelSpec, find
from replay.errors import UsageError

_RUN = "run"


@dataclasses.dataclass(frozen=True, slots=True)
class TopicPairs:
    """Topics of both runs, by partner.

    Attributes
    ----------
    common : list of (topic of A, topic of B)
    only_a, only_b : list of str
    run_names : mapping of run name of A to that of B
        Those that differ and were mapped.
    """

    common: list[tuple[str, str]]
    only_a: list[str]
    only_b: list[str]
    run_names: dict[str, str]


def pair_topics(
    topics_a: Iterable[str], topics_b: Iterable[str], run_names: Mapping[str, str]
) -> TopicPairs:
    """Pair topics by name, run names of A being translated to those of B.

    Without a mapping, the only run name of A stands for the only one of B.
    """
    topics_a, topics_b = sorted(topics_a), sorted(topics_b)
    names_a, names_b = _run_names(topics_a), _run_names(topics_b)
    for name, names, letter in (
        *((name, names_a, "A") for name in run_names),
        *((name, names_b, "B") for name in run_names.values()),
    ):
        if name not in names:
            raise UsageError(
                f"{letter} has no run named {name!r}",
                where="the mapping of run names",
                mend=f"{letter} has: {', '.join(names) or 'none'}",
            )
    if not run_names and len(names_a) == len(names_b) == 1 and names_a != names_b:
        run_names = {names_a[0]: names_b[0]}
    translated = {topic: _translate(topic, run_names) for topic in topics_a}
    common = [(topic, partner) for topic, partner in translated.items() if partner in topics_b]
    taken = {partner for _, partner in common}
    return TopicPairs(
        common,
        [topic for topic, partner in translated.items() if partner not in topics_b],
        [topic for topic in topics_b if topic not in taken],
        dict(run_names),
    )


def run_name(topic: str) -> str | None:
    """Name of the run that a topic bears, if it bears one."""
    spec = find(topic)
    return None if spec is None else spec.parts(topic).get(_RUN)


def _run_names(topics: Iterable[str]) -> list[str]:
    return sorted({name for name in map(run_name, topics) if name is not None})


def _translate(topic: str, run_names: Mapping[str, str]) -> str:
    spec = find(topic)
    name = run_name(topic)
    if spec is None or name is None or name not in run_names:
        return topic
    return spec.at(**(spec.parts(topic) | {_RUN: run_names[name]}))


def spec_of(topic: str, message: str) -> ChannelSpec:
    """Key and tolerances of a topic; one that the table does not know is compared exactly."""
    known = find(topic)
    if known is not None and known.message == message:
        return dataclasses.replace(known, topic=topic)
    return ChannelSpec("UNKNOWN", topic, message, "a channel that this project does not know")
