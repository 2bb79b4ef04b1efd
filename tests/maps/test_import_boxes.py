"""CSV of boxes: every box as the table says, every fault with its line."""

from __future__ import annotations

from contextlib import suppress

import numpy as np
import pytest

from wallkit.errors import MapError
from wallkit.maps.draft.write import write_draft
from wallkit.maps.importers.boxes import COLUMNS, read_boxes
from wallkit.maps.importers.imported import ImportOptions

HEADER = ",".join(COLUMNS)


def table(tmp_path, *rows, header=HEADER):
    path = tmp_path / "boxes.csv"
    path.write_text("\n".join([header, *rows]) + "\n")
    return path


def test_walls_and_fixtures_stand_where_the_table_says(tmp_path):
    path = table(tmp_path, "w,wall,2,3,1.25,1.570796,4,0.1,2.5", "", "# a remark", "s,sink,1,1,0.8,0,0.4,0.5,0.2")
    (draft,) = read_boxes(path, ImportOptions()).drafts
    (wall,) = draft.walls
    assert wall.start == pytest.approx((2.0, 1.0), abs=1e-5)
    assert wall.end == pytest.approx((2.0, 5.0), abs=1e-5)
    assert (wall.thickness_m, wall.height_m) == (0.1, 2.5)
    (sink,) = draft.fixtures
    assert sink.pose == (1.0, 1.0, 0.0)
    assert sink.bottom_m == pytest.approx(0.7)
    assert sink.size_m == (0.4, 0.5, 0.2)


def test_boxes_keep_their_size_where_they_meet(tmp_path):
    path = table(tmp_path, "a,wall,2,0,1,0,4,0.1,2", "b,wall,4,2,1,1.570796,4,0.1,2")
    (draft,) = read_boxes(path, ImportOptions()).drafts
    assert write_draft(draft).decode().count('size="4 0.1 2"') == 2


def test_a_wall_that_hangs_is_kept_where_it_hangs(tmp_path):
    (draft,) = read_boxes(table(tmp_path, "soffit,wall,0,0,2.5,0,4,0.1,0.4"), ImportOptions()).drafts
    assert not draft.walls
    assert draft.fixtures[0].bottom_m == pytest.approx(2.3)


def test_columns_come_in_any_order_and_units_scale_lengths_but_not_angles(tmp_path):
    path = table(tmp_path, "0.5,c,column,1000,2000,1250,300,300,2500", header="yaw,name,class,x,y,z,sx,sy,sz")
    (column,) = read_boxes(path, ImportOptions(units="mm")).drafts[0].fixtures
    assert column.pose == pytest.approx((1.0, 2.0, 0.5))
    assert column.size_m == pytest.approx((0.3, 0.3, 2.5))


def test_a_table_in_millimetres_is_noticed_and_not_converted(tmp_path):
    rows = [f"w{i},wall,{1000 * i},0,1250,0,4000,100,2500" for i in range(3)]
    imported = read_boxes(table(tmp_path, *rows), ImportOptions())
    (finding,) = [note for note in imported.notes if note.code == "WK-E041"]
    assert "looks drawn in millimetres" in finding.message
    assert imported.drafts[0].walls[0].thickness_m == 100


def test_an_own_class_is_declared_and_said(tmp_path):
    imported = read_boxes(table(tmp_path, "v,vending,1,1,1,0,1,1,2"), ImportOptions())
    assert '<wk:class name="vending"' in write_draft(imported.drafts[0]).decode()
    assert any("vending" in note.message for note in imported.notes)


@pytest.mark.parametrize(
    ("rows", "header", "says", "line"),
    [
        (["a,wall,0,0,1,0,4,0.1"], HEADER, "8 values, not 9", 2),
        (["a,wall,0,0,1,0,4,0.1,2", "", "b,wall,0,zero,1,0,4,0.1,2"], HEADER, "y is 'zero', not a number", 4),
        (["a,wall,0,0,1,0,4,nan,2"], HEADER, "sy is 'nan'", 2),
        (["a,wall,0,0,1,0,4,-1,2"], HEADER, "the size is 4 x -1 x 2", 2),
        (["a,wall,0,0,1,90,4,1,2"], HEADER, "yaw is 90, more than a turn", 2),
        (["a,wall,0,0,1,0,4,1,2", "a,wall,0,5,1,0,4,1,2"], HEADER, "'a' is taken by line 2", 3),
        ([",wall,0,0,1,0,4,1,2"], HEADER, "the name is empty", 2),
        (['"a,wall,0,0,1,0,4,1,2'], HEADER, "not a row of CSV", 2),
        (["a,wall,0,0,1,0,4,1,2"], HEADER.replace("sz", "height"), "lacks sz and has 'height'", 1),
        (["a,wall,0,0,1,0,4,1,2"], HEADER.replace("sz", "sy"), "lacks sz", 1),
    ],
)
def test_every_fault_is_said_with_its_line(tmp_path, rows, header, says, line):
    path = table(tmp_path, *rows, header=header)
    with pytest.raises(MapError) as caught:
        read_boxes(path, ImportOptions())
    assert says in caught.value.message
    assert caught.value.where == f"{path}:{line}"
    assert caught.value.hint


def test_an_empty_file_a_picture_and_latin_1_are_refused(tmp_path):
    path = tmp_path / "boxes.csv"
    for content, says in (
        (b"", "is empty"),
        (b"\x89PNG\r\n\0\0", "not a text file"),
        (HEADER.encode() + b"\n\xe4", "UTF-8"),
    ):
        path.write_bytes(content)
        with pytest.raises(MapError, match=says):
            read_boxes(path, ImportOptions())


def test_a_broken_table_gives_a_reason_and_never_a_traceback(tmp_path):
    rng = np.random.default_rng(3)
    good = table(tmp_path, "w,wall,2,3,1.25,1.5,4,0.1,2.5", "s,sink,1,1,0.8,0,0.4,0.5,0.2").read_bytes()
    path = tmp_path / "broken.csv"
    for _ in range(400):
        broken = bytearray(good)
        for at in rng.integers(0, len(good), 2):
            broken[at] = rng.choice(list(b',"\n\r#-e09.xn \x00\xff'))
        path.write_bytes(bytes(broken))
        with suppress(MapError):
            for draft in read_boxes(path, ImportOptions()).drafts:
                write_draft(draft)
