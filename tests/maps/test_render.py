"""Plans: the SVG's coordinates are the map's, every link is there, the PNG shows the same, and symbols know their place."""

from __future__ import annotations

import io
import re
from dataclasses import replace
from xml.etree import ElementTree

import numpy as np
import pytest
import shapely

from tests.maps.drawn import box, placed, ring, robot
from wallkit.errors import MapError
from wallkit.maps.draw.findings import MOST_MARKED
from wallkit.maps.draw.marks import Area, Text
from wallkit.maps.draw.plan import PlanSettings, class_style, draw_plan, plan_svg
from wallkit.maps.draw.png import png_from_drawing
from wallkit.maps.draw.svg import svg_from_drawing
from wallkit.maps.draw.symbols import FURNITURE, SYMBOLS, symbol_of
from wallkit.maps.draw.text import cells_of, coloured_from_cells, plain_from_cells
from wallkit.maps.geometry import parts, slice_at
from wallkit.maps.read import read_map
from wallkit.maps.rules import validate
from wallkit.maps.xml import parse

SVG = "{http://www.w3.org/2000/svg}"
HEADER = (
    '<wk:map format="1.0" units="m rad" level="3" elevation="8" scan_plane="0.3">'
    '<wk:origin kind="georef" epsg="32654" east="0" north="0" yaw="0.5"/>'
    '<wk:room id="hall" kind="hall" floor="0.05 0.05  3.95 0.05  3.95 2.95  0.05 2.95"/></wk:map>'
)
DOOR = (
    '<link name="leaf"><wk:object class="door"/><collision name="leaf.leaf"><origin xyz="0.44 0 1"/>'
    '<geometry><box size="0.88 0.04 2"/></geometry></collision></link>'
    '<joint name="hinge" type="revolute"><parent link="map"/><child link="leaf"/><origin xyz="1 1.5 0" rpy="0 0 0.25"/>'
    '<axis xyz="0 0 1"/><limit lower="0" upper="1.4" effort="1" velocity="1"/></joint>'
)
ROOM = robot(
    HEADER,
    *ring("w", 0, 0, 4, 3),
    box("bowl", "0.5 0.36 0.4", at="0.25 0 0.2", wk_class="toilet"),
    placed("bowl", "3.95 2 0", "0 0 3.141593"),
    box("high", "0.4 0.5 0.2", at="0.2 0 0.8", wk_class="sink"),
    placed("high", "0.05 2 0"),
    DOOR,
)


def map_of(data: bytes):
    return read_map(parse(data))


@pytest.fixture
def example(data):
    return map_of((data / "maps/wkmap_example/restroom.wkmap.urdf").read_bytes())


def groups_of(svg: bytes) -> dict[str, ElementTree.Element]:
    return {g.get("id"): g for g in ElementTree.fromstring(svg).iter(f"{SVG}g") if g.get("id")}


def rings_of(path: ElementTree.Element) -> list[np.ndarray]:
    rings = re.findall(r"M([^MZ]+)", path.get("d"))
    return [np.array([point.split() for point in ring.split("L")], dtype=float) for ring in rings]


def drawn_area(group: ElementTree.Element, style: str):
    paths = [path for path in group.iter(f"{SVG}path") if path.get("class") == style]
    polygons = [shapely.Polygon(outer, holes) for outer, *holes in map(rings_of, paths)]
    return shapely.union_all(polygons)


# -------------------------------------------------------------------------------------------------------- SVG


@pytest.mark.parametrize("z_m", [0.1, 0.3, 0.85, 1.5])
def test_the_bold_outline_of_every_link_is_its_cut_in_map_coordinates(example, z_m):
    groups = groups_of(plan_svg(example, PlanSettings(z_m=z_m)))
    cut = slice_at(example, z_m).by_link()
    assert len(cut) > 5
    for link, polygon in cut.items():
        style = class_style(example.links[link].class_name)
        assert drawn_area(groups[link], style).symmetric_difference(polygon).area < 1e-4 * polygon.length
    for link in {part.link for part in parts(example)} - set(cut):
        assert drawn_area(groups[link], class_style(example.links[link].class_name)).is_empty
        assert drawn_area(groups[link], "light").area > 0


def test_every_link_with_a_part_is_one_group_and_titles_say_class_and_heights(example):
    svg = plan_svg(example)
    ids = re.findall(rb'<g id="([^"]+)"', svg)
    assert len(ids) == len(set(ids))
    assert {part.link.encode() for part in parts(example)} <= set(ids)
    assert b"<title>toilet_1: toilet, 0.00 to 0.80 m high</title>" in svg


def test_the_page_matrix_keeps_the_plan_on_the_page_and_the_scale_bar_honest():
    svg = ElementTree.fromstring(plan_svg(map_of(ROOM)))
    plan = next(g for g in svg.iter(f"{SVG}g") if g.get("class") == "plan")
    a, b, c, d, e, f = (float(v) for v in re.findall(r"[-\d.e]+", plan.get("transform").removeprefix("matrix")))
    assert (b, c, d) == (0, 0, -a)
    points = np.vstack([ring for path in plan.iter(f"{SVG}path") for ring in rings_of(path)])
    page = points * [a, d] + [e, f]
    assert page.min() >= 0
    assert (page <= [float(svg.get("width")), float(svg.get("height"))]).all()
    bar = groups_of(ElementTree.tostring(svg))["page:scale"]
    spans = np.vstack([ring for path in bar.iter(f"{SVG}path") for ring in rings_of(path)])
    length_m = float([text.text for text in bar.iter(f"{SVG}text")][-1].removesuffix(" m"))
    assert np.ptp(spans[:, 0]) / a == pytest.approx(length_m, rel=2e-3)


def test_a_doors_arc_turns_about_its_hinge_from_closed_to_open():
    group = groups_of(plan_svg(map_of(ROOM)))["leaf"]
    (arc,) = (rings_of(path)[0] for path in group.iter(f"{SVG}path") if path.get("class") == "swing")
    from_hinge = arc - [1.0, 1.5]
    assert np.hypot(*from_hinge.T) == pytest.approx(np.hypot(0.88, 0.02), abs=2e-4)
    turned = np.unwrap(np.arctan2(from_hinge[:, 1], from_hinge[:, 0]))
    assert turned[-1] - turned[0] == pytest.approx(1.4, abs=1e-3)
    assert abs(turned[0] - 0.25) < 0.03
    closed, opened = drawn_area(group, class_style("door")), drawn_area(group, "open-leaf")
    assert closed.area == pytest.approx(0.88 * 0.04, abs=1e-3)
    assert shapely.affinity.rotate(closed, 1.4, (1.0, 1.5), use_radians=True).symmetric_difference(opened).area < 1e-3


def test_room_names_stand_in_their_rooms_with_the_area():
    drawing = draw_plan(map_of(ROOM))
    name = next(group for group in drawing.page if group.id == "name:hall").marks
    assert [text.words for text in name] == ["hall", "11.3 m²"]
    corners = drawing.to_page(np.array([(0.05, 2.95), (3.95, 0.05)]))
    assert (corners[0] < name[0].at).all()
    assert (name[0].at < corners[1]).all()


def test_north_is_where_the_survey_says():
    """<wk:origin yaw> turns the map's x from east, so north is a quarter turn farther, less the yaw."""
    drawing = draw_plan(map_of(ROOM))
    marks = next(group for group in drawing.page if group.id == "page:axes").marks
    assert [mark.words for mark in marks if isinstance(mark, Text)] == ["x", "y", "N"]
    tips = [mark.rings[0] for mark in marks if isinstance(mark, Area) and mark.style == "north"]
    along = tips[1][0] - tips[0][:2].mean(axis=0)
    assert np.arctan2(-along[1], along[0]) == pytest.approx(np.pi / 2 - 0.5, abs=1e-6)


def test_the_same_map_gives_the_same_bytes(example):
    assert plan_svg(example) == plan_svg(example)


def test_an_empty_map_is_refused():
    with pytest.raises(MapError, match="nothing to draw"):
        draw_plan(map_of(robot()))


def test_names_of_links_and_rooms_are_escaped():
    data = robot(box("a", "1 1 1"), placed("a", "0 0 0")).replace(b'"a"', b'"a&amp;&lt;b"')
    assert "a&<b" in groups_of(plan_svg(map_of(data), PlanSettings(names=True)))


# --------------------------------------------------------------------------------------------------- findings


def test_findings_are_numbered_at_their_place_and_listed(data):
    path = data / "maps/malformed/mutants/gap_at_corner.wkmap.urdf"
    report = validate(path, select=["X", "S", "G", "E"])
    drawing = draw_plan(report.map, findings=report.findings)
    marks = [group for group in drawing.page if group.id.startswith("finding:")]
    assert len(marks) == len(report.findings) > 0
    for number, (group, finding) in enumerate(zip(marks, report.findings, strict=True), start=1):
        texts = [mark.words for mark in group.marks if hasattr(mark, "words")]
        assert f"{number} {finding.code.removeprefix('WK-')}" in texts
        assert any(finding.code in words and finding.message[:30] in words for words in texts)
        dot = group.marks[1].rings[0].mean(axis=0)
        assert dot == pytest.approx(drawing.to_page(np.array([finding.xyz[:2]]))[0], abs=1.0)


def test_of_many_findings_the_worst_are_marked_and_the_rest_counted():
    m = map_of(ROOM)
    (warning, *_) = validate(ROOM.replace(b'class="sink"', b'class="sink" colour="red"'), select=["S011"]).findings
    many = [replace(warning, severity="warning")] * MOST_MARKED + [replace(warning, severity="error")] * 3
    groups = [group for group in draw_plan(m, findings=many).page if group.id.startswith("finding:")]
    assert [group.title.split()[0] for group in groups] == ["WK-S011"] * MOST_MARKED + ["3"]
    assert {group.marks[1].style for group in groups[:3]} == {"finding-error"}


def test_a_finding_without_a_place_is_marked_at_its_link():
    data = ROOM.replace(b'class="sink"', b'class="sink" colour="red"')
    report = validate(data, select=["S011"])
    (finding,) = report.findings
    assert not finding.xyz
    drawing = draw_plan(map_of(data), findings=[finding])
    (group,) = (group for group in drawing.page if group.id == "finding:1")
    dot = group.marks[1].rings[0].mean(axis=0)
    assert dot == pytest.approx(drawing.to_page(np.array([(0.25, 2.0)]))[0], abs=1.0)


# -------------------------------------------------------------------------------------------------------- PNG


def test_the_png_shows_what_the_svg_says():
    from PIL import Image

    drawing = draw_plan(map_of(ROOM))
    image = Image.open(io.BytesIO(png_from_drawing(drawing))).convert("RGB")
    assert image.size == drawing.size_px
    for place, style in (((2.0, 0.0), "c-wall"), ((4.0, 1.2), "c-wall"), ((0.3, 2.8), "room"), ((3.7, 0.3), "room")):
        x, y = drawing.to_page(np.array([place]))[0]
        rgb = "#" + "".join(f"{value:02x}" for value in image.getpixel((int(x), int(y))))
        assert rgb == drawing.styles[style].fill
    assert len(png_from_drawing(drawing, colours=32)) < len(png_from_drawing(drawing))


# ---------------------------------------------------------------------------------------------------- symbols


@pytest.mark.parametrize("name", [*SYMBOLS, *FURNITURE])
def test_symbols_stay_in_the_footprint(name):
    u0, v0, u1, v1 = bounds = (0.1, -0.35, 0.6, 0.25)
    lines = symbol_of(name if name in SYMBOLS else "furniture", name, bounds)
    points = np.vstack(lines)
    assert np.isfinite(points).all()
    reach = 0.06 if name == "mirror" else 0.0
    assert (points >= np.array([u0, v0]) - 1e-9).all()
    assert (points <= np.array([u1 + reach, v1]) + 1e-9 + reach).all()


def test_a_symbol_faces_the_room():
    """The toilet's cistern is at its back: the narrow end of the drawing is the bowl, away from the wall."""
    cistern, seat, _ = symbol_of("toilet", "", (0.0, -0.2, 0.7, 0.2))
    assert cistern[:, 0].max() <= seat[:, 0].min() + 1e-9
    group = next(g for g in draw_plan(map_of(ROOM)).plan if g.id == "bowl")
    lines = [mark.points for mark in group.marks if getattr(mark, "style", "") == "symbol"]
    assert lines[0][:, 0].min() > lines[1][:, 0].mean()  # it hangs on the east wall, so its back is east


# ------------------------------------------------------------------------------------------------------- text


def test_the_preview_has_walls_around_the_room_and_all_classes(example):
    plan = cells_of(example, columns=60, lines=30)
    text = plain_from_cells(plan)
    rows = text.splitlines()
    assert max(map(len, rows[:-1])) <= 60
    assert len(rows) - 1 <= 30
    assert "corridor" in text
    for letter in "#DTSUM|:":
        assert any(letter in row for row in rows[:-1]), letter
    assert set(rows[-2]) == {"#"}
    assert "\x1b" not in text


def test_the_preview_of_a_plane_has_only_what_it_cuts(example):
    assert "mirror" not in plain_from_cells(cells_of(example, columns=60, z_m=0.3))
    assert "mirror" in plain_from_cells(cells_of(example, columns=60, z_m=1.5))


def test_the_coloured_preview_says_the_same(example):
    plan = cells_of(example, columns=60, lines=30)
    bare = re.sub(r"\x1b\[[\d;]*m", "", coloured_from_cells(plan, example))
    assert len(bare.splitlines()) == len(plain_from_cells(plan).splitlines())
    assert "corridor" in bare


def test_the_settings_fit_the_page():
    svg = svg_from_drawing(draw_plan(map_of(ROOM), PlanSettings(width_px=600, height_px=500)))
    root = ElementTree.fromstring(svg)
    assert float(root.get("width")) <= 600
