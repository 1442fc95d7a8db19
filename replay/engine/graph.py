"""Which topic each stage reads and writes, and how deep in the graph it stands."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping, Sequence
from typing import Any

from replay.channels import ChannelSpec
from replay.errors import MissingChannelError, UsageError
from replay.stages.base import Stage

_RECEIVER = "receiver"


@dataclasses.dataclass(frozen=True, slots=True)
class Node:
    """A stage in its place.

    Attributes
    ----------
    stage : Stage
    inputs, outputs : mapping of ChannelSpec.name to topic
    depth : int
        1 for a stage that reads what was recorded, one more than the deepest
        stage that it reads from.
    """

    stage: Stage[Any]
    inputs: Mapping[str, str]
    outputs: Mapping[str, str]
    depth: int

    @property
    def trigger(self) -> str:
        """Topic whose rows end a step."""
        return self.inputs[self.stage.spec.trigger.name]


def bind(
    stages: Sequence[Stage[Any]], recorded: Mapping[str, int], *, run: str, receiver: str = ""
) -> tuple[Node, ...]:
    """Give each stage its topics.

    Parameters
    ----------
    stages : sequence of Stage
        Each after those that it reads from.
    recorded : mapping of topic to depth
        What the log has.
    run : str
        Name that fills `{run}` in the topics of outputs.
    receiver : str
        Which receiver to use where the log has several; empty takes the only one.

    Raises
    ------
    MissingChannelError
        Where an input is neither in the log nor made by an earlier stage.
    UsageError
        Where several topics fit an input.
    """
    depths = dict(recorded)
    nodes: list[Node] = []
    for stage in stages:
        inputs = {
            spec.name: _find(spec, stage.spec.name, list(depths), receiver)
            for spec in stage.spec.inputs
        }
        depth = 1 + max((depths[topic] for topic in inputs.values()), default=0)
        outputs = {spec.name: spec.at(run=run) for spec in stage.spec.outputs}
        for spec in stage.spec.outputs:
            if not spec.matches(outputs[spec.name]):
                raise UsageError(
                    f"a run cannot be named {run!r}", mend="--set name=NAME, without a slash"
                )
        for topic in outputs.values():
            if topic in depths:
                raise UsageError(
                    f"{topic} is in the log already",
                    mend="give the run another name: --set name=NAME",
                )
            depths[topic] = depth
        nodes.append(Node(stage, inputs, outputs, depth))
    return tuple(nodes)


def _find(spec: ChannelSpec, stage: str, topics: Sequence[str], receiver: str) -> str:
    fitting = [topic for topic in topics if spec.matches(topic)]
    if receiver and "{receiver}" in spec.topic:
        fitting = [topic for topic in fitting if spec.parts(topic)[_RECEIVER] == receiver]
    if len(fitting) == 1:
        return fitting[0]
    if not fitting:
        known = ", ".join(topics) or "none"
        raise MissingChannelError(
            f"{stage} needs a channel {spec.topic} ({spec.about})",
            where=f"the log has: {known}",
            mend="import or simulate a log with this channel, or choose a receiver that it has",
        )
    raise UsageError(
        f"{stage} can read any of {', '.join(fitting)}",
        mend="choose one: --set gnss.receiver=NAME",
    )
