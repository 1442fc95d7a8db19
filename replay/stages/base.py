"""What a stage is: a function from channels to channels that carries a state.

A stage is given blocks: rows of its inputs up to some time, in the order of the
log. Where the log is cut into blocks must not change a bit of what it writes.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Iterator, Mapping
from typing import Final, Protocol, TypeVar

import numpy as np

from replay.channels import ChannelSpec
from replay.configuration import Section
from replay.log.columns import Columns

StateT = TypeVar("StateT")


RECEIVER: Final = "receiver"
BASE: Final = "base"


@dataclasses.dataclass(frozen=True, slots=True)
class Port:
    """One channel that a stage reads or writes.

    Attributes
    ----------
    channel : ChannelSpec
    role : str
        What part the receiver in the topic plays: the configuration's `gnss` section
        names the receivers of RECEIVER and BASE; any other role is the name itself, of a
        receiver or of a baseline between two.
    run : str
        Of an input, the stage whose run the topic speaks of; empty for the run itself.
    optional : bool
        Of an input: the stage does without where the log lacks it.
    """

    channel: ChannelSpec
    role: str = RECEIVER
    run: str = ""
    optional: bool = False

    @property
    def name(self) -> str:
        """Key in blocks, outputs and contexts: `OBS`, or `base.OBS` for another role."""
        return self.channel.name if self.role == RECEIVER else f"{self.role}.{self.channel.name}"


@dataclasses.dataclass(frozen=True, slots=True)
class StageSpec:
    """What the engine knows of a stage.

    Attributes
    ----------
    name : str
    version : int
        Raised with every change that alters an output.
    inputs, outputs : tuple of Port
    trigger : Port
        The input whose rows end a step; the trace has one row per step.
    """

    name: str
    version: int
    inputs: tuple[Port, ...]
    outputs: tuple[Port, ...]
    trigger: Port


@dataclasses.dataclass(frozen=True, slots=True)
class Context:
    """What a stage may know before its first block.

    Attributes
    ----------
    topics : mapping of Port.name to topic
        Inputs and outputs.
    heads : mapping of Port.name to Columns
        The first rows of each recorded input, however the log is cut: for nominal intervals.
    backwards : callable, optional
        Given the Port.name of a recorded input, all its rows in slices, the last slice first:
        for a stage that must know the end before it begins. What it finds it keeps on disk.
    """

    topics: Mapping[str, str]
    heads: Mapping[str, Columns]
    backwards: Callable[[str], Iterator[Columns]] | None = None


Block = Mapping[str, Columns]
"""Rows by Port.name. A channel without rows in the block is not in it."""

Outputs = dict[str, Columns]
"""Rows by Port.name, whose log times lie within the block or at its end."""


class Stage(Protocol[StateT]):
    """One stage of a pipeline."""

    spec: StageSpec

    def start(self, config: Section, context: Context) -> StateT:
        """State before the first row."""

    def step(self, state: StateT, block: Block) -> tuple[StateT, Outputs]:
        """Take a block."""

    def finish(self, state: StateT) -> Outputs:
        """What is left to say after the last block."""

    def dump(self, state: StateT) -> bytes:
        """The state as bytes, the same for equal states."""

    def restore(self, state: StateT, data: bytes) -> StateT:
        """The state of a dump; `state` is that of `start` with the same configuration."""


def dump_arrays(arrays: Mapping[str, np.ndarray]) -> bytes:
    """Arrays as bytes: name, type, shape and content, in the order given."""
    parts: list[bytes] = []
    for name, array in arrays.items():
        content = np.ascontiguousarray(array).tobytes()
        head = f"{name} {','.join(map(str, array.shape))} {len(content)}\n".encode()
        parts.extend([head, content])
    return b"".join(parts)


def restore_arrays(data: bytes, types: Mapping[str, np.dtype]) -> dict[str, np.ndarray]:
    """Arrays of :func:`dump_arrays`, given the type of each.

    Raises
    ------
    ValueError
        Where the bytes are not those of such arrays.
    """
    arrays: dict[str, np.ndarray] = {}
    position = 0
    for name, dtype in types.items():
        end = data.index(b"\n", position)
        found, shape, length = data[position:end].decode().split(" ")
        if found != name:
            raise ValueError(f"a dump holds {found}, not {name}")
        stop = end + 1 + int(length)
        dimensions = tuple(int(n) for n in shape.split(",") if n)
        arrays[name] = np.frombuffer(data[end + 1 : stop], dtype=dtype).reshape(dimensions).copy()
        position = stop
    return arrays
