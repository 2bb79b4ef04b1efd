"""Repairs: twice is as good as once, nothing else changes, and what the file or the user wants left alone is."""

from __future__ import annotations

import pytest

from tests.maps.drawn import HEAD, box, placed, robot
from wallkit.maps.document import Edit
from wallkit.maps.findings import repair as repair_module
from wallkit.maps.findings.repair import CLASSES, repair
from wallkit.maps.rules import RULES, validate
from wallkit.maps.rules.base import Problem, Rule
from wallkit.maps.rules.docs import doc_of, file_from_example, is_file

HEADER = '<wk:map format="1.0" units="m rad" level="1" scan_plane="0.3"/>'
COMMA = robot(HEADER, box("a", "1,2,3"), placed("a", "0 0 0"))
XSG = ["X", "S", "G"]
EXAMPLES = {code: file_from_example(doc_of(rule).bad) for code, rule in RULES.items() if is_file(doc_of(rule).bad)}


@pytest.mark.parametrize("kind", CLASSES)
@pytest.mark.parametrize("code", EXAMPLES)
def test_repairing_the_example_of_a_rule_twice_changes_nothing_and_leaves_no_repair(code, kind):
    once = repair(EXAMPLES[code], kind)
    twice = repair(once.data, kind)
    assert twice.data == once.data
    assert twice.fixed == ()
    assert not [f.code for f in validate(once.data).findings if f.fix and f.fix.kind in CLASSES[kind]]
    assert (once.data == EXAMPLES[code]) == (once.fixed == ())


def test_a_repair_changes_its_own_bytes_only():
    done = repair(COMMA, select=XSG)
    assert done.data == COMMA.replace(b"1,2,3", b"1 2 3")
    assert [finding.code for finding in done.fixed] == ["WK-S023"]
    assert validate(done.data, select=XSG).is_clean


def test_repairs_uncover_and_make_further_repairs():
    """While a number is unreadable nobody asks for duplicates; the duplicate that gets a new name then hangs on nothing."""
    data = robot(HEADER, box("wall", "1,2,3"), box("wall", "1 1 1"), placed("wall", "0 0 0"))
    done = repair(data, "moderate", select=XSG)
    assert [finding.code for finding in done.fixed][:1] == ["WK-S023"]
    assert {finding.code for finding in done.fixed} >= {"WK-S023", "WK-G001"}
    assert validate(done.data, select=XSG).is_clean


def test_a_class_includes_the_milder_ones_and_never_a_graver_one():
    data = robot(HEADER, box("wall", "1,2,3"), box("wall", "1 1 1"), placed("wall", "0 0 0"))
    assert {f.code for f in repair(data, "safe", select=XSG).fixed} == {"WK-S023"}
    assert {f.code for f in repair(data, "moderate", select=XSG).fixed} >= {"WK-S023", "WK-G001"}


def test_what_moves_things_waits_until_what_is_safe_is_done(monkeypatch):
    """A moderate repair sees the file as the safe ones leave it, and one rule's as the rules before it do."""
    rules = {
        "WK-S901": Rule("WK-S901", "warning", swap(b"<!-- one", b"<!-- two"), fix="moderate"),
        "WK-S902": Rule("WK-S902", "warning", swap(b"one two", b"two two"), fix="moderate"),
        "WK-S903": Rule("WK-S903", "warning", swap(b"left", b"one two"), fix="safe"),
    }
    monkeypatch.setattr("wallkit.maps.rules.RULES", rules)
    done = repair(robot("<!-- left -->"), "moderate")
    assert [finding.code for finding in done.fixed] == ["WK-S903", "WK-S901"]
    assert done.data == robot("<!-- two two -->")


def test_a_hundred_repairs_of_one_kind_are_made_and_all_of_them():
    pieces = [piece for n in range(100) for piece in (box(f"b{n}", "1,2,3"), placed(f"b{n}", "0 0 0"))]
    done = repair(robot(HEADER, *pieces), select=XSG)
    assert len(done.fixed) == 100
    assert done.data == robot(HEADER, *pieces).replace(b"1,2,3", b"1 2 3")


def test_rules_without_a_repair_are_not_asked(monkeypatch):
    def never(context):
        raise AssertionError("asked")

    monkeypatch.setitem(RULES, "WK-L999", Rule("WK-L999", "warning", never))
    assert repair(COMMA).data != COMMA
    assert repair(COMMA, select=["L999"]).data == COMMA


def test_what_is_ignored_or_not_selected_stays():
    ignoring = COMMA.replace(b"<collision", b'<wk:ignore rule="S023" reason="as the surveyor wrote it"/><collision')
    assert repair(ignoring, select=XSG).data == ignoring
    assert repair(COMMA, select=XSG, ignore=["S023"]).data == COMMA
    assert repair(COMMA, select=["G"]).data == COMMA
    assert repair(COMMA, select=["S023"]).data != COMMA


@pytest.mark.parametrize("data", [b"", b"\0\0\0", b"<robot", HEAD.encode(), b"\xff" * 9])
def test_what_cannot_be_read_is_left_as_it_is(data):
    done = repair(data, "moderate")
    assert (done.data, done.fixed) == (data, ())


def swap(old: bytes, new: bytes):
    """A rule that wants one word replaced by another."""

    def check(context):
        data = context.document.data
        if old in data:
            at = data.index(old)
            yield Problem(context.root, "wrong word", edits=(Edit(at, len(old), new),))

    return check


def test_repairs_that_undo_each_other_end_where_they_were(monkeypatch):
    rules = {
        "WK-S901": Rule("WK-S901", "warning", swap(b"left", b"right"), fix="safe"),
        "WK-S902": Rule("WK-S902", "warning", swap(b"right", b"left"), fix="safe"),
    }
    monkeypatch.setattr("wallkit.maps.rules.RULES", rules)
    data = robot("<!-- left -->")
    once = repair(data).data
    assert once in (data, data.replace(b"left", b"right"))
    assert repair(once).data == once == repair(data.replace(b"left", b"right")).data


def test_a_repair_that_does_not_help_is_not_made_and_keeps_none_from_being_made(monkeypatch):
    rules = {
        "WK-S901": Rule("WK-S901", "warning", swap(b"more", b"more more"), fix="safe"),
        "WK-S902": Rule("WK-S902", "warning", swap(b"same", b"same"), fix="safe"),
        "WK-S903": Rule("WK-S903", "warning", swap(b"left", b"right"), fix="moderate"),
    }
    monkeypatch.setattr("wallkit.maps.rules.RULES", rules)
    done = repair(robot("<!-- more same left -->"), "moderate")
    assert done.data == robot("<!-- more same right -->")
    assert [finding.code for finding in done.fixed] == ["WK-S903"]


def test_repairs_without_end_are_a_bug_that_is_said(monkeypatch):
    def all_of(old: bytes, new: bytes):
        def check(context):
            data = context.document.data
            edits = [Edit(at, 1, new) for at in range(len(data)) if data[at : at + 1] == old]
            if edits:
                yield Problem(context.root, "wrong letters", edits=tuple(edits))

        return check

    rules = {
        "WK-S901": Rule("WK-S901", "warning", all_of(b"!", b"??"), fix="safe"),
        "WK-S902": Rule("WK-S902", "warning", all_of(b"?", b"!!"), fix="safe"),
    }
    monkeypatch.setattr("wallkit.maps.rules.RULES", rules)
    monkeypatch.setattr(repair_module, "MAX_ROUNDS", 5)
    with pytest.raises(RuntimeError, match="do not settle: the last was of WK-S902"):
        repair(robot('<link name="?"/>'))
