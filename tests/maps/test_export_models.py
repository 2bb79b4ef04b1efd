"""URDF with visuals and SDF: the same links at the same places, and every byte or element where it belongs."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pytest
import yourdfpy
from lxml import etree

from tests.maps.drawn import box, placed, robot, wall
from tests.maps.flat import flat
from wallkit.maps.document import WK_NAMESPACE
from wallkit.maps.draft.doors import DraftDoor
from wallkit.maps.exporters import ExportOptions, export_map
from wallkit.maps.exporters.sdf import rpy_from_rotation
from wallkit.maps.model import SemanticMap
from wallkit.maps.read import load_map, read_map, transform_from_origin
from wallkit.maps.rules import validate
from wallkit.maps.xml import parse

SHAPES = """<link name="stand"><wk:object class="furniture"/>
  <collision><origin xyz="0 0 0.5" rpy="0.1 0.2 0.3"/><geometry><cylinder radius="0.2" length="1"/></geometry></collision>
  <collision><origin xyz="0 0 1.2"/><geometry><sphere radius="0.2"/></geometry></collision></link>"""


def made(drawn, name, **options):
    (data,) = export_map(drawn, Path(f"x.{name}"), ExportOptions(**options), format_name=name).files.values()
    return data


def reread(data):
    return read_map(parse(data, "again.urdf"))


# ------------------------------------------------------------------------------------------------------ URDF


def test_visuals_are_only_added():
    drawn = flat()
    data = made(drawn, "urdf")
    without = data.replace(b"\r", b"")
    for piece in (b"visual", b"material"):
        assert piece not in drawn.document.data
    # taking out what was put in leaves every byte there was
    bare = re.sub(rb"\n *<visual .*?</visual>", b"", without)
    bare = re.sub(rb'<material name="class_\w+"><color [^>]*/></material>\n *', b"", bare)
    assert bare == drawn.document.data
    # and a second time there is nothing to add
    assert made(reread(data), "urdf") == data


def test_every_collision_has_a_visual_of_its_class_and_nothing_is_found_wrong():
    drawn = flat()
    data = made(drawn, "urdf")
    before, after = validate(drawn.document.data), validate(data)
    kept = [f.code for f in before.findings if f.code != "WK-P007"]
    assert [finding.code for finding in after.findings] == kept
    tree = etree.fromstring(data)
    materials = {m.get("name"): m.find("color").get("rgba") for m in tree.findall("material")}
    assert materials["class_glass"].endswith(" 0.4")
    for link in tree.findall("link"):
        collisions, visuals = link.findall("collision"), link.findall("visual")
        assert len(collisions) == len(visuals)
        for collision, visual in zip(collisions, visuals, strict=True):
            for tag in ("origin", "geometry"):
                assert etree.tostring(collision.find(tag)).strip() == etree.tostring(visual.find(tag)).strip()
            wk_class = link.find(f"{{{WK_NAMESPACE}}}object").get("class")
            assert visual.find("material").get("name") == f"class_{wk_class}"
    names = [element.get("name") for element in tree.iter("collision", "visual")]
    assert len(names) == len(set(names))


def test_yourdfpy_draws_it_and_has_the_links_where_we_have_them(tmp_path):
    drawn = flat()
    path = tmp_path / "flat.urdf"
    path.write_bytes(made(drawn, "urdf"))
    loaded = yourdfpy.URDF.load(str(path), build_scene_graph=True, load_meshes=False)
    assert len(loaded.scene.geometry) == sum(len(link.shapes) for link in drawn.links.values())
    for link, T in drawn.poses().items():
        np.testing.assert_allclose(loaded.get_transform(link, "map"), T, atol=1e-9)


def test_a_link_with_visuals_keeps_them_and_odd_layouts_survive():
    seen = box("bin", "0.3 0.3 0.5", wk_class="trash")
    seen = seen.replace("</link>", '<visual><geometry><sphere radius="0.3"/></geometry></visual></link>')
    one_line = robot(seen, placed("bin", "1 1 0"), SHAPES, placed("stand", "2 2 0")).replace(b"\n", b"")
    drawn = reread(one_line)
    exported = export_map(drawn, Path("x.urdf"), ExportOptions())
    assert any("1 links have visuals of their own" in note.message for note in exported.notes)
    (data,) = exported.files.values()
    links = {link.get("name"): link for link in etree.fromstring(data).findall("link")}
    assert [len(links[name].findall("visual")) for name in ("map", "bin", "stand")] == [0, 1, 2]
    assert b"\n" not in data
    windows = flat().document.data.replace(b"\n", b"\r\n")
    assert made(reread(windows), "urdf").replace(b"\r\n", b"\n") == made(flat(), "urdf")


# ------------------------------------------------------------------------------------------------------- SDF

# of SDFormat 1.9 (sdformat.org/spec?ver=1.9), what this exporter may write where
ALLOWED = {
    "sdf": {"model"},
    "model": {"static", "link", "joint"},
    "link": {"pose", "collision", "visual"},
    "collision": {"pose", "geometry"},
    "visual": {"pose", "geometry", "material", "transparency"},
    "geometry": {"box", "cylinder", "sphere", "mesh"},
    "box": {"size"},
    "cylinder": {"radius", "length"},
    "sphere": {"radius"},
    "mesh": {"uri", "scale"},
    "material": {"ambient", "diffuse"},
    "joint": {"parent", "child", "axis"},
    "axis": {"xyz", "limit"},
    "limit": {"lower", "upper", "effort", "velocity"},
}


def pose_of(element):
    """(4, 4) of an element's <pose>: x y z roll pitch yaw, fixed axes as in URDF."""
    numbers = element.findtext("pose").split()
    origin = parse(f'<origin xyz="{" ".join(numbers[:3])}" rpy="{" ".join(numbers[3:])}"/>'.encode()).root
    return transform_from_origin(origin)


def furnished():
    """The flat with a tilted cylinder, a sphere and a mesh."""
    mesh = (
        '<link name="lamp"><collision><geometry><mesh filename="no.stl" scale="1 2 3"/></geometry></collision></link>'
    )
    more = "\n".join(
        [SHAPES, placed("stand", "1 1 0", "0.2 -0.3 2"), mesh, placed("lamp", "0 0 1", "0 1.5707963267948966 0")]
    )
    return reread(flat().document.data.replace(b"</robot>", f"{more}\n</robot>".encode()))


@pytest.mark.parametrize("doors", [None, "open", "closed"])
def test_sdf_has_our_links_at_our_poses(doors):
    drawn = furnished()
    root = etree.fromstring(made(drawn, "sdf", doors=doors))
    assert (root.tag, root.get("version")) == ("sdf", "1.9")
    (model,) = root
    assert model.findtext("static") == "true"
    poses = drawn.poses(drawn.door_states(doors or "rest"))
    links = {link.get("name"): link for link in model.findall("link")}
    assert set(links) == set(poses)
    for name, T in poses.items():
        assert links[name].find("pose").get("relative_to") == "__model__"
        np.testing.assert_allclose(pose_of(links[name]), T, atol=1e-9)
        shapes = drawn.links[name].shapes
        for kind in ("collision", "visual"):
            for shape, element in zip(shapes, links[name].findall(kind), strict=True):
                np.testing.assert_allclose(pose_of(element), shape.T_link_shape, atol=1e-9)
                assert element.find("geometry")[0].tag == shape.kind
        if shapes:
            wk_class = links[name].find(f"{{{WK_NAMESPACE}}}object")
            assert (wk_class.get("class") if wk_class is not None else "") == drawn.links[name].class_name


def test_sdf_holds_only_what_sdformat_knows_and_names_siblings_apart():
    twin = box("at_bin", "0.3 0.3 0.5", wk_class="trash")
    drawn = reread(robot(twin, placed("at_bin", "1 1 0"), box("bin", "1 1 1"), placed("bin", "2 2 0")))
    for data in (made(furnished(), "sdf"), made(drawn, "sdf")):
        root = etree.fromstring(data)
        for element in root.iter():
            own = [child.tag for child in element if not child.tag.startswith("{")]
            assert set(own) <= ALLOWED.get(element.tag, set()), element.tag
        model = root[0]
        names = [element.get("name") for element in model if element.get("name")]
        assert len(names) == len(set(names))
        assert {element.text for element in model.iter("parent", "child")} <= {
            link.get("name") for link in model.iter("link")
        }
        for link in model.findall("link"):
            parts = [element.get("name") for element in link if element.get("name")]
            assert len(parts) == len(set(parts))


def test_a_door_that_does_not_rest_at_zero_keeps_its_travel():
    """Joint states of SDFormat count from how the model is written."""
    drawn = flat(door=DraftDoor("leaf", rest=0.5))
    for doors, state in ((None, 0.5), ("closed", 0.0), ("open", np.pi / 2)):
        (axis,) = etree.fromstring(made(drawn, "sdf", doors=doors)).iter("axis")
        travel = [float(axis.findtext(f"limit/{end}")) for end in ("lower", "upper")]
        assert travel == pytest.approx([-state, np.pi / 2 - state], abs=1e-6)
        assert [float(v) for v in axis.findtext("xyz").split()] == [0, 0, 1]


def test_rpy_is_the_inverse_of_urdfs_rotation():
    rng = np.random.default_rng(3)
    turns = [
        *rng.uniform(-np.pi, np.pi, (200, 3)),
        *((r, s * np.pi / 2, y) for s in (1, -1) for r, y in rng.uniform(-3, 3, (20, 2))),
    ]
    for roll, pitch, yaw in turns:
        text = f'<origin rpy="{roll:.17g} {pitch:.17g} {yaw:.17g}"/>'
        R = transform_from_origin(parse(text.encode()).root)[:3, :3]
        back = " ".join(f"{angle:.17g}" for angle in rpy_from_rotation(R))
        again = transform_from_origin(parse(f'<origin rpy="{back}"/>'.encode()).root)[:3, :3]
        np.testing.assert_allclose(again, R, atol=1e-7)


# ------------------------------------------------------------------------------------- what others load of it


def random_map(rng: np.random.Generator) -> bytes:
    """Walls anywhere, things on walls on things, doors that turn, slide or follow; everything turned freely."""
    pieces: list[str] = []
    names = ["map"]
    movable: list[str] = []
    for i in range(int(rng.integers(3, 15))):
        name, parent = f"l{i}", str(rng.choice(names))
        xyz, rpy = rng.uniform(-5, 5, 3), rng.uniform(-3, 3, 3)
        size = " ".join(f"{v:.4f}" for v in rng.uniform(0.05, 2, 3))
        pieces.append(box(name, size, wk_class=str(rng.choice(["wall", "door", "furniture"]))))
        kind = str(rng.choice(["fixed", "fixed", "revolute", "continuous", "prismatic"]))
        origin = f'<origin xyz="{xyz[0]:.6f} {xyz[1]:.6f} {xyz[2]:.6f}" rpy="{rpy[0]:.9f} {rpy[1]:.9f} {rpy[2]:.9f}"/>'
        body = f'<parent link="{parent}"/><child link="{name}"/>{origin}'
        if kind != "fixed":
            axis = rng.normal(size=3)
            axis /= np.linalg.norm(axis)
            body += f'<axis xyz="{axis[0]:.9f} {axis[1]:.9f} {axis[2]:.9f}"/><limit effort="1" velocity="1"'
            body += "/>" if kind == "continuous" else ' lower="-1" upper="1.2"/>'
            if movable and rng.random() < 0.3:
                leader = str(rng.choice(movable))
                body += f'<mimic joint="{leader}" multiplier="{rng.uniform(-0.5, 0.5):.3f}" offset="0.1"/>'
            else:
                movable.append(f"j{i}")
        pieces.append(f'<joint name="j{i}" type="{kind}">{body}</joint>')
        names.append(name)
    return robot(*pieces)


def loaded_alike(data: bytes, drawn: SemanticMap, folder: Path, rng: np.random.Generator) -> None:
    """yourdfpy has every link where the model has it, at random joint states."""
    path = folder / "m.urdf"
    path.write_bytes(data)
    loaded = yourdfpy.URDF.load(str(path), build_scene_graph=True, load_meshes=False)
    free = [joint.name for joint in drawn.joints.values() if joint.is_movable and joint.mimic is None]
    states = dict(zip(free, rng.uniform(-0.9, 0.9, len(free)).tolist(), strict=True))
    loaded.update_cfg(states)
    root = drawn.root
    poses = drawn.poses(states)
    assert set(loaded.link_map) == set(drawn.links) == set(poses)
    for link, T in poses.items():
        np.testing.assert_allclose(loaded.get_transform(link, root), T, atol=1e-7)


@pytest.mark.parametrize("seed", range(25))
def test_what_validate_accepts_yourdfpy_loads_with_the_same_poses(tmp_path, seed):
    rng = np.random.default_rng(seed)
    data = random_map(rng)
    report = validate(data, select=("X", "S", "G"))
    assert [f for f in report.findings if f.severity == "error"] == []
    loaded_alike(data, report.map, tmp_path, rng)
    # and so does what the exporter made of it
    loaded_alike(made(report.map, "urdf"), report.map, tmp_path, rng)


@pytest.mark.data
def test_example_and_apartment_load_alike(data, tmp_path):
    rng = np.random.default_rng(0)
    for name in ("wkmap_example/restroom.wkmap.urdf", "urdf_maps/iai_apartment/apartment.urdf"):
        drawn = load_map(data / "maps" / name)
        loaded_alike(made(drawn, "urdf"), drawn, tmp_path, rng)


def test_walls_of_a_map_are_seen_in_sdf_as_large_as_they_are():
    drawn = reread(robot(wall("w", (0, 0), (4, 0), 0.2)))
    (size,) = etree.fromstring(made(drawn, "sdf")).findall(".//collision/geometry/box/size")
    assert [float(v) for v in size.text.split()] == [4.0, 0.2, 2.5]
