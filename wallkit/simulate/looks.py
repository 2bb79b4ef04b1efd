"""A world and a seed -> how everything in it looks: walls by room, doors by leaf, people by their clothes, and the lamps.

Every thing draws from a generator of its own name: one more chair changes no wall.
"""

from __future__ import annotations

import zlib
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Literal

import numpy as np

from wallkit.core.config import setting
from wallkit.core.types import Float64Array
from wallkit.simulate.ceiling import ceiling_picture, lamps_of, painted_picture
from wallkit.simulate.decals import picture
from wallkit.simulate.panels import Panel
from wallkit.simulate.textures import TEXTURES, Colour, Texture, colour
from wallkit.simulate.world import Solid, World


@dataclass(frozen=True)
class Looks:
    """How the world looks to cameras. What is not said is drawn from the seed."""

    ceiling: Literal["unique", "repeating", "painted"] = setting(
        "unique",
        "unique: lamps, vents, stains, no two places look the same; repeating: panels every 1.2 m, the hard case; "
        "painted: colours that run into each other",
    )
    lamps_off: float = setting(0.0, "share of the ceiling's lamps that are switched off", low=0, high=1)
    walls: str = setting(
        "", "one surface for all walls: paint, plaster, tiles, brick, wainscot, concrete; else by room"
    )
    posters: float = setting(0.12, "posters per metre of wall", low=0, high=1)
    lights: int = setting(0, "lamps that light a place, the nearest ones; 0: by chance 2 to 5", low=0, high=6)
    brightness: float = setting(1.0, "of all light", low=0.05, high=4)
    shadows: bool = setting(False, "lamps cast shadows; twice to ten times as slow")
    seed: int = setting(-1, "looks of their own: the same world in other clothes; -1: the log's seed", low=-1)


@dataclass(frozen=True, eq=False)
class Surface:
    """What a renderer is told of a surface.

    Attributes:
        texture: None for one colour. fits: the texture fills a face once, instead of repeating at its size.
        rgba: colour, or tint of the texture; the last one is opacity.
        glow: light of its own; ceilings have some, as lamps below them do not light them in this renderer.
    """

    texture: Texture | None = None
    fits: bool = False
    rgba: tuple[float, float, float, float] = (1.0, 1.0, 1.0, 1.0)
    glow: float = 0.0
    shine: float = 0.1
    reflects: float = 0.0


@dataclass(frozen=True, eq=False)
class Lamp:
    """A light at a place in the map, shining down; colour in [0, 1]."""

    at: tuple[float, float, float]
    colour: Colour


@dataclass(frozen=True, eq=False)
class Wardrobe:
    """All surfaces of one world.

    Attributes:
        own: surfaces by the name that a solid has as its `look`; of a box they are its front.
    """

    world: World
    looks: Looks
    seed: int
    own: Mapping[str, Surface] = field(default_factory=dict)
    _kept: dict[str, Surface] = field(default_factory=dict)

    def rng(self, name: str) -> np.random.Generator:
        """The generator of one thing."""
        return np.random.default_rng([self.seed, zlib.crc32(name.encode())])

    def kept(self, key: str, make: Callable[[np.random.Generator], Surface]) -> Surface:
        """The surface of a key, made at the first time."""
        if key not in self._kept:
            self._kept[key] = make(self.rng(key))
        return self._kept[key]

    # ---------------------------------------------------------------------------------- what looks how

    def panel(self, panel: Panel) -> Surface:
        """The surface of a face, or a piece of one, of a box."""
        solid = self.world.solids[panel.solid]
        name = solid.class_name
        if solid.light == "mirror":
            return self.mirror
        if solid.look in self.own and panel.side == "front":
            return self.own[solid.look]
        if name == "wall" and not solid.look:
            kind = next((room.kind for room in self.world.rooms if room.id == panel.room), "")
            return self.kept(f"wall of {panel.room}", lambda rng: _wall(rng, kind, self.looks.walls))
        painted = _FACES.get(name, {}).get(panel.side)
        if name == "toilet" and solid.T_body_solid[2, 3] > 0.45:
            painted = "tank" if panel.side == "front" else None
        # the edge of a door's leaf is no door
        if painted and not solid.look and min(panel.size_m) > 0.08:
            return self._painted(solid, panel, painted)
        return self.plain(solid)

    def _painted(self, solid: Solid, panel: Panel, name: str) -> Surface:
        w, h = panel.size_m
        key = f"{solid.instance} {panel.side} {w:.2f} {h:.2f}"
        base = self._base(solid)
        glossy = 0.5 if solid.class_name in _PORCELAIN else 0.15
        return self.kept(key, lambda rng: Surface(picture(rng, name, panel.size_m, base), fits=True, shine=glossy))

    def plain(self, solid: Solid) -> Surface:
        """The surface of a solid that has the same one all over."""
        if solid.light == "glass":
            return self.kept("glass", lambda rng: Surface(rgba=(*colour(rng, 0.5, 0.12, 0.9), 0.22), shine=0.9))
        if solid.class_name == "person":
            return self._clothes(solid)
        base = self._base(solid)
        kind = solid.look if solid.look in TEXTURES else _PLAIN.get(solid.class_name, "laminate")
        shine = 0.5 if solid.class_name in _PORCELAIN else 0.1
        return self.kept(f"{solid.instance} plain", lambda rng: Surface(TEXTURES[kind](rng, base), shine=shine))

    def _base(self, solid: Solid) -> Colour:
        """The colour of a thing; fixtures of a building are of one make."""
        name = solid.class_name
        hue, saturation, value = _COLOURS.get(name, (None, 0.3, 0.6))
        rng = self.rng(name if name in _PORCELAIN or name in ("door", "partition") else solid.instance)
        drawn = float(rng.random()) if hue is None else hue
        return colour(rng, drawn, saturation * float(rng.uniform(0.5, 1.4)), value)

    def _clothes(self, solid: Solid) -> Surface:
        """Skin, hair, trousers, a top, shoes; of one person the same from every side."""
        part = solid.look
        piece = "skin" if part in ("forearm",) else "top" if part in ("torso", "upper_arm") else part
        piece = "trousers" if part in ("thigh", "shin", "hips") else piece
        rng = self.rng(f"{solid.instance} {piece}")
        if piece in ("skin", "head"):
            tone = float(self.rng(f"{solid.instance} tone").uniform(0.30, 0.92))
            rgb = colour(rng, 0.07, 0.45, tone, spread=0.015)
        elif piece == "foot":
            rgb = colour(rng, 0.08, 0.3, float(rng.uniform(0.08, 0.7)))
        else:
            rgb = colour(rng, float(rng.random()), float(rng.uniform(0.05, 0.85)), float(rng.uniform(0.12, 0.9)))
        return Surface(rgba=(*rgb, 1.0), shine=0.05)

    @property
    def mirror(self) -> Surface:
        """Silvered glass."""
        return self.kept("mirror", lambda rng: Surface(rgba=(0.30, 0.32, 0.33, 1.0), reflects=0.85, shine=0.8))

    def floor(self, kind: str, room: str) -> Surface:
        """The floor of a room of some kind."""
        return self.kept(f"floor of {room}", lambda rng: _floor(rng, kind))

    def poster(self, key: str, size_m: tuple[float, float]) -> Surface:
        """Something that hangs on a wall."""
        return self.kept(
            f"poster {key}", lambda rng: Surface(picture(rng, "poster", size_m, (1, 1, 1)), fits=True, shine=0.2)
        )

    def ceiling(self, size_m: tuple[float, float]) -> Surface:
        """The ceiling over everything."""
        if self.looks.ceiling == "repeating":
            grid = TEXTURES["ceiling_grid"]
            return self.kept("ceiling", lambda rng: Surface(grid(rng, colour(rng, 0.1, 0.02, 0.85)), glow=0.45))
        if self.looks.ceiling == "painted":
            return self.kept("ceiling", lambda rng: Surface(painted_picture(rng, size_m), fits=True, glow=0.45))
        return self.kept(
            "ceiling", lambda rng: Surface(ceiling_picture(rng, size_m, self.lamps(size_m)), fits=True, glow=0.45)
        )

    # ------------------------------------------------------------------------------------------- light

    def lamps(self, size_m: tuple[float, float]) -> Float64Array:
        """(L, 5) of `lamps_of` for this world's ceiling, and whether each is on."""
        lamps = lamps_of(self.rng("lamps"), size_m)
        is_on = self.rng("switches").random(len(lamps)) >= self.looks.lamps_off
        return np.column_stack([lamps, is_on])

    def light_count(self, lamps: int) -> int:
        """How many lamps light a place at once."""
        return min(self.looks.lights or int(self.rng("light count").integers(2, 6)), lamps)

    def lights(self, corner: Float64Array, size_m: tuple[float, float]) -> tuple[Lamp, ...]:
        """The lamps as lights, each a little different, under a ceiling whose lowest corner is at (2,)."""
        rng = self.rng("lights")
        warmth = float(rng.uniform(-1, 1))
        found = []
        for x, y, _, _, is_on in self.lamps(size_m).tolist():
            power = float(rng.uniform(0.75, 1.1)) * is_on
            tint = np.clip((1 + 0.10 * warmth, 1.0, 1 - 0.16 * warmth), 0, 1.15) * power
            at = (float(corner[0] + x), float(corner[1] + y), self.world.height_m - 0.08)
            found.append(Lamp(at, tuple(tint.tolist())))
        return tuple(found)


# -------------------------------------------------------------------------------------------- tables

_PORCELAIN = ("toilet", "urinal", "sink")
# which faces of a class are painted with what
_FACES: Mapping[str, Mapping[str, str]] = {
    "toilet": {"top": "toilet_top", "front": "toilet_front"},
    "urinal": {"front": "urinal_front"},
    "sink": {"top": "sink_top", "front": "sink_front"},
    "door": dict.fromkeys(("front", "back", "left", "right"), "door"),
    "dispenser": {"front": "dispenser"},
    "radiator": {"front": "radiator", "back": "radiator"},
    "trash": dict.fromkeys(("front", "back", "left", "right"), "bin"),
    "furniture": dict.fromkeys(("front", "back"), "drawers"),
}
_PLAIN: Mapping[str, str] = {
    "wall": "paint",
    "column": "concrete",
    "furniture": "wood",
    "door": "wood",
    "trash": "metal",
    "dispenser": "laminate",
    "cart": "metal",
    "floor": "concrete",
}
# hue (None: any), saturation, brightness
_COLOURS: Mapping[str, tuple[float | None, float, float]] = {
    "toilet": (0.12, 0.04, 0.93),
    "urinal": (0.12, 0.04, 0.93),
    "sink": (0.12, 0.04, 0.93),
    "door": (0.07, 0.45, 0.60),
    "partition": (None, 0.20, 0.72),
    "column": (0.10, 0.08, 0.72),
    "furniture": (0.08, 0.40, 0.62),
    "radiator": (0.12, 0.04, 0.90),
    "dispenser": (0.60, 0.05, 0.85),
    "trash": (0.60, 0.08, 0.45),
    "cart": (0.60, 0.05, 0.55),
    "floor": (0.10, 0.08, 0.55),
}


def _wall(rng: np.random.Generator, kind: str, wanted: str) -> Surface:
    """Wet rooms are tiled; others painted, plastered, of brick or half and half."""
    if wanted and wanted in TEXTURES:
        name = wanted
    elif kind == "restroom":
        name = str(rng.choice(["tiles", "tiles", "tiles", "wainscot", "paint"]))
    else:
        name = str(rng.choice(["paint", "paint", "plaster", "wainscot", "brick", "concrete"]))
    if name == "brick":
        base = colour(rng, 0.04, 0.5, 0.55)
    elif name == "tiles":
        base = colour(rng, float(rng.random()), float(rng.uniform(0.02, 0.25)), float(rng.uniform(0.65, 0.95)))
    else:
        base = colour(rng, float(rng.random()), float(rng.uniform(0.0, 0.22)), float(rng.uniform(0.68, 0.95)))
    return Surface(TEXTURES[name](rng, base), shine=0.35 if name == "tiles" else 0.05)


def _floor(rng: np.random.Generator, kind: str) -> Surface:
    if kind == "restroom":
        name = str(rng.choice(["floor_tiles", "floor_tiles", "terrazzo"]))
    elif kind == "office":
        name = str(rng.choice(["carpet", "planks", "laminate"]))
    else:
        name = str(rng.choice(["floor_tiles", "planks", "terrazzo", "carpet", "concrete"]))
    if name == "planks":
        base = colour(rng, 0.08, 0.4, float(rng.uniform(0.4, 0.7)))
    else:
        base = colour(rng, float(rng.random()), float(rng.uniform(0.03, 0.25)), float(rng.uniform(0.4, 0.8)))
    return Surface(TEXTURES[name](rng, base), shine=0.25)
