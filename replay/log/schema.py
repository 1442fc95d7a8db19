"""Protobuf schemas as MCAP keeps them: a message's name and a serialized FileDescriptorSet."""

from __future__ import annotations

import functools
import importlib
import pkgutil

from google.protobuf import descriptor_pool
from google.protobuf.descriptor import Descriptor, FileDescriptor
from google.protobuf.descriptor_pb2 import FileDescriptorSet
from google.protobuf.message import DecodeError

import replay.schemas
from replay.errors import SchemaError
from replay.log.names import nearest

PROTOBUF = "protobuf"


@functools.cache
def _own_messages() -> tuple[str, ...]:
    """Load every generated module, so that the default pool knows its messages."""
    names: list[str] = []
    for module in sorted(pkgutil.iter_modules(replay.schemas.__path__), key=lambda m: m.name):
        if module.name.endswith("_pb2"):
            loaded = importlib.import_module(f"replay.schemas.{module.name}")
            names += [m.full_name for m in loaded.DESCRIPTOR.message_types_by_name.values()]
    return tuple(names)


def descriptor(message: str) -> Descriptor:
    """Descriptor of a message of this project, or of one that is already loaded.

    Raises
    ------
    SchemaError
        Where no loaded schema has that name; the nearest is named.
    """
    known = _own_messages()
    try:
        return descriptor_pool.Default().FindMessageTypeByName(message)
    except KeyError:
        raise SchemaError(
            f"there is no message {message}{nearest(message, known)}", where="replay/schemas"
        ) from None


@functools.cache
def descriptor_set(message: str) -> bytes:
    """Schema data of a message: its file after all that it imports, as the spec asks."""
    found = FileDescriptorSet()
    seen: set[str] = set()

    def add(file: FileDescriptor) -> None:
        if file.name in seen:
            return
        seen.add(file.name)
        for dependency in file.dependencies:
            add(dependency)
        file.CopyToProto(found.file.add())

    add(descriptor(message).file)
    return found.SerializeToString(deterministic=True)


def foreign_descriptor(message: str, schema_data: bytes) -> Descriptor:
    """Descriptor of a message as a log's own schema defines it.

    Raises
    ------
    SchemaError
        Where the data is no FileDescriptorSet that defines the message.
    """
    pool = descriptor_pool.DescriptorPool()
    try:
        files = FileDescriptorSet.FromString(schema_data).file
        waiting = {file.name: file for file in files}
        while waiting:
            # Writers differ in the order of files; the pool wants imports first.
            ready = [
                name
                for name, file in waiting.items()
                if not any(dependency in waiting for dependency in file.dependency)
            ]
            if not ready:
                raise SchemaError(f"the files of {message} import each other")
            for name in ready:
                pool.AddSerializedFile(waiting.pop(name).SerializeToString())
        return pool.FindMessageTypeByName(message)
    except (DecodeError, KeyError, TypeError, ValueError) as error:
        raise SchemaError(f"the schema of {message} cannot be read: {error}") from error
