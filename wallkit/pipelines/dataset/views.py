"""A world and a seed -> views of it: doors ajar, people about, a camera somewhere that looks at something worth learning."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass

import numpy as np

from wallkit.core.camera import Camera
from wallkit.core.types import Float64Array
from wallkit.errors import SimulationError
from wallkit.simulate.camera import Unit
from wallkit.simulate.figure import PARTS, Figure, figures, postures
from wallkit.simulate.floor import Floor, floor_of
from wallkit.simulate.looks import Looks
from wallkit.simulate.photo import Photo
from wallkit.simulate.scene import Scene
from wallkit.simulate.world import World

# how often a view is aimed at a thing of a class that the world has; "" looks anywhere
_AIMS: Mapping[str, float] = {
    "toilet": 4,
    "urinal": 4,
    "sink": 3,
    "mirror": 2,
    "door": 5,
    "partition": 2,
    "glass": 2,
    "window": 1,
    "person": 3,
    "wall": 2,
    "column": 1,
    "furniture": 1,
    "radiator": 0.5,
    "trash": 1,
    "dispenser": 1,
    "": 2,
}
_CAMERA_RADIUS_M, _PERSON_RADIUS_M = 0.28, 0.3
_TRIES = 16
_REACH_M = (0.7, 5.0)


@dataclass(frozen=True)
class Variety:
    """What differs between scenes and views, as (from, to) unless it says otherwise."""

    hfov_deg: tuple[float, float] = (55.0, 100.0)
    height_m: tuple[float, float] = (0.25, 1.6)
    pitch_sd_rad: float = math.radians(7)
    roll_sd_rad: float = math.radians(1.5)
    most_people: int = 5
    distorted: float = 0.3
    shadows: float = 0.2


@dataclass(frozen=True, eq=False)
class View:
    """One moment from one place.

    Attributes:
        T_map_optical: (4, 4) of the camera. bodies: T_map_body of doors and people.
        unit: the scene's camera with this picture's exposure. aim: the class that it looks at.
    """

    T_map_optical: Float64Array
    bodies: dict[str, Float64Array]
    unit: Unit
    aim: str
    jpeg_quality: int


def people_of(rng: np.random.Generator, most: int) -> tuple[Figure, ...]:
    """Nobody in every third world, else some."""
    return figures(rng, 0 if rng.random() < 0.33 else int(rng.integers(1, most + 1)))


def looks_of(rng: np.random.Generator, variety: Variety) -> Looks:
    """How a scene looks."""
    return Looks(
        ceiling="repeating" if rng.random() < 0.3 else "unique",
        posters=float(rng.uniform(0, 0.3)),
        brightness=float(np.exp(rng.normal(0, 0.25))),
        shadows=bool(rng.random() < variety.shadows),
    )


def camera_of(rng: np.random.Generator, variety: Variety, size: tuple[int, int]) -> Camera:
    """The lens of a scene; some distort."""
    width, height = size
    focal = width / 2 / math.tan(math.radians(float(rng.uniform(*variety.hfov_deg))) / 2)
    cx, cy = (np.array(size) - 1) / 2 + rng.normal(0, 0.01, 2) * size
    K = np.array([[focal, 0, cx], [0, focal * float(rng.normal(1, 0.003)), cy], [0, 0, 1]])
    D = np.zeros(5)
    if rng.random() < variety.distorted:
        half = math.hypot(width, height) / 2 / focal
        # so strong that the corners move by up to 12 %
        D[0] = float(rng.uniform(-0.12, 0.04)) / half**2
    return Camera("plumb_bob", width, height, K, D, "camera", "camera_optical_frame")


def views_of(
    rng: np.random.Generator, scene: Scene, people: tuple[Figure, ...], camera: Camera, variety: Variety, count: int
) -> Iterator[View]:
    """Views of a scene, whose world already has these people. The scene is posed as in the view when it is yielded.

    Raises:
        SimulationError: there is no floor to stand on.
    """
    world = scene.world
    floor = floor_of(world, with_doors=False)
    places = floor.free_points(_CAMERA_RADIUS_M)
    if not len(places):
        raise SimulationError("there is no floor that a robot fits on", where=world.source, hint="check the rooms")
    focus = _things_by_class(world)
    unit = Unit("camera", camera.frame, camera, camera, np.eye(4), np.eye(4))
    for _ in range(count):
        bodies = {**world.poses(_door_states(rng, world)), **_standing(rng, people, floor, places)}
        scene.place(bodies)
        T, aim = _camera_pose(rng, scene, bodies, places, focus, variety, camera)
        yield View(T, bodies, unit.developing(_photo(rng)), aim, int(rng.integers(70, 96)))


# -------------------------------------------------------------------------------------------- details


def _things_by_class(world: World) -> dict[str, list[list[int]]]:
    """Of every class, its things as the numbers of their solids."""
    by_thing: dict[str, list[int]] = {}
    for number, solid in enumerate(world.solids):
        by_thing.setdefault(solid.instance, []).append(number)
    found: dict[str, list[list[int]]] = {}
    for numbers in by_thing.values():
        found.setdefault(world.solids[numbers[0]].class_name, []).append(numbers)
    return found


def _door_states(rng: np.random.Generator, world: World) -> dict[str, float]:
    """A third shut, the others anywhere."""
    states = {}
    for body in world.bodies:
        if body.motion == "free" or body.follows:
            continue
        low, high = (float(np.clip(limit, -math.pi, math.pi)) for limit in body.limits)
        states[body.name] = float(np.clip(0.0, low, high)) if rng.random() < 0.35 else float(rng.uniform(low, high))
    return states


def _standing(
    rng: np.random.Generator, people: tuple[Figure, ...], floor: Floor, places: Float64Array
) -> dict[str, Float64Array]:
    """T_map_body of the parts of people who stand and walk anywhere, in the middle of a step."""
    if not people:
        return {}
    free = floor.free_points(_PERSON_RADIUS_M)
    free = free if len(free) else places
    at = free[rng.integers(0, len(free), len(people))]
    poses = np.column_stack([at, rng.uniform(-math.pi, math.pi, len(people))])
    speeds = np.where(rng.random(len(people)) < 0.6, rng.uniform(0.5, 1.5, len(people)), 0.0)
    parts = postures(people, poses, rng.uniform(0, 10, len(people)), speeds)
    return {
        f"{figure.name}.{part}": T
        for figure, T_parts in zip(people, parts, strict=True)
        for part, T in zip(PARTS, T_parts, strict=True)
    }


def _camera_pose(
    rng: np.random.Generator,
    scene: Scene,
    bodies: Mapping[str, Float64Array],
    places: Float64Array,
    focus: dict[str, list[list[int]]],
    variety: Variety,
    camera: Camera,
) -> tuple[Float64Array, str]:
    """T_map_optical, and the class of what it looks at: a thing that is in sight from there."""
    names = [name for name in _AIMS if name in focus or not name]
    weights = np.array([_AIMS[name] for name in names])
    half_view = math.atan(camera.width / 2 / camera.K[0, 0])
    for _ in range(3):
        aim = str(rng.choice(names, p=weights / weights.sum()))
        height = float(rng.uniform(*variety.height_m))
        if not aim:
            break
        things = focus[aim]
        solids = things[int(rng.integers(len(things)))]
        solid = scene.world.solids[solids[int(rng.integers(len(solids)))]]
        target = (bodies[solid.body] if solid.body else np.eye(4)) @ solid.T_body_solid @ _inside(rng, solid.size)
        away = np.hypot(*(places - target[:2]).T)
        near = places[(away > _REACH_M[0]) & (away < _REACH_M[1])]
        for at in near[rng.permutation(len(near))[:_TRIES]]:
            ray = target[:3] - (*at, height)
            hits = scene.cast(np.array([*at, height]), ray[None] / np.linalg.norm(ray), is_camera=True)
            if int(hits.solids[0]) in solids:
                yaw = math.atan2(ray[1], ray[0]) + float(rng.uniform(-0.6, 0.6)) * half_view
                down = math.atan2(-ray[2], math.hypot(ray[0], ray[1])) * float(rng.uniform(0.2, 1.0))
                return _optical(rng, (*at, yaw), height, down, variety), aim
    place = places[int(rng.integers(len(places)))]
    return _optical(rng, (*place, float(rng.uniform(-math.pi, math.pi))), height, 0.0, variety), ""


def _inside(rng: np.random.Generator, size: tuple[float, ...]) -> Float64Array:
    """(4,) a point in a shape, in its frame."""
    spread = 0.3 * np.array(size) if len(size) == 3 else np.zeros(3)
    return np.append(rng.uniform(-1, 1, 3) * spread, 1.0)


def _optical(
    rng: np.random.Generator, pose: tuple[float, ...], height_m: float, down_rad: float, variety: Variety
) -> Float64Array:
    """(4, 4) x right, y down, z forward of a camera that looks along a heading, and somewhat down."""
    from scipy.spatial.transform import Rotation

    x, y, yaw = pose
    pitch = down_rad + float(rng.normal(0, variety.pitch_sd_rad))
    roll = float(rng.normal(0, variety.roll_sd_rad))
    R = Rotation.from_euler("ZYX", [yaw, float(np.clip(pitch, -0.6, 0.9)), roll]).as_matrix()
    T = np.eye(4)
    # forward, left, up -> right, down, forward
    T[:3, :3] = R @ np.array([[0, 0, 1], [-1, 0, 0], [0, -1, 0]])
    T[:3, 3] = (x, y, height_m)
    return T


def _photo(rng: np.random.Generator) -> Photo:
    """Exposure, colour, blur and noise of one picture."""
    return Photo(
        auto_exposure=float(rng.uniform(0.4, 1.0)),
        exposure=float(np.exp(rng.normal(0, 0.3))),
        vignette=float(rng.uniform(0, 0.35)),
        read_noise=float(rng.uniform(0, 0.01)),
        shot_noise=float(rng.uniform(0, 0.03)),
        warmth=float(np.clip(rng.normal(0, 0.35), -1, 1)),
        gamma=float(np.exp(rng.normal(0, 0.12))),
        defocus_px=float(rng.exponential(0.8)) if rng.random() < 0.35 else 0.0,
    )
