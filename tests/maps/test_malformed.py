"""Every malformed file: the rules it must raise, no other error that the fault does not cause, and repairs that settle."""

from __future__ import annotations

import json
import os
from pathlib import Path

import pytest

from wallkit.maps.findings.repair import repair
from wallkit.maps.rules import RULES, validate

# errors that a fault brings with it, and why they are its own
CAUSED = {
    # what hangs on "${prefix}pillar" is nothing: its joint was not expanded either
    "mutants/xacro_leftover.wkmap.urdf": {"WK-G006"},
    # the manifest says so itself: the second opening is "also not cut"
    "mutants/openings_overlap.wkmap.urdf": {"WK-O001"},
}
# warnings that a fault brings with it
WARNED = {
    # its prefix wk stands for another namespace, so all that it says is nobody's
    "parse/ext_first_child_of_geometry.urdf": {"WK-S013"},
    # with the prefix taken for wallkit's, the empty <wk:map/> lacks format and units
    "parse/undeclared_prefix.urdf": {"WK-S032"},
    # a wall without thickness leaves its fixtures hanging 6 cm before it
    "mutants/zero_thickness_wall.wkmap.urdf": {"WK-E012"},
    # the leaf is there, the hole is not declared
    "mutants/cut_without_opening.wkmap.urdf": {"WK-O008"},
    # in the swing of the door there is no wall behind the sink
    "mutants/door_hits_fixture.wkmap.urdf": {"WK-E012"},
    # a room without a way in has no door
    "mutants/room_unreachable.wkmap.urdf": {"WK-T008"},
    # 4.8 mm at the far end is a corner that misses
    "mutants/rounded_right_angle.wkmap.urdf": {"WK-E022"},
    # the floor leaks below the wall that begins above the LiDAR
    "mutants/wall_off_floor.wkmap.urdf": {"WK-T007"},
    # without its bowl the toilet begins with the tank, exactly at the LiDAR's height, and the room looks alike turned round
    "mutants/mesh_missing.wkmap.urdf": {"WK-L003", "WK-L013"},
    # ${prefix} is no plain name
    "mutants/xacro_leftover.wkmap.urdf": {"WK-S015"},
}
# errors that are only seen once the prefix wk is declared and its words are wallkit's
REVEALED = {
    "parse/undeclared_prefix.urdf": {"WK-C001"},
    "parse/undeclared_prefix_attr.urdf": {"WK-S011"},
}
FOLDER = Path(os.environ.get("WALLKIT_TEST_DATA", "")) / "maps/malformed"
CASES = json.loads((FOLDER / "manifest.json").read_text())["cases"] if (FOLDER / "manifest.json").is_file() else []


def codes(report, severity=None):
    return {f.code for f in report.findings if severity in (None, f.severity)}


@pytest.mark.data
def test_the_manifest_names_known_rules_only(data):
    assert len(CASES) == 69
    assert sum(bool(case["expect"]) for case in CASES) == 66
    assert {code for case in CASES for code in case["expect"]} <= set(RULES)
    assert {*CAUSED, *WARNED} <= {case["file"] for case in CASES}


@pytest.mark.data
@pytest.mark.parametrize("case", CASES, ids=lambda case: case["file"])
def test_a_malformed_file_raises_its_rules_and_nothing_its_fault_does_not_cause(data, case):
    report = validate(data / "maps/malformed" / case["file"])
    expected = set(case["expect"])
    assert expected <= codes(report)
    assert codes(report, "error") - expected == CAUSED.get(case["file"], set())
    assert codes(report, "warning") - expected == WARNED.get(case["file"], set())


@pytest.mark.data
def test_the_example_is_clean_and_says_what_its_lidar_misses(data):
    report = validate(data / "maps/wkmap_example/restroom.wkmap.urdf")
    assert report.skipped == ()
    assert {f.severity for f in report.findings} == {"info"}
    unseen = {f.message.split("'")[1] for f in report.findings if f.code == "WK-L001"}
    assert unseen == {"window_n", "urinal_1", "sink_1", "mirror_1"}


@pytest.mark.long
@pytest.mark.data
@pytest.mark.parametrize("kind", ["safe", "moderate"])
@pytest.mark.parametrize("case", CASES, ids=lambda case: case["file"])
def test_a_repaired_file_is_clean_of_what_was_repaired_and_a_second_time_changes_nothing(data, case, kind):
    path = data / "maps/malformed" / case["file"]
    before = path.read_bytes()
    done = repair(before, kind, source=str(path))
    assert repair(done.data, kind, source=str(path)).data == done.data
    assert bool(done.fixed) == (done.data != before)
    after = validate(done.data, source=str(path))
    # what a repair of this class could still take away is gone, but for findings that no repair helps
    left = {f.code for f in after.findings if f.fix is not None and f.fix.kind in ("safe", kind)}
    assert not left & {f.code for f in done.fixed}
    # nothing breaks that was sound before
    sound = validate(before, source=str(path))
    new = (codes(after, "error") - codes(sound, "error")) & set(sound.checked)
    assert new == REVEALED.get(case["file"], set())
