"""Clean maps raise nothing; broken in one place at random, the rule for that fault notices, wherever the map lies."""

from __future__ import annotations

import math
import zlib
from collections import Counter

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from tests.maps.drawn import LOCALISABILITY
from tests.maps.faults import FAULTS, mutants
from tests.maps.faults_of_use import FAULTS_OF_USE, hall
from tests.maps.random_maps import clean_map
from wallkit.maps.document import Document, Edit, apply_edits, wk
from wallkit.maps.rules import validate as validate_all
from wallkit.maps.xml import parse

PER_FAULT = 9
# they ask where the map lies, or how its angles are written
ABSOLUTE = {"WK-E030", "WK-E042", "WK-E044", "WK-S025"}
# what is found by looking at something else than what was changed
ELSEWHERE = {
    *("tag not closed", "orphan", "no limits", "link name twice", "joint name twice", "two parents"),
    *("gap at a corner", "map in another unit", "hole not declared", "room walled up"),
}


def validate(data):
    """All rules but those about localizability."""
    return validate_all(data, ignore=LOCALISABILITY)


def test_there_are_enough_kinds_of_faults():
    assert len(FAULTS) >= 30
    assert len(FAULTS) * PER_FAULT >= 500


@pytest.mark.long
@pytest.mark.parametrize("name", FAULTS)
def test_every_fault_is_noticed(name):
    for mutant in mutants(name, PER_FAULT):
        findings = validate(mutant.data).findings
        lines = {finding.line for finding in findings if finding.code == mutant.rule}
        assert lines, (name, sorted({finding.code for finding in findings}), mutant.data.decode("latin-1"))
        assert name in ELSEWHERE or lines & mutant.changed_lines, (name, lines, mutant.changed_lines)


@pytest.mark.parametrize("seed", range(25))
def test_a_clean_map_raises_no_alarm(seed):
    report = validate(clean_map(np.random.default_rng([1, seed]), turned=seed % 2 == 0))
    assert [(f.code, f.message) for f in report.findings if f.severity != "info"] == []


@pytest.mark.long
@pytest.mark.parametrize("name", FAULTS_OF_USE)
def test_every_fault_of_use_is_noticed(name):
    rule, make = FAULTS_OF_USE[name]
    for seed in range(5):
        codes = {finding.code for finding in validate_all(make(np.random.default_rng([7, seed]))).findings}
        assert rule in codes, (name, seed, sorted(codes))


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(10))
def test_a_hall_that_looks_different_everywhere_raises_no_alarm(seed):
    report = validate_all(hall(np.random.default_rng([8, seed])))
    assert [(f.code, f.message) for f in report.findings if f.severity != "info"] == []


# --------------------------------------------------------------------------------------------- what changes nothing


def moved(document: Document, yaw: float, dx: float, dy: float) -> bytes:
    """The same building elsewhere: every joint on `map` and every room is moved."""
    assert document.root is not None
    c, s = math.cos(yaw), math.sin(yaw)
    edits: list[Edit] = []

    def at(numbers: list[float]) -> list[float]:
        return [c * numbers[0] - s * numbers[1] + dx, s * numbers[0] + c * numbers[1] + dy, *numbers[2:]]

    for joint in document.root.findall("joint"):
        if joint.find("parent").get("link") == "map":
            origin = joint.find("origin")
            roll, pitch, turn = map(float, (origin.get("rpy") or "0 0 0").split())
            xyz = " ".join(f"{v:.9f}" for v in at(list(map(float, origin.get("xyz").split()))))
            text = f'<origin xyz="{xyz}" rpy="{roll:.9f} {pitch:.9f} {turn + yaw:.9f}"/>'
            edits.append(Edit(origin.span.offset, origin.span.end - origin.span.offset, text.encode()))
    for room in document.root.iter():
        if room.tag == wk("room"):
            flat = list(map(float, room.get("floor").split()))
            turned = [v for k in range(0, len(flat), 2) for v in at(flat[k : k + 2])]
            edits.append(room.attribute("floor").replaced_by(" ".join(f"{v:.9f}" for v in turned)))
    return apply_edits(document.data, edits)


def said(data: bytes) -> Counter[tuple[str, str]]:
    """How often each rule speaks about each element."""
    return Counter((f.code, f.xpath) for f in validate(data).findings if f.code not in ABSOLUTE)


GEOMETRIC = [
    *("fixture in the wall", "fixture off its wall", "gap at a corner", "hinge in the wall", "room walled up"),
    *("room too large", "hole not cut", "wall above the floor", "pasted twice", "door into another room"),
]


@pytest.mark.parametrize("name", GEOMETRIC)
def test_a_rigid_motion_of_the_whole_map_changes_no_finding(name):
    rng = np.random.default_rng(zlib.crc32(name.encode()))
    for mutant in mutants(name, 2, seed=3):
        yaw, (dx, dy) = float(rng.uniform(-math.pi, math.pi)), rng.uniform(-9, 9, 2)
        assert said(moved(parse(mutant.data, "m"), yaw, dx, dy)) == said(mutant.data)


@pytest.mark.parametrize("name", GEOMETRIC[:5])
def test_the_order_of_links_and_joints_changes_no_finding(name):
    rng = np.random.default_rng(5)
    for mutant in mutants(name, 2, seed=4):
        root = parse(mutant.data, "m").root
        assert root is not None
        spans = [(e.span.offset, e.span.end) for e in root.children if e.tag in ("link", "joint")]
        pieces = [mutant.data[start:end] for start, end in spans]
        mixed = [pieces[k] for k in rng.permutation(len(pieces))]
        edits = [Edit(start, end - start, text) for (start, end), text in zip(spans, mixed, strict=True)]
        # of two that are in each other's way either may be named
        codes = [
            Counter(code for code, _ in said(data).elements())
            for data in (mutant.data, apply_edits(mutant.data, edits))
        ]
        assert codes[0] == codes[1]


# ------------------------------------------------------------------------------------------------------- any bytes

SEEDS = [clean_map(np.random.default_rng([2, k])) for k in range(3)]
damage = st.lists(
    st.tuples(st.integers(0, 30_000), st.integers(0, 40), st.one_of(st.binary(max_size=8), st.sampled_from(
        [b"<", b">", b'"', b"<wk:", b"</link>", b"nan", b"1e999", b"-", b"<!--", b"]]>", b"&#0;", b"\xff\xfe", b"<robot>"]
    ))),
    min_size=1,
    max_size=6,
)  # fmt: skip


def damaged(data: bytes, blows: list[tuple[int, int, bytes]]) -> bytes:
    for offset, length, text in blows:
        at = offset % (len(data) + 1)
        data = data[:at] + text + data[at + length :]
    return data


@settings(max_examples=60, deadline=None, derandomize=True, suppress_health_check=list(HealthCheck))
@given(st.sampled_from(SEEDS), damage)
def test_no_damage_ends_in_a_traceback(data, blows):
    for finding in validate(damaged(data, blows)).findings:
        assert finding.line >= 1
        assert finding.column >= 1


@settings(max_examples=150, deadline=None, derandomize=True)
@given(st.binary(max_size=200))
def test_no_bytes_end_in_a_traceback(data):
    assert validate(data).count("error") > 0


@pytest.mark.slow
@settings(max_examples=1500, deadline=None, suppress_health_check=list(HealthCheck))
@given(st.sampled_from(SEEDS), damage)
def test_no_damage_ends_in_a_traceback_for_a_minute(data, blows):
    validate(damaged(data, blows))
