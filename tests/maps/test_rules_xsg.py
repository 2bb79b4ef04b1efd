"""Rules X, S and G where their examples leave room: what is said, where, and what is left alone."""

from __future__ import annotations

import pytest

from tests.maps.drawn import HEAD, box, placed, robot
from wallkit.maps.document import apply_edits
from wallkit.maps.rules import validate
from wallkit.maps.rules.tolerances import Tolerances
from wallkit.maps.xml import parse


def found(data, code, **options):
    return [f for f in validate(data, **options).findings if f.code == code]


def hinge(name="j", limit='<limit lower="0" upper="1" effort="1" velocity="1"/>', kind="revolute", more=""):
    joint = f'<joint name="{name}" type="{kind}"><parent link="map"/><child link="{name}_leaf"/>{limit}{more}</joint>'
    return f'<link name="{name}_leaf"/>{joint}'


# ---------------------------------------------------------------------------------------------------- X


def test_a_byte_order_mark_is_only_told():
    data = b"\xef\xbb\xbf" + robot()
    (mark,) = found(data, "WK-X004")
    assert (mark.severity, mark.line, mark.column) == ("info", 1, 1)
    assert apply_edits(data, mark.fix.edits) == robot()


def test_a_latin_1_file_is_turned_into_utf_8_by_its_repair():
    text = '<?xml version="1.0" encoding="ISO-8859-1"?>\n<robot name="größe"><link name="map"/></robot>'
    (finding,) = found(text.encode("latin-1"), "WK-X004")
    assert finding.severity == "warning"
    assert apply_edits(text.encode("latin-1"), finding.fix.edits).decode() == text.replace("ISO-8859-1", "UTF-8")


def test_repairs_of_a_latin_1_file_stay_latin_1():
    head = '<?xml version="1.0" encoding="ISO-8859-1"?>\n'
    data = (head + HEAD + '<link name="wänd"/><link name="wänd"/></robot>').encode("latin-1")
    (finding,) = found(data, "WK-G001")
    assert parse(apply_edits(data, finding.fix.edits)).root.children[1].get("name") == "wänd_2"


def test_mixed_line_ends_become_the_usual_one():
    data = b'<robot name="t">\r\n<link name="map"/>\r\n\n</robot>\r\n'
    (finding,) = found(data, "WK-X006")
    assert "3 x CRLF, 1 x LF" in finding.message
    assert apply_edits(data, finding.fix.edits).count(b"\r\n") == 4
    assert found(robot(), "WK-X006") == []


def test_tabs_between_numbers_become_spaces_and_other_tabs_stay():
    data = robot(
        '<link name="a\tb"><collision><origin xyz="1\t 2  3"/><geometry><box size="1 1 1"/></geometry></collision></link>'
    )
    (finding,) = found(data, "WK-X006")
    assert b'xyz="1 2 3"' in apply_edits(data, finding.fix.edits)


def test_the_open_tags_are_named_where_the_xml_breaks():
    (finding,) = found(b'<robot name="t">\n <link name="a">\n  <collision>\n </link>\n</robot>', "WK-X001")
    assert (finding.line, finding.column) == (4, 4)
    assert "robot > link > collision (the last one since 3:3)" in finding.message
    assert "empty" in found(b" \n", "WK-X001")[0].message


def test_nothing_of_a_file_with_a_doctype_is_read():
    report = validate(
        b'<!DOCTYPE r [<!ENTITY x SYSTEM "file:///etc/hostname">]><robot name="t"><link name="&x;"/></robot>'
    )
    assert [f.code for f in report.findings] == ["WK-X010"]
    assert report.map is None
    assert {skip.code[:4] for skip in report.skipped} >= {"WK-S", "WK-G"}


# ---------------------------------------------------------------------------------------------------- S


def test_a_namespace_around_everything_is_taken_off():
    data = b'<robot name="t" xmlns="urn:urdf" ><link name="map"/></robot>'
    (finding,) = found(data, "WK-S002")
    assert apply_edits(data, finding.fix.edits) == b'<robot name="t" ><link name="map"/></robot>'
    prefixed = b'<u:robot name="t" xmlns:u="urn:urdf"><u:link name="map"/></u:robot>'
    assert [f.fix for f in found(prefixed, "WK-S002")] == [None]


@pytest.mark.parametrize(
    ("file", "severity"), [("<link name='a'/>", "info"), ("<link name='a'><wk:object class='wall'/></link>", "warning")]
)
def test_a_header_is_wanted_by_files_that_use_wallkits_elements(file, severity):
    (finding,) = found(robot(file), "WK-S004")
    assert finding.severity == severity


def test_wallkits_prefix_on_another_namespace_is_more_than_foreign():
    data = b'<robot name="t" xmlns:wk="urn:wk" xmlns:d="u"><link name="map"><wk:object/><d:x/><d:y d:z="1"/></link></robot>'
    ours, other = found(data, "WK-S013")
    assert (ours.severity, ours.hint) == ("warning", 'write xmlns:wk="urn:wallkit:map:1"')
    assert other.severity == "info"
    assert "3 names ignored" in other.message
    # a prefix that is declared and not used says nothing
    assert found(b'<robot name="t" xmlns:wk="urn:wk"><link name="map"/></robot>', "WK-S013") == []


def test_what_other_programs_and_other_rules_look_after_is_left_alone():
    data = robot(
        "<gazebo><anything/></gazebo>",
        '<link name="a"><sensor q="1"/><collision><geometry><capsule radius="1" length="2"/></geometry></collision></link>',
        placed("a", "0 0 0"),
    )
    assert [f.code for f in validate(data, select=["X", "S"]).findings if f.severity != "info"] == []


def test_a_mistyped_element_is_renamed_at_both_ends():
    data = robot('<link name="a"><colision><geometry/></colision><visul/></link>')
    findings = found(data, "WK-S012")
    assert [f.message.split(" ")[0] for f in findings] == ["<colision>", "<visul>"]
    repaired = apply_edits(data, [edit for f in findings for edit in f.fix.edits])
    assert b'<link name="a"><collision><geometry/></collision><visual/></link>' in repaired


def test_a_wrapper_tells_how_much_it_hides():
    (finding,) = found(robot('<group><link name="a"/><joint name="j"/></group>'), "WK-S012")
    assert "2 links and joints in it are not read" in finding.message


def test_a_wk_attribute_on_a_urdf_element_is_told_as_such():
    (finding,) = found(robot('<link name="a" wk:class="wall"/>'), "WK-S011")
    assert "only elements have" in finding.message


@pytest.mark.parametrize(
    ("attribute", "code", "message"),
    [
        ('size="1 2"', "WK-S021", "has 2 numbers, it needs 3 metres"),
        ('size="1 2 x"', "WK-S021", "'x'"),
        ('size="2000000 1 1"', "WK-S021", "beyond a million: '2000000'"),
        ('size="1 inf 1"', "WK-S022", "'inf'"),
        ('size="1,5 1 1"', "WK-S023", "'1,5 1 1'"),
        ('size="1 1 30cm"', "WK-S024", "'30cm'"),
        ("", "WK-S032", "<box> has no size"),
        ('size=" "', "WK-S032", "<box> has no size"),
    ],
)
def test_numbers_are_judged_by_their_first_trouble(attribute, code, message):
    data = robot(
        f'<link name="a"><collision><geometry><box {attribute}/></geometry></collision></link>', placed("a", "0 0 0")
    )
    errors = [f for f in validate(data).findings if f.severity == "error"]
    assert [f.code for f in errors] == [code]
    assert message in errors[0].message


def test_a_decimal_comma_has_no_repair_but_a_separating_one_has():
    decimal = robot('<link name="a"><collision><geometry><box size="1,5 1 1"/></geometry></collision></link>')
    assert found(decimal, "WK-S023")[0].fix is None
    between = robot('<link name="a"><collision><geometry><box size="1, 2,3"/></geometry></collision></link>')
    assert b'size="1 2 3"' in apply_edits(between, found(between, "WK-S023")[0].fix.edits)


def test_survey_coordinates_may_exceed_a_million_and_room_corners_come_in_pairs():
    header = (
        '<wk:map format="1.0" units="m rad"><wk:origin kind="surveyed" north="3948811.75"/>'
        '<wk:room id="a" floor="{}"/></wk:map>'
    )
    assert found(robot(header.format("0 0  1 0  1 1")), "WK-S021") == []
    for floor in ("0 0 1 0", "0 0 1 0 1 1 1"):
        (finding,) = found(robot(header.format(floor)), "WK-S021")
        assert "at least three pairs" in finding.message


def test_angles_may_have_as_many_decimals_as_they_need():
    data = robot(box("a", "1.0000001 1 1"), placed("a", "0 0 0", "0 0 1.5707963"))
    (finding,) = found(data, "WK-S025")
    assert "size" in finding.message


@pytest.mark.parametrize(
    ("row", "attribute"),
    [
        ('<wk:class name="a" lidar="glas"/>', "lidar"),
        ('<wk:class name="a" movable="yes"/>', "movable"),
        ('<wk:class name="a" seg="one"/>', "seg"),
        ('<wk:ignore rule="E" reason="r" until="31.12.2026"/>', "until"),
    ],
)
def test_words_that_an_attribute_does_not_know_are_told(row, attribute):
    (finding,) = found(robot(f'<wk:map format="1.0" units="m rad">{row}</wk:map>'), "WK-S017")
    assert finding.message.startswith(f"{attribute}=")


def test_levels_are_asked_for_in_sets_only():
    data = robot('<wk:map format="1.0" units="m rad" level="2"/>')
    assert found(data, "WK-S042") == []
    (finding,) = found(data, "WK-S042", in_set=True)
    assert "no elevation" in finding.message


@pytest.mark.parametrize(
    ("version", "is_newer"), [("1.0", False), ("0.9", False), ("1.1", True), ("2.0", True), ("one", True)]
)
def test_formats_up_to_ours_are_read(version, is_newer):
    assert bool(found(robot(f'<wk:map format="{version}" units="m  rad"/>'), "WK-S041")) == is_newer


def test_the_next_namespace_is_a_newer_format():
    data = b'<robot name="t" xmlns:wk="urn:wallkit:map:2"><wk:map/><wk:check/><link name="map"/></robot>'
    report = validate(data)
    assert [f.code for f in report.findings if f.severity == "error"] == ["WK-S041"]


# ---------------------------------------------------------------------------------------------------- G


def test_each_further_link_of_a_name_gets_a_free_one():
    data = robot('<link name="a"/><link name="a"/><link name="a_2"/><link name="a"/>', placed("a", "0 0 0"))
    findings = found(data, "WK-G001")
    repaired = apply_edits(data, [edit for f in findings for edit in f.fix.edits])
    names = [link.get("name") for link in parse(repaired).root.findall("link")]
    assert names == ["map", "a", "a_3", "a_2", "a_4"]


def test_a_child_of_two_parents_does_not_make_its_parents_orphans():
    data = robot(
        '<link name="a"/><link name="b"/>', placed("b", "0 0 0"), placed("b", "0 0 0", parent="a").replace("at_b", "k")
    )
    assert [f.code for f in validate(data).findings if f.severity == "error"] == ["WK-G005"]


def test_an_orphan_tells_what_hangs_on_it_and_is_hung_on_the_root():
    data = robot('<link name="a"/><link name="b"/>', placed("b", "0 0 0", parent="a"))
    (finding,) = found(data, "WK-G006")
    assert "link 'a' hangs on nothing, and with it 1 more; the root is 'map'" in finding.message
    assert found(apply_edits(data, finding.fix.edits), "WK-G006") == []


def test_a_circle_is_printed_once_and_a_link_on_itself_is_one():
    links = '<link name="a"/><link name="b"/><link name="c"/><link name="d"/>'
    joints = [placed("b", "0 0 0", parent="a"), placed("c", "0 0 0", parent="b"), placed("a", "0 0 0", parent="c")]
    (finding,) = found(robot(links, *joints, placed("d", "0 0 0", parent="c")), "WK-G007")
    assert (
        "c -> a -> b -> c" in finding.message
        or "a -> b -> c -> a" in finding.message
        or "b -> c -> a -> b" in finding.message
    )
    (own,) = found(robot('<link name="a"/>', placed("a", "0 0 0", parent="a")), "WK-G007")
    assert "a -> a" in own.message


def test_a_long_chain_is_told_by_its_last_link():
    links = "".join(f'<link name="l{k}"/>' for k in range(10))
    joints = [placed(f"l{k}", "0 0 0", parent=f"l{k - 1}" if k else "map") for k in range(10)]
    (finding,) = found(robot(links, *joints), "WK-G009")
    assert "link 'l9' hangs on a chain of 10 joints (more than 8)" in finding.message
    assert found(robot(links, *joints), "WK-G009", tolerances=Tolerances(depth=10)) == []


def test_swapped_limits_are_swapped_back():
    data = robot(hinge(limit='<limit upper="-1.5" lower="0" effort="1" velocity="1"/>'))
    (finding,) = found(data, "WK-G021")
    assert b'<limit upper="0" lower="-1.5" effort' in apply_edits(data, finding.fix.edits)


def test_a_rounded_unit_axis_is_one_and_a_longer_is_shortened():
    assert found(robot(hinge(more='<axis xyz="0.7071 0.7071 0"/>')), "WK-G023") == []
    data = robot(hinge(more='<axis xyz="0 3 4"/>'))
    (finding,) = found(data, "WK-G023")
    assert "is 5 long" in finding.message
    assert b'<axis xyz="0 0.6 0.8"/>' in apply_edits(data, finding.fix.edits)


def test_a_joint_without_travel_away_from_zero_is_not_made_fixed():
    (at_zero,) = found(robot(hinge(limit='<limit effort="1" velocity="1"/>')), "WK-G024")
    assert at_zero.fix is not None
    (elsewhere,) = found(robot(hinge(limit='<limit lower="1" upper="1" effort="1" velocity="1"/>')), "WK-G024")
    assert elsewhere.fix is None


@pytest.mark.parametrize(
    ("target", "says"), [("nobody", "does not exist"), ("at_w", "cannot move"), ("k", "in the end follows it")]
)
def test_a_joint_follows_one_that_leads(target, says):
    pieces = [
        hinge(more=f'<mimic joint="{target}"/>'),
        hinge("k", more='<mimic joint="j"/>'),
        '<link name="w"/>',
        placed("w", "0 0 0"),
    ]
    first = found(robot(*pieces), "WK-G025")[0]
    assert says in first.message
