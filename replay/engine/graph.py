"""Which topic each stage reads and writes, and how deep in the graph it stands."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping, Sequence
from typing import Any, Final

from replay.channels import IMU, IMU_UNIT
from replay.errors import MissingChannelError, UsageError
from replay.stages.base import BASE, RECEIVER, Port, Stage

_USUAL: Final = {RECEIVER: "rover", BASE: "base"}


@dataclasses.dataclass(frozen=True, slots=True)
class Node:
    """A stage in its place.

    Attributes
    ----------
    stage : Stage
    inputs, outputs : mapping of Port.name to topic
        Optional inputs that the log lacks are not in it.
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
    stages: Sequence[Stage[Any]],
    recorded: Mapping[str, int],
    *,
    run: str,
    receivers: Mapping[str, str] | None = None,
) -> tuple[Node, ...]:
    """Give each stage its topics.

    The last stage writes the run that was asked for; one before it writes a run of
    its own name, and is left out where the log has what later stages need of it.

    Parameters
    ----------
    stages : sequence of Stage
        Each after those that it reads from.
    recorded : mapping of topic to depth
        What the log has.
    run : str
        Name that fills `{run}` in the topics of the last stage's outputs.
    receivers : mapping of role to str, optional
        Which receiver plays which role, and under IMU_UNIT's name which inertial unit stands
        in for the one without a name. Where it is empty the only one that the log
        has is taken, leaving aside the one that plays another role or is called so.

    Raises
    ------
    MissingChannelError
        Where an input is neither in the log nor made by an earlier stage.
    UsageError
        Where several topics fit an input.
    """
    depths = dict(recorded)
    nodes: list[Node] = []
    chosen = {role: name for role, name in (receivers or {}).items() if name}
    for place, stage in enumerate(stages):
        last = place == len(stages) - 1
        own = run if last else stage.spec.name
        try:
            found = [
                (port, _find(port, stage.spec.name, list(depths), chosen))
                for port in stage.spec.inputs
            ]
        except MissingChannelError:
            if last or not _recorded_already(stage, stages[place + 1 :], own, recorded, chosen):
                raise
            continue
        inputs = {port.name: topic for port, topic in found if topic is not None}
        named = dict(chosen)
        for port, topic in found:
            if topic is not None and port.role in _USUAL and "{receiver}" in port.channel.topic:
                named.setdefault(port.role, port.channel.parts(topic).get("receiver", ""))
        if not last and _recorded_already(stage, stages[place + 1 :], own, recorded, named):
            continue
        depth = 1 + max((depths[topic] for topic in inputs.values()), default=0)
        outputs = {port.name: _topic(port, own, named) for port in stage.spec.outputs}
        for port in stage.spec.outputs:
            if not port.channel.matches(outputs[port.name]):
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


def _topic(port: Port, run: str, receivers: Mapping[str, str]) -> str:
    named = port.role if port.role not in _USUAL else ""
    return port.channel.at(
        run=run,
        receiver=receivers.get(port.role, named),
        baseline=named,
        rover=receivers.get(RECEIVER, ""),
    )


def _recorded_already(
    stage: Stage[Any],
    later: Sequence[Stage[Any]],
    run: str,
    recorded: Mapping[str, int],
    receivers: Mapping[str, str],
) -> bool:
    """Whether the log has every output of a stage that later ones cannot do without."""
    wanted = {
        (port.channel.name, port.role, port.run)
        for other in later
        for port in other.spec.inputs
        if not port.optional
    }
    needed = [
        port
        for port in stage.spec.outputs
        if (port.channel.name, port.role, run if "{run}" in port.channel.topic else "") in wanted
    ]
    names = {role: receivers.get(role) or _USUAL[role] for role in _USUAL}
    return bool(needed) and all(_topic(port, run, names) in recorded for port in needed)


def _find(
    port: Port, stage: str, topics: Sequence[str], receivers: Mapping[str, str]
) -> str | None:
    spec = port.channel
    fitting = [topic for topic in topics if spec.matches(topic)]
    if spec is IMU and receivers.get(IMU_UNIT.name):
        spec = IMU_UNIT
        fitting = [topic for topic in topics if topic == spec.at(unit=receivers[spec.name])]
    if port.run:
        fitting = [topic for topic in fitting if spec.parts(topic).get("run") == port.run]
    if "{baseline}" in spec.topic:
        fitting = [topic for topic in fitting if spec.parts(topic)["baseline"] == port.role]
    elif port.role not in _USUAL:
        fitting = [topic for topic in fitting if spec.parts(topic)["receiver"] == port.role]
    elif "{rover}" in spec.topic:
        rover = receivers.get(RECEIVER)
        fitting = [topic for topic in fitting if rover in ("", None, spec.parts(topic)["rover"])]
    elif "{receiver}" in spec.topic:
        of = {spec.parts(topic)["receiver"]: topic for topic in fitting}
        name = receivers.get(port.role, "")
        if name:
            fitting = [of[name]] if name in of else []
        elif len(of) > 1:
            others = {receivers.get(role) or usual for role, usual in _USUAL.items()}
            others.discard(_USUAL[port.role])
            fitting = [topic for receiver, topic in of.items() if receiver not in others]
    if len(fitting) == 1:
        return fitting[0]
    if not fitting:
        if port.optional:
            return None
        known = ", ".join(topics) or "none"
        raise MissingChannelError(
            f"{stage} needs a channel {spec.topic} ({spec.about})",
            where=f"the log has: {known}",
            mend="import or simulate a log with this channel, or choose a receiver or inertial "
            "unit that it has",
        )
    raise UsageError(
        f"{stage} can read any of {', '.join(fitting)}",
        mend=f"choose one: --set gnss.{port.role}=NAME",
    )
