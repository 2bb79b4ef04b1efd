"""`wallkit localize --filter` through a camera: what is kept, what is said when it cannot be, what the folder holds."""

from __future__ import annotations

import hashlib
import json
import threading
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from tests.e2e import camera_log
from wallkit.cli.localize import warnings_of
from wallkit.core.camera import Camera
from wallkit.errors import CalibrationError, ConfigError, LogError, ModelError
from wallkit.logs.reader import open_log
from wallkit.pipelines.cameras import CameraRequest
from wallkit.pipelines.config import load_config
from wallkit.pipelines.localize import Request, localize, prepare
from wallkit.segment.class_map import class_map
from wallkit.segment.default import model_path
from wallkit.segment.fixture import USUAL, oracle

ORACLE = {"model": "oracle"}


@pytest.fixture(scope="module")
def world(tmp_path_factory):
    """A log with people before the walls, its calibration, and a model that knows walls and people by colour."""
    folder = tmp_path_factory.mktemp("camera")
    camera_log.write_log(folder / "log.mcap", seconds=9)
    camera_log.write_calibration(folder / "front.toml")
    (folder / "colours.onnx").write_bytes(oracle(USUAL, (256, 320), "class-scores"))
    return folder


def prepared(log, filters=("wall_mask",), *, words=(), seeds=1, calibrations=(), **cameras):
    config = load_config(
        None, ["localize.particles=300", *words], {"points.filters": (tuple(filters), "--filter")}
    ).config
    request = Request((log,), init="truth", cameras=CameraRequest(calibrations=calibrations, **cameras))
    return prepare(request, config, seeds=seeds)


def ready(world, filters=("wall_mask",), **given):
    return prepared(world / "log.mcap", filters, calibrations=(world / "front.toml",), **{**ORACLE, **given})


def test_the_command_keeps_walls_and_says_so(wallkit, tmp_path, world):
    words = ("--filter", "wall_mask", "--calib", world / "front.toml", "--model", "oracle", "--init", "truth")
    done = wallkit("localize", world / "log.mcap", *words, "--overlay", "2", "-o", "run", "-q", "--particles", "300")
    assert done.code == 0, done.err
    said = next(line for line in done.out.splitlines() if line.startswith("filter"))
    assert "wall_mask:" in said
    assert "seen by no camera" in said
    run = json.loads((tmp_path / "run" / "run.json").read_text())
    classes = run["filtering"]["classes"]
    assert classes["person"]["returns"] > 100
    assert classes["person"]["kept"] == 0
    assert classes["wall"]["kept"] > 0.9 * classes["wall"]["returns"]
    assert classes["not seen"]["kept"] == classes["not seen"]["returns"]
    assert run["filtering"]["cameras"][0]["topic"] == "/oracle/front/classes"
    assert str(world / "front.toml") in {entry["path"] for entry in run["inputs"]}
    metrics = json.loads((tmp_path / "run" / "metrics.json").read_text())
    assert 0 < metrics["kept_share"] < 1
    assert len(list((tmp_path / "run" / "overlays").glob("*.png"))) == 2
    page = (tmp_path / "run" / "report.html").read_text()
    assert page.count("data:image/jpeg;base64,") == 2
    assert "What the point filters kept" in page
    result = open_log([tmp_path / "run" / "result.mcap"])
    topics = {c.topic for c in result.channels}
    assert {"/wallkit/filter/kept", "/wallkit/filter/rejected", "/wallkit/camera/front/annotations"} <= topics
    layout = json.loads((tmp_path / "run" / "foxglove-layout.json").read_text())
    assert layout["configById"]["Image!camera"]["imageMode"]["imageTopic"] == "/camera/front/image/compressed"
    # drawn again from the folder, with its pictures
    assert wallkit("report", "run", "-o", "again.html").code == 0
    assert (tmp_path / "again.html").read_text().count("data:image/jpeg;base64,") == 2


@pytest.mark.parametrize("name", ["wall_mask", "reject_dynamic", "soft_mask"])
def test_no_return_on_a_person_is_kept_and_few_on_walls_are_lost(world, name):
    run = localize(ready(world, (name,)))
    counts = run.filtering.by_class
    assert counts["person"][1] == 0
    assert counts["wall"][1] > 0.9 * counts["wall"][0]
    assert run.estimate.health.name == "LOCALIZED"


def test_an_onnx_model_sees_what_the_oracle_sees(world):
    by_oracle = localize(ready(world)).filtering.by_class
    by_model = localize(ready(world, model=str(world / "colours.onnx"))).filtering
    assert by_model.by_class["person"][0] == pytest.approx(by_oracle["person"][0], rel=0.15)
    assert by_model.by_class["wall"][0] == pytest.approx(by_oracle["wall"][0], rel=0.05)
    assert by_model.by_class["person"][1] == 0
    assert by_model.segment_ms > 0


def test_polygons_keep_what_pixels_keep(world):
    by_pixel = localize(ready(world)).filtering
    by_polygon = localize(ready(world, words=("points.look.lookup=crossing_number",))).filtering
    assert by_polygon.kept == pytest.approx(by_pixel.kept, rel=0.03)


def test_a_picture_shows_the_returns_that_were_passed_over_too(world):
    (few,), (every,) = (
        localize(ready(world, words=(f"points.look.returns={n}",)), moments=1).moments for n in (100, 0)
    )
    assert few.stamp_ns == every.stamp_ns
    np.testing.assert_array_equal(few.all_pixels, every.all_pixels)
    assert len(few.pixels) < 0.3 * len(few.all_pixels)
    # those that were looked up are among them
    assert {tuple(at) for at in few.pixels} <= {tuple(at) for at in few.all_pixels}
    assert len(every.pixels) == len(every.all_pixels)


def test_the_folder_names_the_model_it_was_run_with_by_its_hash(world, wallkit, tmp_path):
    words = ("--filter", "wall_mask", "--calib", world / "front.toml", "--init", "truth", "-q", "--particles", "300")
    for model, file in ((world / "colours.onnx", world / "colours.onnx"), ("default", model_path(Path("default")))):
        done = wallkit("localize", world / "log.mcap", *words, "--model", model, "--fallback", "lidar", "-o", "run",
                       "--overwrite", "--end", "2")  # fmt: skip
        assert done.code in (0, 4), done.err
        hashes = {entry["sha256"] for entry in json.loads((tmp_path / "run" / "run.json").read_text())["inputs"]}
        assert hashlib.sha256(file.read_bytes()).hexdigest() in hashes


def test_later_seeds_look_at_no_image_and_say_what_a_first_one_says(world):
    both = ready(world, seeds=2)
    first, second = localize(both), localize(replace(both, request=replace(both.request, seed=1)))
    alone = localize(replace(ready(world), request=replace(both.request, seed=1)))
    assert (first.filtering.images > 0, second.filtering.images) == (True, 0)
    np.testing.assert_array_equal(second.steps.poses, alone.steps.poses)
    assert second.filtering.by_class == alone.filtering.by_class


def test_a_cache_of_segmentations_changes_nothing_but_who_looks(world, tmp_path):
    """Images are segmented once for all filters, calibrations and clocks; the time that this took is counted every time."""
    model, words = str(world / "colours.onnx"), (f"segment.cache={tmp_path / 'seen'}",)
    alone = localize(ready(world, model=model))
    first = localize(ready(world, model=model, words=words))
    again = ready(world, model=model, words=words)
    looked = []
    again.sight.segment = looked.append
    second = localize(again)
    assert not looked
    for run in (first, second):
        np.testing.assert_array_equal(run.steps.poses, alone.steps.poses)
        assert run.filtering.by_class == alone.filtering.by_class
    assert second.filtering.segment_ms == pytest.approx(first.filtering.segment_ms)
    assert any("segmented in an earlier run" in line for line in second.filtering.lines())
    # other filters and a wrong calibration look at the same images
    turned = (
        "points.perturb.rotation_deg=2",
        "points.perturb.rotation_axis=[0,1,0]",
        "points.perturb.time_offset_ms=20",
    )
    other = ready(world, ("soft_mask",), model=model, words=(*words, *turned))
    assert "errors are put in on purpose: rotation_deg = 2, time_offset_ms = 20" in " ".join(warnings_of(other))
    localize(other)
    assert other.sight.cache.kept < 0.4 * other.sight.cache.found


def test_images_that_come_too_seldom_for_their_tolerance_are_said(world):
    """Ten a second: 0.06 s is more than half of the time between two, 0.04 s is less."""
    assert not warnings_of(ready(world))
    (said,) = warnings_of(ready(world, words=("logs.image_tolerance_s=0.04",)))
    assert "come every 0.1 s" in said
    assert "--set logs.image_tolerance_s=0.06" in said


def test_shrunken_masks_keep_fewer_returns_and_lost_images_none(world):
    kept = {
        word: localize(ready(world, words=(f"points.perturb.{word}",))).filtering
        for word in ("seed=0", "mask_px=4", "mask_px=-4", "drop_share=0.5")
    }
    walls = {word: found.by_class["wall"][1] for word, found in kept.items()}
    assert walls["mask_px=-4"] < walls["seed=0"] < walls["mask_px=4"]
    assert kept["mask_px=4"].by_class["person"][0] < kept["seed=0"].by_class["person"][0]
    assert 0.2 < kept["drop_share=0.5"].without_image / kept["drop_share=0.5"].updates < 0.8


def test_only_images_for_updates_are_segmented_and_all_of_them_ahead(world):
    """Ten images a second, an update every 0.2 m: most are never looked at, and none while the filter waits."""
    given = ready(world)
    segment, threads = given.sight.segment, []

    def spy(image):
        threads.append(threading.current_thread().name)
        return segment(image)

    given.sight.segment = spy
    run = localize(given)
    assert run.filtering.images == run.filtering.updates
    assert len(threads) <= run.filtering.updates + 2
    assert len(threads) < 0.6 * run.sync.images
    assert sum(name.startswith("segment") for name in threads) >= run.filtering.updates - 2


def altered(given, change, *, after_s=4.0):
    """The same run whose images are segmented by `change(segment, image)` from a time on."""
    segment = given.sight.segment

    def other(image):
        late = image.stamp_ns > camera_log.START_NS + round(after_s * 1e9)
        return change(segment, image) if late else segment(image)

    given.sight.segment = other
    return given


def unreadable(segment, image):
    raise LogError("no image")


def failing(segment, image):
    raise ModelError("the network answers with NaN", where="colours.onnx")


def of_double_size(segment, image):
    return class_map(np.repeat(np.repeat(segment(image).labels(), 2, axis=0), 2, axis=1), camera_log.CLASSES)


@pytest.mark.parametrize(
    ("change", "why"),
    [(unreadable, "its image cannot be read"), (of_double_size, "its image is 640 x 480, not 320 x 240 as its calib")],
)
def test_images_that_cannot_be_used_say_nothing_and_are_counted(world, change, why):
    """The same as without them: what a camera said before stands, and no later return is on a person."""
    run = localize(altered(ready(world), change))
    found = run.filtering
    assert 0 < found.without_image == sum(found.silent.values()) < found.updates
    (line,) = (line for line in found.lines() if line.startswith("front: "))
    assert why in line
    assert f"at {found.without_image} of {found.updates} updates" in line
    # no frame is without a label and with a weight of 0
    assert found.by_class["not seen"][0] == found.by_class["not seen"][1]


def test_later_seeds_say_the_same_about_images_that_cannot_be_used(world):
    both = altered(ready(world, seeds=2), unreadable)
    first, second = localize(both), localize(both)
    assert first.filtering.silent == second.filtering.silent != {}


def test_a_network_that_fails_ends_the_run_unless_the_lidar_may_stand_in(world):
    with pytest.raises(ModelError, match="answers with NaN"):
        localize(altered(ready(world), failing))
    for _ in range(2):
        given = altered(ready(world, may_fall_back=True), failing)
        run = localize(given)
        assert "colours.onnx: the network answers with NaN" in given.sight.given_up
        assert run.filtering.lines()[-1].startswith("the LiDAR alone was used from then on: colours.onnx")
        # what falls away is the filter, too, not only its labels
        assert 0 < run.filtering.without_image < run.filtering.updates


def test_a_model_that_never_sees_a_wall_is_given_up_when_the_lidar_may_stand_in(world, tmp_path):
    bare = camera_log.write_log(tmp_path / "bare.mcap", only_floor=True)
    words = ("points.wall_mask.unseen_weight=0",)
    given = prepared(bare, calibrations=(world / "front.toml",), may_fall_back=True, words=words, **ORACLE)
    run = localize(given)
    assert "finds no wall, partition" in run.filtering.lines()[-1]
    found = run.filtering
    # the first twenty updates lose every return, those after keep every one
    assert found.kept == found.by_class["not seen"][1]
    assert found.few == 19
    again = localize(given)
    np.testing.assert_array_equal(again.steps.poses, run.steps.poses)


def test_images_are_skipped_by_rate_and_that_is_said(world):
    often, seldom = localize(ready(world)), localize(ready(world, words=("segment.rate_hz=1",)))
    assert seldom.filtering.images < often.filtering.images
    skipped = {("front", "its image is skipped by segment.rate_hz"): seldom.filtering.without_image}
    assert seldom.filtering.silent == skipped


def test_a_recording_that_begins_with_a_damaged_image_is_used(world, tmp_path):
    log = camera_log.write_log(tmp_path / "log.mcap", seconds=2, damaged=2)
    model = str(world / "colours.onnx")
    run = localize(prepared(log, calibrations=(world / "front.toml",), model=model))
    assert run.filtering.images > 0
    log = camera_log.write_log(tmp_path / "none.mcap", seconds=1, damaged=100)
    with pytest.raises(LogError, match="begins with no readable image"):
        prepared(log, calibrations=(world / "front.toml",), model=model)


def test_a_failed_calibration_is_refused_unless_allowed(world, tmp_path):
    failed = camera_log.write_calibration(tmp_path / "failed.toml", camera_log.failed())
    with pytest.raises(CalibrationError, match=r"failed.toml: the calibration's verdict is FAIL \(plane: 73 mm off\)"):
        prepared(world / "log.mcap", calibrations=(failed,), **ORACLE)
    assert prepared(world / "log.mcap", calibrations=(failed,), allow_unverified=True, **ORACLE).sight is not None
    other = camera_log.write_calibration(tmp_path / "other.toml", camera_log.calibration(lidar_frame="rear_laser"))
    with pytest.raises(CalibrationError, match="is of the LiDAR 'rear_laser', the scans are of 'laser'"):
        prepared(world / "log.mcap", calibrations=(other,), **ORACLE)


def test_images_that_are_not_of_the_calibrations_size_are_refused(world, tmp_path):
    made = camera_log.calibration()
    K = made.camera.K.copy()
    large = replace(made, camera=Camera("plumb_bob", 640, 480, K, np.zeros(5), "front", "camera_front"))
    path = camera_log.write_calibration(tmp_path / "large.toml", large)
    with pytest.raises(CalibrationError, match=r"is for images of 640 x 480, those of .* have 320 x 240"):
        prepared(world / "log.mcap", calibrations=(path,), **ORACLE)


def test_a_camera_info_of_another_size_is_refused(world, tmp_path):
    log = camera_log.write_log(tmp_path / "log.mcap", seconds=0.5, info_size=(640, 480))
    given = {"calibrations": (world / "front.toml",), **ORACLE}
    with pytest.raises(CalibrationError, match=r"camera_info says 640 x 480, the images of .* have 320 x 240"):
        prepared(log, **given)
    allowed = prepared(log, allow_unverified=True, **given)
    assert "camera_info says 640 x 480" in allowed.sight.cameras[0].notes[0]


def test_a_calibration_that_nobody_verified_is_used_and_named(world, tmp_path):
    path = camera_log.write_calibration(tmp_path / "new.toml", camera_log.calibration(verdict="", pixel_error_95=None))
    unverified, unknown = prepared(world / "log.mcap", calibrations=(path,), **ORACLE).sight.cameras[0].notes
    assert "never verified" in unverified
    assert "has no pixel_error_95" in unknown
    assert not ready(world).sight.cameras[0].notes


def test_a_log_without_a_camera_is_refused_and_the_lidar_stands_in_when_told(world, tmp_path):
    log = camera_log.write_log(tmp_path / "log.mcap", seconds=0.5, images=False, oracle=False)
    model = str(world / "colours.onnx")
    given = {"calibrations": (world / "front.toml",), "model": model}
    with pytest.raises(LogError, match="holds no camera images"):
        prepared(log, **given)
    with pytest.raises(LogError, match="holds no labels of a simulator"):
        prepared(log, **given | ORACLE)
    alone = prepared(log, ("wall_mask", "line_fit"), may_fall_back=True, **given)
    assert alone.sight is None
    assert alone.config.points.filters == ("line_fit",)
    assert "holds no camera images" in alone.fallen_back


def test_what_is_missing_is_asked_for(world):
    with pytest.raises(ConfigError, match="needs to know where LiDAR points land"):
        prepared(world / "log.mcap", **ORACLE)
    assert prepared(world / "log.mcap", calibrations=(world / "front.toml",)).sight.model == "default"
    with pytest.raises(LogError, match="no camera 'rear'"):
        ready(world, cameras=("rear",))
    with pytest.raises(ConfigError, match="2 cameras and 1 calibrations"):
        ready(world, cameras=("front", "rear"))


def test_a_camera_that_nothing_looks_through_is_not_used(world):
    assert ready(world, ("line_fit",)).sight is None
    assert ready(world, ()).sight is None
    assert ready(world, (), words=("localize.sensor=per_class",)).sight is not None
    assert warnings_of(ready(world, ()))[-1].startswith("nothing looks through the camera")
    assert warnings_of(prepared(world / "log.mcap", ("line_fit",), overlays=2))[-1].startswith("nothing looks through")


def test_a_camera_is_found_by_name_or_topic_or_frame(world, tmp_path):
    topic = "/oracle/front/classes"
    for words in ((), ("front",), (topic,)):
        (camera,) = ready(world, cameras=words).sight.cameras
        assert (camera.topic, camera.picture_topic) == (topic, "/camera/front/image/compressed")
    made = camera_log.calibration()
    stranger = replace(made, camera=replace(made.camera, frame="camera_rear", name="rear"))
    path = camera_log.write_calibration(tmp_path / "rear.toml", stranger)
    with pytest.raises(
        CalibrationError, match=r"the camera of this calibration \('rear', frame 'camera_rear'\) is not in"
    ):
        prepared(world / "log.mcap", calibrations=(path,), **ORACLE)


def test_a_model_without_a_wall_is_refused_and_roles_can_be_said(world, tmp_path):
    path = tmp_path / "people.onnx"
    path.write_bytes(oracle({"person": USUAL["person"], "brickwork": USUAL["wall"]}, (256, 320), "class-scores"))
    with pytest.raises(ModelError, match="no class counts as wall or partition") as caught:
        ready(world, model=str(path))
    assert "segment.roles.wall" in caught.value.hint
    assert ready(world, ("reject_dynamic",), model=str(path)).sight is not None
    path.write_bytes(oracle({"bricks": USUAL["person"], "brickwork": USUAL["wall"]}, (256, 320), "class-scores"))
    with pytest.raises(ModelError, match="no class counts as person or movable"):
        ready(world, ("reject_dynamic",), model=str(path))
    path.write_bytes(oracle({"person": USUAL["person"], "brickwork": USUAL["wall"]}, (256, 320), "class-scores"))
    assert ready(world, model=str(path), words=('segment.roles.wall=["brickwork"]',)).sight is not None


def test_images_of_another_time_and_masks_without_walls_are_said_while_running(world, tmp_path):
    given = {"calibrations": (world / "front.toml",), **ORACLE}
    late = camera_log.write_log(tmp_path / "late.mcap", image_shift_ms=50_000)
    with pytest.raises(
        LogError,
        match=r"none of the first 20 scans has an image that can be used: no image within logs.image_tolerance_s",
    ):
        localize(prepared(late, **given))
    run = localize(prepared(late, may_fall_back=True, **given))
    assert run.filtering.without_image == run.filtering.updates > 20
    bare = camera_log.write_log(tmp_path / "bare.mcap", only_floor=True)
    with pytest.raises(ModelError, match="finds no wall, partition under any return of the first 20 scans"):
        localize(prepared(bare, **given))
