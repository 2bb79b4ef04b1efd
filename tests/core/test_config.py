"""Settings: where each came from, what wins, and what is said about mistakes."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Literal

import pytest

from wallkit.core.config import (
    Source,
    build,
    choice,
    component,
    line_of,
    name_in,
    pick,
    read_toml,
    section,
    setting,
    source_from_words,
    table_from,
)
from wallkit.errors import ConfigError


@dataclass(frozen=True)
class Round:
    radius_m: float = setting(1.0, "radius", low=0)


@dataclass(frozen=True)
class Square:
    side_m: float = setting(2.0, "side", low=0)


SHAPES = {"round": Round, "square": Square}
WAYS = {"left": lambda: -1, "right": lambda: 1}


@dataclass(frozen=True)
class Inner:
    count: int = setting(3, "how many", low=1, high=9)
    names: tuple[str, ...] = setting((), "names")


@dataclass(frozen=True)
class Outer:
    speed: float = setting(1.0, "speed", low=0)
    mode: Literal["fast", "slow"] = setting("fast", "mode")
    is_on: bool = setting(True, "switch")
    limit: float | None = setting(None, "limit")
    corners: tuple[tuple[float, float], ...] = setting((), "nested")
    far_m: float = setting(1.0, "a range that allows infinity", high=math.inf)
    way: str = choice(WAYS, "left", "which way")
    shape: Round | Square = component(SHAPES, "round", "the shape")
    inner: Inner = section(Inner, "inside")


def source(text, tmp_path):
    path = tmp_path / "wallkit.toml"
    path.write_text(text)
    return read_toml(path)


def test_later_sources_win_and_every_value_knows_its_origin(tmp_path):
    file = source('speed = 2\n[inner]\ncount = 4\nnames = ["a", "b"]\n[shape]\nname = "square"\nside_m = 5\n', tmp_path)
    settings, origins = build(Outer, [file, source_from_words(["inner.count=5", "mode=slow", "limit=.5"])])
    assert settings == Outer(2.0, "slow", limit=0.5, shape=Square(5.0), inner=Inner(5, ("a", "b")))
    assert origins["speed"].endswith("wallkit.toml:1")
    assert origins["inner.names"].endswith("wallkit.toml:4")
    assert origins["shape.name"].endswith("wallkit.toml:6")
    assert origins["inner.count"] == "--set"
    assert origins["is_on"] == "default"


def test_a_table_of_settings_builds_the_same_settings_again():
    settings, _ = build(
        Outer, [source_from_words(["shape=square", "shape.side_m=7", "way=right", "inner.names=['x']"])]
    )
    again, _ = build(Outer, [Source(table_from(settings), "again")])
    assert again == settings


def test_another_component_drops_the_settings_of_the_one_before():
    words = [source_from_words(["shape.radius_m=3"]), source_from_words(["shape=square"])]
    assert build(Outer, words)[0].shape == Square()


@pytest.mark.parametrize(
    ("word", "message"),
    [
        ("sped=1", "no setting 'sped'"),
        ("inner.cuont=1", "no setting 'cuont'"),
        ("speed=fast", "must be a number"),
        ("speed=-1", "at least 0"),
        ("speed=nan", "at least 0"),
        ("speed=inf", "must be a finite number"),
        ("limit=nan", "must be a finite number"),
        ("limit=-inf", "must be a finite number"),
        ("corners=[[1.0, nan]]", "must be a finite number"),
        ("inner.count=10", "at most 9"),
        ("inner.count=1.5", "a whole number"),
        ("inner.count=true", "a whole number"),
        ("is_on=1", "true or false"),
        ("mode=quick", "one of fast, slow"),
        ("way=up", "no way is called 'up'"),
        ("shape=oval", "no shape is called 'oval'"),
        ("inner=3", "is a table"),
        ("inner.names=x", "a list"),
        ("speed", "not KEY=VALUE"),
    ],
)
def test_a_mistake_is_one_sentence(word, message):
    with pytest.raises(ConfigError, match=message):
        build(Outer, [source_from_words([word])])


def test_a_mistake_in_a_file_names_the_line_and_the_closest_name(tmp_path):
    with pytest.raises(ConfigError) as caught:
        build(Outer, [source("speed = 1\n\n[inner]\n# how many\ncuont = 4\n", tmp_path)])
    assert "wallkit.toml:5" in str(caught.value)
    assert "count" in str(caught.value.hint)


def test_infinity_passes_where_the_range_names_it():
    assert build(Outer, [source_from_words(["far_m=inf"])])[0].far_m == math.inf
    with pytest.raises(ConfigError, match="finite"):
        build(Outer, [source_from_words(["far_m=-inf"])])


@pytest.mark.parametrize("text", ["speed = ", "speed = fast", "[inner"])
def test_broken_toml_is_said_with_its_file(tmp_path, text):
    with pytest.raises(ConfigError, match="not valid TOML"):
        source(text, tmp_path)


def test_lines_are_found_by_dotted_key():
    text = "a = 1\n[b]\nc = 2\n[b.d]\ne = 3\n"
    assert [line_of(text, key) for key in (["a"], ["b", "c"], ["b", "d", "e"], ["b", "d"], ["x"])] == [1, 3, 5, 5, None]


def test_a_users_own_part_is_named_by_module():
    own = pick({}, f"{__name__}:Square", what="shape")
    assert own is Square
    assert name_in(SHAPES, Square()) == "square"
    assert name_in({}, Square()) == f"{__name__}:Square"
    with pytest.raises(ConfigError, match="cannot load shape"):
        pick({}, "no.such.module:Thing", what="shape")


@dataclass(frozen=True)
class Even:
    count: int = setting(2, "how many")

    def __post_init__(self):
        if self.count % 2:
            raise ConfigError(f"{self.count} is odd", hint=f"{self.count + 1}")


@dataclass(frozen=True)
class Pairs:
    even: Even = section(Even, "pairs")


def test_what_a_table_says_against_itself_is_told_with_its_place_and_hint(tmp_path):
    with pytest.raises(ConfigError, match="3 is odd") as caught:
        build(Pairs, [source("[even]\ncount = 3\n", tmp_path)])
    assert caught.value.where.endswith("wallkit.toml:2")
    assert caught.value.hint == "4"
