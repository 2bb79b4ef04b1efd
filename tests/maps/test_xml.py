"""Bytes -> a tree that knows its places: against a writer that notes them, against lxml, and by slicing the bytes."""

from __future__ import annotations

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from lxml import etree

from tests.maps.drawn import HEAD, many_walls, robot
from wallkit.maps.document import WK_NAMESPACE, Edit, apply_edits, escaped, wk
from wallkit.maps.xml import MAX_DEPTH, MAX_ELEMENTS, parse

NAMES = st.sampled_from(["link", "a", "wk:object", "größe", "x.y-1"])
KEYS = st.lists(st.sampled_from(["name", "xyz", "size", "ß", "wk:id"]), unique=True, max_size=3)
VALUES = st.text(st.sampled_from("aß0 .&<>'\"/=\n"), max_size=8)
SPACES = st.sampled_from([" ", "\n  ", "  "])


@st.composite
def elements(draw, depth=0):
    """(name, [(key, value, space, quote, around '=')], children or None for <empty/>)."""
    keys = draw(KEYS)
    attributes = [
        (key, draw(VALUES), draw(SPACES), draw(st.sampled_from("\"'")), draw(st.sampled_from(["=", " = "])))
        for key in keys
    ]
    children = draw(st.one_of(st.none(), st.lists(elements(depth + 1), max_size=3))) if depth < 3 else None
    return draw(NAMES), attributes, children


class Writer:
    """Writes a drawn element and notes where everything went, in order of the start tags."""

    def __init__(self, head: bytes) -> None:
        self.data = bytearray(head)
        self.noted: list[dict] = []

    def add(self, text: str) -> None:
        self.data += text.encode()

    def write(self, element, extra="") -> bytes:
        name, attributes, children = element
        note = {"name": name, "start": len(self.data), "attributes": [], "values": []}
        self.noted.append(note)
        self.add(f"<{name}{extra}")
        for key, value, space, quote, equals in attributes:
            self.add(space)
            begin = len(self.data)
            self.add(f"{key}{equals}{quote}")
            inside = len(self.data)
            self.add(escaped(value))
            note["attributes"].append((begin, len(self.data) + 1))
            note["values"].append((inside, len(self.data), value.replace("\n", " ")))
            self.add(quote)
        self.add("/>" if children is None else ">")
        note["start_end"] = len(self.data)
        if children is not None:
            for child in children:
                self.add("\n<!-- <x/> -->/>")
                self.write(child)
            self.add(f"</{name} >")
        note["end"] = len(self.data)
        return bytes(self.data)


@settings(max_examples=150, deadline=None)
@given(elements(), st.sampled_from([b"", b"\xef\xbb\xbf", b"\xef\xbb\xbf<?xml version='1.0'?>\r\n<!-- \xc3\xa4 -->"]))
def test_every_place_is_where_the_writer_put_it(element, head):
    writer = Writer(head)
    data = writer.write(element, f' xmlns:wk="{WK_NAMESPACE}"')
    document = parse(data)
    assert document.root is not None, document.faults
    found = list(document.root.iter())
    assert [e.name for e in found] == [note["name"] for note in writer.noted]
    for e, note in zip(found, writer.noted, strict=True):
        assert (e.span.offset, e.span.end) == (note["start"], note["end"])
        assert (e.start_span.offset, e.start_span.end) == (note["start"], note["start_end"])
        attributes = [a for a in e.attributes if a.name != "xmlns:wk"]
        assert [(a.span.offset, a.span.end) for a in attributes] == note["attributes"]
        assert [(a.value_span.offset, a.value_span.end, a.value) for a in attributes] == note["values"]
        assert list(e.attrs) == [a.name for a in attributes]
        before = data[: e.offset].removeprefix(b"\xef\xbb\xbf").decode()
        assert (e.span.line, e.span.column) == (before.count("\n") + 1, len(before) - before.rfind("\n"))


@settings(max_examples=50, deadline=None)
@given(elements())
def test_tags_values_lines_and_paths_agree_with_lxml(element):
    data = Writer(b"<?xml version='1.0'?>\n").write(element, f' xmlns:wk="{WK_NAMESPACE}"')
    ours = list(parse(data).root.iter())
    tree = etree.fromstring(data)
    theirs = list(tree.iter(etree.Element))
    assert [(e.tag, e.attrs, e.span.line) for e in ours] == [
        # libxml2 gives the line a start tag ends on
        (t.tag, dict(t.attrib), t.sourceline - data[e.offset : e.start_span.end].count(b"\n"))
        for e, t in zip(ours, theirs, strict=True)
    ]
    for e, t in zip(ours, theirs, strict=True):
        assert tree.getroottree().xpath(e.xpath, namespaces={"wk": WK_NAMESPACE}) == [t]


def test_names_in_paths_only_where_they_tell_siblings_apart():
    data = robot('<link name="a"/><link name="a"/><link name="b"><visual/></link>')
    paths = [e.xpath for e in parse(data).root.children]
    assert paths == [
        "/robot/link[@name='map']",
        "/robot/link[2]",
        "/robot/link[3]",
        "/robot/link[@name='b']",
    ]


@settings(max_examples=300, deadline=None)
@given(
    st.one_of(st.binary(max_size=200), st.text(st.sampled_from("<>/ab:=\"'&;!?[]- \n\0ä"), max_size=60).map(str.encode))
)
def test_no_bytes_raise(data):
    document = parse(data)
    assert (document.root is None) == any(
        f.kind not in ("undeclared-prefix", "instruction", "declaration") for f in document.faults
    )
    for fault in document.faults:
        assert 0 <= fault.span.offset <= fault.span.end <= len(data)


@settings(max_examples=200, deadline=None)
@given(st.integers(0, 2**31), st.integers(1, 6))
def test_no_damage_to_a_map_raises(seed, changes):
    import random

    rng = random.Random(seed)
    data = bytearray(many_walls(4))
    for _ in range(changes):
        data[rng.randrange(len(data))] = rng.randrange(256)
    document = parse(bytes(data))
    if document.root is not None:
        assert all(document.data[e.offset] == ord("<") and e.span.end <= len(data) for e in document.root.iter())


@pytest.mark.parametrize(
    ("data", "kind", "offset"),
    [
        (b"", "not-well-formed", 0),
        (b"<robot><link></robot>", "not-well-formed", 15),
        (b'<r a="1" a="2"/>', "not-well-formed", 9),
        (b'<r xmlns:a="u" xmlns:b="u" a:x="1" b:x="2"/>', "not-well-formed", 0),
        (b"<r>&nowhere;</r>", "not-well-formed", 3),
        (b'<?xml version="1.0"?><!-- <!DOCTYPE --><!DOCTYPE r [<!ENTITY a "b">]><r>&a;</r>', "doctype", 39),
        (b"<r>\xe9</r>", "encoding", 3),
        (b"<r>\x01</r>", "encoding", 3),
        ("<r/>".encode("utf-16"), "encoding", 0),
        (b'<?xml version="1.0" encoding="UTF-16"?><r/>', "encoding", 30),
        (b'<?xml version="1.0" encoding="nonsense"?><r/>', "encoding", 30),
        (b"<r>" + b"<a>" * MAX_DEPTH + b"</a>" * MAX_DEPTH + b"</r>", "too-large", 3 * MAX_DEPTH),
    ],
)
def test_what_cannot_be_read_is_one_fault_at_its_place(data, kind, offset):
    document = parse(data)
    assert document.root is None
    assert [(f.kind, f.span.offset) for f in document.faults] == [(kind, offset)]


def test_elements_and_bytes_are_counted(monkeypatch):
    full = parse(b"<r>" + b"<a/>" * (MAX_ELEMENTS - 1) + b"</r>")
    assert full.root is not None
    assert parse(b"<r>" + b"<a/>" * MAX_ELEMENTS + b"</r>").faults[0].kind == "too-large"
    monkeypatch.setattr("wallkit.maps.xml.MAX_BYTES", 10)
    assert [f.kind for f in parse(b"<robot></robot>").faults] == ["too-large"]


def test_an_undeclared_prefix_is_told_once_and_reading_goes_on():
    document = parse(b'<robot><wk:map wk:a="1"/><wk:map/><x:y/></robot>')
    assert [(f.kind, f.subject, document.slice(f.span)) for f in document.faults] == [
        ("undeclared-prefix", "wk", "wk:map"),
        ("undeclared-prefix", "x", "x:y"),
    ]
    assert [e.tag for e in document.root.children] == [wk("map"), wk("map"), "{undeclared:x}y"]
    # only elements are taken for wallkit's: it has no attributes of its own
    assert list(document.root.children[0].attrs) == ["{undeclared:wk}a"]


def test_namespaces_follow_their_scope():
    data = b'<a xmlns="u"><b xmlns=""><c/></b><d xmlns:p="v" p:k="1"/></a>'
    assert [e.tag for e in parse(data).root.iter()] == ["{u}a", "b", "c", "{u}d"]
    assert parse(data).root.children[1].attrs == {"{v}k": "1"}


def test_latin_1_is_read_when_it_is_declared():
    document = parse('<?xml version="1.0" encoding="ISO-8859-1"?>\n<ü n="é" m="1"/>'.encode("latin-1"))
    assert [f.kind for f in document.faults] == ["declaration"]
    assert document.root.get("n") == "é"
    assert document.root.attribute("m").span.column == 10


def test_instructions_inside_the_tree_name_their_element():
    fault = parse(HEAD.encode() + b"<geometry><?x y?></geometry></robot>").faults[0]
    assert (fault.kind, fault.subject, fault.element.tag) == ("instruction", "x", "geometry")


@settings(max_examples=200, deadline=None)
@given(st.binary(max_size=60), st.data())
def test_edits_change_their_bytes_and_no_others(data, draw):
    cuts = sorted(draw.draw(st.lists(st.integers(0, len(data)), max_size=8, unique=True)))
    spans = list(zip(cuts[::2], cuts[1::2], strict=False))
    edits = [Edit(a, b - a, draw.draw(st.binary(max_size=4))) for a, b in spans]
    kept, position = b"", 0
    for edit in edits:
        kept += data[position : edit.offset] + edit.text
        position = edit.offset + edit.length
    shuffled = draw.draw(st.permutations(edits + edits[:1]))
    assert apply_edits(data, shuffled) == kept + data[position:]


@pytest.mark.parametrize("edits", [[Edit(0, 3, b""), Edit(2, 1, b"x")], [Edit(4, 3, b"")], [Edit(-1, 1, b"")]])
def test_edits_that_overlap_or_leave_the_file_are_refused(edits):
    with pytest.raises(ValueError, match="overlaps"):
        apply_edits(b"abcdef", edits)


def test_an_attribute_gets_any_value():
    data = b"<a k='1' l=\"2\"/>"
    root = parse(data).root
    for name in ("k", "l"):
        changed = apply_edits(data, [root.attribute(name).replaced_by("<\"'&é")])
        assert parse(changed).root.get(name) == "<\"'&é"
