"""The registry of exporters: every one says something of every map, refuses what it cannot, and writes nothing itself."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from tests.maps.drawn import box, placed, ring, robot
from tests.maps.flat import flat
from wallkit.errors import MapError
from wallkit.maps.exporters import EXPORTERS, ExportOptions, export_map, format_of
from wallkit.maps.importers import IMPORTERS
from wallkit.maps.read import read_map
from wallkit.maps.xml import parse

OUTS = {name: e.suffixes[0] if e.suffixes else "" for name, e in EXPORTERS.items()}


@pytest.mark.parametrize("name", EXPORTERS)
def test_every_exporter_makes_whole_files_and_touches_neither_map_nor_disk(tmp_path, name):
    drawn = flat()
    before = drawn.document.data
    out = tmp_path / f"flat{OUTS[name]}"
    first = export_map(drawn, out, ExportOptions(), format_name=name)
    assert first.files
    assert all(data for data in first.files.values())
    assert list(tmp_path.iterdir()) == []
    assert drawn.document.data == before
    # the same map, the same bytes
    assert export_map(flat(), out, ExportOptions(), format_name=name).files == first.files
    assert {note.code for note in first.notes} <= {"export.wrote", "export.taken", "export.lost"}
    assert first.notes[0].code in ("export.wrote", "export.taken")
    for path in first.files:
        assert path.parent == (out if EXPORTERS[name].is_folder else tmp_path)


@pytest.mark.parametrize("name", EXPORTERS)
def test_every_exporter_takes_a_map_without_classes_doors_or_header(tmp_path, name):
    """A plain URDF: walls by name, a cylinder, a mesh that is not there, a link without anything."""
    column = (
        '<link name="pillar"><collision><geometry><cylinder radius="0.2" length="2"/></geometry></collision></link>'
    )
    mesh = '<link name="sofa"><collision><geometry><mesh filename="sofa.stl"/></geometry></collision></link>'
    pieces = [*ring("wall", 0, 0, 4, 3), column, placed("pillar", "2 1 1"), mesh, placed("sofa", "1 1 0")]
    data = robot(*pieces, '<link name="frame"/>', placed("frame", "0 0 0"))
    data = data.replace(b'<wk:object class="wall"/>', b"").replace(b' xmlns:wk="urn:wallkit:map:1"', b"")
    plain = read_map(parse(data, "plain.urdf"))
    options = ExportOptions(z_m=0.3) if "z_m" in EXPORTERS[name].options else ExportOptions()
    assert export_map(plain, tmp_path / f"x{OUTS[name]}", options, format_name=name).files


@pytest.mark.parametrize("name", ["pgm", "fields"])
def test_a_cut_needs_a_height_from_somebody(name):
    bare = read_map(parse(robot(*ring("wall", 0, 0, 4, 3)), "bare.urdf"))
    with pytest.raises(MapError, match="at which height") as caught:
        export_map(bare, Path("x"), ExportOptions(), format_name=name)
    assert "--z 0.30" in caught.value.hint
    with pytest.raises(MapError, match="nothing of the map is cut at 9 m"):
        export_map(bare, Path("x"), ExportOptions(z_m=9.0), format_name=name)


def test_a_suffix_tells_the_format_and_the_longest_one_wins():
    told = {"a.yaml": "pgm", "a.pgm": "pgm", "a.building.yaml": "rmf", "a.sdf": "sdf", "a.wkmap.urdf": "urdf"}
    assert {name: format_of(Path(name)) for name in told} == told
    with pytest.raises(MapError) as caught:
        format_of(Path("folder"))
    assert caught.value.hint == f"name it: --format {'|'.join(EXPORTERS)}"


def test_an_unknown_format_is_answered_with_the_closest():
    with pytest.raises(MapError, match="no exporter 'geojsn'") as caught:
        export_map(flat(), Path("x"), ExportOptions(), format_name="geojsn")
    assert "did you mean 'geojson'" in caught.value.hint


@pytest.mark.parametrize(
    ("name", "options", "flag"),
    [
        ("rmf", ExportOptions(z_m=0.3), "--z"),
        ("sdf", ExportOptions(cell_m=0.1), "--resolution"),
        ("urdf", ExportOptions(doors="open"), "--doors"),
        ("fields", ExportOptions(is_solid=True), "--solid"),
        ("pgm", ExportOptions(crs="wgs84"), "--crs"),
    ],
)
def test_an_option_that_a_format_would_ignore_is_refused(name, options, flag):
    with pytest.raises(MapError, match=f"no use for {flag}") as caught:
        export_map(flat(), Path("x"), options, format_name=name)
    assert caught.value.hint.endswith(" do")


@pytest.mark.parametrize("name", ["sdf", "geojson"])
def test_doors_as_probabilities_are_for_rasters(name):
    with pytest.raises(MapError, match="probabilities"):
        export_map(flat(), Path("x"), ExportOptions(doors="prior"), format_name=name)


def test_what_a_format_cannot_say_is_counted_in_words():
    def lost(name):
        notes = export_map(flat(), Path("x"), ExportOptions(), format_name=name).notes
        return next((note for note in notes if note.code == "export.lost"), None)

    rmf = lost("rmf")
    assert rmf.message.endswith("are not part of RMF")
    # five walls are 2.6 m high, RMF's 2.5; the door 2.1, RMF's 2.2
    assert rmf.detail["heights"] == 6
    assert rmf.detail["thicknesses other than 0.1 m"] == 5
    assert (rmf.detail["prior"], rmf.detail["window"], rmf.detail["LiDAR behaviours"]) == (1, 1, 2)
    assert lost("sdf").detail["rooms"] == 2
    assert lost("pgm").detail["prior"] == 1
    assert lost("urdf") is None


def test_the_drawing_is_the_one_that_map_show_makes():
    from wallkit.maps.draw.plan import PlanSettings, plan_svg

    (data,) = export_map(flat(), Path("a.svg"), ExportOptions(z_m=0.3)).files.values()
    assert data == plan_svg(flat(), PlanSettings(z_m=0.3))
    assert data != plan_svg(flat())


def test_importers_and_exporters_share_their_names():
    assert {"rmf", "pgm"} <= set(EXPORTERS) & set(IMPORTERS)


def test_fields_say_what_they_are_and_are_the_localizers_own(tmp_path):
    import cv2
    import numpy as np

    from wallkit.maps.grids.semantic_fields import fields_from_map

    drawn = flat()
    files = export_map(drawn, tmp_path, ExportOptions(cell_m=0.05), format_name="fields").files
    about = json.loads(files[tmp_path / "fields.json"])
    fields = fields_from_map(drawn, cell_m=0.05).fields
    (tmp_path / "fields.npz").write_bytes(files[tmp_path / "fields.npz"])
    with np.load(tmp_path / "fields.npz") as stored:
        assert set(stored.files) == {*fields.distances_m, "is_free"}
        for name, field in fields.distances_m.items():
            np.testing.assert_array_equal(stored[name], field)
            picture = cv2.imdecode(np.frombuffer(files[tmp_path / f"{name}.png"], np.uint8), cv2.IMREAD_UNCHANGED)
            seen = picture[::-1] * about["png_m_per_grey"]
            near = field < 2.5
            np.testing.assert_allclose(seen[near], field[near], atol=0.0051)
    assert about["shape"] == list(fields.shape)
    assert about["origin"] == fields.origin.tolist()
    assert set(about["fields"]) == set(fields.distances_m)
    assert about["fields"]["door"]["movable"] is True
    assert about["z_m"] == 0.3


def test_a_class_that_is_not_seen_has_no_field_and_is_named(tmp_path):
    high = box("shelf", "1 1 0.5", at="0 0 1.5", wk_class="furniture")
    drawn = read_map(parse(robot(*ring("w", 0, 0, 4, 3), high, placed("shelf", "2 1 0")), "m.urdf"))
    exported = export_map(drawn, tmp_path, ExportOptions(z_m=0.3), format_name="fields")
    assert tmp_path / "furniture.png" not in exported.files
    assert any("furniture" in note.message for note in exported.notes if note.code == "export.taken")
