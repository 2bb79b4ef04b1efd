"""Rules R: documented examples on real images, real map_server files, places in the YAML, and repairs."""

from __future__ import annotations

import numpy as np
import pytest

from wallkit.maps.document import apply_edits
from wallkit.maps.rules import RULES, validate
from wallkit.maps.rules.docs import doc_of

R_RULES = [code for code in RULES if code.startswith("WK-R")]
GOOD = "image: floor.pgm\nresolution: 0.05\norigin: [1.5, -2, 0]\n"


@pytest.fixture
def folder(tmp_path):
    """Images to name: floor.pgm with walls, free and unknown; clear.png with alpha; colour.png."""
    import cv2

    floor = np.full((40, 60), 254, np.uint8)
    floor[:, :5] = floor[:4] = 0
    floor[30:] = 205
    cv2.imwrite(str(tmp_path / "floor.pgm"), floor)
    see_through = np.dstack([floor] * 3 + [np.where(floor == 205, 0, 255).astype(np.uint8)])
    cv2.imwrite(str(tmp_path / "clear.png"), see_through)
    cv2.imwrite(str(tmp_path / "colour.png"), np.dstack([floor, floor, 255 - floor]))
    cv2.imwrite(str(tmp_path / "deep.png"), floor.astype(np.uint16) * 257)
    return tmp_path


def judged(folder, text, **options):
    return validate(text.encode(), source=str(folder / "map.yaml"), **options)


def said(report):
    return [(f.code, f.severity, f.line, f.column) for f in report.findings]


@pytest.mark.parametrize("code", R_RULES)
def test_the_documented_example_of_a_raster_rule_raises_it_and_its_good_twin_does_not(folder, code):
    doc = doc_of(RULES[code])
    assert code in {f.code for f in judged(folder, doc.bad).findings}
    assert code not in {f.code for f in judged(folder, doc.good).findings}


def test_a_sound_raster_is_clean_and_only_its_group_runs(folder):
    report = judged(folder, GOOD)
    assert report.findings == ()
    assert set(report.checked) == set(R_RULES)
    assert report.skipped == ()
    assert validate(b"<robot/>", source="a.urdf", select=["R"]).checked == ()


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("image: floor.pgm # the plan\nresolution: none\norigin: [0, 0, 0]\n", [("WK-R004", "error", 2, 13)]),
        (GOOD + "mode: Skale\n", [("WK-R007", "error", 4, 7)]),
        (GOOD + "negate: 1\n", [("WK-R003", "info", 4, 9)]),
        (GOOD + "negate: 7\n", [("WK-R003", "error", 4, 9)]),
        (GOOD + "occupied_thresh: 65\n", [("WK-R005", "error", 4, 18)]),
        (GOOD.replace("floor.pgm", '"colour.png"'), [("WK-R003", "warning", 1, 8)]),
        (GOOD.replace("floor.pgm", "deep.png"), [("WK-R003", "warning", 1, 8)]),
        (GOOD.replace("floor.pgm", "floor.yaml"), [("WK-R001", "error", 1, 8)]),
        (GOOD.replace("-2, 0]", "-2, 0.5]"), [("WK-R004", "info", 3, 9)]),
        ("image: [\n", [("WK-R001", "error", 2, 1)]),
        ("- a\n", [("WK-R001", "error", 1, 1)]),
        ("", [("WK-R001", "error", 1, 1)]),
    ],
)
def test_a_fault_is_told_at_its_value(folder, text, expected):
    assert said(judged(folder, text)) == expected


def test_the_repair_of_a_threshold_changes_its_number_only(folder):
    text = GOOD + "free_thresh:   0.25   # as in nav2\nmode: trinary\n"
    (finding,) = judged(folder, text).findings
    assert finding.detail == {"cells": 10 * 60}
    assert apply_edits(text.encode(), finding.fix.edits).decode() == text.replace("0.25", "0.196")
    # the image has no unknown cell where negate turns it around, or in another mode
    assert judged(folder, text.replace("trinary", "raw"), select=["R002"]).findings == ()


def test_bytes_that_are_no_yaml_are_one_error(folder):
    for data in (b"\xff\xfe", b"\0", b"a: b: c", b"&a [*a]", b"? 3\n", b"image: !!python/name:os.system x"):
        report = validate(data, source=str(folder / "map.yaml"))
        assert report.count("error") >= 1, data


@pytest.mark.data
def test_real_rasters_are_judged_as_their_readme_says(data):
    def of(name):
        return validate(data / f"maps/pgm/{name}.yaml").findings

    (depot,) = of("depot")
    assert (depot.code, depot.line, depot.detail["cells"]) == ("WK-R002", 7, 8894)
    assert "8,894 unknown cells" in depot.message
    assert [(f.code, f.severity, f.line) for f in of("invalid_image")] == [
        ("WK-R001", "error", 1),
        ("WK-R004", "info", 3),
    ]
    assert [f.code for f in of("testmap")] == ["WK-R004"]
    for name in ("map", "tb3_sandbox", "willow-2010-02-18-0.10"):
        assert of(name) == ()
