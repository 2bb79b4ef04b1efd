"""Canonical form: twice is once, nothing that a reader sees changes, remarks stay where they were."""

from __future__ import annotations

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from tests.maps.drawn import HEAD, box, placed, ring, robot
from wallkit.errors import MapError
from wallkit.maps.canonical import DECLARATION, WIDTH, canonical
from wallkit.maps.document import escaped
from wallkit.maps.grammar import TAGS
from wallkit.maps.numbers import numbers_from_text
from wallkit.maps.read import prior_from_text, read_map
from wallkit.maps.rules import validate
from wallkit.maps.xml import parse


def formatted(data: bytes) -> bytes:
    return canonical(parse(data))


def meaning(element):
    """What a reader gets of an element: numbers as numbers, names as words."""
    values = {}
    for name, value in element.attrs.items():
        known = TAGS[element.tag].attributes.get(name) if element.tag in TAGS else None
        numbers = numbers_from_text(value, largest=known.largest) if known else None
        if known and known.kind in ("numbers", "pairs") and numbers is not None:
            values[name] = numbers
        elif known and known.kind in ("names", "integers"):
            values[name] = value.split()
        elif known and known.kind == "prior":
            values[name] = prior_from_text(value) or value
        else:
            values[name] = value
    return element.tag, values, element.text, [meaning(child) for child in element.children]


def map_files(folder):
    return [path for path in sorted(folder.rglob("*")) if path.is_file() and b"<robot" in path.read_bytes()[:20000]]


def test_every_map_of_the_data_formats_once_and_for_all_and_means_the_same(data):
    count = 0
    for path in map_files(data / "maps"):
        document = parse(path.read_bytes(), str(path))
        if document.root is None:
            continue
        count += 1
        once = canonical(document)
        again = parse(once)
        assert canonical(again) == once, path.name
        assert meaning(again.root) == meaning(document.root), path.name
    assert count > 50


def test_formatting_changes_no_pose_and_no_finding(data):
    path = data / "maps/malformed/mutants/door_hits_jamb.wkmap.urdf"
    before, after = path.read_bytes(), formatted(path.read_bytes())
    poses, moved = (read_map(parse(data)).poses() for data in (before, after))
    assert {name: pose.tolist() for name, pose in poses.items()} == {name: p.tolist() for name, p in moved.items()}
    messages = [[(f.code, f.message, f.xyz) for f in validate(data).findings] for data in (before, after)]
    assert messages[0] == messages[1]


# ------------------------------------------------------------------------------------------------ hypothesis

NUMBERS = st.one_of(
    st.floats(-1e5, 1e5, allow_nan=False).map(repr),
    st.sampled_from(["0.30", "1.0", "+2", ".5", "5.", "-0", "1e-3", "2E+2", "0.1234567891234", "1e-20", "000.10"]),
)
WORDS = st.text(st.characters(blacklist_categories=("Cs", "Cc"), blacklist_characters="\ufffe\uffff"), max_size=8)
SPACE = st.text(" \t\n", min_size=1, max_size=4)
COMMENTS = WORDS.map(lambda text: f"<!--{text.replace('-', '')}-->")
VALUES = st.one_of(st.lists(NUMBERS, min_size=3, max_size=3).flatmap(lambda n: SPACE.map(lambda s: s.join(n))), WORDS)


@st.composite
def elements(draw, depth=0):
    """Any nesting of known and unknown elements, remarks, spaces and now and then text."""
    tag = draw(
        st.sampled_from(["link", "joint", "origin", "box", "collision", "wk:object", "wk:room", "gazebo", "o:x"])
    )
    names = draw(
        st.lists(
            st.sampled_from(["name", "xyz", "rpy", "size", "floor", "id", "o:k", "class", "z"]), unique=True, max_size=4
        )
    )
    attributes = "".join(f"{draw(SPACE)}{name}={quoted(draw(VALUES), draw(st.booleans()))}" for name in names)
    children = draw(st.lists(elements(depth=depth + 1), max_size=3)) if depth < 3 else []
    pieces = []
    for child in children:
        pieces += [draw(st.one_of(SPACE, st.just(""), COMMENTS)), child]
    if draw(st.integers(0, 9)) == 0:
        pieces.append(draw(WORDS.map(escaped)))
    if not pieces and draw(st.booleans()):
        return f"<{tag}{attributes}/>"
    return f"<{tag}{attributes}>{''.join(pieces)}</{tag}>"


def quoted(value: str, single: bool) -> str:
    quote = "'" if single else '"'
    return quote + escaped(value) + quote


@pytest.mark.long
@settings(max_examples=150, deadline=None)
@given(st.lists(st.one_of(elements(), COMMENTS, SPACE), max_size=5))
def test_any_document_formats_once_and_for_all_and_means_the_same(pieces):
    head = HEAD.replace(">", ' xmlns:o="urn:other">')
    data = (head + "\n".join(pieces) + "</robot>").encode()
    document = parse(data)
    if document.root is None:
        return
    once = canonical(document)
    again = parse(once)
    assert again.root is not None
    assert canonical(again) == once
    assert meaning(again.root) == meaning(document.root)
    assert sorted(comments(once)) == sorted(comments(data))


def comments(data: bytes) -> list[str]:
    return [piece.partition("-->")[0] for piece in data.decode().split("<!--")[1:]]


# -------------------------------------------------------------------------------------------------- the form


def test_the_form():
    data = robot(
        "<!-- the map -->",
        "",
        "",
        '<wk:map units="m  rad" format="1.0" scan_plane="0.30"><wk:room floor="0 0 4.0 0 4 3.00 0 3" id="hall"/></wk:map>',
        '<link name="leaf"><wk:object class="door"/><!-- oak -->',
        "</link> <!-- not yet hung -->",
        '<joint type="revolute" name="h"><parent link="map"/><child link="leaf"/><axis xyz="0 0 1.0"/>'
        '<limit upper="1.570" lower="0.0"/><wk:state prior="closed:0.70  open:.3" rest="0"/></joint>',
    )
    assert formatted(data.replace(b"\n", b"\r\n")).decode().splitlines() == [
        DECLARATION,
        '<robot name="t" xmlns:wk="urn:wallkit:map:1">',
        '  <link name="map"/>',
        "  <!-- the map -->",
        "",
        '  <wk:map format="1.0" units="m  rad" scan_plane="0.3">',
        '    <wk:room id="hall" floor="0 0  4 0  4 3  0 3"/>',
        "  </wk:map>",
        '  <link name="leaf">',
        '    <wk:object class="door"/> <!-- oak -->',
        "  </link> <!-- not yet hung -->",
        '  <joint name="h" type="revolute">',
        '    <parent link="map"/>',
        '    <child link="leaf"/>',
        '    <axis xyz="0 0 1"/>',
        '    <limit lower="0" upper="1.57"/>',
        '    <wk:state rest="0" prior="closed:0.7 open:0.3"/>',
        "  </joint>",
        "</robot>",
    ]


def test_lines_fit_where_they_can_be_broken():
    text = formatted(robot(*ring("w", 0, 0, 4, 3), box("a", "1 2 3"), placed("a", "0.123456 2 3"))).decode()
    assert max(map(len, text.splitlines())) <= WIDTH
    assert '    <collision name="a.body"><origin xyz="0 0 0" rpy="0 0 0"/><geometry><box size="1 2 3"/>' in text


def test_what_holds_text_stays_to_the_byte():
    plugin = '<plugin  name = "p" >\n   some   <b c="1.0"/> text\n</plugin>'
    assert plugin.encode() in formatted(robot(f"<gazebo>{plugin}</gazebo>"))


def test_wrong_numbers_stay_as_they_are():
    data = robot('<link name="a"><collision><origin xyz="1,0 0 0.10"/></collision></link>')
    assert b'xyz="1,0 0 0.10"' in formatted(data)


@pytest.mark.parametrize("value", ["a&amp;b", "a&#10;b", "&lt;&quot;'"])
def test_escapes_survive(value):
    (link,) = parse(formatted(robot(f'<link name="{value}"/>'))).root.findall("link")[1:]
    assert link.get("name") == parse(robot(f'<link name="{value}"/>')).root.findall("link")[1].get("name")


def test_other_encodings_become_utf_8():
    data = '<?xml version="1.0" encoding="iso-8859-1"?><robot name="Gebäude"/>'.encode("latin-1")
    assert formatted(data) == f'{DECLARATION}\n<robot name="Gebäude"/>\n'.encode()


def test_remarks_around_the_root_stay():
    data = b"<?xml version='1.0'?>\n<!-- a -->\n<?style x?>\n<robot name='t'/>\n<!-- z -->"
    assert formatted(data).decode() == f'{DECLARATION}\n<!-- a -->\n<?style x?>\n<robot name="t"/>\n<!-- z -->\n'


def test_torn_files_are_refused_with_their_place():
    with pytest.raises(MapError, match="open here: robot") as error:
        canonical(parse(b"<robot>", "a.urdf"))
    assert error.value.where.startswith("a.urdf:1:")
