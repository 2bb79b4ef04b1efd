"""Parts, slices, walls, free space and sweeps: closed forms, dense sampling, and the figures of the example."""

from __future__ import annotations

import math

import numpy as np
import pytest
import shapely

from tests.maps.drawn import box, many_walls, placed, ring, robot, wall
from wallkit.maps.geometry import CYLINDER_SIDES, parts, slice_at, slice_parts
from wallkit.maps.read import load_map, read_map
from wallkit.maps.space import door_sweep, free_space, rooms_by_flood
from wallkit.maps.walls import gaps, wall_axes, wall_ends
from wallkit.maps.xml import parse


def model(*pieces):
    return read_map(parse(robot(*pieces)))


def shape_link(name, shape):
    return f'<link name="{name}"><collision><geometry>{shape}</geometry></collision></link>'


@pytest.fixture(scope="module")
def example(data):
    return load_map(data / "maps/wkmap_example/restroom.wkmap.urdf")


# ----------------------------------------------------------------------------------------------- slices


@pytest.mark.parametrize("rpy", ["0.3 0 0", "0 0.5 0.2", "0.4 -0.7 1", "1.5707963267948966 0 0.3", "0 1.57 0"])
def test_a_tilted_box_is_cut_exactly(rpy):
    m = model(box("b", "1 0.4 2"), placed("b", "3 2 1", rpy))
    (part,) = parts(m)
    grid = np.stack(np.meshgrid(np.linspace(1, 5, 241), np.linspace(0, 4, 241)), axis=-1).reshape(-1, 2)
    for z in (0.2, 0.9, 1.0, 1.6):
        cut = part.cut(z)
        inside_box = np.column_stack([grid, np.full(len(grid), z)]) - part.T_map_shape[:3, 3]
        local = np.abs(inside_box @ part.T_map_shape[:3, :3])
        margin = np.min(np.array([0.5, 0.2, 1.0]) - local, axis=1)
        inside = shapely.contains_xy(cut, grid[:, 0], grid[:, 1]) if not cut.is_empty else np.zeros(len(grid), bool)
        sure = np.abs(margin) > 1e-9
        np.testing.assert_array_equal(inside[sure], margin[sure] > 0)


def test_slicing_commutes_with_turning_the_map():
    pieces = [box("b", "1 0.4 2", rpy="0.3 0.2 0"), placed("b", "3 2 1"), *ring("r", 0, 0, 4, 3)]
    turned = "\n".join(pieces).replace('link="map"', 'link="base"')
    plain = slice_at(model(*pieces), 0.8).solid
    rotated = slice_at(model('<link name="base"/>', placed("base", "1 2 0", "0 0 0.7"), turned), 0.8).solid
    back = shapely.affinity.translate(shapely.affinity.rotate(plain, 0.7, (0, 0), use_radians=True), 1, 2)
    assert rotated.symmetric_difference(back).area < 1e-9


def test_a_plane_belongs_to_the_upper_of_two_stacked_boxes():
    m = model(
        box("low", "1 1 1", at="0 0 0.5"),
        placed("low", "0 0 0"),
        box("top", "1 1 1", at="0 0 1.5"),
        placed("top", "0 0 0"),
    )
    found = [[part.link for part in slice_at(m, z).parts] for z in (-0.01, 0.0, 0.99, 1.0, 1.99, 2.0)]
    assert found == [[], ["low"], ["low"], ["top"], ["top"], []]


def test_cylinders_and_spheres_have_their_areas():
    m = model(
        shape_link("c", '<cylinder radius="0.5" length="2"/>'),
        placed("c", "0 0 0"),
        shape_link("s", '<sphere radius="0.5"/>'),
        placed("s", "3 0 0"),
        shape_link("l", '<cylinder radius="0.5" length="2"/>'),
        placed("l", "6 0 0", "0 1.5707963267948966 0"),
    )
    polygon = CYLINDER_SIDES / 2 * math.sin(2 * math.pi / CYLINDER_SIDES)
    cut = slice_at(m, 0.3).by_link()
    assert cut["c"].area == pytest.approx(polygon * 0.25)
    assert cut["s"].area == pytest.approx(polygon * (0.25 - 0.09))
    # a lying cylinder is cut along its length; the prism is inside the true circle
    assert cut["l"].area == pytest.approx(2 * 2 * math.sqrt(0.25 - 0.09), rel=0.01)


def test_meshes_and_broken_sizes_have_no_part():
    m = model(
        shape_link("m", '<mesh filename="a.stl"/>'),
        placed("m", "0 0 0"),
        box("n", "1 nan 1"),
        placed("n", "0 0 0"),
        box("z", "1 0 1"),
        placed("z", "0 0 0"),
        box("lost", "1 1 1"),
        box("ok", "1 1 1"),
        placed("ok", "0 0 0"),
    )
    assert [part.name for part in parts(m)] == ["ok.body"]


def test_segments_are_the_outlines_of_their_owners():
    m = model(*ring("r", 0, 0, 4, 3))
    cut = slice_at(m, 0.5)
    assert cut.segments.shape == (16, 4)
    assert cut.owners == [name for name in ("r_s", "r_n", "r_w", "r_e") for _ in range(4)]
    assert set(cut.classes) == {"wall"}
    lengths = np.hypot(*(cut.segments[:, 2:] - cut.segments[:, :2]).T)
    assert lengths.sum() == pytest.approx(sum(polygon.length for polygon in cut.polygons))


@pytest.mark.data
@pytest.mark.parametrize(
    ("z", "seen", "unseen"),
    [
        (0.10, {"toilet_1"}, {"partition_1", "urinal_1", "sink_1", "mirror_1", "window_n"}),
        (0.30, {"toilet_1", "partition_1"}, {"urinal_1", "sink_1", "mirror_1", "window_n"}),
        (0.85, {"partition_1", "urinal_1", "sink_1"}, {"toilet_1", "mirror_1", "window_n"}),
        (1.50, {"mirror_1", "window_n"}, {"toilet_1", "urinal_1", "sink_1"}),
    ],
)
def test_the_example_shows_at_each_height_what_stands_there(example, z, seen, unseen):
    links = set(slice_at(example, z).by_link())
    assert seen <= links
    assert not unseen & links


# ----------------------------------------------------------------------------------------- rooms, doors


@pytest.mark.data
def test_the_doors_of_the_example_join_its_two_rooms(example):
    closed = rooms_by_flood(example, 0.30, "closed")
    # 5 x 3.88 m less toilet and partition; 5 x 2 m and what the leaf leaves of the wall's thickness
    assert [region.area_m2 for region in closed] == pytest.approx([19.1825, 10.072], abs=0.002)
    assert [region.area_m2 for region in rooms_by_flood(example, 0.30, "open")] == pytest.approx([29.29], abs=0.01)
    for angle in (0.8, 1.2, 1.5708):
        regions = rooms_by_flood(example, 0.30, {"door_m_hinge": angle})
        assert [region.area_m2 for region in regions] == pytest.approx([29.25], abs=0.01)


@pytest.mark.data
def test_a_corner_gap_leaks_a_room(data):
    leaking = load_map(data / "maps/malformed/mutants/gap_at_corner.wkmap.urdf")
    assert [region.area_m2 for region in rooms_by_flood(leaking, 0.30)] == pytest.approx([19.1825], abs=0.002)


@pytest.mark.parametrize(("gap", "rooms"), [(0.029, 2), (0.031, 1)])
def test_a_way_narrower_than_a_passage_joins_nothing(gap, rooms):
    halves = [wall("a", (2, 0), (2, 1.5 - gap / 2)), wall("b", (2, 1.5 + gap / 2), (2, 3))]
    m = model(*ring("r", 0, 0, 4, 3), *halves)
    assert len(rooms_by_flood(m, 0.5, passage_m=0.03)) == rooms


def test_areas_are_exact_and_the_outside_is_told():
    m = model(*ring("r", 0, 0, 4, 3), box("post", "0.5 0.5 1", at="0 0 0.5"), placed("post", "2 1.5 0", "0 0 0.4"))
    inside, outside = sorted(free_space(slice_at(m, 0.5)), key=lambda region: region.is_outside)
    assert inside.area_m2 == pytest.approx(3.9 * 2.9 - 0.25)
    assert outside.is_outside
    assert free_space(slice_at(m, 9.0)) == []


def test_a_door_sweeps_its_quarter_circle():
    leaf = box("leaf", "0.9 0.0001 2", at="0.45 0 1", wk_class="door")
    joint = (
        '<joint name="d" type="revolute"><parent link="map"/><child link="leaf"/><origin xyz="1 1 0"/><axis xyz="0 0 1"/>'
        '<limit lower="0" upper="1.5707963" effort="1" velocity="1"/></joint>'
    )
    m = model(leaf, joint)
    sweep = door_sweep(m, m.joints["d"], steps=64)
    assert sweep.swept.area == pytest.approx(math.pi / 4 * 0.81, rel=1e-3)
    assert sweep.z_m == (0.0, 2.0)
    np.testing.assert_allclose(sweep.leaves[0].bounds, [1, 0.99995, 1.9, 1.00005], atol=1e-9)
    np.testing.assert_allclose(sweep.leaves[-1].bounds, [0.99995, 1, 1.00005, 1.9], atol=1e-6)


@pytest.mark.data
def test_a_sweep_covers_every_position_of_the_leaf(example):
    (joint,) = example.doors
    sweep = door_sweep(example, joint)
    # between two states the edge is short of its arc by r (1 - cos(step / 2))
    short = 0.9 * (1 - math.cos(1.5708 / 32 / 2))
    for state in np.linspace(0, 1.5708, 50):
        (leaf,) = (part.footprint for part in parts(example, {joint.name: state}) if part.link == "door_m")
        assert sweep.swept.buffer(short + 1e-9).contains(leaf)


# ------------------------------------------------------------------------------------------------ walls


@pytest.mark.data
def test_walls_of_the_example_run_along_their_x_through_their_openings(example):
    runs = {run.link: run for run in wall_axes(example, parts(example))}
    ends = {name: [*run.start.round(3), *run.end.round(3)] for name, run in runs.items()}
    assert ends == {
        "wall_s": [-0.12, -0.06, 5.12, -0.06],
        "wall_n": [-0.12, 6.06, 5.12, 6.06],
        "wall_w": [-0.06, 0, -0.06, 6],
        "wall_e": [5.06, 0, 5.06, 6],
        "wall_mid": [0, 2.06, 5, 2.06],
    }
    assert {round(run.thickness_m, 9) for run in runs.values()} == {0.12}
    assert len(runs["wall_mid"].parts) == 3
    assert runs["wall_mid"].height_m == pytest.approx(2.7)


def boxes_in_one_link(*boxes, openings=""):
    collisions = "".join(
        f'<collision><origin xyz="{at}" rpy="0 0 {yaw}"/><geometry><box size="{size}"/></geometry></collision>'
        for at, size, yaw in boxes
    )
    return f'<link name="w"><wk:object class="wall"/>{openings}{collisions}</link>' + placed("w", "1 1 0", "0 0 0.5")


def test_a_passage_without_head_is_bridged_by_its_opening_only():
    pieces = [("0.5 0 1", "1 0.1 2", 0), ("2.5 0 1", "1 0.1 2", 0)]
    opening = '<wk:opening id="p" kind="passage" along="1 2" z="0 2"/>'
    whole, parted = model(boxes_in_one_link(*pieces, openings=opening)), model(boxes_in_one_link(*pieces))
    assert [run.length_m for run in wall_axes(whole, parts(whole))] == pytest.approx([3.0])
    assert [run.length_m for run in wall_axes(parted, parts(parted))] == pytest.approx([1.0, 1.0])


def test_a_polyline_wall_has_a_run_for_each_direction_and_a_stub_joins_its_wall():
    m = model(
        boxes_in_one_link(("1 0 1", "2 0.1 2", 0), ("2.025 0 1", "0.05 0.1 2", 0), ("2 0.75 1", "1.5 0.1 2", 1.5707963))
    )
    runs = wall_axes(m, parts(m))
    assert [run.length_m for run in runs] == pytest.approx([2.05, 1.5])
    assert runs[0].direction @ [math.cos(0.5), math.sin(0.5)] == pytest.approx(1)
    assert abs(runs[1].direction @ runs[0].direction) < 1e-6


def test_ends_find_their_neighbours_and_gaps_their_widths():
    m = model(wall("a", (0, 0), (3, 0)), wall("b", (3.12, 0), (5, 0)), wall("t", (1.5, 0.07), (1.5, 2)))
    ends = wall_ends(wall_axes(m, parts(m)), parts(m), reach_m=0.3)
    found = {
        (end.run.link, end.is_start): (end.neighbour.link if end.neighbour else None, end.distance_m) for end in ends
    }
    assert found[("a", True)] == (None, math.inf)
    assert found[("a", False)] == ("b", pytest.approx(0.12))
    assert found[("b", True)] == ("a", pytest.approx(0.12))
    assert found[("t", True)] == ("a", pytest.approx(0.02))
    open_gaps = gaps(ends, min_m=0.001, max_m=0.3)
    assert [(gap.run.link, gap.neighbour.link) for gap in open_gaps] == [("a", "b"), ("t", "a")]
    np.testing.assert_allclose(open_gaps[1].nearest[1], 0.05)


def test_things_at_other_heights_close_no_gap():
    beam = box("beam", "1 1 0.3", at="0 0 2.8") + placed("beam", "3 0 0")
    m = model(wall("a", (0, 0), (3, 0)), beam)
    ends = wall_ends(wall_axes(m, parts(m)), parts(m), reach_m=0.3)
    assert next(end for end in ends if end.run.link == "a" and not end.is_start).neighbour is None


def test_five_thousand_walls_make_their_rooms():
    m = read_map(parse(many_walls(5000)))
    solids = parts(m)
    runs = wall_axes(m, solids)
    assert len(wall_ends(runs, solids, reach_m=0.3)) == 10_000
    regions = [region for region in free_space(slice_parts(solids, 0.3)) if not region.is_outside]
    assert len(regions) == 1250
    assert {round(region.area_m2, 6) for region in regions} == {15.21}
