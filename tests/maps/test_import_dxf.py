"""DXF plans: wall lines by layer, doors from their swings, and a unit that is said, doubted or asked for, never guessed."""

from __future__ import annotations

import math
import sys
from contextlib import suppress

import numpy as np
import pytest

from wallkit.errors import MapError
from wallkit.maps.draft.write import write_draft
from wallkit.maps.importers import import_map, recognise
from wallkit.maps.importers.dxf import read_dxf
from wallkit.maps.importers.imported import ImportOptions

ezdxf = pytest.importorskip("ezdxf", reason="the extra wallkit[dxf] is not installed")

M, MM, UNITLESS = 6, 4, 0


def plan(tmp_path, draw, *, unit=M):
    """A DXF with what `draw(modelspace, document)` puts in it."""
    document = ezdxf.new()
    document.header["$INSUNITS"] = unit
    draw(document.modelspace(), document)
    path = tmp_path / "plan.dxf"
    document.saveas(path)
    return path


def house(modelspace, _document, scale=1.0):
    """A rectangle with walls of 0.2 m, drawn by their faces, and a door swing with its leaf."""
    for inset in (0.0, 0.2):
        low, right, top = inset, 6 - inset, 4 - inset
        corners = [(low, low), (right, low), (right, top), (low, top)]
        modelspace.add_lwpolyline(np.array(corners) * scale, close=True, dxfattribs={"layer": "A-WALL"})
    door(modelspace, (2, 0), 0.9, scale=scale)


def door(modelspace, hinge, leaf, *, scale=1.0, start=0, leaf_at=90):
    """A leaf open at `leaf_at` degrees and an arc over a right angle from `start`."""
    x, y = np.array(hinge) * scale
    r, a = leaf * scale, math.radians(leaf_at)
    attributes = {"layer": "A-DOOR"}
    modelspace.add_arc((x, y), r, start, start + 90, dxfattribs=attributes)
    modelspace.add_line((x, y), (x + r * math.cos(a), y + r * math.sin(a)), dxfattribs=attributes)


def notes(imported, code):
    return [note for note in imported.notes if note.code == code]


def test_lines_and_polylines_of_wall_layers_become_thin_walls(tmp_path):
    def draw(modelspace, document):
        house(modelspace, document)
        modelspace.add_line((0, 0), (9, 9), dxfattribs={"layer": "dimensions"})

    imported = read_dxf(plan(tmp_path, draw), ImportOptions())
    (draft,) = imported.drafts
    walls = [w for w in draft.walls if not w.openings]
    assert len(walls) == 8
    assert sum(w.length_m for w in walls) == pytest.approx(2 * (6 + 4) + 2 * (5.6 + 3.6))
    assert any("'dimensions' (1)" in n.message for n in notes(imported, "import.skipped"))
    write_draft(draft)


def test_curves_are_walls_of_short_chords(tmp_path):
    def draw(modelspace, _document):
        modelspace.add_arc((0, 0), 2.0, 0, 180, dxfattribs={"layer": "wand"})

    walls = read_dxf(plan(tmp_path, draw), ImportOptions(units="m")).drafts[0].walls
    assert sum(w.length_m for w in walls) == pytest.approx(2 * math.pi, rel=0.005)
    middles = [((w.start[0] + w.end[0]) / 2, (w.start[1] + w.end[1]) / 2) for w in walls]
    assert all(abs(math.hypot(*m) - 2) < 0.03 for m in middles)


@pytest.mark.parametrize(
    ("start", "leaf_at", "side", "along"),
    [
        # the leaf stands at one end of its arc, the doorway is at the other
        (0, 90, "left", (1, 0)),
        (0, 0, "right", (0, 1)),
        (90, 180, "left", (0, 1)),
        (180, 180, "right", (0, -1)),
    ],
)
def test_a_door_is_shut_where_its_leaf_is_not_drawn(tmp_path, start, leaf_at, side, along):
    def draw(modelspace, _document):
        modelspace.add_line((0, -1), (4, -1), dxfattribs={"layer": "WALL"})
        door(modelspace, (2, 0), 0.9, start=start, leaf_at=leaf_at)

    (frame,) = [w for w in read_dxf(plan(tmp_path, draw), ImportOptions()).drafts[0].walls if w.openings]
    (opening,) = frame.openings
    assert (opening.fill.hinge, opening.fill.side) == ("start", side)
    assert frame.length_m == pytest.approx(0.92)
    heading = (np.array(frame.end) - frame.start) / frame.length_m
    np.testing.assert_allclose(heading, along, atol=1e-6)
    # the hinge, on the face of the swing side, is where it was drawn
    out = np.array([-heading[1], heading[0]]) * (1 if side == "left" else -1)
    np.testing.assert_allclose(frame.start + 0.01 * heading + frame.thickness_m / 2 * out, (2, 0), atol=1e-6)


@pytest.mark.parametrize("mirror", [1, -1])
def test_a_door_block_is_read_wherever_and_however_it_is_inserted(tmp_path, mirror):
    def draw(modelspace, document):
        block = document.blocks.new("PUERTA")
        door(block, (0, 0), 0.8)
        modelspace.add_line((0, 0), (9, 0), dxfattribs={"layer": "MURO"})
        modelspace.add_blockref("PUERTA", (5, 2), dxfattribs={"rotation": 90, "xscale": mirror})

    imported = read_dxf(plan(tmp_path, draw), ImportOptions())
    (frame,) = [w for w in imported.drafts[0].walls if w.openings]
    # the block's doorway runs along +x (mirrored: -x); turned by 90 degrees along +y (-y); its leaf stands towards -x
    heading = (np.array(frame.end) - frame.start) / frame.length_m
    np.testing.assert_allclose(heading, (0, mirror), atol=1e-6)
    assert frame.openings[0].fill.side == ("left" if mirror == 1 else "right")
    assert notes(imported, "import.read")[-1].detail == {"doors": 1, "door_blocks": 1}


def test_a_toilet_block_is_a_toilet_at_its_wall_and_other_blocks_are_said(tmp_path):
    def draw(modelspace, document):
        for name in ("P-Toilet", "SOFA"):
            block = document.blocks.new(name)
            block.add_lwpolyline([(0, -0.2), (0.7, -0.2), (0.7, 0.2), (0, 0.2)], close=True)
            modelspace.add_blockref(name, (3.0, 0.1))
        modelspace.add_line((0, 0), (9, 0), dxfattribs={"layer": "muro"})

    imported = read_dxf(plan(tmp_path, draw), ImportOptions())
    (toilet,) = imported.drafts[0].fixtures
    assert (toilet.class_name, toilet.wall) == ("toilet", "face_1")
    assert toilet.pose == pytest.approx((3.35, 0.01, math.pi / 2))
    assert any("1 SOFA" in n.message for n in notes(imported, "import.skipped"))


def test_walls_inside_of_a_block_that_is_the_whole_plan_are_found(tmp_path):
    def draw(modelspace, document):
        block = document.blocks.new("FLOOR1")
        block.add_line((0, 0), (5, 0), dxfattribs={"layer": "WALLS"})
        modelspace.add_blockref("FLOOR1", (10, 10), dxfattribs={"rotation": 90})

    (wall,) = read_dxf(plan(tmp_path, draw), ImportOptions()).drafts[0].walls
    np.testing.assert_allclose(sorted([wall.start, wall.end]), [(10, 10), (10, 15)], atol=1e-9)


def test_lines_drawn_twice_are_one_wall(tmp_path):
    def draw(modelspace, _document):
        modelspace.add_line((0, 0), (5, 0), dxfattribs={"layer": "WALL"})
        modelspace.add_line((5, 0), (0, 0), dxfattribs={"layer": "WALL"})

    imported = read_dxf(plan(tmp_path, draw), ImportOptions())
    assert len(imported.drafts[0].walls) == 1
    assert [n.detail["twice"] for n in notes(imported, "import.skipped")] == [1]


def test_a_wrong_unit_is_reported_with_a_proposal_and_not_applied(tmp_path):
    # drawn in inches, the header says millimetres
    path = plan(tmp_path, lambda modelspace, document: house(modelspace, document, scale=1 / 0.0254), unit=MM)
    imported = read_dxf(path, ImportOptions())
    (finding,) = notes(imported, "WK-E041")
    assert "looks drawn in inches" in finding.message
    assert "--units in" in finding.hint
    assert max(w.length_m for w in imported.drafts[0].walls) == pytest.approx(6 / 0.0254 / 1000)
    again = read_dxf(path, ImportOptions(units="in"))
    assert not notes(again, "WK-E041")
    assert max(w.length_m for w in again.drafts[0].walls) == pytest.approx(6.0)


def test_without_a_unit_the_user_is_asked_with_the_evidence(tmp_path):
    with pytest.raises(MapError, match=r"declares no unit; it looks drawn in metres: door leaf 0\.9") as caught:
        read_dxf(plan(tmp_path, house, unit=UNITLESS), ImportOptions())
    assert "--units m" in caught.value.hint


def test_layers_are_the_users_choice(tmp_path):
    def draw(modelspace, _document):
        modelspace.add_line((0, 0), (5, 0), dxfattribs={"layer": "03_outline"})
        modelspace.add_line((0, 1), (5, 1), dxfattribs={"layer": "04_text"})

    path = plan(tmp_path, draw)
    assert len(read_dxf(path, ImportOptions(layers=("03*",))).drafts[0].walls) == 1
    with pytest.raises(MapError, match=r"no layer's name means wall; there are .*'03_outline' \(1 lines\)"):
        read_dxf(path, ImportOptions())
    with pytest.raises(MapError, match="no layer matches attic"):
        read_dxf(path, ImportOptions(layers=("attic",)))


def test_without_ezdxf_the_error_names_the_extra(tmp_path, monkeypatch):
    monkeypatch.setitem(sys.modules, "ezdxf", None)
    with pytest.raises(MapError, match="needs the package ezdxf") as caught:
        read_dxf(tmp_path / "plan.dxf", ImportOptions())
    assert caught.value.hint == "pip install 'wallkit[dxf]'"


@pytest.mark.parametrize(
    "content", [b"", b"AC1027\0\0", b"0\nSECTION\n", b"  0\nSECTION\n  2\nENTITIES\n0\nLINE\n10\nx\n"]
)
def test_what_is_no_drawing_is_refused(tmp_path, content):
    path = tmp_path / "plan.dxf"
    path.write_bytes(content)
    with pytest.raises(MapError) as caught:
        read_dxf(path, ImportOptions())
    assert caught.value.hint


def test_a_broken_drawing_gives_a_reason_and_never_a_traceback(tmp_path):
    rng = np.random.default_rng(11)
    good = plan(tmp_path, house).read_bytes()
    start = good.index(b"ENTITIES")
    path = tmp_path / "broken.dxf"
    for _ in range(40):
        broken = bytearray(good[: rng.integers(start, len(good))]) if rng.random() < 0.3 else bytearray(good)
        for at in rng.integers(start, len(broken), 12):
            broken[at] = rng.choice(list(b"0123456789.-eE\nA \xff"))
        path.write_bytes(bytes(broken))
        with suppress(MapError):
            for draft in read_dxf(path, ImportOptions()).drafts:
                write_draft(draft)


@pytest.mark.data
def test_bishop_says_millimetres_and_inches_are_proposed(data):
    path = data / "maps/dxf/bishop_overland_floorplan.dxf"
    assert recognise(path) == "dxf"
    (finding,) = notes(import_map(path, ImportOptions()), "WK-E041")
    assert "says millimetres, but looks drawn in inches" in finding.message
    again = import_map(path, ImportOptions(units="in"))
    assert not notes(again, "WK-E041")
    widths = sorted(w.openings[0].along[1] - 0.02 for w in again.drafts[0].walls if w.openings)
    # leaves of 24, 28, 30 and 36 inches, as drawn
    assert widths == pytest.approx([0.6096, 0.7112, *[0.762] * 6, *[0.9144] * 2], abs=1e-6)
    write_draft(again.drafts[0])


@pytest.mark.data
def test_ceco_is_read_in_metres_with_its_three_door_blocks(data):
    imported = import_map(data / "maps/dxf/ceco_architecture_53.dxf", ImportOptions())
    details = [n.detail for n in notes(imported, "import.read")]
    assert details[0] == {"unit": "m", "declared": "m"}
    assert (details[1]["width_m"], details[1]["depth_m"]) == pytest.approx((43.1, 32.6), abs=0.05)
    assert details[-1] == {"doors": 3, "door_blocks": 3}
    assert not notes(imported, "WK-E041")
    write_draft(imported.drafts[0])
