"""Merges: both sides' changes and nothing else, ours to the byte where theirs did nothing, conflicts with both values."""

from __future__ import annotations

import re

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from tests.maps.drawn import box, placed, ring, robot
from wallkit.errors import MapError
from wallkit.maps.canonical import canonical
from wallkit.maps.diff.compare import compare_maps
from wallkit.maps.diff.links import Side, renamed_links
from wallkit.maps.diff.merge import meaning, merge_maps
from wallkit.maps.diff.merge_names import Names, renamed
from wallkit.maps.read import read_map
from wallkit.maps.xml import parse


def merged(base: bytes, ours: bytes, theirs: bytes, **settings_):
    maps = [read_map(parse(data)) for data in (base, ours, theirs)]
    sides = [Side.of(m) for m in maps]
    names = Names(renamed_links(sides[0], sides[1], 1e-6), renamed_links(sides[0], sides[2], 1e-6))
    return merge_maps(*(parse(data) for data in (base, ours, theirs)), names, **settings_)


def said(a: bytes, b: bytes) -> set[str]:
    return {change.text for change in compare_maps(read_map(parse(a)), read_map(parse(b)))}


@pytest.fixture
def example(data) -> bytes:
    return (data / "maps/wkmap_example/restroom.wkmap.urdf").read_bytes()


BIN = box("bin", "0.3 0.3 0.6", wk_class="trash") + "\n  " + placed("bin", "1 3 0")
# edits of different things: any of them can be merged with any other
EDITS = {
    "move": (b'"wall_mid"/><origin xyz="0 2.06 0"', b'"wall_mid"/><origin xyz="0 2.09 0"'),
    "limit": (b'upper="1.5708"', b'upper="1.92"'),
    "lower": (b'lower="0"', b'lower="-0.1"'),
    "class": (b'<wk:object class="urinal"/>', b'<wk:object class="sink"/>'),
    "plane": (b'scan_plane="0.30"', b'scan_plane="0.35"'),
    "note": (b'class="wall" sigma="0.01"', b'class="wall" sigma="0.01" note="brick"'),
    "gone": (re.compile(rb'  <link name="toilet_1">.*?</link>\n.*?</joint>\n', re.DOTALL), b""),
    "new": (b"</robot>", f"  <!-- by the door -->\n  {BIN}\n</robot>".encode()),
    "room": (b'kind="circulation"', b'kind="hall"'),
    "part": (b'size="0.32 0.35 0.60"', b'size="0.32 0.40 0.60"'),
    "child": (b'<link name="map"/>', b'<link name="map"><wk:ignore rule="WK-E023" reason="x"/></link>'),
    "sigma": (b' sigma="0.01"', b""),
    "form": (b"\n  <link", b"\n\n  <!-- ours -->\n  <link"),
}


def edited(data: bytes, name: str) -> bytes:
    old, new = EDITS[name]
    done = old.sub(new, data) if isinstance(old, re.Pattern) else data.replace(old, new)
    assert done != data
    return done


@pytest.mark.parametrize("name", EDITS)
def test_a_side_that_did_nothing_changes_nothing(example, name):
    changed = edited(example, name)
    assert merged(example, changed, example).data == changed
    taken = merged(example, example, changed)
    assert taken.conflicts == ()
    assert meaning(parse(taken.data).root) == meaning(parse(changed).root)
    both = merged(example, changed, changed)
    assert (both.data, both.conflicts) == (changed, ())


@settings(max_examples=40, deadline=None)
@given(choice=st.data())
def test_disjoint_edits_give_both_in_either_order(data, choice):
    base = (data / "maps/wkmap_example/restroom.wkmap.urdf").read_bytes()
    names = choice.draw(st.permutations([name for name in EDITS if name not in ("note", "sigma")]))
    cut = choice.draw(st.integers(0, len(names)))
    ours = theirs = everything = base
    for name in names[:cut]:
        ours, everything = edited(ours, name), edited(everything, name)
    for name in names[cut:]:
        theirs, everything = edited(theirs, name), edited(everything, name)
    done = merged(base, ours, theirs)
    assert done.conflicts == ()
    assert said(everything, done.data) == set()
    assert said(merged(base, theirs, ours).data, done.data) == set()


def test_ours_keeps_its_bytes(example):
    ours = edited(edited(example, "form"), "limit").replace(b"  <joint", b"\t<joint")
    done = merged(example, ours, edited(example, "plane"))
    assert done.data == ours.replace(b'scan_plane="0.30"', b'scan_plane="0.35"')


def test_an_added_element_brings_its_remark_but_not_one_that_is_there(example):
    base = example.replace(b"</robot>", b"  <!-- end -->\n</robot>")
    theirs = base.replace(b"</robot>", f"  <!-- a bin -->\n  {BIN}\n</robot>".encode())
    done = merged(base, edited(base, "limit"), theirs)
    assert done.data.count(b"<!-- end -->") == 1
    assert done.data.count(b"<!-- a bin -->") == 1


# -------------------------------------------------------------------------------------------------- conflicts

CONFLICTS = (
    ("limit", (b'upper="1.5708"', b'upper="2.0"'), "@upper", "1.5708", "1.92", "2"),
    (
        "move",
        (b'"wall_mid"/><origin xyz="0 2.06 0"', b'"wall_mid"/><origin xyz="0 2.5 0"'),
        "origin",
        "2.06",
        "2.09",
        "2.5",
    ),
    ("class", (b'class="urinal"/>\n', b'class="toilet"/>\n'), "@class", "urinal", "sink", "toilet"),
    (
        "part",
        (b'size="0.32 0.35 0.60"', b'size="0.3 0.35 0.60"'),
        "urinal_1.body",
        "0.32 0.35",
        "0.32 0.40",
        "0.3 0.35",
    ),
    ("gone", (b'size="0.50 0.36 0.40"', b'size="0.50 0.40 0.40"'), "toilet_1", "0.36", "", "0.40 0.40"),
    ("new", (b"</robot>", BIN.replace("0.6", "0.8").encode() + b"</robot>"), "bin", "", "0.6", "0.8"),
)


@pytest.mark.parametrize(("name", "other", "place", "base", "mine", "its"), CONFLICTS, ids=[c[0] for c in CONFLICTS])
def test_what_both_changed_is_named_with_both_values(example, name, other, place, base, mine, its):
    ours, theirs = edited(example, name), example.replace(*other)
    done = merged(example, ours, theirs)
    (conflict,) = done.conflicts
    assert place in conflict.place
    for word, text in ((base, conflict.base), (mine, conflict.ours), (its, conflict.theirs)):
        assert word in text
    assert done.data == ours
    assert said(merged(example, ours, theirs, favour="theirs").data, theirs) == set()
    swapped = merged(example, theirs, ours)
    assert [(c.ours, c.theirs) for c in swapped.conflicts] == [(conflict.theirs, conflict.ours)]


def test_a_link_that_one_side_removes_and_the_other_moves_comes_with_its_joint(example):
    ours, theirs = (
        edited(example, "gone"),
        example.replace(b'"toilet_1"/><origin xyz="4.9', b'"toilet_1"/><origin xyz="4.7'),
    )
    for a, b in ((ours, theirs), (theirs, ours)):
        (conflict,) = merged(example, a, b).conflicts
        assert "toilet_1" in conflict.place
        assert merged(example, a, b).data == a
        assert said(merged(example, a, b, favour="theirs").data, b) == set()


# ---------------------------------------------------------------------------------------------------- renames


def test_a_rename_here_and_a_change_there_are_both_made(example):
    new_name = renamed(parse(example), {"wall_mid": "divider"})
    assert said(example, new_name) == {"wall_mid renamed to divider"}
    changed = edited(edited(example, "move"), "limit")
    for ours, theirs in ((new_name, changed), (changed, new_name)):
        done = merged(example, ours, theirs)
        assert done.conflicts == ()
        assert said(renamed(parse(changed), {"wall_mid": "divider"}), done.data) == set()
        assert b"wall_mid" not in done.data.replace(b"at_wall_mid", b"")


def test_a_rename_reaches_every_reference():
    text = robot(box("bin", "1 1 1"), placed("bin", "1 3 0"), '<gazebo reference="bin"/>')
    new_name = renamed(parse(text), {"bin": "basket"})
    assert new_name == text.replace(b'"bin', b'"basket')


def test_two_names_for_one_link_are_a_conflict(example):
    ours, theirs = (renamed(parse(example), {"sink_1": name}) for name in ("basin", "lavabo"))
    done = merged(example, ours, theirs)
    assert [(c.base, c.ours, c.theirs) for c in done.conflicts] == [("sink_1", "basin", "lavabo")]
    assert done.data == ours
    assert said(merged(example, ours, theirs, favour="theirs").data, theirs) == set()


# ----------------------------------------------------------------------------------------------------- corners


def test_formatting_of_either_side_is_no_change(example):
    ours = edited(example, "limit")
    done = merged(example, ours, canonical(parse(example)))
    assert (done.data, done.conflicts) == (ours, ())


def test_a_prefix_that_theirs_adds_comes_along_and_one_of_two_meanings_is_refused():
    base = robot(*ring("w", 0, 0, 4, 3))
    theirs = base.replace(b'xmlns:wk="urn:wallkit:map:1"', b'xmlns:wk="urn:wallkit:map:1" xmlns:o="urn:o"')
    theirs = theirs.replace(b"</robot>", b"<o:note/></robot>")
    done = merged(base, base, theirs)
    assert meaning(parse(done.data).root) == meaning(parse(theirs).root)
    ours = base.replace(b'xmlns:wk="urn:wallkit:map:1"', b'xmlns:wk="urn:wallkit:map:1" xmlns:o="urn:p"')
    with pytest.raises(MapError, match="xmlns:o is 'urn:p' here and 'urn:o'"):
        merged(base, ours, theirs)


def test_torn_files_are_refused():
    with pytest.raises(MapError):
        merge_maps(parse(b"<robot>"), parse(robot()), parse(robot()))
