"""O, what fills an opening: a link that exists, hangs on the wall, fits the hole and fills no other."""

from __future__ import annotations

from collections.abc import Iterator

from wallkit.errors import closest
from wallkit.maps.nouns import Opening
from wallkit.maps.rules.base import Context, Problem, Rule
from wallkit.maps.rules.elevation import fill_extents


def o003_too_wide(context: Context) -> Iterator[Problem]:
    """What fills an opening is wider than the hole.

    Bad:
      <link name="wall_a"><wk:opening id="w" kind="window" along="1 2" z="0 2.5" fill="pane"/>
      <collision><origin xyz="0.5 0 1.25"/><geometry><box size="1 0.1 2.5"/></geometry></collision>
      <collision><origin xyz="3 0 1.25"/><geometry><box size="2 0.1 2.5"/></geometry></collision></link>
      <joint name="a" type="fixed"><parent link="map"/><child link="wall_a"/></joint>
      <link name="pane"><collision><origin xyz="0 0 1.25"/><geometry><box size="1.1 0.01 2.5"/></geometry></collision>
      </link>
      <joint name="p" type="fixed"><parent link="wall_a"/><child link="pane"/><origin xyz="1.5 0 0"/></joint>
    Good:
      <link name="wall_a"><wk:opening id="w" kind="window" along="1 2" z="0 2.5" fill="pane"/>
      <collision><origin xyz="0.5 0 1.25"/><geometry><box size="1 0.1 2.5"/></geometry></collision>
      <collision><origin xyz="3 0 1.25"/><geometry><box size="2 0.1 2.5"/></geometry></collision></link>
      <joint name="a" type="fixed"><parent link="map"/><child link="wall_a"/></joint>
      <link name="pane"><collision><origin xyz="0 0 1.25"/><geometry><box size="1 0.01 2.5"/></geometry></collision>
      </link>
      <joint name="p" type="fixed"><parent link="wall_a"/><child link="pane"/><origin xyz="1.5 0 0"/></joint>
    """
    yield from _too_large(context, 0)


def o004_too_tall(context: Context) -> Iterator[Problem]:
    """What fills an opening is taller than the hole.

    Bad:
      <link name="wall_a"><wk:opening id="w" kind="window" along="1 2" z="0 2.5" fill="pane"/>
      <collision><origin xyz="0.5 0 1.25"/><geometry><box size="1 0.1 2.5"/></geometry></collision>
      <collision><origin xyz="3 0 1.25"/><geometry><box size="2 0.1 2.5"/></geometry></collision></link>
      <joint name="a" type="fixed"><parent link="map"/><child link="wall_a"/></joint>
      <link name="pane"><collision><origin xyz="0 0 1.3"/><geometry><box size="1 0.01 2.6"/></geometry></collision>
      </link>
      <joint name="p" type="fixed"><parent link="wall_a"/><child link="pane"/><origin xyz="1.5 0 0"/></joint>
    Good:
      <link name="wall_a"><wk:opening id="w" kind="window" along="1 2" z="0 2.5" fill="pane"/>
      <collision><origin xyz="0.5 0 1.25"/><geometry><box size="1 0.1 2.5"/></geometry></collision>
      <collision><origin xyz="3 0 1.25"/><geometry><box size="2 0.1 2.5"/></geometry></collision></link>
      <joint name="a" type="fixed"><parent link="map"/><child link="wall_a"/></joint>
      <link name="pane"><collision><origin xyz="0 0 1.25"/><geometry><box size="1 0.01 2.5"/></geometry></collision>
      </link>
      <joint name="p" type="fixed"><parent link="wall_a"/><child link="pane"/><origin xyz="1.5 0 0"/></joint>
    """
    yield from _too_large(context, 1)


def o007_fill(context: Context) -> Iterator[Problem]:
    """An opening is filled by a link that does not exist, or that does not hang on this wall.

    Bad:
      <link name="wall_a"><wk:opening id="w" kind="window" along="1 2" z="0 2.5" fill="pan"/>
      <collision><origin xyz="0.5 0 1.25"/><geometry><box size="1 0.1 2.5"/></geometry></collision>
      <collision><origin xyz="3 0 1.25"/><geometry><box size="2 0.1 2.5"/></geometry></collision></link>
      <joint name="a" type="fixed"><parent link="map"/><child link="wall_a"/></joint>
    Good:
      <link name="wall_a"><wk:opening id="w" kind="window" along="1 2" z="0 2.5"/>
      <collision><origin xyz="0.5 0 1.25"/><geometry><box size="1 0.1 2.5"/></geometry></collision>
      <collision><origin xyz="3 0 1.25"/><geometry><box size="2 0.1 2.5"/></geometry></collision></link>
      <joint name="a" type="fixed"><parent link="map"/><child link="wall_a"/></joint>
    """
    for link in context.map.links.values():
        children = [joint.child for joint in context.map.children_of(link.name)]
        for opening in link.openings:
            if not opening.fill or opening.fill in children:
                continue
            spot = opening.element.spot("fill")
            hint = closest(opening.fill, children) if children else f"hang what fills it on '{link.name}'"
            if opening.fill not in context.map.links:
                yield Problem(spot, f"opening '{opening.id}' is filled by '{opening.fill}', which does not exist", hint)
            elif opening.fill not in context.map.subtree(link.name)[1:]:
                related = ((f"'{opening.fill}'", context.map.links[opening.fill].element),)
                message = f"opening '{opening.id}' is filled by '{opening.fill}', which does not hang on '{link.name}'"
                yield Problem(spot, message, f"its joint's parent must be '{link.name}'", related=related)


def o009_two_fills(context: Context) -> Iterator[Problem]:
    """One link fills two openings.

    Bad:
      <link name="wall_a"><wk:opening id="w" kind="window" along="1 2" z="0 2.5" fill="pane"/>
      <wk:opening id="v" kind="window" along="3 4" z="0 2.5" fill="pane"/>
      <collision><origin xyz="0.5 0 1.25"/><geometry><box size="1 0.1 2.5"/></geometry></collision>
      <collision><origin xyz="2.5 0 1.25"/><geometry><box size="1 0.1 2.5"/></geometry></collision>
      <collision><origin xyz="4.5 0 1.25"/><geometry><box size="1 0.1 2.5"/></geometry></collision></link>
      <joint name="a" type="fixed"><parent link="map"/><child link="wall_a"/></joint>
      <link name="pane"><collision><origin xyz="0 0 1.25"/><geometry><box size="1 0.01 2.5"/></geometry></collision>
      </link>
      <joint name="p" type="fixed"><parent link="wall_a"/><child link="pane"/><origin xyz="1.5 0 0"/></joint>
    Good:
      <link name="wall_a"><wk:opening id="w" kind="window" along="1 2" z="0 2.5" fill="pane"/>
      <collision><origin xyz="0.5 0 1.25"/><geometry><box size="1 0.1 2.5"/></geometry></collision>
      <collision><origin xyz="3 0 1.25"/><geometry><box size="2 0.1 2.5"/></geometry></collision></link>
      <joint name="a" type="fixed"><parent link="map"/><child link="wall_a"/></joint>
      <link name="pane"><collision><origin xyz="0 0 1.25"/><geometry><box size="1 0.01 2.5"/></geometry></collision>
      </link>
      <joint name="p" type="fixed"><parent link="wall_a"/><child link="pane"/><origin xyz="1.5 0 0"/></joint>
    """
    first: dict[str, Opening] = {}
    for link in context.map.links.values():
        for opening in link.openings:
            if opening.fill in first:
                other = first[opening.fill]
                message = f"'{opening.fill}' fills opening '{other.id}' and opening '{opening.id}'"
                related = ((f"opening '{other.id}'", other.element),)
                yield Problem(opening.element.spot("fill"), message, "give each opening its own link", related=related)
            elif opening.fill:
                first[opening.fill] = opening


# -------------------------------------------------------------------------------------------- details


def _too_large(context: Context, axis: int) -> Iterator[Problem]:
    word, side = (("wide", "along"), ("tall", "z"))[axis]
    for link in context.map.links.values():
        for opening in link.openings:
            extent = context.once(fill_extents).get(opening.element)
            low, high = opening.along_m if axis == 0 else opening.z_m
            if extent is None or not high > low:
                continue
            size_m = extent[axis + 2] - extent[axis]
            if size_m > high - low + context.tolerances.leaf_m:
                message = f"'{opening.fill}' is {size_m:.3f} m {word}, opening '{opening.id}' only {high - low:.3f} m"
                fill = context.map.links[opening.fill]
                at = fill.shapes[0].geometry if fill.shapes else fill.element
                related = ((f"opening '{opening.id}'", opening.element.spot(side)),)
                yield Problem(at, message, f"make it at most {high - low:.3f} m {word}", related=related)


RULES = (
    Rule("WK-O003", "error", o003_too_wide),
    Rule("WK-O004", "error", o004_too_tall),
    Rule("WK-O007", "error", o007_fill),
    Rule("WK-O009", "error", o009_two_fills),
)
