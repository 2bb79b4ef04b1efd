"""GeoJSON of a map: areas that shapely finds again, what the map says, and coordinates on Earth only where it knows them."""

from __future__ import annotations

import json
import math
from pathlib import Path

import numpy as np
import pytest
import shapely

from tests.maps.flat import AT_M, DEEP_M, ORIGIN, THICK_M, flat
from wallkit.errors import MapError
from wallkit.maps.draft.draft import DraftOrigin
from wallkit.maps.exporters import ExportOptions, export_map
from wallkit.maps.exporters.utm import lonlat_from_utm, utm_zone
from wallkit.maps.geometry import parts

OUT = Path("flat.geojson")


def collection(drawn, **options):
    (data,) = export_map(drawn, OUT, ExportOptions(**options)).files.values()
    return json.loads(data)


def shapes(document):
    """{id: (geometry, properties)} as shapely reads it."""
    return {f["id"]: (shapely.geometry.shape(f["geometry"]), f["properties"]) for f in document["features"]}


def test_every_element_covers_what_its_parts_cover():
    drawn = flat()
    found = shapes(collection(drawn))
    by_link: dict[str, list] = {}
    for part in parts(drawn):
        by_link.setdefault(part.link, []).append(part.footprint)
    assert {name for name, (_, p) in found.items() if p["kind"] == "element"} == set(by_link)
    for link, footprints in by_link.items():
        union = shapely.union_all(footprints)
        assert found[link][0].area == pytest.approx(union.area, rel=1e-3, abs=1e-4)
        assert found[link][0].symmetric_difference(union).area < 2e-4 * union.length
    assert all(shapely.is_valid(geometry) for geometry, _ in found.values())


def test_rooms_and_openings_have_their_size_and_place():
    found = shapes(collection(flat()))
    bath, properties = found["room/bath"]
    assert bath.area == pytest.approx((AT_M - THICK_M) * (DEEP_M - THICK_M), abs=1e-3)
    assert properties == {"kind": "room", "class": "restroom", "area_m2": pytest.approx(bath.area, abs=1e-3)}
    hole, properties = found["middle/d"]
    assert (hole.geom_type, properties["class"], properties["fill"]) == ("LineString", "door", "leaf")
    np.testing.assert_allclose(shapely.get_coordinates(hole), [(AT_M, 1.0), (AT_M, 1.9)], atol=1e-3)
    assert properties["width_m"] == pytest.approx(0.9)


def test_elements_carry_what_the_map_says_of_them():
    found = shapes(collection(flat()))
    leaf = found["leaf"][1]
    assert (leaf["class"], leaf["motion"], leaf["on"]) == ("door", "revolute", "middle")
    assert leaf["travel"] == pytest.approx([0, math.pi / 2], abs=1e-5)
    assert leaf["prior"] == {"closed": 0.7, "open": 0.2, "unknown": 0.1}
    assert (found["mirror"][1]["lidar"], found["mirror"][1]["p_return"]) == ("mirror", 0.0)
    assert found["toilet"][1]["z_m"] == [0.0, 0.78]
    assert "motion" not in found["toilet"][1]


def test_doors_turn_and_a_cut_sees_only_its_height():
    shut, wide = (shapes(collection(flat(), doors=doors))["leaf"][0].bounds for doors in ("closed", "open"))
    assert shut[3] - shut[1] == pytest.approx(0.88, abs=1e-3)
    assert wide[2] - wide[0] == pytest.approx(0.88, abs=0.05)
    high = export_map(flat(), OUT, ExportOptions(z_m=1.2))
    found = shapes(json.loads(high.files[OUT]))
    # the door's head is cut away at this height, so the wall is two pieces; toilet and mirror end below
    assert found["middle"][0].geom_type == "MultiPolygon"
    assert "toilet" not in found
    assert any("2 elements without a footprint at 1.2 m" in note.message for note in high.notes)


def test_local_coordinates_are_said_not_to_be_degrees():
    exported = export_map(flat(), OUT, ExportOptions())
    assert json.loads(exported.files[OUT])["crs"]["properties"]["name"].endswith("metres")
    assert any("metres in frame map, not degrees" in note.message for note in exported.notes)


def test_surveyed_coordinates_are_the_maps_turned_and_moved():
    local, grid = shapes(collection(flat()))["room/hall"][0], shapes(collection(flat(), crs="epsg"))["room/hall"][0]
    turn = ORIGIN.yaw_rad
    R = np.array([[math.cos(turn), -math.sin(turn)], [math.sin(turn), math.cos(turn)]])
    wanted = shapely.transform(local, lambda p: p @ R.T + [ORIGIN.east_m, ORIGIN.north_m])
    assert grid.symmetric_difference(wanted).area < 1e-3
    assert collection(flat(), crs="epsg")["crs"]["properties"]["name"] == "urn:ogc:def:crs:EPSG::32654"


def test_degrees_are_where_the_survey_says_and_as_large():
    document = collection(flat(), crs="wgs84")
    # RFC 7946: WGS84 is not named, exterior rings turn anticlockwise
    assert "crs" not in document
    room = shapes(document)["room/bath"][0]
    assert all(shapely.is_ccw(part.exterior) for part in shapely.get_parts(room))
    longitude, latitude = room.centroid.coords[0]
    # zone 54 lies around 141 degrees east; 118 km west of it at 35.7 degrees north are 1.30 degrees
    assert longitude == pytest.approx(141 - 117_855 / (111_320 * math.cos(math.radians(35.68))), abs=0.01)
    assert latitude == pytest.approx(35.68, abs=0.02)
    per_degree = np.array([111_320 * math.cos(math.radians(latitude)), 110_950])
    area = shapely.transform(room, lambda p: (p - [longitude, latitude]) * per_degree).area
    assert area == pytest.approx((AT_M - THICK_M) * (DEEP_M - THICK_M), rel=5e-3)


@pytest.mark.parametrize("crs", ["epsg", "wgs84"])
def test_a_map_that_does_not_know_where_it_is_stays_local(crs):
    with pytest.raises(MapError, match="where on Earth") as caught:
        collection(flat(origin=None), crs=crs)
    assert "--crs local" in caught.value.hint


def test_systems_that_are_no_utm_are_left_to_gdal():
    elsewhere = flat(origin=DraftOrigin("georef", 25832, 500000.0, 5400000.0, 0.0))
    assert collection(elsewhere, crs="epsg")["crs"]["properties"]["name"].endswith("25832")
    with pytest.raises(MapError, match="EPSG:25832") as caught:
        collection(elsewhere, crs="wgs84")
    assert "ogr2ogr" in caught.value.hint


def test_utm_against_known_places():
    # the CN Tower: 43 38 33.24 N, 79 23 13.7 W is 17N 630084 4833438, to the metre
    (tower,) = lonlat_from_utm(np.array([[630084.0, 4833438.0]]), 32617)
    assert tower == pytest.approx([-(79 + 23 / 60 + 13.7 / 3600), 43 + 38 / 60 + 33.24 / 3600], abs=2e-5)
    # the meridian arc to 45 degrees on WGS84 is 4984944.378 m, scaled by 0.9996 on the central meridian
    (middle,) = lonlat_from_utm(np.array([[500000.0, 4984944.378 * 0.9996]]), 32632)
    assert middle == pytest.approx([9.0, 45.0], abs=1e-8)
    # the south mirrors the north
    north = lonlat_from_utm(np.array([[411000.0, 3000000.0]]), 32633)
    south = lonlat_from_utm(np.array([[411000.0, 1e7 - 3000000.0]]), 32733)
    np.testing.assert_allclose(south, north * [1, -1], atol=1e-12)


def test_utm_is_conformal_and_scaled_as_a_transverse_mercator():
    """A metre of grid is the same in both directions, and 1 / k0 on the central meridian."""
    a, e2 = 6378137.0, 0.0066943799901413165
    for east, north in ((500000.0, 4000000.0), (300000.0, 6000000.0), (800000.0, 1000000.0)):
        d = 10.0
        points = np.array([[east, north], [east + d, north], [east, north + d]])
        degrees = np.radians(lonlat_from_utm(points, 32632))
        s = math.sin(degrees[0, 1])
        across, along = a / math.sqrt(1 - e2 * s**2), a * (1 - e2) / (1 - e2 * s**2) ** 1.5
        steps = (degrees[1:] - degrees[0]) * [across * math.cos(degrees[0, 1]), along]
        lengths = np.hypot(*steps.T)
        assert lengths[0] == pytest.approx(lengths[1], rel=1e-5)
        assert steps[0] @ steps[1] == pytest.approx(0.0, abs=1e-3)
        scale = d / lengths[0]
        offset = (east - 500000.0) / 6_370_000
        assert scale == pytest.approx(0.9996 * (1 + offset**2 / 2), rel=3e-5)


def test_only_utm_codes_have_zones():
    assert utm_zone(32654) == (54, True)
    assert utm_zone(32701) == (1, False)
    assert [utm_zone(code) for code in (None, 4326, 32600, 32661, 32761, 25832)] == [None] * 6
