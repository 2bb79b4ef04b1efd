"""The registry of importers: formats are recognised by content, every importer refuses nonsense with a reason."""

from __future__ import annotations

import numpy as np
import pytest

from wallkit.errors import MapError
from wallkit.maps.importers import IMPORTERS, import_map, recognise
from wallkit.maps.importers.imported import ImportOptions, Names

HEADS = {
    "rmf": "coordinate_system: reference_image\nlevels:\n  L1: {}\n",
    "pgm": "image: map.pgm\nresolution: 0.05\norigin: [0, 0, 0]\n",
    "lines": "source_id: a\nfeatures:\n  - id: 0\n",
    "dxf": "  0\nSECTION\n  2\nHEADER\n",
    "urdf": '<?xml version="1.0"?>\n<robot name="r">\n',
    "csv": "# boxes\nname,class,x,y,z,yaw,sx,sy,sz\n",
}


@pytest.mark.parametrize("name", IMPORTERS)
@pytest.mark.parametrize("suffix", [".yaml", ".txt", ""])
def test_a_format_is_recognised_by_its_content_whatever_its_name(tmp_path, name, suffix):
    path = tmp_path / f"file{suffix}"
    path.write_text(HEADS[name])
    assert recognise(path) == name


def test_a_suffix_helps_where_the_content_does_not(tmp_path):
    path = tmp_path / "boxes.csv"
    path.write_text("a;b\n")
    assert recognise(path) == "csv"


def test_what_cannot_be_told_is_asked_for(tmp_path):
    path = tmp_path / "plan.bin"
    path.write_bytes(b"\0\1\2")
    with pytest.raises(MapError) as caught:
        recognise(path)
    assert caught.value.hint == "name it: --format rmf|pgm|lines|dxf|csv|urdf"


def test_an_unknown_format_is_answered_with_the_closest(tmp_path):
    with pytest.raises(MapError, match="no importer 'dfx'") as caught:
        import_map(tmp_path / "x", ImportOptions(), format_name="dfx")
    assert "did you mean 'dxf'" in caught.value.hint


@pytest.mark.parametrize("name", IMPORTERS)
def test_every_importer_refuses_a_missing_file_a_folder_and_noise(tmp_path, name):
    noise = tmp_path / "noise"
    rng = np.random.default_rng(1)
    for path in (tmp_path / "missing", tmp_path, noise):
        for size in (0, 3, 200, 5000) if path == noise else (0,):
            if path == noise:
                noise.write_bytes(rng.bytes(size))
            with pytest.raises(MapError) as caught:
                IMPORTERS[name](path, ImportOptions())
            assert str(path) in caught.value.where
            assert caught.value.message


def test_link_names_are_valid_and_unique_whatever_the_file_calls_its_things():
    names = Names()
    taken = [names.take(wanted) for wanted in ("map", "main door", "main door", "3", "", "Tür", "a.b-c_d")]
    assert taken == ["map_2", "main_door", "main_door_2", "n3", "thing", "T_r", "a.b-c_d"]
