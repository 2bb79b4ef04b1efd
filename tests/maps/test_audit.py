"""Maps with one fault each against what a robot records in the true rooms: the fault is told, and nothing else."""

from __future__ import annotations

import re
from dataclasses import replace

import numpy as np
import pytest

from tests.maps.audit_worlds import FLOOR, SIGMA_M, WALLS, Z_M, logged_in, map_of, scaled, with_wall, without
from wallkit.errors import ConfigError
from wallkit.maps.audit.audit import evidence_of
from wallkit.maps.audit.draw import draw_audit
from wallkit.maps.document import apply_edits
from wallkit.maps.draft.draft import DraftWall
from wallkit.maps.draft.write import write_draft
from wallkit.maps.draw.svg import svg_from_drawing
from wallkit.maps.read import read_map
from wallkit.maps.rules import RULES, audit_against, explain, validate
from wallkit.maps.rules.tolerances import Tolerances
from wallkit.maps.xml import parse

TRUE = map_of()
# poses as a filter finds them: noise of their own, and something they all share
FILTERED = {"pose_sd": (0.03, 0.01), "sd": (0.03, 0.03, 0.01), "is_absolute": False}


def audited(semantic_map, logged):
    """The evidence and the report."""
    evidence = evidence_of(semantic_map, logged, Z_M, sigma_m=SIGMA_M)
    return evidence, audit_against(semantic_map.document, evidence, Tolerances())


def told(report):
    return [(finding.code, finding.detail.get("link")) for finding in report.findings]


# ------------------------------------------------------------------------------------ nothing to tell


@pytest.mark.long
@pytest.mark.parametrize("seed", range(4))
@pytest.mark.parametrize("poses", [{}, FILTERED], ids=["true", "filtered"])
def test_an_exact_map_raises_nothing_with_people_walking(seed, poses):
    _, report = audited(TRUE, logged_in(TRUE, seed, people=3, **poses))
    assert told(report) == []
    assert {"WK-A001", "WK-A006"} <= set(report.checked)


def test_a_bias_that_all_filtered_poses_share_moves_no_wall():
    logged = logged_in(TRUE, 0, **FILTERED)
    _, report = audited(TRUE, replace(logged, poses=logged.poses + [0.04, -0.03, 0.01]))
    assert told(report) == []


# ------------------------------------------------------------------------------------------ one fault


@pytest.mark.long
@pytest.mark.parametrize("poses", [{}, FILTERED], ids=["true", "filtered"])
def test_a_wall_drawn_3_cm_off_is_told_with_an_honest_sigma(poses):
    """Over ten logs the offset is 3 cm within its sigma, at least as often as a normal distribution has it."""
    drawn = map_of(with_wall("east", (10.03, 0), (10.03, 7)))
    pulls = []
    for seed in range(10):
        evidence, report = audited(drawn, logged_in(TRUE, seed, **poses))
        assert told(report) == [("WK-A003", "east")]
        (shift,) = evidence.elements["east"].shifts
        assert shift.normal == pytest.approx((-1, 0), abs=1e-6)
        pulls.append((shift.offset_m - 0.03) / shift.sd_m)
    assert np.mean(np.abs(pulls) < 1) >= 0.68
    assert np.max(np.abs(pulls)) < 3
    assert re.search(r"stands (2\.[6-9]|3\.[0-4]) \+- 0\.\d cm farther towards -x", report.findings[0].message)


def test_more_views_from_the_same_places_do_not_shrink_sigma():
    once = logged_in(TRUE, 0, beams=91)
    n, m = len(once), len(once.views)
    thrice = replace(
        once,
        stamps_s=np.arange(3 * n) * 0.4,
        poses=np.tile(once.poses, (3, 1)),
        sd=np.tile(once.sd, (3, 1)),
        views=np.repeat(np.arange(3 * n), m // n),
        bearings_rad=np.tile(once.bearings_rad, 3),
        ranges_m=np.tile(once.ranges_m, 3),
    )
    a, b = (evidence_of(TRUE, log, Z_M, sigma_m=SIGMA_M).elements["east"].shifts[0] for log in (once, thrice))
    assert b.sd_m == pytest.approx(a.sd_m, rel=0.02)


def test_worse_poses_make_sigma_larger():
    good, bad = (logged_in(TRUE, 0, sd=(sd, sd, 0.01)) for sd in (0.01, 0.1))
    a, b = (evidence_of(TRUE, log, Z_M, sigma_m=SIGMA_M).elements["column"].shifts[0] for log in (good, bad))
    assert b.sd_m > a.sd_m


def test_the_repair_of_a_shifted_wall_puts_it_where_it_stands():
    """And then the shelf on it, which moved along and had been right."""
    drawn, logged = map_of(with_wall("east", (10.03, 0), (10.03, 7))), logged_in(TRUE, 0)
    for link in ("east", "shelf"):
        _, report = audited(drawn, logged)
        assert told(report) == [("WK-A003", link)]
        assert report.findings[0].fix.kind == "moderate"
        repaired = apply_edits(drawn.document.data, report.findings[0].fix.edits)
        drawn = read_map(parse(repaired, "floor.wkmap.urdf"))
    assert drawn.poses()["east"][0, 3] == pytest.approx(10.0, abs=0.005)
    assert drawn.poses()["shelf"][0, 3] == pytest.approx(9.94, abs=0.005)
    assert told(audited(drawn, logged)[1]) == []


@pytest.mark.parametrize(
    ("name", "place", "size", "class_name"),
    [("column", (7.5, 3.6), (0.4, 0.4), "column"), ("cupboard", (0.31, 1.2), (1.0, 0.5), "furniture")],
)
def test_what_the_map_lacks_is_found_at_its_place_with_its_size(name, place, size, class_name):
    evidence, report = audited(map_of(without(name)), logged_in(TRUE, 1, people=2))
    assert [code for code, _ in told(report)] == ["WK-A002"]
    (cluster,) = evidence.clusters
    np.testing.assert_allclose(cluster.pose[:2], place, atol=0.06)
    np.testing.assert_allclose(cluster.size_m, size, atol=0.1)
    assert cluster.class_name == class_name


def test_what_is_to_be_pasted_makes_the_map_whole():
    drawn = map_of(without("column"))
    logged = logged_in(TRUE, 1)
    _, report = audited(drawn, logged)
    paste = report.findings[0].detail["paste"]
    whole = drawn.document.data.replace(b"</robot>", paste.encode() + b"\n</robot>")
    assert validate(whole, select=["X", "S", "G"]).count("error") == 0
    evidence, _ = audited(read_map(parse(whole, "floor.wkmap.urdf")), logged)
    assert evidence.clusters == ()
    assert evidence.elements["column_1"].unsupported_m == 0


def test_a_wall_that_is_not_there_is_told():
    phantom = DraftWall("phantom", (6.5, 2.5), (8.5, 2.5), 0.1)
    evidence, report = audited(map_of(replace(FLOOR, walls=(*WALLS, phantom))), logged_in(TRUE, 0, people=2))
    assert told(report) == [("WK-A001", "phantom")]
    assert evidence.elements["phantom"].unsupported_m > 3.5
    assert "is not there" in report.findings[0].message


def test_a_wall_that_is_missing_from_the_map_is_told_as_something_new():
    phantom = DraftWall("partition", (6.5, 2.5), (8.5, 2.5), 0.1)
    real = map_of(replace(FLOOR, walls=(*WALLS, phantom)))
    evidence, report = audited(TRUE, logged_in(real, 0))
    assert [code for code, _ in told(report)] == ["WK-A002"]
    (cluster,) = evidence.clusters
    assert cluster.class_name == "wall"
    np.testing.assert_allclose(cluster.pose[:2], (7.5, 2.5), atol=0.06)
    np.testing.assert_allclose(cluster.size_m, (2.0, 0.1), atol=0.1)


def test_a_door_that_stood_open_is_told_and_one_at_rest_is_not():
    (joint,) = TRUE.doors
    evidence, report = audited(TRUE, logged_in(TRUE, 0, doors={joint.name: joint.open}))
    assert [code for code, _ in told(report)] == ["WK-A005"]
    (finding,) = report.findings
    assert finding.severity == "info"
    assert "seen open" in finding.message
    np.testing.assert_allclose(np.median(evidence.doors[joint.name].states), joint.open, atol=0.05)
    ajar, _ = audited(TRUE, logged_in(TRUE, 0, doors={joint.name: 0.8}))
    np.testing.assert_allclose(np.median(ajar.doors[joint.name].states), 0.8, atol=0.05)


@pytest.mark.parametrize("factor", [1.02, 0.985])
@pytest.mark.parametrize("poses", [{}, FILTERED], ids=["true", "filtered"])
def test_a_map_drawn_too_large_or_small_raises_that_alone(factor, poses):
    evidence, report = audited(map_of(scaled(factor)), logged_in(TRUE, 0, **poses))
    assert [code for code, _ in told(report)] == ["WK-A004"]
    assert report.findings[0].severity == "error"
    assert 1 + evidence.drift.values[3] == pytest.approx(1 / factor, abs=3 * evidence.drift.sd[3])


def test_origin_and_heading_are_judged_by_true_poses_only():
    logged = logged_in(TRUE, 0)
    logged = replace(logged, poses=logged.poses + [0.2, -0.1, 0.0])
    evidence, report = audited(TRUE, logged)
    assert [code for code, _ in told(report)] == ["WK-A004"]
    np.testing.assert_allclose(evidence.drift.values[:2], (0.2, -0.1), atol=0.02)
    assert told(audited(TRUE, replace(logged, is_absolute=False, sd=logged.sd * 3))[1]) == []


def test_what_the_log_never_looked_at_is_told():
    _, report = audited(TRUE, logged_in(TRUE, 0, route=[(1.5, 2.6), (3.4, 2.2), (3.4, 0.8), (1.2, 0.6)]))
    assert {code for code, _ in told(report)} == {"WK-A006"}
    assert ("WK-A006", "shelf") in told(report)
    assert ("WK-A006", "south") not in told(report)


# ------------------------------------------------------------------------------------- rules, picture


def test_without_a_log_its_rules_do_not_run_and_say_so_when_asked():
    report = validate(write_draft(FLOOR))
    needing = {code for code, rule in RULES.items() if rule.needs_log}
    assert needing == {f"WK-A00{n}" for n in range(1, 7)}
    assert not needing & {*report.checked, *(skip.code for skip in report.skipped)}
    with pytest.raises(ConfigError, match="needs a log"):
        validate(write_draft(FLOOR), select=["A003"])
    assert "WK-A003" in explain("a003")


def test_an_inline_ignore_takes_a_finding_out():
    drawn = write_draft(with_wall("east", (10.03, 0), (10.03, 7)))
    mark = b'<link name="east">'
    assert mark in drawn
    ignoring = drawn.replace(mark, mark + b'<wk:ignore rule="WK-A003" reason="known"/>')
    _, report = audited(read_map(parse(ignoring, "floor.wkmap.urdf")), logged_in(TRUE, 0))
    assert report.findings == ()
    assert [finding.code for finding in report.ignored] == ["WK-A003"]


def test_the_picture_has_what_was_seen_what_is_new_and_what_is_gone():
    walls = (*with_wall("east", (10.03, 0), (10.03, 7)).walls, DraftWall("phantom", (6.5, 2.5), (8.5, 2.5), 0.1))
    drawn = map_of(replace(without("column"), walls=walls))
    evidence, report = audited(drawn, logged_in(TRUE, 0))
    groups = {group.id for group in draw_audit(drawn, evidence, report.findings, Z_M).plan}
    wanted = {"audit:path", "audit:seen", "audit:gone", "audit:cluster:1", "audit:shift:east"}
    assert wanted <= groups
    assert svg_from_drawing(draw_audit(drawn, evidence, report.findings, Z_M)).startswith(b"<?xml")
