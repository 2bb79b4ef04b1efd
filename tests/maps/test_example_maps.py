"""The maps to start from: clean under every rule, complete, tidy, and the same to another URDF loader."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import wallkit
from wallkit.maps.canonical import canonical
from wallkit.maps.read import load_map
from wallkit.maps.rules import validate
from wallkit.maps.space import rooms_by_flood
from wallkit.maps.xml import parse

FOLDER = Path(wallkit.__file__).parents[1] / "maps"
MAPS = sorted(FOLDER.glob("*.wkmap.urdf"))


def test_they_are_there():
    assert [path.name.partition(".")[0] for path in MAPS] == ["corridor", "office", "restroom"]


@pytest.mark.parametrize("path", MAPS, ids=lambda path: path.stem)
def test_no_rule_warns(path):
    report = validate(path)
    assert [str(finding) for finding in report.findings if finding.severity != "info"] == []
    assert report.skipped == ()


@pytest.mark.parametrize("path", MAPS, ids=lambda path: path.stem)
def test_header_classes_rooms_and_door_states_are_said(path):
    semantic_map = load_map(path)
    header = semantic_map.header
    assert (header.format, header.units, header.scan_plane_m) == ("1.0", "m rad", 0.3)
    assert header.max_range_m is not None
    assert header.robot_radius_m is not None
    used = {link.class_name for link in semantic_map.links.values()} - {""}
    assert used == {row.name for row in semantic_map.all_classes}
    assert not any(link.class_is_inferred for link in semantic_map.links.values() if link.name != "map")
    assert semantic_map.doors
    for joint in semantic_map.doors:
        assert joint.state is not None
        assert joint.state.rest is not None
        assert sum((joint.state.prior or {}).values()) == pytest.approx(1.0)


@pytest.mark.parametrize("path", MAPS, ids=lambda path: path.stem)
def test_the_declared_rooms_are_those_that_walls_and_closed_doors_enclose(path):
    """Above the furniture, below the heads of doors."""
    import shapely

    semantic_map = load_map(path)
    regions = [region.polygon for region in rooms_by_flood(semantic_map, 2.05)]
    for room in semantic_map.rooms.values():
        floor = shapely.Polygon(room.floor)
        inside = shapely.union_all([region for region in regions if region.intersects(floor.buffer(-0.1))])
        covered = inside.intersection(floor).area / floor.area
        assert covered > 0.9, room.id


@pytest.mark.parametrize("path", MAPS, ids=lambda path: path.stem)
def test_they_are_in_canonical_form(path):
    assert canonical(parse(path.read_bytes())) == path.read_bytes()


@pytest.mark.parametrize("path", MAPS, ids=lambda path: path.stem)
def test_yourdfpy_places_every_link_where_wallkit_does(path):
    import yourdfpy

    other = yourdfpy.URDF.load(str(path), build_scene_graph=True, load_meshes=False, build_collision_scene_graph=False)
    semantic_map = load_map(path)
    rng = np.random.default_rng(3)
    leading = [joint for joint in semantic_map.doors if joint.mimic is None]
    states = {joint.name: float(rng.uniform(*joint.travel)) for joint in leading}
    other.update_cfg(states)
    poses = semantic_map.poses(states)
    assert set(other.link_map) == set(poses)
    for link, T in poses.items():
        np.testing.assert_allclose(other.get_transform(link, "map"), T, atol=1e-9)


@pytest.mark.parametrize("path", MAPS, ids=lambda path: path.stem)
def test_their_pictures_are_small_and_show_in_the_readme(path):
    name = path.name.partition(".")[0]
    assert (FOLDER / f"{name}.png").stat().st_size < 60_000
    assert f"({name}.png)" in (FOLDER / "README.md").read_text(encoding="utf-8")
