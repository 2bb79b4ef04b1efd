"""Fields of semantic maps against closed forms: exact distances, what is seen, what may not answer."""

from __future__ import annotations

import numpy as np
import pytest
import shapely

from tests.maps.drawn import HEAD, box, placed, ring, wall
from tests.plan import Plan, cast, occupancy, plan_from_polylines
from wallkit.core.grid import distances_at
from wallkit.core.grid import placed as placed_in
from wallkit.core.raycast import cast_rays
from wallkit.errors import MapError
from wallkit.maps.grids.fields import MapsSettings, fields_from_grid
from wallkit.maps.grids.semantic_fields import SIGMA_M, distances_to_segments, fields_from_map
from wallkit.maps.read import read_map
from wallkit.maps.surfaces import floor_at, surfaces_at
from wallkit.maps.xml import parse
from wallkit.pipelines.maps import load_map

PLANE = '<wk:map format="1.0" units="m rad" up="z" scan_plane="0.3">{}</wk:map>'
# the inside of ring(0, 0, 4, 3) is 3.9 m x 2.9 m
INSIDE_M = 2 * (3.9 + 2.9)
LOW, HIGH = 0.05, np.array([3.95, 2.95])


def file_of(*pieces, rooms=""):
    return "\n".join([HEAD, PLANE.format(rooms), '<link name="map"/>', *pieces, "</robot>"]).encode()


def map_of(*pieces, rooms=""):
    return read_map(parse(file_of(*pieces, rooms=rooms), "drawn.urdf"))


def surfaces_of(*pieces, rooms=""):
    drawn = map_of(*pieces, rooms=rooms)
    return surfaces_at(drawn, floor_at(drawn, 0.3))


def lengths(surfaces, class_name=None):
    """Length of all surfaces, or of one class [m]."""
    chosen = [class_name in (None, name) for name in surfaces.classes]
    ends = surfaces.segments[chosen]
    return float(np.hypot(*(ends[:, 2:] - ends[:, :2]).T).sum())


def extra_m(probability):
    """How much farther a surface seems that answers with a probability."""
    return SIGMA_M * np.sqrt(2 * np.log(1 / probability))


def at(fields, x, y, name="all"):
    column, row = np.floor((np.array([x, y]) - fields.origin[:2]) / fields.resolution_m).astype(int)
    return float(fields.distances_m[name][row, column])


def door(prior="", rest=0.0, hinge="2 1.5 0"):
    """A leaf of 0.8 m x 0.04 m, 1 cm from its hinge, that closes along +x and opens towards +y."""
    joint = (
        f'<joint name="hinge" type="revolute"><parent link="map"/><child link="leaf"/><origin xyz="{hinge}"/>'
        '<axis xyz="0 0 1"/><limit lower="0" upper="1.5707963267948966" effort="1" velocity="1"/>'
        f'<wk:state rest="{rest}" prior="{prior}"/></joint>'
    )
    return [box("leaf", "0.8 0.04 2", at="0.41 0 1", wk_class="door"), joint]


# ------------------------------------------------------------------------------------------------- distances


def test_distances_to_segments_are_those_of_shapely_and_rays_end_at_every_one():
    rng = np.random.default_rng(3)
    segments = rng.uniform(-2, 5, (60, 4))
    extra = rng.choice([0.0, 0.0, 0.19, 0.7], 60)
    low, cell_m, shape = np.array([-1.03, 0.21]), 0.04, (83, 119)
    row, column = np.mgrid[: shape[0], : shape[1]]
    x, y = low[0] + column * cell_m, low[1] + row * cell_m
    lines = shapely.linestrings(segments.reshape(-1, 2, 2))
    centres = shapely.points(x + cell_m / 2, y + cell_m / 2)
    brute = np.sqrt(shapely.distance(centres[..., None], lines) ** 2 + extra**2).min(axis=-1)
    drawn = distances_to_segments(segments, extra, low, cell_m, shape)

    beyond = brute > cell_m * np.sqrt(0.5)
    np.testing.assert_allclose(drawn[beyond], brute[beyond], atol=1e-6)
    np.testing.assert_array_less(brute[~beyond] - drawn[~beyond], 0.22 * cell_m)
    np.testing.assert_array_less(drawn, brute + 1e-6)
    # raycast ends below half a cell
    opaque = shapely.multilinestrings(segments[extra == 0].reshape(-1, 2, 2))
    is_passed = shapely.intersects(shapely.box(x, y, x + cell_m, y + cell_m), opaque)
    assert is_passed.sum() > 500
    assert drawn[is_passed].max() < 0.5 * cell_m


def test_rays_end_where_the_walls_are():
    """Of rays from all over a room, none slips through a wall that lies across the cells."""
    turned = '<link name="building"/>', placed("building", "0.3 0.2 0", "0 0 0.37")
    walls = [p.replace('<parent link="map"/>', '<parent link="building"/>') for p in ring("w", 0, 0, 4, 3)]
    drawn = map_of(*turned, *walls)
    fields = fields_from_map(drawn).fields
    rows, columns = np.nonzero(fields.is_free & (fields.distances_m["all"] > 0.2))
    places = np.column_stack([columns, rows])[:: len(rows) // 200] + 0.5
    poses = np.column_stack([fields.origin[:2] + places * fields.resolution_m, np.zeros(len(places))])
    bearings = np.linspace(-np.pi, np.pi, 180, dtype=np.float32)
    cells = np.empty((len(poses), len(bearings)), dtype=np.float32)
    per_m = np.float32(1 / fields.resolution_m)
    rays = np.stack([np.cos(bearings), np.sin(bearings)])
    cast_rays(placed_in(fields, poses, border=0), rays, fields.distances_m["all"], per_m, 12 * per_m, cells)
    faces = Plan(surfaces_at(drawn, floor_at(drawn, 0.3)).segments)
    exact = np.stack([cast(faces, np.zeros((0, 3)), pose[:2], bearings.astype(float), 12.0) for pose in poses])
    behind = cells / per_m - exact
    assert behind.max() < 0.05
    assert np.median(np.abs(behind)) < fields.resolution_m


def inside_a_turned_room(fields, turn, shift):
    """Distances of a field at the cells inside the room, and what they are in closed form."""
    row, column = np.mgrid[: fields.shape[0], : fields.shape[1]]
    centres = fields.origin[:2] + (np.stack([column, row], axis=-1) + 0.5) * fields.resolution_m
    c, s = np.cos(turn), np.sin(turn)
    x, y = np.moveaxis((centres - shift) @ np.array([[c, -s], [s, c]]), -1, 0)
    exact = np.minimum.reduce([x - LOW, HIGH[0] - x, y - LOW, HIGH[1] - y])
    inside = exact > 0.1
    return fields.distances_m["all"][inside], exact[inside]


def test_exact_distances_beat_those_to_cell_centres():
    turn, shift, cell_m = 0.4, np.array([1.013, -2.291]), 0.05
    c, s = np.cos(turn), np.sin(turn)
    whole = '<link name="building"/>', placed("building", f"{shift[0]} {shift[1]} 0", f"0 0 {turn}")
    walls = [p.replace('<parent link="map"/>', '<parent link="building"/>') for p in ring("w", 0, 0, 4, 3)]
    drawn = fields_from_map(map_of(*whole, *walls), cell_m=cell_m).fields
    measured, exact = inside_a_turned_room(drawn, turn, shift)
    np.testing.assert_allclose(measured, exact, atol=2e-6)

    corners = np.array([(LOW, LOW), (HIGH[0], LOW), HIGH, (LOW, HIGH[1]), (LOW, LOW)])
    faces = plan_from_polylines([tuple(p) for p in corners @ np.array([[c, s], [-s, c]]) + shift])
    middle = np.array([c * 2 - s * 1.5, s * 2 + c * 1.5]) + shift
    raster = fields_from_grid(occupancy(faces, cell_m, inside=middle), wall_depth_m=0.0)
    measured, exact = inside_a_turned_room(raster, turn, shift)
    # a cell counts as wall wherever the face crosses it, so the nearest centre lies before the face
    assert np.mean(measured - exact) < -0.2 * cell_m
    assert np.sqrt(np.mean((measured - exact) ** 2)) > 0.25 * cell_m


# -------------------------------------------------------------------------------------------- what is seen


def test_only_the_insides_of_a_rooms_walls_are_surfaces():
    surfaces = surfaces_of(*ring("w", 0, 0, 4, 3))
    assert lengths(surfaces) == pytest.approx(INSIDE_M, abs=1e-4)
    assert np.ptp(surfaces.segments.reshape(-1, 2), axis=0) == pytest.approx([3.9, 2.9], abs=1e-4)


def test_what_stands_against_a_wall_covers_it():
    toilet = box("toilet", "0.5 0.4 0.8", at="0.25 0 0.4", wk_class="toilet")
    surfaces = surfaces_of(*ring("w", 0, 0, 4, 3), toilet, placed("toilet", "0.05 1.5 0"))
    assert lengths(surfaces, "toilet") == pytest.approx(0.4 + 2 * 0.5, abs=1e-4)
    assert lengths(surfaces, "wall") == pytest.approx(INSIDE_M - 0.4, abs=1e-4)


def test_a_mirror_hides_the_wall_behind_it_and_is_no_surface_itself():
    mirror = box("mirror", "0.006 1.2 0.8", at="0.006 0 0.4", wk_class="mirror")
    surfaces = surfaces_of(*ring("w", 0, 0, 4, 3), mirror, placed("mirror", "0.05 1.5 0"))
    assert set(surfaces.classes) == {"wall"}
    assert lengths(surfaces) == pytest.approx(INSIDE_M - 1.2, abs=1e-4)


def test_a_wall_between_two_rooms_is_seen_from_both():
    surfaces = surfaces_of(*ring("w", 0, 0, 4, 3), wall("mid", (2, 0), (2, 3)))
    assert lengths(surfaces) == pytest.approx(INSIDE_M - 2 * 0.1 + 2 * 2.9, abs=1e-4)


def test_a_room_with_a_way_out_is_still_indoors():
    south, *others = ring("w", 0, 0, 8, 6)
    assert south.count("<link") == 1
    broken = [wall("w_s", (-0.05, 0), (3.5, 0)), wall("w_t", (4.5, 0), (8.05, 0)), *others]
    surfaces = surfaces_of(*broken)
    inside_m = 2 * (7.9 + 5.9) - 1.0
    # the jambs may be seen, the facade is not
    assert inside_m - 0.01 <= lengths(surfaces) <= inside_m + 0.2 + 0.01
    drawn = fields_from_map(map_of(*broken)).fields
    area_m2 = drawn.is_free.sum() * drawn.resolution_m**2
    assert area_m2 == pytest.approx(7.9 * 5.9, rel=0.03)


def test_where_nothing_is_enclosed_the_robot_may_be_anywhere_and_sees_everything():
    drawn = map_of(wall("a", (0, 0), (4, 0)), wall("b", (0, 5), (4, 5)))
    assert lengths(surfaces_at(drawn, floor_at(drawn, 0.3))) == pytest.approx(2 * 2 * 4.1, abs=1e-4)
    assert fields_from_map(drawn).fields.is_free.mean() > 0.9


def test_floor_nobody_can_reach_is_not_free():
    shaft = ring("shaft", 1, 1, 1.8, 1.8)
    fields = fields_from_map(map_of(*ring("w", 0, 0, 4, 3), *shaft)).fields
    row, column = np.floor((np.array([1.4, 1.4]) - fields.origin[:2]) / fields.resolution_m).astype(int)
    assert not fields.is_free[row, column]
    assert at(fields, 1.4, 1.4) == pytest.approx(0.45, abs=0.02)  # its walls are seen from the room only


def test_free_floor_is_the_floor_between_the_walls():
    fields = fields_from_map(map_of(*ring("w", 0, 0, 4, 3))).fields
    assert fields.is_free.sum() * fields.resolution_m**2 == pytest.approx(3.9 * 2.9, rel=0.03)
    assert fields.distances_m["all"][fields.is_free].min() > 0


@pytest.mark.parametrize("turn", [0.3, 2.0])
def test_moving_the_map_moves_its_surfaces_and_nothing_else(turn):
    pieces = [*ring("w", 0, 0, 4, 3), wall("mid", (2, 0), (2, 1.2)), *door("closed:0.6 open:0.3")]
    whole = '<link name="building"/>', placed("building", "12.3 -4.56 0", f"0 0 {turn}")
    moved = surfaces_of(*whole, *[p.replace('<parent link="map"/>', '<parent link="building"/>') for p in pieces])
    there = surfaces_of(*pieces)
    for name in ("wall", "door"):
        assert lengths(moved, name) == pytest.approx(lengths(there, name), abs=1e-4)


# ---------------------------------------------------------------------------------- what may not answer


def test_glass_scores_a_return_by_its_return_probability():
    pane = box("pane", "2 0.01 2", at="0 0 1", wk_class="glass")
    room = [*ring("w", 0, 0, 10, 8), pane, placed("pane", "5 4 0")]
    fields = fields_from_map(map_of(*room)).fields
    for off in (0.0, 0.05, 0.2):
        seems, is_away = at(fields, 5.0, 4.0051 + off), at(fields, 5.0, 4.0051 + off, "glass")
        hit = np.exp(-0.5 * np.array([seems, is_away]) ** 2 / SIGMA_M**2)
        assert hit[0] / hit[1] == pytest.approx(0.15, rel=1e-4)
        assert is_away == pytest.approx(off, abs=0.02)


def test_a_door_stands_where_its_prior_says():
    room = [*ring("w", 0, 0, 6, 5), *door("closed:0.7 open:0.2 unknown:0.1", hinge="3 2 0")]
    fields = fields_from_map(map_of(*room), cell_m=0.01).fields
    assert at(fields, 3.4, 2.02) < 0.01
    assert at(fields, 2.98, 2.5) == pytest.approx(extra_m(0.2), abs=0.003)
    assert set(fields.distances_m) == {"all", "door", "wall"}


@pytest.mark.parametrize(("rest", "stands", "does_not"), [(0, (3.4, 2.0), (3, 2.6)), ("1.570796", (3, 2.4), (3.6, 2))])
def test_a_door_without_a_prior_stands_at_rest(rest, stands, does_not):
    room = [*ring("w", 0, 0, 6, 5), *door("", rest, hinge="3 2 0")]
    surfaces = surfaces_of(*room)
    leaf = shapely.multilinestrings(surfaces.segments[[c == "door" for c in surfaces.classes]].reshape(-1, 2, 2))
    assert shapely.distance(leaf, shapely.Point(stands)) == pytest.approx(0.02, abs=1e-6)
    assert shapely.distance(leaf, shapely.Point(does_not)) > 0.5
    assert set(surfaces.p_there) == {1.0}


# ------------------------------------------------------------------------------------- heights and pictures


def test_the_slice_is_at_the_maps_plane_unless_another_is_given():
    shelf = box("shelf", "0.5 2 0.2", at="0 0 1.1", wk_class="furniture")
    drawn = map_of(*ring("w", 0, 0, 4, 3), shelf, placed("shelf", "2 1.5 0"))
    assert "furniture" not in fields_from_map(drawn).fields.distances_m
    assert "furniture" in fields_from_map(drawn, scan_plane_m=1.1).fields.distances_m


@pytest.mark.parametrize(
    ("options", "words", "hint"),
    [
        ({"scan_plane_m": 9.0}, "cut at 9 m", "reach from 0 to 2.50 m"),
        ({"scan_plane_m": 2.0, "cell_m": 0.0005}, "more than 36,000,000", "maps.cell_m="),
    ],
)
def test_what_cannot_be_drawn_is_refused(options, words, hint):
    with pytest.raises(MapError, match=words) as caught:
        fields_from_map(map_of(*ring("w", 0, 0, 4, 3)), **options)
    assert hint in caught.value.hint


def test_a_map_of_mirrors_alone_is_refused():
    mirror = box("mirror", "0.006 1.2 0.8", at="0 0 0.4", wk_class="mirror")
    with pytest.raises(MapError, match="meets nothing that returns"):
        fields_from_map(map_of(mirror, placed("mirror", "0 0 0")))


def test_a_map_without_a_scan_plane_asks_for_one():
    pieces = "\n".join([HEAD, '<link name="map"/>', *ring("w", 0, 0, 4, 3), "</robot>"]).encode()
    drawn = read_map(parse(pieces, "drawn.urdf"))
    with pytest.raises(MapError, match="at which height") as caught:
        fields_from_map(drawn)
    assert "maps.scan_plane_m" in caught.value.hint
    fields_from_map(drawn, scan_plane_m=0.3)


def test_the_picture_shows_walls_floor_and_the_unknown():
    drawn = fields_from_map(map_of(*ring("w", 0, 0, 4, 3)))
    grid, fields = drawn.grid, drawn.fields
    np.testing.assert_array_equal(grid.cells == 0, fields.is_free)
    np.testing.assert_array_equal(grid.origin, fields.origin)
    assert grid.cells[0, 0] == -1
    assert distances_at(fields, np.array([[2.0, 0.0], [0.0, 1.5]])) == pytest.approx(0.05, abs=0.02)
    x, y = np.floor((np.array([2.0, 0.0]) - grid.origin[:2]) / grid.resolution_m).astype(int)
    assert grid.cells[y, x] == 100


# ------------------------------------------------------------------------------------------------ loading


@pytest.mark.parametrize("name", ["floor.wkmap.urdf", "floor.xml", "floor"])
@pytest.mark.parametrize("mark", [b"", b"\xef\xbb\xbf", b"\n \n"])
def test_a_semantic_map_is_known_by_its_content(tmp_path, name, mark):
    path = tmp_path / name
    path.write_bytes(mark + file_of(*ring("w", 0, 0, 4, 3)))
    loaded = load_map(path, None, MapsSettings(cell_m=0.05))
    assert loaded.fields.resolution_m == 0.05
    assert loaded.files == (path,)
    assert loaded.findings == ()


def test_a_faulty_map_is_refused_with_its_first_error(tmp_path):
    path = tmp_path / "floor.wkmap.urdf"
    path.write_bytes(file_of(*ring("w", 0, 0, 4, 3), placed("nobody", "0 0 0")))
    with pytest.raises(MapError, match="nobody") as caught:
        load_map(path, None, MapsSettings())
    assert caught.value.where.startswith(f"{path}:")
    assert f"wallkit map validate {path}" in caught.value.hint


@pytest.mark.parametrize(
    ("body", "code"),
    [('<mesh filename="bath.stl"/>', "fields.meshes"), ('<box size="1 0 1"/>', "fields.sizes")],
)
def test_what_is_not_drawn_is_named(tmp_path, body, code):
    bath = f'<link name="bath"><wk:object class="sink"/><collision><geometry>{body}</geometry></collision></link>'
    path = tmp_path / "floor.wkmap.urdf"
    path.write_bytes(file_of(*ring("w", 0, 0, 4, 3), bath, placed("bath", "1 1 0")))
    (finding,) = load_map(path, None, MapsSettings()).findings
    assert (finding.code, finding.severity, finding.detail) == (code, "warning", {"count": 1})
    assert path.read_text().splitlines()[finding.line - 1] == bath


@pytest.mark.data
def test_faulty_maps_are_refused_with_a_hint_or_drawn(data):
    files = sorted((data / "maps/malformed").rglob("*.urdf"))
    assert len(files) > 60
    hints = []
    for file in files:
        try:
            fields = load_map(file, None, MapsSettings(cell_m=0.1)).fields
        except MapError as error:
            hints.append(error.hint)
        else:
            assert np.isfinite(fields.distances_m["all"]).all()
    assert len(files) / 2 < len(hints) < len(files)
    assert all(hints)


@pytest.mark.data
def test_the_example_is_drawn_as_it_is_built(data):
    """Figures of design/map-format.md: 19.2 m2 and 10.1 m2 of floor, only toilet and partition in the slice."""
    fields = load_map(data / "maps/wkmap_example/restroom.wkmap.urdf", None, MapsSettings()).fields
    assert set(fields.distances_m) == {"all", "wall", "door", "toilet", "partition"}
    assert fields.is_free.sum() * fields.resolution_m**2 == pytest.approx(29.3, rel=0.02)
