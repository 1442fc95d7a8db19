"""A TOML table as text that depends on its content alone."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from replay.configuration import literal


def to_toml(table: Mapping[str, Any], path: tuple[str, ...] = ()) -> str:
    """Canonical TOML: keys in their order, plain values before tables.

    Parameters
    ----------
    table : mapping
        Scalars, lists of scalars and tables of them.
    path : tuple of str
        Names of the tables around this one.
    """
    lines = [
        f"{toml_key(key)} = {literal(value)}"
        for key, value in table.items()
        if not isinstance(value, Mapping)
    ]
    text = "".join(f"{line}\n" for line in lines)
    for key, value in table.items():
        if isinstance(value, Mapping):
            inner = (*path, toml_key(key))
            text += f"\n[{'.'.join(inner)}]\n{to_toml(value, inner)}"
    return text if path else text.lstrip("\n")


def toml_key(key: str) -> str:
    """A name as a key of TOML, quoted where it has to be."""
    bare = key.isascii() and key.replace("-", "").replace("_", "").isalnum()
    return key if bare else literal(key)
