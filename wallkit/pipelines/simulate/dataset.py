"""A seed, and maps if there are any -> a training set of pictures nobody took. Read `simulate_dataset` from top to bottom.

A scene is a building with its own looks, light, lens and people; several pictures are taken in it. Scenes are made one by
one, by several processes if asked, in an unfinished folder beside the result; what is there is not made again.
"""

from __future__ import annotations

import json
import shutil
from collections.abc import Callable, Iterator
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

import wallkit
from wallkit.dataset.classes import LabelSet
from wallkit.dataset.documents import Record, split_of_groups
from wallkit.dataset.labels import Labelled, Labelling
from wallkit.dataset.write import Layout, manifest_record, write_documents, write_picture
from wallkit.errors import DatasetError
from wallkit.maps.draft.write import write_draft
from wallkit.maps.read import load_map, read_map
from wallkit.maps.xml import parse
from wallkit.pipelines.dataset.views import Variety, camera_of, looks_of, people_of, views_of
from wallkit.pipelines.outputs import check_out, put_in_place
from wallkit.pipelines.run_folder import sha256, write_json
from wallkit.pipelines.simulate.buildings import random_building
from wallkit.pipelines.simulate.world import world_from_map
from wallkit.pipelines.unfinished import unfinished_of
from wallkit.simulate.camera import photograph, shot_of, solids_by_raster, solids_by_rays
from wallkit.simulate.gl import backend
from wallkit.simulate.looks import Wardrobe
from wallkit.simulate.scenario import Scenario
from wallkit.simulate.scene import Scene
from wallkit.simulate.stage import staged
from wallkit.simulate.studio import Studio
from wallkit.simulate.world import World

Progress = Callable[[int], None]


@dataclass(frozen=True)
class DatasetRequest:
    """What to make.

    Attributes:
        maps: scenes are made in these in turn; none: in random buildings.
        exact: masks by cast rays instead of by the renderer; five times as slow.
        per_scene: pictures in one scene. val: share of scenes for validation.
    """

    images: int
    seed: int = 0
    maps: tuple[Path, ...] = ()
    size: tuple[int, int] = (640, 480)
    per_scene: int = 12
    val: float = 0.2
    exact: bool = False
    labels: LabelSet = LabelSet()
    variety: Variety = Variety()

    @property
    def scenes(self) -> int:
        return -(-self.images // self.per_scene)


@dataclass(frozen=True)
class Made:
    """What was written. resumed: scenes that an interrupted run had made."""

    images: int
    scenes: int
    resumed: int
    statistics: dict[str, Any]


def simulate_dataset(
    request: DatasetRequest, out: Path, *, jobs: int = 1, overwrite: bool = False, progress: Progress = lambda _: None
) -> Made:
    """A folder with pictures, labels of three kinds, data.yaml, manifest.json, statistics.json and a contact sheet.

    The same request gives the same labels. A run that is interrupted goes on where it stopped when it is started again.

    Args:
        progress: told how many pictures are done.

    Raises:
        OutputError: `out` cannot be used, or an interrupted set of other settings is there.
        MapError, SimulationError, DatasetError: see check_request; no OpenGL works.
    """
    check_out(out, overwrite=overwrite)
    check_request(request)
    backend()
    # once the set was taken out, nothing would be lost
    unfinished, fingerprint = unfinished_of(out, "set", "set/images/*/*"), _fingerprint(request)
    unfinished.check(fingerprint, overwrite=overwrite)
    unfinished.open(fingerprint)
    working = unfinished.folder
    (working / "scenes").mkdir(exist_ok=True)
    layout = _layout(request, working)
    layout.make()
    there = {number for number in range(request.scenes) if _scene_file(working, number).exists()}
    left = [number for number in range(request.scenes) if number not in there]
    done = sum(_count(request, number) for number in there)
    progress(done)
    for number in _each(request, working, left, jobs):
        done += _count(request, number)
        progress(done)
    records = [r for n in range(request.scenes) for r in json.loads(_scene_file(working, n).read_text("utf-8"))]
    title = f"wallkit {wallkit.__version__}, {len(records)} pictures of {request.scenes} scenes, seed {request.seed}"
    statistics = write_documents(layout, records, title=title)
    write_json(layout.folder / "manifest.json", _manifest(fingerprint, records, statistics))
    write_json(layout.folder / "run.json", {"schema": 1, "command": "simulate dataset", "seed": request.seed})
    put_in_place(layout.folder, out)
    shutil.rmtree(working)
    return Made(len(records), request.scenes, len(there), statistics)


def check_request(request: DatasetRequest) -> None:
    """Refuse what cannot be made, before anything is.

    Raises:
        DatasetError: no pictures, a negative seed, a share or size that is none. MapError: a map cannot be used.
    """
    width, height = request.size
    if request.images < 1 or request.per_scene < 1:
        raise DatasetError(f"{request.images} pictures, {request.per_scene} per scene", hint="--images 1 or more")
    if request.seed < 0:
        raise DatasetError(f"seed {request.seed} is negative", hint="use 0 or more")
    if not (32 <= width <= 4096 and 32 <= height <= 4096):
        raise DatasetError(f"pictures of {width} x {height}", hint="--size 640x480; sides from 32 to 4096")
    split_of_groups(["scene"], request.val, request.seed)
    for path in request.maps:
        request.labels.table(world_from_map(load_map(path)).class_names)


# -------------------------------------------------------------------------------------------- scenes


def make_scene(request: DatasetRequest, folder: Path, number: int) -> int:
    """Makes the pictures and labels of one scene, then the file that says they are there; its number comes back."""
    import cv2

    cv2.setNumThreads(1)
    rng = np.random.default_rng([request.seed, number])
    layout = _layout(request, folder)
    world, source = _world(rng, request, number)
    people = people_of(rng, request.variety.most_people)
    solids = tuple(solid for figure in people for solid in figure.solids)
    bodies = tuple(body for figure in people for body in figure.bodies)
    world = replace(world, solids=(*world.solids, *solids), bodies=(*world.bodies, *bodies))
    scene, group = Scene(world), f"scene_{number:05d}"
    table = np.append(request.labels.table(world.class_names), np.uint8(255))
    looks, camera = looks_of(rng, request.variety), camera_of(rng, request.variety, request.size)
    split = _splits(request)[group]
    records = []
    with Studio(Wardrobe(world, looks, int(rng.integers(2**31)))) as studio:
        count = _count(request, number)
        for k, view in enumerate(views_of(rng, scene, people, camera, request.variety, count)):
            studio.place(view.bodies)
            # a generator of its own: what the renderer draws decides nothing of the views to come
            noise = np.random.default_rng([request.seed, number, k])
            image = photograph(noise, studio, view.unit, [view.T_map_optical])
            if request.exact:
                seen = solids_by_rays(scene, view.unit, view.T_map_optical)
            else:
                seen = solids_by_raster(studio, view.unit, view.T_map_optical)
            shot = shot_of(scene, image, seen)
            more = {
                "aim": view.aim,
                "map": source,
                "T_map_optical": np.round(view.T_map_optical, 6).tolist(),
                "K": np.round(camera.K, 4).tolist(),
                "D": np.round(camera.D, 6).tolist(),
                "people": len(people),
            }
            labelled = Labelled(f"{group}_{k:02d}", group, image, table[shot.classes], shot.instances, more)
            records.append(write_picture(replace(layout, jpeg_quality=view.jpeg_quality), labelled, split))
    done = _scene_file(folder, number)
    partial = done.with_suffix(".partial")
    partial.write_text(json.dumps(records), encoding="utf-8")
    partial.rename(done)
    return number


def _world(rng: np.random.Generator, request: DatasetRequest, number: int) -> tuple[World, str]:
    """A scene's world with floor and ceiling, and where it is from."""
    if request.maps:
        path = request.maps[number % len(request.maps)]
        return staged(world_from_map(load_map(path)), Scenario()), path.name
    document = parse(write_draft(random_building(rng)), source=f"scene {number} of seed {request.seed}")
    return staged(world_from_map(read_map(document)), Scenario()), "random"


def _each(request: DatasetRequest, folder: Path, numbers: list[int], jobs: int) -> Iterator[int]:
    """Makes scenes, by several processes if asked; their numbers as they are done."""
    if jobs <= 1 or len(numbers) < 2:
        for number in numbers:
            yield make_scene(request, folder, number)
        return
    import multiprocessing
    from concurrent.futures import ProcessPoolExecutor, as_completed

    # OpenGL does not live through a fork
    context = multiprocessing.get_context("spawn")
    with ProcessPoolExecutor(min(jobs, len(numbers)), mp_context=context) as pool:
        waiting = [pool.submit(make_scene, request, folder, number) for number in numbers]
        try:
            for future in as_completed(waiting):
                yield future.result()
        except BaseException:
            pool.shutdown(cancel_futures=True)
            raise


def _count(request: DatasetRequest, number: int) -> int:
    """How many pictures a scene has; the last one has the rest."""
    return min(request.per_scene, request.images - number * request.per_scene)


def _splits(request: DatasetRequest) -> dict[str, str]:
    names = [f"scene_{number:05d}" for number in range(request.scenes)]
    return split_of_groups(names, request.val, request.seed)


# -------------------------------------------------------------------------------------------- folder


def _layout(request: DatasetRequest, folder: Path) -> Layout:
    """The set itself, beside what is known of the unfinished run."""
    return Layout(folder / "set", Labelling(request.labels))


def _scene_file(folder: Path, number: int) -> Path:
    return folder / "scenes" / f"{number:05d}.json"


def _fingerprint(request: DatasetRequest) -> Record:
    """Everything that decides what is made."""
    import mujoco

    plain = {
        "wallkit": wallkit.__version__,
        "mujoco": mujoco.__version__,
        "numpy": np.__version__,
        **{key: value for key, value in asdict(request).items() if key not in ("maps", "labels")},
        "maps": [{"file": path.name, "sha256": sha256(path)} for path in request.maps],
        "names": request.labels.names,
        "classes": dict(request.labels.of),
    }
    return dict(json.loads(json.dumps(plain)))


def _manifest(fingerprint: Record, records: list[Record], statistics: Record) -> Record:
    """manifest.json: how to make it again, and what every file must be."""
    return {
        "schema": 1,
        "kind": "simulated",
        "augmented": False,
        **fingerprint,
        "gl": backend(),
        "statistics": statistics,
        "pictures": [manifest_record(record) for record in records],
    }
