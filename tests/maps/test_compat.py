"""What other programs make of a file: predictions against what they did, and yourdfpy itself."""

from __future__ import annotations

import datetime
import json
import os
from pathlib import Path

import pytest

from tests.maps.drawn import box, placed, ring, robot
from wallkit.maps.document import apply_edits
from wallkit.maps.findings.compat import views_of
from wallkit.maps.rules import validate
from wallkit.maps.rules.tolerances import Tolerances
from wallkit.pipelines.map.compat import compat_of
from wallkit.pipelines.map.verdicts import Selection

FOLDER = Path(os.environ.get("WALLKIT_TEST_DATA", "")) / "maps/malformed"
MANIFEST = FOLDER / "manifest.json"
RAN = [c for c in json.loads(MANIFEST.read_text())["cases"] if "check_urdf_6_0_0" in c] if MANIFEST.is_file() else []
# what the programs did when the files were made, as outcomes
YOURDFPY = {"valid": {"loads", "differs"}, "invalid": {"differs"}}
URDFDOM = {"accepts": {"loads", "differs"}, "rejects": {"refuses"}, "exit 0 but drops the element": {"differs"}}
SELECTION = Selection(Tolerances(), datetime.date(2026, 1, 1))


@pytest.mark.data
@pytest.mark.parametrize("case", RAN, ids=lambda case: case["file"])
def test_what_is_predicted_is_what_the_programs_did(data, case):
    report = validate(data / "maps/malformed" / case["file"])
    yourdfpy, urdfdom, _ = views_of(report.findings, report.document)
    assert yourdfpy.outcome in YOURDFPY.get(case["yourdfpy_0_0_60"], {"refuses"})
    assert urdfdom.outcome in URDFDOM[case["check_urdf_6_0_0"]]


@pytest.mark.data
@pytest.mark.parametrize("name", ["wkmap_example/restroom.wkmap.urdf", "urdf_maps/iai_apartment/apartment.urdf"])
def test_yourdfpy_puts_every_link_where_we_do(data, name):
    found = compat_of(data / "maps" / name, SELECTION, with_yourdfpy=True)
    assert found.is_same is True
    assert found.loaded.endswith("links in the same places")


def test_yourdfpy_s_own_verdict_is_told_and_broken_xml_is_not_given_to_it(tmp_path):
    for data, said in (
        (robot('<link name="a"><collision><geometry/></collision></link>', placed("a", "0 0 0")), "stopped with "),
        (b'<!DOCTYPE robot [<!ENTITY e "x">]><robot name="&e;"/>', "not tried"),
    ):
        path = tmp_path / "m.urdf"
        path.write_bytes(data)
        found = compat_of(path, SELECTION, with_yourdfpy=True)
        assert found.loaded.startswith(said)
        assert not found.is_good


def test_moving_an_extension_out_of_geometry_keeps_it_and_lets_the_file_load(tmp_path):
    path = tmp_path / "m.urdf"
    bad = box("a", "1 1 1").replace("<geometry>", '<geometry><wk:ignore rule="WK-E004" reason="a pillar"/>')
    path.write_bytes(robot(bad, placed("a", "0 0 0")))
    (finding,) = (f for f in validate(path, select=["P001"]).findings)
    path.write_bytes(apply_edits(path.read_bytes(), finding.fix.edits))
    assert b'</geometry><wk:ignore rule="WK-E004" reason="a pillar"/></collision>' in path.read_bytes()
    assert compat_of(path, SELECTION, with_yourdfpy=True).is_same


# --------------------------------------------------------------------------------------------------------- meshes


def mesh(filename, where="collision"):
    return f'<link name="m"><{where}><geometry><mesh filename="{filename}"/></geometry></{where}></link>' + placed(
        "m", "0 0 0"
    )


@pytest.mark.parametrize(
    ("filename", "expected"),
    [
        ("sofa.stl", []),
        ("meshes/none.stl", ["WK-P010"]),
        ("package://flat/sofa.stl", ["WK-P010"]),
        ("../sofa.stl", ["WK-P011"]),
        ("meshes/../../sofa.stl", ["WK-P011"]),
        ("/etc/passwd", ["WK-P011"]),
        ("file:///etc/passwd", ["WK-P011"]),
        ("https://example.org/sofa.stl", ["WK-P011"]),
        ("link.stl", ["WK-P011"]),
    ],
)
def test_a_mesh_is_a_file_in_the_map_s_folder_or_it_is_told(tmp_path, filename, expected):
    inside = tmp_path / "map"
    (inside / "meshes").mkdir(parents=True)
    (inside / "sofa.stl").write_bytes(b"solid")
    (tmp_path / "sofa.stl").write_bytes(b"solid")
    (inside / "link.stl").symlink_to(tmp_path / "sofa.stl")
    report = validate(robot(*ring("r", 0, 0, 4, 3), mesh(filename)), source=str(inside / "m.urdf"), select=["P"])
    assert [f.code for f in report.findings if f.severity == "error"] == expected


def test_missing_meshes_of_pictures_only_are_a_warning():
    report = validate(robot(mesh("none.dae", "visual")), select=["P010"])
    assert [f.severity for f in report.findings] == ["warning"]


@pytest.mark.data
def test_real_files_tell_their_meshes_and_xacro_once(data):
    apartment = validate(data / "maps/urdf_maps/iai_apartment/apartment.urdf")
    assert apartment.map is not None
    assert len(apartment.map.links) == 117
    (meshes,) = (f for f in apartment.findings if f.code.startswith(("WK-P010", "WK-P011")))
    # the file has 179 lines with a mesh; two of them stand in comments
    assert meshes.detail["count"] == 177
    assert sum(meshes.detail["folders"].values()) == 177
    assert sum(f.code == "WK-E030" for f in apartment.findings) == 100
    burger = validate(data / "maps/urdf_robots/turtlebot3_burger.urdf")
    told = {f.message.split(" ")[0]: f.detail["count"] for f in burger.findings if f.code == "WK-P012"}
    assert told == {"<xacro:arg>": 1, "<xacro:property>": 1, "${namespace}": 25}
