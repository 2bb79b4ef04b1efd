"""Class names become roles: the user's words before the common ones, and each word in one place."""

from __future__ import annotations

import pytest

from wallkit.core.config import Source, build, source_from_words
from wallkit.core.segmentation import BACKGROUND
from wallkit.errors import ConfigError
from wallkit.segment.roles import COMMON, Roles
from wallkit.segment.settings import SegmentSettings


def test_spelling_is_forgiven_and_the_rest_is_other():
    assert Roles().of(("Wall_Tile", "WALL", "windowpane", "person", "robot", BACKGROUND)) == (
        *("wall", "wall", "glass", "person", "other"),
        BACKGROUND,
    )


def test_every_common_word_counts_as_its_own_role():
    for role, words in COMMON.items():
        assert Roles().of(words) == (role,) * len(words)
    assert (*COMMON, "other") == Roles.names()


def test_the_users_words_join_the_common_ones():
    assert Roles(wall=("cladding",)).of(("Cladding", "wall", "robot")) == ("wall", "wall", "other")


def test_a_word_of_the_users_leaves_the_role_that_it_commonly_has():
    """Whichever of the two roles comes first in the table."""
    assert Roles(movable=("sink", "Toilet")).of(("sink", "toilet", "basin")) == ("movable", "movable", "sink")
    assert Roles(wall=("person",)).of(("person", "people")) == ("wall", "person")
    assert Roles(other=("column",)).of(("column", "pillar")) == ("other", "wall")


def test_a_word_in_two_roles_is_refused_with_both_and_the_place():
    with pytest.raises(ConfigError, match=r"'Sink' .* segment.roles.sink and segment.roles.movable") as caught:
        build(SegmentSettings, [source_from_words(['roles.movable=["Sink"]', 'roles.sink=["sink", "tub"]'])])
    assert caught.value.where == "--set"
    text = '[roles]\nmovable = ["cart"]\nother = ["cart"]\n'
    with pytest.raises(ConfigError, match=r"segment.roles.movable and segment.roles.other") as caught:
        build(SegmentSettings, [Source({"roles": {"movable": ["cart"], "other": ["cart"]}}, "wallkit.toml", text)])
    assert caught.value.where.startswith("wallkit.toml:")
    assert caught.value.hint
    assert Roles(wall=("tiles", "Tiles")).of(("tiles",)) == ("wall",)
