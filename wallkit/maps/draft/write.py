"""A draft -> the bytes of a wkmap 1.0 file: frames, joints, boxes cut round the openings, closed corners."""

from __future__ import annotations

from collections.abc import Iterator

from wallkit.maps.classes import DEFAULT_TAXONOMY, RESTROOM_V1
from wallkit.maps.draft.draft import Draft, check_draft, classes_used
from wallkit.maps.draft.placed import placed_walls
from wallkit.maps.draft.xml import attributes, class_line, fixture_lines, number_text, room_line, wall_lines
from wallkit.maps.grammar import FORMAT, UNITS


def write_draft(draft: Draft) -> bytes:
    """The draft as wkmap 1.0: UTF-8 XML, at most six decimals, the same bytes for the same draft.

    Raises:
        MapError: see check_draft.
    """
    check_draft(draft)
    placed = list(placed_walls(draft))
    lines = [
        '<?xml version="1.0" encoding="UTF-8"?>',
        f'<robot{attributes(name=draft.name)} xmlns:wk="urn:wallkit:map:1">',
    ]
    lines += _header(draft)
    lines.append('  <link name="map"/>')
    for wall in placed:
        lines += wall_lines(wall)
    by_name = {wall.wall.name: wall for wall in placed}
    for fixture in draft.fixtures:
        lines += fixture_lines(fixture, by_name.get(fixture.wall or ""))
    return ("\n".join([*lines, "</robot>"]) + "\n").encode()


def _header(draft: Draft) -> Iterator[str]:
    plane = None if draft.scan_plane_m is None else number_text(draft.scan_plane_m)
    yield (
        "  <wk:map"
        + attributes(
            format=FORMAT,
            units=UNITS,
            up="z",
            level=draft.level,
            elevation=number_text(draft.elevation_m),
            scan_plane=plane,
            taxonomy=DEFAULT_TAXONOMY,
            source=draft.source or None,
        )
        + ">"
    )
    if origin := draft.origin:
        yield (
            "    <wk:origin"
            + attributes(
                kind=origin.kind,
                epsg=str(origin.epsg),
                east=number_text(origin.east_m),
                north=number_text(origin.north_m),
                yaw=number_text(origin.yaw_rad),
            )
            + "/>"
        )
    table = {**RESTROOM_V1, **{info.name: info for info in draft.classes}}
    used = {class_name for _, class_name in classes_used(draft)} | {info.name for info in draft.classes}
    for info in table.values():
        if info.name in used:
            yield class_line(info)
    for room in draft.rooms:
        yield room_line(room)
    yield "  </wk:map>"
