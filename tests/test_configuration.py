"""Configuration: units, one number for three, near misses, text that goes round."""

from __future__ import annotations

import math
import tomllib
from typing import Annotated, Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from replay.configuration import (
    UNITS,
    Section,
    build,
    describe,
    field_unit,
    known_part,
    literal,
    merge,
    parse_assignments,
    quantity,
    to_si,
    to_toml,
)
from replay.errors import ConfigurationError, ExitCode
from replay.stages.loose_config import LooseConfig


class Inner(Section, frozen=True):
    rate: Annotated[float, quantity("rad/s", "a rate")] = 0.5
    three: tuple[Annotated[float, quantity("m", "three of them")], ...] = (1.0, 2.0, 3.0)
    count: int = 4
    on: bool = False


class Outer(Section, frozen=True):
    name: str = "plain"
    ratio: Annotated[float, quantity("1", "a part")] = 0.25
    inner: Inner = Inner()


def made(*tables: dict[str, Any]) -> Outer:
    return build(Outer, tables)


# Values from definitions, not from the table: SI brochure, CGPM 1901, one degree is pi/180.
@pytest.mark.parametrize(
    ("text", "unit", "expected"),
    [
        ("5 deg/h", "rad/s", 5.0 * math.pi / 180.0 / 3600.0),
        ("0.1 deg/s", "rad/s", 0.1 * math.pi / 180.0),
        ("0.3 deg/sqrt(h)", "rad/sqrt(s)", 0.3 * math.pi / 180.0 / 60.0),
        ("0.004 deg/s/sqrt(Hz)", "rad/sqrt(s)", 0.004 * math.pi / 180.0),
        ("18 deg/h/sqrt(Hz)", "rad/sqrt(s)", 18.0 * math.pi / 180.0 / 3600.0),
        ("0.06 m/s/sqrt(h)", "m/s/sqrt(s)", 0.001),
        ("100 ug/sqrt(Hz)", "m/s/sqrt(s)", 100e-6 * 9.80665),
        ("2 mg", "m/s^2", 2e-3 * 9.80665),
        ("30 mGal", "m/s^2", 3e-4),
        ("36 km/h", "m/s", 10.0),
        ("3.2 cm", "m", 0.032),
        ("-1.5e3 mm", "m", -1.5),
        ("20 arcsec", "rad", 20.0 * math.pi / 648000.0),
        ("180deg", "rad", math.pi),
        ("150 ppm", "1", 1.5e-4),
        ("0.1 %", "1", 1e-3),
        ("2 h", "s", 7200.0),
        ("250 ms", "s", 0.25),
        ("0.2 kHz", "Hz", 200.0),
        ("2 deg/g", "rad/(m/s^2)", 2.0 * math.pi / 180.0 / 9.80665),
        ("7", "m", 7.0),
        (".5 m", "m", 0.5),
        ("5. m", "m", 5.0),
        (" 7.5 m ", "m", 7.5),
    ],
)
def test_quantities(text: str, unit: str, expected: float) -> None:
    assert to_si(text, unit, "key") == pytest.approx(expected, rel=1e-15)


@pytest.mark.parametrize("text", ["5 s", "deg", "5 deg 3", "1.2.3 m", "5 M", "", "m 5", "--5 m"])
def test_words_that_are_no_length(text: str) -> None:
    with pytest.raises(ConfigurationError, match=r"inner\.three") as caught:
        to_si(text, "m", "inner.three")
    assert "km" in caught.value.mend
    assert caught.value.exit_code is ExitCode.USAGE


def test_each_unit_holds_itself() -> None:
    for unit, known in UNITS.items():
        assert known[unit] == 1.0
        assert all(factor > 0.0 for factor in known.values())
    with pytest.raises(ValueError):
        quantity("furlong", "no")


def test_later_tables_win_key_by_key() -> None:
    config = made({"name": "a", "inner": {"rate": 1.0, "count": 7}}, {"inner": {"rate": "2 deg/s"}})
    assert (config.name, config.inner.count) == ("a", 7)
    assert config.inner.rate == pytest.approx(math.radians(2.0))
    assert made() == Outer()


def test_tables_are_not_changed() -> None:
    first: dict[str, Any] = {"inner": {"rate": 1.0}}
    second: dict[str, Any] = {"inner": {"rate": 2.0, "three": ["1 cm", 2, 3]}}
    made(first, second)
    assert first == {"inner": {"rate": 1.0}}
    assert second == {"inner": {"rate": 2.0, "three": ["1 cm", 2, 3]}}
    into: dict[str, Any] = {}
    merge(into, first)
    into["inner"]["rate"] = 9.0
    assert first["inner"]["rate"] == 1.0


def test_lists_take_quantities() -> None:
    assert made({"inner": {"three": ["10 cm", 2, "3 km"]}}).inner.three == (0.1, 2.0, 3000.0)


@pytest.mark.parametrize("value", [0.004, "0.004", "0.229183118052329 deg/sqrt(s)", [0.004] * 3])
def test_one_number_stands_for_three(value: object) -> None:
    """A list of one is broadcast by the stage, so that a record of three is filled alike."""
    from tests.engine.drives import StageRun, short_rows

    rows = {topic: columns.take(slice(0, 50)) for topic, columns in short_rows().items()}
    config = build(LooseConfig, [{"filter": {"gyro_noise": value}}])
    record = StageRun(rows, config).state.config
    assert record["gyro_noise"][0].tolist() == pytest.approx([0.004] * 3)


@pytest.mark.parametrize(
    ("table", "what", "mend"),
    [
        ({"inner": {"ratee": 1.0}}, "unknown key inner.ratee", "did you mean inner.rate"),
        ({"nam": "x"}, "unknown key nam", "did you mean name"),
        ({"zzzzzz": 1}, "unknown key zzzzzz", "known here: name, ratio, inner"),
        ({"inner": 3}, "inner is a table", "inner.KEY=VALUE"),
        ({"inner": {"count": "few"}}, "count", "replay pipelines"),
        ({"inner": {"count": 1.5}}, "count", "replay pipelines"),
        ({"inner": {"rate": [1.0, 2.0]}}, "rate", "replay pipelines"),
        ({"inner": {"rate": "5 m"}}, "inner.rate: '5 m' is no quantity in rad/s", "deg/h"),
        ({"name": 3.5}, "name", "replay pipelines"),
        ({"inner": {"three": {"x": 1}}}, "three", "replay pipelines"),
    ],
)
def test_what_cannot_be(table: dict[str, Any], what: str, mend: str) -> None:
    with pytest.raises(ConfigurationError) as caught:
        made(table)
    assert what in caught.value.what
    assert mend in caught.value.mend


def test_known_part() -> None:
    table = {"name": "x", "other": {"a": 1}, "inner": {"rate": 1.0, "gone": 2, "count": 3}}
    assert known_part(Outer, table) == {"name": "x", "inner": {"rate": 1.0, "count": 3}}


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("a.b=1", {"a": {"b": 1}}),
        ("a.b=1.5e-3", {"a": {"b": 1.5e-3}}),
        ("a=true", {"a": True}),
        ("a=[1, '2 cm']", {"a": [1, "2 cm"]}),
        ("a=5 deg/h", {"a": "5 deg/h"}),
        ("name=run2", {"name": "run2"}),
        ("name='a = b'", {"name": "a = b"}),
        ("name=a=b", {"name": "a=b"}),
        (" a . b = 3 ", None),
    ],
)
def test_assignments(text: str, expected: dict[str, Any] | None) -> None:
    if expected is None:
        with pytest.raises(ConfigurationError):
            build(Outer, [parse_assignments([text])])
    else:
        assert parse_assignments([text]) == expected


def test_later_assignments_win() -> None:
    assert parse_assignments(["a.b=1", "a.c=2", "a.b=3"]) == {"a": {"b": 3, "c": 2}}
    for text in ("a.b", "=3", " =3"):
        with pytest.raises(ConfigurationError, match="no assignment"):
            parse_assignments([text])


finite = st.floats(allow_nan=False, allow_infinity=False)
texts = st.text(st.characters(codec="utf-8", exclude_categories=("Cs",)))
outers = st.builds(
    Outer,
    name=texts,
    ratio=finite,
    inner=st.builds(
        Inner,
        rate=finite,
        three=st.lists(finite, max_size=5).map(tuple),
        count=st.integers(-(2**53), 2**53),
        on=st.booleans(),
    ),
)


@given(outers)
def test_canonical_text_gives_the_configuration(config: Outer) -> None:
    text = to_toml(config)
    again = build(Outer, [tomllib.loads(text)])
    assert again == config
    assert to_toml(again) == text
    # -0.0 equals 0.0, but it is another number.
    assert math.copysign(1.0, again.ratio) == math.copysign(1.0, config.ratio)


@given(texts)
def test_text_literals(text: str) -> None:
    assert tomllib.loads(f"value = {literal(text)}")["value"] == text


@given(st.floats())
def test_float_literals(value: float) -> None:
    again = tomllib.loads(f"value = {literal(value)}")["value"]
    assert again == value or (math.isnan(again) and math.isnan(value))


def test_no_literal_for_a_table() -> None:
    with pytest.raises(TypeError):
        literal({"a": 1})


def test_canonical_text_of_the_pipeline() -> None:
    config = build(LooseConfig, [{"filter": {"gyro_noise": "0.3 deg/sqrt(h)", "states": 21}}])
    assert build(LooseConfig, [tomllib.loads(to_toml(config))]) == config


def test_description_names_every_key() -> None:
    rows = describe(Outer)
    assert [row[0] for row in rows] == [
        "name",
        "ratio",
        "inner.rate",
        "inner.three",
        "inner.count",
        "inner.on",
    ]
    assert rows[3] == ("inner.three", "[1.0, 2.0, 3.0]", "m", "three of them")
    assert field_unit(int) is None


def test_every_number_of_the_pipeline_has_a_unit_and_a_meaning() -> None:
    rows = describe(LooseConfig)
    assert len(rows) > 60
    for key, default, unit, meaning in rows:
        if "." in default:  # floats and lists of them
            assert unit in UNITS, key
            assert meaning, key


class Deepest(Section, frozen=True):
    first: float = 1.0
    second: float = 2.0


class Between(Section, frozen=True):
    inner: Deepest = Deepest(second=4.0)
    third: float = 3.0


class Topmost(Section, frozen=True):
    middle: Between = Between(inner=Deepest(first=5.0), third=6.0)


def test_a_table_keeps_what_its_parent_gives_it() -> None:
    """A pipeline's own defaults of a section outlive a key that is set in it."""
    built = build(Topmost, [{"middle": {"inner": {"second": 7.0}}}])
    assert built == Topmost(middle=Between(inner=Deepest(first=5.0, second=7.0), third=6.0))
    assert build(Topmost, [{}]) == Topmost()
