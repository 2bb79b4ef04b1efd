"""Labels of beams: what they add to a scan, that without them nothing changes, and that a wrong one does little harm."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from tests.localize.worlds import FLAT, fields_of, scan_at
from tests.maps.drawn import box, placed, robot, wall
from tests.plan import plan_from_polylines
from wallkit.core.geometry import compose, wrap_angle
from wallkit.core.types import BeamLabels, Frame
from wallkit.localize.class_conditional import ClassConditional
from wallkit.localize.per_class import PerClass
from wallkit.maps.grids.semantic_fields import fields_from_map
from wallkit.maps.read import read_map
from wallkit.maps.xml import parse
from wallkit.points.labels import labelled_scan

# a square room of 4 m; a door of 0.9 m, flush with the middle of the north wall, makes the one difference
SIDE, DOOR = 4.0, (1.55, 2.45)
ROOM = plan_from_polylines([(0, 0), (SIDE, 0), (SIDE, SIDE), (0, SIDE), (0, 0)])
CLASSES = ("wall", "door", "person")
TRUE = np.array([1.3, 2.2, 0.4])
# the quarter turns about the middle that map the walls onto themselves
ALIKE = np.stack([compose([2, 2, turn], compose([-2, -2, 0], TRUE)) for turn in np.arange(4) * np.pi / 2])


@pytest.fixture(scope="module")
def fields():
    half = 0.05
    walls = [
        wall("south", (-2 * half, -half), (SIDE + 2 * half, -half)),
        wall("west", (-half, 0), (-half, SIDE)),
        wall("east", (SIDE + half, 0), (SIDE + half, SIDE)),
        wall("north_a", (-2 * half, SIDE + half), (DOOR[0], SIDE + half)),
        wall("north_b", (DOOR[1], SIDE + half), (SIDE + 2 * half, SIDE + half)),
        box("door", "0.9 0.1 2.5", at="0 0 1.25", wk_class="door"),
        placed("door", f"2 {SIDE + half} 0"),
    ]
    return fields_from_map(read_map(parse(robot(*walls))), scan_plane_m=0.3).fields


def labelled(pose, *, wrong=0.0, seed=0):
    """What is seen from a pose, with the labels a perfect camera gives, a share of them wrong."""
    rng = np.random.default_rng(seed)
    scan = scan_at(ROOM, pose, sigma_m=0.01, rng=rng, fov_rad=2 * np.pi)
    x, y = compose(pose, np.pad(scan.points.xyz_m[:, :2], ((0, 0), (0, 1))))[:, :2].T
    is_door = (x > DOOR[0]) & (x < DOOR[1]) & (y > SIDE - 0.1)
    is_door ^= rng.random(len(x)) < wrong
    return replace(scan, labels=is_door.astype(np.int64), classes=CLASSES)


def test_four_poses_are_alike_until_beams_carry_labels(fields):
    scan = labelled(TRUE)
    bare = PerClass().on(fields).log_likelihood(ALIKE, replace(scan, labels=None))
    assert np.ptp(bare) < 1.0
    told = PerClass().on(fields).log_likelihood(ALIKE, scan)
    share = np.exp(told - told.max())
    assert share[0] / share.sum() > 0.99


@pytest.mark.parametrize("seed", range(5))
def test_one_label_in_ten_may_be_wrong(fields, seed):
    told = PerClass().on(fields).log_likelihood(ALIKE, labelled(TRUE, wrong=0.1, seed=seed))
    assert told[0] > told[1:].max() + 1.0


def test_the_best_of_all_poses_is_the_true_one(fields):
    """A lattice over the room and all headings: with labels the best place is the true one."""
    x, y, yaw = np.meshgrid(np.arange(0.3, 3.8, 0.1), np.arange(0.3, 3.8, 0.1), np.deg2rad(np.arange(0, 360, 5)))
    poses = np.column_stack([x.ravel(), y.ravel(), yaw.ravel()])
    best = poses[np.argmax(PerClass().on(fields).log_likelihood(poses, labelled(TRUE)))]
    assert np.hypot(*(best - TRUE)[:2]) < 0.1
    assert abs(wrap_angle(best[2] - TRUE[2])) < np.deg2rad(5)


@pytest.mark.parametrize(
    "untold",
    [
        {"labels": None},
        {"labels": np.full(180, -1)},
        {"confidences": np.zeros(180, np.float32)},
    ],
)
def test_without_labels_it_is_the_class_conditional_model(fields, untold):
    scan = replace(labelled(TRUE), **untold)
    poses = TRUE + np.random.default_rng(2).normal(0, 0.3, (50, 3))
    wanted = ClassConditional().on(fields).log_likelihood(poses, scan)
    np.testing.assert_array_equal(PerClass().on(fields).log_likelihood(poses, scan), wanted)


def test_a_raster_has_no_classes_so_labels_tell_nothing():
    fields, scan = fields_of(FLAT), scan_at(FLAT, np.array([3.5, 2.0, 0.3]))
    scan = replace(scan, labels=np.ones(len(scan.weights), np.int64), classes=CLASSES)
    poses = np.array([[3.5, 2.0, 0.3], [3.7, 2.0, 0.3]])
    wanted = ClassConditional().on(fields).log_likelihood(poses, scan)
    np.testing.assert_array_equal(PerClass().on(fields).log_likelihood(poses, scan), wanted)


def test_a_sure_label_of_something_unmapped_is_as_a_return_of_weight_0(fields):
    """But for a constant: what is known to be a person tells nothing about the pose."""
    scan = labelled(TRUE)
    people = np.arange(180) % 3 == 0
    poses = TRUE + np.random.default_rng(3).normal(0, 0.3, (50, 3))
    model = PerClass(label_trust=1.0, beams=180).on(fields)
    told = model.log_likelihood(poses, replace(scan, labels=np.where(people, 2, scan.labels)))
    ignored = model.log_likelihood(poses, replace(scan, weights=np.where(people, 0, 1).astype(np.float32)))
    np.testing.assert_allclose(told - told[0], ignored - ignored[0], atol=1e-4)


def test_confidence_mixes_the_two_densities(fields):
    scan = labelled(TRUE)
    sure = np.linspace(0.1, 1, 180).astype(np.float32)
    model = PerClass(temper=1.0, label_trust=0.8, beams=180)
    hit = {name: np.exp(-0.5 * (d / 0.1) ** 2) / (0.1 * np.sqrt(2 * np.pi)) for name, d in fields.distances_m.items()}
    x, y = compose(TRUE, np.pad(scan.points.xyz_m[:, :2].astype(float), ((0, 0), (0, 1))))[:, :2].T
    at = tuple(np.floor((np.stack([y, x]) - fields.origin[1::-1, None]) / fields.resolution_m).astype(int))
    own, trust = np.where(scan.labels == 1, hit["door"][at], hit["wall"][at]), 0.8 * sure
    z = scan.points.ranges_m.astype(float)
    unknown = 0.2 * np.exp(-0.2 * z) / (1 - np.exp(-0.2 * 25.0))
    wanted = np.log(0.8 * (trust * own + (1 - trust) * hit["all"][at]) + 0.2 * unknown).sum()
    got = model.on(fields).log_likelihood(TRUE[None], replace(scan, confidences=sure))[0]
    assert got == pytest.approx(wanted, rel=1e-3)


def test_labels_follow_their_beams_into_the_scan():
    points = replace(
        scan_at(FLAT, np.array([3.5, 2.0, 0.3]), beams=9).points, beams=np.array([0, 2, 3, 4, 5, 6, 7, 8, 99])
    )
    told = BeamLabels(0, np.arange(9) % 2, ("wall", "door"), np.linspace(0, 1, 9).astype(np.float32))
    scan = labelled_scan(Frame(0, points, np.zeros(3), labels=told))
    np.testing.assert_array_equal(scan.labels, [0, 0, 1, 0, 1, 0, 1, 0, -1])
    np.testing.assert_allclose(scan.confidences[:-1], np.array([0, 2, 3, 4, 5, 6, 7, 8]) / 8)
    assert scan.classes == ("wall", "door")
    assert labelled_scan(Frame(0, points, np.zeros(3))).labels is None
