"""Configuration: a tree of frozen structs, read from TOML, written back canonically.

Numbers are SI. Where a field has a unit, a person may write a quantity instead:
`gyro_bias_sigma = "5 deg/h"`. An unknown key is an error that names the nearest
known one. Later tables win over earlier ones, key by key.
"""

from __future__ import annotations

import contextlib
import difflib
import math
import re
import tomllib
from collections.abc import Iterable, Mapping
from typing import Annotated, Any, Final, TypeVar, get_args, get_origin, get_type_hints

import msgspec

from replay.errors import ConfigurationError

Table = dict[str, Any]
ConfigT = TypeVar("ConfigT", bound="Section")

STANDARD_GRAVITY_M_S2: Final = 9.80665  # CGPM 1901
_DEG: Final = math.pi / 180.0

# Unit of a field -> what may be written for it -> factor to the field's unit.
UNITS: Final[dict[str, dict[str, float]]] = {
    "1": {"1": 1.0, "ppm": 1e-6, "%": 1e-2},
    "s": {"s": 1.0, "ms": 1e-3, "min": 60.0, "h": 3600.0},
    "m": {"m": 1.0, "cm": 1e-2, "mm": 1e-3, "km": 1e3},
    "m/s": {"m/s": 1.0, "cm/s": 1e-2, "mm/s": 1e-3, "km/h": 1.0 / 3.6},
    "m/s^2": {
        "m/s^2": 1.0,
        "g": STANDARD_GRAVITY_M_S2,
        "mg": 1e-3 * STANDARD_GRAVITY_M_S2,
        "ug": 1e-6 * STANDARD_GRAVITY_M_S2,
        "mGal": 1e-5,
    },
    "rad": {"rad": 1.0, "deg": _DEG, "mrad": 1e-3, "arcmin": _DEG / 60.0, "arcsec": _DEG / 3600.0},
    "rad/s": {"rad/s": 1.0, "deg/s": _DEG, "deg/h": _DEG / 3600.0},
    "rad/sqrt(s)": {
        "rad/sqrt(s)": 1.0,
        "deg/sqrt(h)": _DEG / 60.0,
        "deg/sqrt(s)": _DEG,
        "rad/s/sqrt(Hz)": 1.0,
        "deg/s/sqrt(Hz)": _DEG,
        "deg/h/sqrt(Hz)": _DEG / 3600.0,
    },
    "m/s/sqrt(s)": {
        "m/s/sqrt(s)": 1.0,
        "m/s/sqrt(h)": 1.0 / 60.0,
        "m/s^2/sqrt(Hz)": 1.0,
        "mg/sqrt(Hz)": 1e-3 * STANDARD_GRAVITY_M_S2,
        "ug/sqrt(Hz)": 1e-6 * STANDARD_GRAVITY_M_S2,
    },
    "rad/(m/s^2)": {"rad/(m/s^2)": 1.0, "deg/(m/s^2)": _DEG, "deg/g": _DEG / STANDARD_GRAVITY_M_S2},
    "Hz": {"Hz": 1.0, "kHz": 1e3},
    "dB-Hz": {"dB-Hz": 1.0},
}

_QUANTITY = re.compile(
    r"\s*(?P<number>[-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?)\s*(?P<unit>\S+)\s*"
)
_CONTROL = re.compile(r"[\x00-\x1f\x7f]")  # TOML 1.0 wants these escaped


class Section(msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """One table of a configuration."""


def quantity(unit: str, about: str) -> msgspec.Meta:
    """Mark a float field with its unit and its meaning, for `Annotated`."""
    if unit not in UNITS:
        raise ValueError(f"no unit {unit!r}")
    return msgspec.Meta(description=about, extra={"unit": unit})


Scalar = Annotated[float, quantity("1", "a plain ratio")]


def build(cls: type[ConfigT], tables: Iterable[Mapping[str, Any]]) -> ConfigT:
    """A configuration of type `cls` from tables, later ones winning.

    Raises
    ------
    ConfigurationError
        For an unknown key, a wrong type, a unit that does not fit.
    """
    merged: Table = {}
    for table in tables:
        merge(merged, table)
    prepared = _prepare(cls, merged, ())
    try:
        return msgspec.convert(prepared, type=cls, strict=False)
    except msgspec.ValidationError as error:
        raise ConfigurationError(
            f"configuration: {error}", mend="`replay pipelines NAME` lists keys, units and defaults"
        ) from error


def merge(into: Table, table: Mapping[str, Any]) -> None:
    """Put `table` over `into`, table by table."""
    for key, value in table.items():
        if isinstance(value, Mapping) and isinstance(into.get(key), dict):
            merge(into[key], value)
        else:
            into[key] = {**value} if isinstance(value, Mapping) else value


def known_part(cls: type[Section], table: Mapping[str, Any]) -> Table:
    """The keys of a table that `cls` knows, sections and their keys alike."""
    hints = get_type_hints(cls)
    kept: Table = {}
    for key, value in table.items():
        inner = hints.get(key)
        if inner is None:
            continue
        if isinstance(value, Mapping) and isinstance(inner, type) and issubclass(inner, Section):
            kept[key] = known_part(inner, value)
        else:
            kept[key] = value
    return kept


def parse_assignments(assignments: Iterable[str]) -> Table:
    """`["filter.states=15", "name=run2"]` as a table.

    Raises
    ------
    ConfigurationError
        Where an assignment has no `=`.
    """
    result: Table = {}
    for assignment in assignments:
        path, sign, text = assignment.partition("=")
        if not sign or not path.strip():
            raise ConfigurationError(
                f"{assignment!r} is no assignment", mend="write --set section.key=value"
            )
        value: Any = text.strip()
        with contextlib.suppress(tomllib.TOMLDecodeError):  # bare words and quantities are text
            value = tomllib.loads(f"value = {text}")["value"]
        nested: Table = {}
        inner = nested
        *sections, key = path.strip().split(".")
        for section in sections:
            inner[section] = {}
            inner = inner[section]
        inner[key] = value
        merge(result, nested)
    return result


def _prepare(cls: type[Section], table: Mapping[str, Any], path: tuple[str, ...]) -> Table:
    """Check keys and turn quantities into SI numbers."""
    hints = get_type_hints(cls, include_extras=True)
    prepared: Table = {}
    defaults = {
        field.name: field.default
        for field in msgspec.structs.fields(cls)
        if isinstance(field.default, Section)
    }
    for key, value in table.items():
        name = ".".join((*path, key))
        if key not in hints:
            near = difflib.get_close_matches(key, hints, n=1, cutoff=0.5)
            hint = f"did you mean {'.'.join((*path, near[0]))}?" if near else ""
            known = f"known here: {', '.join(hints)}"
            raise ConfigurationError(f"unknown key {name}", mend=f"{hint} {known}".strip())
        if key in defaults and isinstance(value, Mapping):
            # What is not said stays as this table has it, not as its own class does.
            whole: Table = msgspec.to_builtins(defaults[key])
            merge(whole, value)
            value = whole
        prepared[key] = _prepare_value(hints[key], value, name, (*path, key))
    return prepared


def _prepare_value(hint: Any, value: Any, name: str, path: tuple[str, ...]) -> Any:
    if isinstance(hint, type) and issubclass(hint, Section):
        if not isinstance(value, Mapping):
            raise ConfigurationError(f"{name} is a table", mend=f"write {name}.KEY=VALUE")
        return _prepare(hint, value, path)
    unit = field_unit(hint)
    if unit is None:
        return value
    many = get_origin(hint) is tuple
    items = list(value) if isinstance(value, list | tuple) else [value]
    numbers = [to_si(item, unit, name) if isinstance(item, str) else item for item in items]
    if not many:
        return numbers[0] if len(items) == 1 else numbers
    return numbers


def field_unit(hint: Any) -> str | None:
    """Unit of an annotated field, its items' unit for a tuple of them."""
    if get_origin(hint) is Annotated:
        for meta in get_args(hint)[1:]:
            if isinstance(meta, msgspec.Meta) and meta.extra:
                return str(meta.extra["unit"])
    if get_origin(hint) is tuple:
        return field_unit(get_args(hint)[0])
    return None


def to_si(text: str, unit: str, name: str) -> float:
    """A number, or a quantity as a person writes it, to the unit of its field.

    Raises
    ------
    ConfigurationError
        Where it is neither, or its unit is of another kind.
    """
    try:
        return float(text)
    except ValueError:
        pass
    match = _QUANTITY.fullmatch(text)
    factor = UNITS[unit].get(match["unit"]) if match else None
    if match is None or factor is None:
        raise ConfigurationError(
            f"{name}: {text!r} is no quantity in {unit}",
            mend=f"write a number in {unit}, or a number and one of {', '.join(UNITS[unit])}",
        )
    return float(match["number"]) * factor


def to_toml(section: Section) -> str:
    """Canonical TOML: fields in the order of their definition, floats as Python writes them."""
    lines: list[str] = []
    _write(section, (), lines)
    return "\n".join(lines) + "\n"


def _write(section: Section, path: tuple[str, ...], lines: list[str]) -> None:
    inner: list[tuple[str, Section]] = []
    for name in section.__struct_fields__:
        value = getattr(section, name)
        if isinstance(value, Section):
            inner.append((name, value))
        else:
            lines.append(f"{name} = {literal(value)}")
    for name, value in inner:
        lines.extend(["", f"[{'.'.join((*path, name))}]"])
        _write(value, (*path, name), lines)


def literal(value: Any) -> str:
    """TOML literal of a scalar or a list of scalars."""
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, int | float):
        return repr(value)
    if isinstance(value, str):
        escaped = value.replace("\\", "\\\\").replace('"', '\\"')
        escaped = _CONTROL.sub(lambda found: f"\\u{ord(found[0]):04x}", escaped)
        return f'"{escaped}"'
    if isinstance(value, list | tuple):
        return "[" + ", ".join(literal(item) for item in value) + "]"
    raise TypeError(f"no TOML literal for {type(value).__name__}")


def describe(cls: type[Section], path: tuple[str, ...] = ()) -> list[tuple[str, str, str, str]]:
    """Rows of (key, default, unit, meaning) of a configuration, sections flattened."""
    rows: list[tuple[str, str, str, str]] = []
    hints = get_type_hints(cls, include_extras=True)
    defaults = cls()
    for name, hint in hints.items():
        value = getattr(defaults, name)
        if isinstance(value, Section):
            rows.extend(describe(type(value), (*path, name)))
            continue
        rows.append((".".join((*path, name)), literal(value), field_unit(hint) or "", about(hint)))
    return rows


def about(hint: Any) -> str:
    """Meaning of an annotated field."""
    if get_origin(hint) is Annotated:
        for meta in get_args(hint)[1:]:
            if isinstance(meta, msgspec.Meta) and meta.description:
                return meta.description
    if get_origin(hint) is tuple:
        return about(get_args(hint)[0])
    return ""
