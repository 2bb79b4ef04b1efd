"""Plain URDF: nothing changes but that the classes are said, and what is missing is counted once."""

from __future__ import annotations

import numpy as np
import pytest

from tests.maps.drawn import box, placed, ring, robot
from wallkit.maps.importers import ImportOptions, import_map
from wallkit.maps.read import load_map, read_map
from wallkit.maps.rules import validate
from wallkit.maps.xml import parse


def test_a_plain_map_keeps_its_links_and_says_their_classes(tmp_path):
    mesh = (
        '<link name="sofa"><collision><geometry><mesh filename="package://x/sofa.stl"/></geometry></collision></link>'
    )
    data = robot(
        *ring("wall", 0, 0, 4, 3), box("toilet", "1 1 1"), placed("toilet", "2 2 0"), mesh, placed("sofa", "1 1 0")
    )
    for said in (b'<wk:object class="wall"/>', b' xmlns:wk="urn:wallkit:map:1"'):
        data = data.replace(said, b"")
    path = tmp_path / "plain.urdf"
    path.write_bytes(data)
    imported = import_map(path, ImportOptions(scan_plane_m=0.3))
    before, after = read_map(parse(data)), read_map(parse(imported.data))
    assert after.header.scan_plane_m == 0.3
    assert {link.name: link.class_name for link in after.links.values() if link.shapes} == {
        **{f"wall_{side}": "wall" for side in "snwe"},
        "toilet": "toilet",
        "sofa": "furniture",
    }
    assert not any(link.class_is_inferred for link in after.links.values() if link.shapes)
    for link, T in before.poses().items():
        np.testing.assert_array_equal(after.poses()[link], T)
    # every byte that was there is there, in order
    rest = iter(imported.data)
    assert all(byte in rest for byte in data)
    (missing,) = [note for note in imported.notes if note.code == "import.skipped"]
    assert "1 collision meshes are missing (package://" in missing.message


@pytest.mark.data
def test_the_apartment_comes_in_whole(data, tmp_path):
    imported = import_map(data / "maps/urdf_maps/iai_apartment/apartment.urdf", ImportOptions())
    assert "117 links, 116 joints: 74 fixed, 27 prismatic, 15 revolute" in imported.notes[0].message
    assert len([note for note in imported.notes if "meshes are missing" in note.message]) == 1
    out = tmp_path / "apartment.wkmap.urdf"
    out.write_bytes(imported.data)
    assert len(load_map(out).links) == 117
    assert [f for f in validate(imported.data, select=("X", "S", "G")).findings if f.severity == "error"] == []
