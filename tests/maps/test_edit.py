"""Every editing verb on one floor: own bytes only, a file that parses, words, refusals; yourdfpy places it alike."""

from __future__ import annotations

import math
import random
import re

import numpy as np
import pytest

from tests.maps.floor import CUT, FLOOR, JUDGED, P1, SPLIT, context_of, done
from wallkit.errors import MapError
from wallkit.maps.classes import ClassInfo
from wallkit.maps.document import apply_edits
from wallkit.maps.draft.draft import DraftOpening, DraftWall
from wallkit.maps.edit import place, snap
from wallkit.maps.edit.add import add_class, add_fixture, add_room, add_wall
from wallkit.maps.edit.add_openings import DoorWords, Place, add_door
from wallkit.maps.edit.adopt import adopt
from wallkit.maps.edit.changes import number_like
from wallkit.maps.edit.copy import array
from wallkit.maps.edit.cut import cut, fill
from wallkit.maps.edit.origin import Survey, reorigin, survey
from wallkit.maps.edit.place import move, rotate
from wallkit.maps.edit.rename import rename
from wallkit.maps.edit.tree import remove, reparent
from wallkit.maps.edit.units import scale
from wallkit.maps.edit.values import set_values
from wallkit.maps.edit.verbs import VERBS
from wallkit.maps.edit.walls import join, split
from wallkit.maps.rules import validate
from wallkit.maps.rules.base import Context
from wallkit.maps.xml import parse


def test_the_map_drawn_here_is_clean():
    assert [f for f in validate(FLOOR, select=JUDGED).findings if f.severity != "info"] == []


# ---------------------------------------------------------------------------------------------------- contract

# verb -> (file, arguments, names of elements whose bytes may change, words that are said)
EXAMPLES = {
    "add wall": (FLOOR, (DraftWall("wall_x", (2.5, -0.05), (2.5, 2.05), 0.1, 2.5),), (), "wall_x: added"),
    "add door": (FLOOR, (Place("wall_e", (0.5, 1.4), (0, 2.1)), DoorWords()), ("wall_e",), "connects outside and hall"),
    "add window": (FLOOR, (Place("wall_n", (1.0, 2.0), (1.0, 2.0)),), ("wall_n",), "window_1: added"),
    "add fixture": (FLOOR, ("sink",), (), "on wall_mid at 2.4 m, left side (wash)"),
    "add room": (done(FLOOR, remove, "hall"), ("hall", "corridor"), (), "8 m2"),
    "add class": (FLOOR, (ClassInfo("locker", (14,), movable=True),), (), "seg 14"),
    "array": (FLOOR, ("urinal_1", 3, (-0.75, 0, 0)), (), "urinal_3: added"),
    "move": (FLOOR, ("sink_1", (0.1, 0, 0)), ("at_sink_1",), "3.2 2.1 0 -> 3.3 2.1 0"),
    "rotate": (FLOOR, ("sink_1", 0.1), ("at_sink_1",), "1.570796 -> 1.670796 rad"),
    "rename": (FLOOR, ("sink_1", "basin"), ("sink_1", "at_sink_1"), "sink_1 -> basin"),
    "remove": (FLOOR, ("sink_1",), ("sink_1", "at_sink_1"), "sink_1: removed (sink)"),
    "reparent": (FLOOR, ("sink_1", "map"), ("at_sink_1",), "wall_mid -> map"),
    "snap": (
        FLOOR.replace(b'4.05 0 0" rpy="0 0 1.5707963', b'4.05 0 0" rpy="0 0 1.5607963'),
        (),
        ("at_wall_e",),
        "1.570796",
    ),
    "cut": (FLOOR, ("wall_s", P1), ("wall_s",), "0.5 to 1.5 m along"),
    "fill": (CUT, ("p1",), ("wall_s",), "opening p1: removed"),
    "split": (FLOOR, ("wall_mid", 2.5), ("wall_mid", "at_sink_1"), "sink_1: hangs on wall_mid -> wall_mid_b"),
    "join": (
        SPLIT,
        ("wall_mid", "wall_mid_b"),
        ("wall_mid", "wall_mid_b", "at_wall_mid_b", "at_sink_1"),
        "wall_mid_b: removed",
    ),
    "adopt": (FLOOR.replace(b'<wk:object class="sink"/>', b""), (), ("sink_1",), "sink: 1 link"),
    "scale": (FLOOR, (2.0, ("sink_1",)), ("sink_1",), "5 numbers times 2"),
    "origin": (
        FLOOR,
        ((1.0, 0.0, 0.0),),
        (*(f"at_wall_{w}" for w in ("s", "n", "w", "e", "mid")), "hall", "wash", "wk:origin"),
        "now at (1, 0)",
    ),
    "set": (FLOOR, ("sink_1", {"sigma": "0.02"}), ("sink_1",), "sigma nothing -> 0.02"),
}
KWARGS = {"add fixture": {"on": ("wall_mid", 2.4, "wash")}, "add room": {"at": (1.0, 1.0)}}


def example(name: str):
    data, args, own, words = EXAMPLES[name]
    context = context_of(data)
    return data, VERBS[name](context, *args, **KWARGS.get(name, {})), own, words


def test_every_verb_has_an_example():
    assert set(EXAMPLES) == set(VERBS)


@pytest.mark.parametrize("name", VERBS)
def test_a_verb_changes_the_bytes_of_its_own_elements_only(name):
    data, changes, own, words = example(name)
    assert changes.edits
    assert words in "\n".join(changes.said)
    root = context_of(data).root
    spans = [e.span for e in root.iter() if e.get("name") in own or e.get("id") in own or e.name in own]
    for edit in changes.edits:
        inside = any(span.offset <= edit.offset and edit.offset + edit.length <= span.end for span in spans)
        # an element that goes takes the line end before it along; an insertion stands between elements
        goes = (
            edit.text == b""
            and data[edit.offset : edit.offset + edit.length].lstrip()[:1] == b"<"
            and any(edit.offset + edit.length == span.end for span in spans)
        )
        between = (
            edit.length == 0 and edit.text.strip().startswith(b"<") and data[edit.offset - 1 : edit.offset] == b">"
        )
        assert inside or goes or between, data[edit.offset : edit.offset + edit.length]


@pytest.mark.parametrize("name", VERBS)
def test_what_a_verb_leaves_parses_keeps_comments_and_has_no_new_error(name):
    data, changes, *_ = example(name)
    after = apply_edits(data, changes.edits)
    assert re.findall(b"<!--.*?-->", after) == re.findall(b"<!--.*?-->", data)
    before = {f.code for f in validate(data, select=JUDGED).findings if f.severity == "error"}
    new = {f.code for f in validate(after, select=JUDGED).findings if f.severity == "error"} - before
    # a wall through a room, and a sink turned into its wall, are what was asked for
    assert new <= ({"WK-T003"} if name == "add wall" else {"WK-E010"} if name == "rotate" else set())


@pytest.mark.parametrize("name", VERBS)
def test_a_verb_writes_in_the_files_own_manner(name):
    """With other line ends, another prefix and another encoding the same edit says the same."""
    data, *_ = EXAMPLES[name]
    args, kwargs = EXAMPLES[name][1], KWARGS.get(name, {})
    plain = done(data, VERBS[name], *args, **kwargs)

    def foreign(text: bytes) -> bytes:
        text = text.replace(b"UTF-8", b"iso-8859-1").replace(b"drawn by hand", b"gez\xe4hlt")
        return (
            text.replace(b"xmlns:wk", b"xmlns:k")
            .replace(b"<wk:", b"<k:")
            .replace(b"</wk:", b"</k:")
            .replace(b"\n", b"\r\n")
        )

    assert done(foreign(data), VERBS[name], *args, **kwargs) == foreign(plain)


@pytest.mark.parametrize(
    ("verb", "args"),
    [
        (move, ("snk_1", (1, 0, 0))),
        (rotate, ("snk_1", 1.0)),
        (rename, ("snk_1", "x")),
        (remove, ("snk_1",)),
        (reparent, ("snk_1", "map")),
        (array, ("snk_1", 2, (1, 0, 0))),
        (scale, (2.0, ("snk_1",))),
    ],
)
def test_an_unknown_name_is_answered_with_the_closest(verb, args):
    with pytest.raises(MapError) as refused:
        verb(context_of(FLOOR), *args)
    assert "'snk_1'" in refused.value.message
    assert "did you mean 'sink_1'" in refused.value.hint


@pytest.mark.parametrize("name", ["add wall", "add fixture", "add class"])
def test_add_then_remove_are_the_same_bytes(name):
    data, changes, *_ = example(name)
    added = {"add wall": "wall_x", "add fixture": "sink_2", "add class": "locker"}[name]
    assert done(apply_edits(data, changes.edits), remove, added) == data


# ----------------------------------------------------------------------------------------------------- numbers


@pytest.mark.parametrize(
    ("word", "value", "text"),
    [
        ("0.50", 0.5, "0.50"),
        ("0.50", 0.75, "0.75"),
        ("0.50", 1.0, "1.00"),
        ("4.0", 0.0, "0"),
        ("1", -0.0000001, "0"),
        ("3", 1 / 3, "0.333333"),
        ("1e-1", 0.1, "1e-1"),
        ("1e-1", 0.2, "0.2"),
        ("", -1.25, "-1.25"),
        ("0.1234567", 0.5, "0.500000"),
    ],
)
def test_a_number_is_written_like_the_one_it_replaces(word, value, text):
    assert number_like(word, value) == text
    # where no number of the file has zeros at its end, none gets them
    short = text.rstrip("0").rstrip(".") if "." in text and text != word else text
    assert number_like(word, value, keeps_zeros=False) == short


@pytest.mark.parametrize(
    ("verb", "args"), [(move, ("sink_1", (1, 0, 0))), (rotate, ("sink_1", 1.0)), (reorigin, ((1.0, 0.0, 0.0),))]
)
def test_what_cannot_be_read_is_not_written_anew(verb, args):
    data = FLOOR.replace(b'"3.2 0.05 0"', b'"3,2 0.05 0"').replace(b'"-0.1 5.15 0"', b'"-0.1 nan 0"')
    with pytest.raises(MapError, match="cannot be read") as refused:
        verb(context_of(data), *args)
    assert refused.value.where.startswith("t.urdf:")


def test_what_other_programs_draw_is_named():
    data = FLOOR.replace(b'<collision name="wall_s.run">', b"<visual><geometry/></visual><collision name='wall_s.run'>")
    assert "wall_s: its 1 <visual> stays as before" in cut(context_of(data), "wall_s", P1).said


# ---------------------------------------------------------------------------------------------------- refusals


@pytest.mark.parametrize(
    ("verb", "args", "said"),
    [
        (move, ("map", (1, 0, 0)), "'map' hangs on nothing"),
        (move, ("door_1", (0.1, 0, 0)), "fills opening 'd1'"),
        (rotate, ("door_1", 0.1), "fills opening 'd1'"),
        (place.move_opening, ("d1", 2.5), "would reach from 3.5 to 4.4 m, wall 'wall_mid' goes from 0 to 4 m"),
        (place.move_opening, ("d2", 2.5), "no opening 'd2'"),
        (array, ("urinal_1", 1, (1, 0, 0)), "a row of 1"),
        (array, ("urinal_1", 3, (0, 0, 0)), "0 m"),
        (array, ("urinal_1", 3, (0.5, 0, 0)), "4.325 to 5.675 m, wall 'wall_w' goes from 0 to 5.1 m"),
        (array, ("wall_mid", 2, (0, 1, 0)), "hangs on 'wall_mid'"),
        (array, ("door_1", 2, (1, 0, 0)), "moves"),
        (reparent, ("wall_mid", "sink_1"), "'sink_1' hangs on 'wall_mid' itself"),
        (reparent, ("door_1", "wall_n"), "fills opening 'd1'"),
        (remove, ("wall_mid",), "'door_1', 'sink_1' hang on 'wall_mid'"),
        (remove, ("map",), "what everything hangs on"),
        (remove, ("wall",), "elements are of class 'wall'"),
        (rename, ("map", "world"), "the map's root"),
        (rename, ("sink_1", "urinal_1"), "taken"),
        (rename, ("sink_1", "a b"), "no name"),
        (rename, ("urinal", "pissoir"), "the taxonomy's"),
        (rename, ("hall", "wash"), "a room 'wash' already"),
        (fill, ("d1",), "'door_1' fills opening 'd1'"),
        (cut, ("wall_s", DraftOpening("p", "passage", (3.5, 4.5), (0, 2))), "leaves wall 'wall_s', 0 to 4.2 m"),
        (cut, ("wall_s", DraftOpening("p", "passage", (1, 2), (0, 3))), "0 to 3 m up, leaves wall"),
        (cut, ("wall_s", DraftOpening("p", "passage", (2, 1), (0, 2))), "is empty"),
        (cut, ("wall_s", DraftOpening("d1", "passage", (1, 2), (0, 2))), "an opening 'd1' already"),
        (cut, ("wall_mid", DraftOpening("p", "passage", (1.5, 2.5), (0, 2))), "overlaps opening 'd1', 1 to 1.9 m"),
        (cut, ("sink_1", DraftOpening("p", "passage", (1, 2), (0, 2))), "no wall but sink"),
        (split, ("wall_mid", 1.5), "lies in opening 'd1', 1 to 1.9 m"),
        (split, ("wall_mid", 4.0), "not inside wall 'wall_mid', 0 to 4 m"),
        (split, ("wall_mid", 3.0, "wall_e"), "'wall_e' is taken"),
        (join, ("wall_s", "wall_e"), "90 deg off"),
        (join, ("wall_s", "wall_n"), "5.2 m beside"),
        (join, ("wall_s", "wall_s"), "itself"),
        (scale, (-1.0,), "-1"),
        (scale, (1.0,), "1"),
        (add_wall, (DraftWall("wall_s", (0, 0), (1, 0), 0.1),), "taken"),
        (add_wall, (DraftWall("x", (0, 0), (0, 0), 0.1),), "a length of 0 m"),
        (add_wall, (DraftWall("x", (0, 0), (1, 0), -0.1),), "a thickness of -0.1 m"),
        (add_room, ("hall",), "a room 'hall' already"),
        (add_class, (ClassInfo("wall"),), "has 'wall' already"),
        (add_class, (ClassInfo("x", (1,)),), "class 'wall' has the segmentation id 1"),
        (add_class, (ClassInfo("x", p_return=1.5),), "p_return is 1.5"),
        (add_fixture, ("snk",), "no class 'snk'"),
        (add_fixture, ("sink",), "where does 'sink_2' stand"),
        (set_values, ("sink_1", {"class": "snk"}), "no class 'snk'"),
        (set_values, ("sink_1", {"sigma": "2cm"}), "not 1 number: '2cm'"),
        (set_values, ("sink_1", {"sigma": "-1"}), "sigma=-1"),
        (set_values, ("sink_1", {"sigm": "1"}), "no attribute 'sigm'"),
        (set_values, ("sink_1", {"class": ""}), "cannot do without class"),
        (set_values, ("door_1", {"prior": "closed:0.7"}), "no distribution"),
        (set_values, ("d1", {"along": "1 2"}), "not set alone"),
        (set_values, ("wall", {"lidar": "glas"}), "lidar=glas"),
        (set_values, ("door_1", {"connects": "hall wsh"}), "no room 'wsh'"),
        (set_values, ("nobody", {"class": "sink"}), "nothing is named 'nobody'"),
        (reorigin, ((math.inf, 0, 0),), "no place"),
        (survey, (Survey(east_m=1.0, epsg=None),), None),
    ],
)
def test_what_makes_no_sense_is_refused_with_its_numbers(verb, args, said):
    context = context_of(FLOOR)
    if said is None:
        assert verb(context, *args).edits
        return
    with pytest.raises(MapError) as refused:
        verb(context, *args)
    assert said in refused.value.message
    assert refused.value.hint


# ---------------------------------------------------------------------------------------------- yourdfpy agrees


@pytest.mark.parametrize("name", VERBS)
def test_yourdfpy_places_every_link_where_we_do(name, tmp_path):
    import yourdfpy

    data, changes, *_ = example(name)
    after = apply_edits(data, changes.edits)
    path = tmp_path / "t.urdf"
    path.write_bytes(after)
    robot = yourdfpy.URDF.load(str(path), build_scene_graph=True, load_meshes=False)
    for link, T in context_of(after).map.poses().items():
        np.testing.assert_allclose(robot.get_transform(link, "map"), T, atol=1e-9)


# ----------------------------------------------------------------------------------------- on the real example


@pytest.fixture(scope="module")
def restroom(data) -> bytes:
    return (data / "maps/wkmap_example/restroom.wkmap.urdf").read_bytes()


@pytest.mark.parametrize(
    ("there", "back"),
    [
        ((move, "toilet_1", (0, -0.1, 0)), (move, "toilet_1", (0, 0.1, 0))),
        ((move, "wall_mid", (0.5, 0.25, 0)), (move, "wall_mid", (-0.5, -0.25, 0))),
        ((rotate, "partition_1", 0.1), (rotate, "partition_1", -0.1)),
        ((rename, "wall_mid", "wall_m"), (rename, "wall_m", "wall_mid")),
        ((rename, "restroom_m", "men"), (rename, "men", "restroom_m")),
        ((rename, "door_m", "gate"), (rename, "gate", "door_m")),
        ((reparent, "toilet_1", "map"), (reparent, "toilet_1", "wall_e")),
        ((cut, "wall_s", DraftOpening("p1", "passage", (1.0, 2.2), (0.0, 2.1))), (fill, "p1")),
        ((split, "wall_mid", 2.5), (join, "wall_mid", "wall_mid_b")),
        ((scale, 1000), (scale, 0.001)),
        ((set_values, "wall_n", {"note": "a"}), (set_values, "wall_n", {"note": ""})),
    ],
)
def test_there_and_back_are_the_same_bytes(restroom, there, back):
    after = done(restroom, *there)
    assert after != restroom
    assert done(after, *back) == restroom


@pytest.mark.parametrize("seed", range(12))
def test_edits_one_after_another_leave_a_map_that_yourdfpy_places_alike(restroom, seed, tmp_path):
    """Six edits drawn at random; those that are refused change nothing."""
    import yourdfpy

    rng = random.Random(seed)
    data = restroom

    def shift() -> tuple[float, float, float]:
        return (round(rng.uniform(-1, 1), 3), round(rng.uniform(-1, 1), 3), 0.0)

    for step in range(6):
        links = sorted(context_of(data).map.links)
        name, other = rng.choice(links), rng.choice(links)
        verb, *args = rng.choice(
            [
                (move, name, shift()),
                (rotate, name, round(rng.uniform(-3, 3), 4)),
                (rename, name, f"thing{step}"),
                (reparent, name, other),
                (remove, name),
                (array, name, 3, shift()),
                (split, name, round(rng.uniform(0, 5), 2)),
                (cut, name, DraftOpening(f"o{step}", "passage", (round(rng.uniform(0, 4), 2), 4.5), (0.0, 2.0))),
                (add_door, Place(name, (0.2, 1.0), (0, 2)), DoorWords()),
                (add_fixture, "sink", f"sink{step}"),
                (reorigin, (*shift()[:2], 0.3)),
                (scale, 2.0),
            ]
        )
        try:
            changes = verb(context_of(data), *args)
        except MapError:
            continue
        data = apply_edits(data, changes.edits)
        assert validate(data, select=["X", "S", "G"]).count("error") == 0, changes.said
    path = tmp_path / "t.urdf"
    path.write_bytes(data)
    robot = yourdfpy.URDF.load(str(path), build_scene_graph=True, load_meshes=False)
    poses = context_of(data).map.poses()
    assert set(poses) == set(context_of(data).map.links)
    for link, T in poses.items():
        np.testing.assert_allclose(robot.get_transform(link, "map"), T, atol=1e-9)


def test_no_verb_falls_over_a_faulty_file(data):
    """Refused with a hint, or made and still to be parsed; never a traceback, never a number that is none."""
    refused = made = 0
    for path in sorted((data / "maps/malformed").glob("*/*.urdf")):
        document = parse(path.read_bytes(), path.name)
        if document.root is None:
            continue
        for verb, *args in (
            (move, "toilet_1", (0.1, 0, 0)),
            (rotate, "wall_e", 0.1),
            (
                remove,
                "wall_mid",
            ),
            (reparent, "sink_1", "map"),
            (rename, "wall_mid", "w"),
            (array, "urinal_1", 3, (-0.7, 0, 0)),
            (cut, "wall_s", P1),
            (fill, "d1"),
            (split, "wall_mid", 2.5),
            (join, "wall_s", "wall_n"),
            (scale, 0.001),
            (reorigin, (1.0, 2.0, 0.3)),
            (adopt,),
            (snap.straighten,),
            (set_values, "door_m", {"class": "wall"}),
            (add_wall, DraftWall("new", (1, 1), (2, 1), 0.1)),
            (add_fixture, "sink", "new"),
        ):
            try:
                changes = verb(Context(document), *args)
            except MapError as error:
                refused += 1
                hints = error.hint
            else:
                made += 1
                after = apply_edits(document.data, changes.edits)
                assert parse(after).root is not None, (path.name, verb)
                assert after.count(b"nan") <= document.data.count(b"nan"), (path.name, verb)
                hints = "made"
            assert hints, (path.name, verb)
    assert refused > 100
    assert made > 300
