"""A semantic map -> GeoJSON: a feature for every element, opening and room, with what the map says of it.

Coordinates are metres in frame map unless the map's <wk:origin> says where that lies on Earth. GeoJSON itself (RFC 7946)
knows WGS84 only: for the other two the file names its system in the `crs` member of GeoJSON 2008, which QGIS and GDAL read.
"""

from __future__ import annotations

import json
import math
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np

from wallkit.core.geometry import transform_points
from wallkit.core.types import Float64Array
from wallkit.errors import MapError
from wallkit.maps.exporters.exported import Exported, ExportOptions, Notes, doors_of, lose_meaning, things
from wallkit.maps.exporters.utm import lonlat_from_utm, utm_zone
from wallkit.maps.geometry import Part, parts
from wallkit.maps.model import SemanticMap
from wallkit.maps.nouns import Joint, Link
from wallkit.maps.surfaces import p_return_of

# decimals: a tenth of a millimetre in metres, and in degrees
METRE_DECIMALS, DEGREE_DECIMALS = 4, 9
CHINK_M = 1e-6


def export_geojson(semantic_map: SemanticMap, out: Path, options: ExportOptions) -> Exported:
    """One FeatureCollection. Footprints are seen from above, or cut at --z where it is given.

    Raises:
        MapError: the map's origin does not allow the coordinates asked for.
    """
    notes = Notes(semantic_map.source, "GeoJSON")
    project, decimals, crs = _projection(semantic_map, options, notes)
    doors = doors_of(semantic_map, options)
    poses = semantic_map.poses(semantic_map.door_states(doors))
    by_link: dict[str, list[Part]] = {}
    for part in parts(semantic_map, poses=poses):
        by_link.setdefault(part.link, []).append(part)
    found: list[tuple[str, Any, dict[str, Any]]] = []
    bodiless = 0
    for link in things(semantic_map):
        footprint = _footprint(by_link.get(link.name, []), options.z_m)
        if footprint is not None:
            found.append((link.name, footprint, _properties(semantic_map, link, by_link[link.name])))
        bodiless += footprint is None
        found += _openings(link, poses)
    found += _rooms(semantic_map)
    features = [
        {"type": "Feature", "id": name, "geometry": _geometry(shape, project, decimals), "properties": properties}
        for name, shape, properties in found
    ]
    kinds = [properties["kind"] for *_, properties in found]
    counted = ", ".join(f"{kinds.count(kind)} {kind}s" for kind in ("element", "opening", "room"))
    notes.wrote(f"{counted}; doors: {doors}", features=len(features))
    height = "" if options.z_m is None else f" at {options.z_m:g} m"
    notes.lose(f"element without a footprint{height}", bodiless, many=f"elements without a footprint{height}")
    said = {"class", "LiDAR behaviour", "room", "declared opening", "prior", "accuracy"}
    lose_meaning(notes, semantic_map, but=said if options.crs == "local" else {*said, "survey origin"})
    header = semantic_map.header
    document = {
        "type": "FeatureCollection",
        "name": semantic_map.name,
        **crs,
        "wallkit": {"level": header.level, "elevation_m": header.elevation_m, "frame": "map", "crs": options.crs},
        "features": features,
    }
    return Exported({out: (json.dumps(document, indent=1, allow_nan=False) + "\n").encode()}, notes.all())


# ------------------------------------------------------------------------------------------ coordinates

Project = Callable[[Float64Array], Float64Array]


def _projection(semantic_map: SemanticMap, options: ExportOptions, notes: Notes) -> tuple[Project, int, dict[str, Any]]:
    """(points in frame map -> coordinates, decimals, members of the collection that name the system)."""
    survey = semantic_map.header.survey
    if options.crs == "local":
        notes.taken("coordinates are metres in frame map, not degrees", hint="--crs wgs84 if the map has a <wk:origin>")
        return lambda points: points, METRE_DECIMALS, {"crs": _named("urn:wallkit:crs:map:metres")}
    if survey is None or survey.kind == "none" or survey.epsg is None or None in (survey.east_m, survey.north_m):
        raise MapError(
            "the map does not say where on Earth it lies",
            where=semantic_map.source,
            hint='<wk:origin kind="surveyed" epsg="32654" east="..." north="..." yaw="..."/> in <wk:map>, or --crs local',
        )
    epsg = survey.epsg
    T_grid_map = np.array([survey.east_m, survey.north_m, survey.yaw_rad or 0.0], dtype=np.float64)
    if options.crs == "epsg":
        notes.taken(f"coordinates are easting and northing of EPSG:{epsg}")
        crs = {"crs": _named(f"urn:ogc:def:crs:EPSG::{epsg}")}
        return lambda points: transform_points(T_grid_map, points), METRE_DECIMALS, crs
    if utm_zone(epsg) is None:
        raise MapError(
            f"its origin is in EPSG:{epsg}, and only zones of WGS84 / UTM (EPSG:32601 to 32760) are turned into degrees",
            where=semantic_map.source,
            hint=f"--crs epsg, then `ogr2ogr -t_srs EPSG:4326 degrees.geojson FILE` (it reads EPSG:{epsg})",
        )
    notes.taken(
        f"coordinates are longitude and latitude on WGS84, from EPSG:{epsg}; metres count as metres of its grid"
    )
    return lambda points: lonlat_from_utm(transform_points(T_grid_map, points), epsg), DEGREE_DECIMALS, {}


def _named(name: str) -> dict[str, Any]:
    return {"type": "name", "properties": {"name": name}}


def _geometry(shape: Any, project: Project, decimals: int) -> dict[str, Any]:
    """The shape in the collection's coordinates: valid after rounding, exterior rings anticlockwise (RFC 7946, 3.1.6)."""
    import shapely

    moved = shapely.set_precision(shapely.transform(shape, project), 10.0**-decimals)
    clean = shapely.transform(moved, lambda points: np.round(points, decimals))
    if clean.geom_type == "Polygon":
        clean = shapely.geometry.polygon.orient(clean)
    elif clean.geom_type == "MultiPolygon":
        clean = shapely.MultiPolygon([shapely.geometry.polygon.orient(polygon) for polygon in clean.geoms])
    return dict(shapely.geometry.mapping(clean))


# --------------------------------------------------------------------------------------------- features


def _footprint(solid: list[Part], z_m: float | None) -> Any:
    """Union of the footprints, or of the cuts at a height; None when nothing is there."""
    import shapely

    polygons = [part.footprint if z_m is None else part.cut(z_m) for part in solid]
    # boxes that touch leave no chink between them
    union = shapely.union_all([polygon for polygon in polygons if polygon.area > 0], grid_size=CHINK_M)
    return None if union.is_empty else union


def _properties(semantic_map: SemanticMap, link: Link, solid: list[Part]) -> dict[str, Any]:
    info, joint = semantic_map.class_of(link.name), semantic_map.parent_joint(link.name)
    properties: dict[str, Any] = {
        "kind": "element",
        "class": link.class_name or None,
        "z_m": [min(part.z_m[0] for part in solid), max(part.z_m[1] for part in solid)],
        "on": joint.parent if joint else None,
        "lidar": info.lidar if info else None,
        "p_return": p_return_of(info),
    }
    said = {"room": link.room, "connects": list(link.connects), "separates": list(link.separates), "note": link.note}
    properties.update({key: value for key, value in said.items() if value})
    if link.sigma_m is not None:
        properties["sigma_m"] = link.sigma_m
    return {**properties, **_motion(joint)} if joint and joint.is_movable else properties


def _motion(joint: Joint) -> dict[str, Any]:
    """What a door does: URDF's numbers, and the belief."""
    prior = joint.state.prior if joint.state else None
    return {
        "joint": joint.name,
        "motion": joint.kind,
        "travel": [None if math.isinf(end) else end for end in joint.travel],
        "rest": joint.rest,
        **({"prior": dict(prior)} if prior else {}),
        **({"follows": joint.mimic.joint} if joint.mimic else {}),
    }


def _openings(link: Link, poses: dict[str, Float64Array]) -> Iterator[tuple[str, Any, dict[str, Any]]]:
    """Each opening as a line along its wall's axis."""
    import shapely

    for opening in link.openings:
        if link.name in poses:
            ends = [(poses[link.name] @ [x, 0.0, 0.0, 1.0])[:2] for x in opening.along_m]
            properties = {
                "kind": "opening",
                "class": opening.kind,
                "in": link.name,
                "width_m": opening.along_m[1] - opening.along_m[0],
                "z_m": list(opening.z_m),
                "fill": opening.fill or None,
            }
            yield f"{link.name}/{opening.id}", shapely.LineString(ends), properties


def _rooms(semantic_map: SemanticMap) -> Iterator[tuple[str, Any, dict[str, Any]]]:
    import shapely

    for room in semantic_map.rooms.values():
        if room.floor is not None:
            polygon = shapely.Polygon(room.floor)
            properties = {"kind": "room", "class": room.kind or None, "area_m2": round(float(polygon.area), 6)}
            yield f"room/{room.id}", polygon, properties
