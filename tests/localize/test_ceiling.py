from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from tests.localize.ceilings import drive, eye, painted, photograph
from tests.localize.worlds import FLAT, fields_of, scan_at
from wallkit.core.ceiling import CeilingSight, colours_at
from wallkit.core.ceiling_eye import smoothed
from wallkit.core.config import Source, build, source_from_words
from wallkit.core.geometry import compose, relative
from wallkit.errors import MapError
from wallkit.localize.ceiling import CEILINGS, CentrePixel, Gradient, Histogram, Patch
from wallkit.localize.ceiling_eye import ceiling_eyes, fields_of_ceiling
from wallkit.localize.ceiling_filter import SEED, ceiling_localizer
from wallkit.localize.ceiling_settings import CeilingSettings
from wallkit.localize.colours import SPACES
from wallkit.localize.filter import monte_carlo_localizer
from wallkit.localize.sensor import LikelihoodField
from wallkit.localize.settings import LocalizeSettings

RNG = np.random.default_rng(0)
CEILING = painted()
SMOOTH = smoothed(CEILING, 0.04)
POSE = np.array([2.0, 4.6, 0.7])
EYE = eye()
VIEW = EYE.view(0, photograph(CEILING, POSE))
POSES = np.column_stack([RNG.uniform(-1, 7, 300), RNG.uniform(2, 8, 300), RNG.uniform(-3, 3, 300)])
ALL = sorted(CEILINGS)


def likelihood(name: str, ceiling=SMOOTH, threads: int = 1):
    return CEILINGS[name]().on(ceiling, threads=threads)


# ------------------------------------------------------------------------------------------ what a view shows


def test_a_view_shows_the_colours_that_the_map_has_there():
    """Mirrored or turned maps and cameras fail here: the photograph follows rays up, the view projects places down."""
    colours, known = colours_at(SMOOTH, POSE, VIEW)
    assert known.all()
    assert np.abs(colours[0] - VIEW.colours.reshape(-1, 3)).mean() < 0.02
    for wrong in (POSE + [0, 0, np.pi / 2], POSE + [0, 0, np.pi], POSE * [1, 1, -1]):
        assert np.abs(colours_at(SMOOTH, wrong, VIEW)[0][0] - VIEW.colours.reshape(-1, 3)).mean() > 0.06


def test_an_aslant_camera_sees_the_same_places():
    from scipy.spatial.transform import Rotation

    T = EYE.T_base_optical.copy()
    T[:3, :3] = T[:3, :3] @ Rotation.from_rotvec([0.12, -0.08, 0.4]).as_matrix()
    aslant = replace(EYE, T_base_optical=T)
    view = aslant.view(0, photograph(CEILING, POSE, T_base_optical=T))
    assert np.abs(view.colours - VIEW.colours)[view.is_seen].mean() < 0.02
    np.testing.assert_allclose(view.centre, VIEW.centre, atol=0.05)


def test_a_view_from_a_moment_ago_is_moved_by_odometry():
    moved = np.array([0.4, -0.1, 0.5])
    there = EYE.view(0, photograph(CEILING, compose(POSE, moved)))
    colours, _ = colours_at(SMOOTH, POSE, there.seen_from(moved))
    assert np.abs(colours[0] - there.colours.reshape(-1, 3)).mean() < 0.02


# ---------------------------------------------------------------------------------- the contract of every model


@pytest.mark.parametrize("name", ALL)
def test_likelihoods_are_finite_and_at_most_one(name):
    far = np.vstack([POSES, [[1e4, -1e4, 0], [-1.0, 2.0, 3.0], POSE]])
    log_p = likelihood(name).log_likelihood(far, VIEW)
    assert log_p.shape == (303,)
    assert log_p.dtype == np.float64
    assert np.isfinite(log_p).all()
    assert (log_p <= 1e-6).all()
    assert log_p[300] < log_p[302] - 0.5  # outside the map is no place to hide


@pytest.mark.parametrize("name", ALL)
def test_the_right_place_is_the_likeliest(name):
    model = likelihood(name)
    here = model.log_likelihood(POSE[None], VIEW)[0]
    assert here > np.quantile(model.log_likelihood(POSES, VIEW), 0.97)


@pytest.mark.parametrize("name", ALL)
def test_a_view_that_shows_nothing_says_nothing(name):
    nothing = replace(
        VIEW,
        is_seen=np.zeros_like(VIEW.is_seen),
        colours=np.zeros_like(VIEW.colours),
        centre=np.full(3, np.nan, np.float32),
    )
    assert (likelihood(name).log_likelihood(POSES, nothing) == 0).all()


@pytest.mark.parametrize("name", ALL)
def test_threads_change_nothing_and_inputs_stay(name):
    poses, colours = POSES.copy(), VIEW.colours.copy()
    one = likelihood(name).log_likelihood(poses, VIEW)
    np.testing.assert_array_equal(one, likelihood(name, threads=3).log_likelihood(poses, VIEW))
    np.testing.assert_array_equal(poses, POSES)
    np.testing.assert_array_equal(colours, VIEW.colours)


@pytest.mark.parametrize("name", ALL)
def test_a_moved_map_moves_the_answer(name):
    by = np.array([3.2, -1.7, 0.9])
    moved = replace(SMOOTH, origin=compose(by, SMOOTH.origin))
    here = likelihood(name).log_likelihood(POSES, VIEW)
    there = likelihood(name, moved).log_likelihood(compose(by, POSES), VIEW)
    # a place on the edge of two pixels may fall to either
    assert np.quantile(np.abs(here - there), 0.9) < 0.05 * np.ptp(here)


# ------------------------------------------------------------------------------------------- formulas, in NumPy


def test_the_centre_pixel_is_the_formula_of_the_seed():
    colours, known = colours_at(
        CEILING,
        POSES,
        replace(VIEW, points_m=VIEW.centre_m[None, None].astype(np.float32), is_seen=np.ones((1, 1), bool)),
    )
    distance = (np.abs(VIEW.centre - colours[:, 0]) ** 4).sum(axis=1) ** 0.25
    expected = np.where(known[:, 0], np.exp(-distance), np.exp(-1.0))
    got = np.exp(CentrePixel().on(CEILING).log_likelihood(POSES, VIEW))
    close = np.isclose(got, expected, atol=1e-4)
    assert close.mean() > 0.99  # float32 cells at an edge


@pytest.mark.parametrize("order", [1.0, 2.0, 3.0, 4.0])
def test_a_patch_is_the_mean_of_clipped_norms(order):
    s = Patch(exposure=1.0, order=order, most=0.2, temperature=0.5)
    colours, known = colours_at(SMOOTH, POSES, VIEW)
    norm = (np.abs(VIEW.colours.reshape(-1, 3) - colours) ** order).sum(axis=2) ** (1 / order)
    expected = -np.where(known, np.minimum(norm, 0.2), s.unseen).mean(axis=1) / 0.5
    got = s.on(SMOOTH).log_likelihood(POSES, VIEW)
    assert np.quantile(np.abs(got - expected), 0.99) < 0.01


def test_brightness_of_a_view_changes_no_gradient_and_little_of_a_patch():
    darker = replace(VIEW, colours=VIEW.colours * np.float32(0.7), centre=VIEW.centre * np.float32(0.7))
    near = POSE + RNG.normal(0, (0.2, 0.2, 0.1), (200, 3))
    gradient = Gradient().on(SMOOTH)
    np.testing.assert_allclose(
        gradient.log_likelihood(near, darker), gradient.log_likelihood(near, VIEW), rtol=1e-3, atol=0.02
    )
    patch = Patch().on(SMOOTH)
    assert np.abs(patch.log_likelihood(near, darker) - patch.log_likelihood(near, VIEW)).max() < 2.0
    fixed = Patch(exposure=1.0).on(SMOOTH)
    assert fixed.log_likelihood(POSE[None], darker)[0] < fixed.log_likelihood(POSE[None], VIEW)[0] - 5


def test_heading_is_seen_by_what_turns_with_the_robot():
    turned = np.column_stack([np.tile(EYE.centre_m, (2, 1)), [0.0, 2.0]])
    # turns about the place above the camera, so that it stays where it is
    about = np.array([compose(compose(POSE, [*EYE.centre_m, yaw]), [*-EYE.centre_m, 0]) for yaw in turned[:, 2]])
    for model, sees in ((CentrePixel(), False), (Histogram(), False), (Patch(), True), (Gradient(), True)):
        here, there = model.on(SMOOTH).log_likelihood(about, VIEW)
        assert (abs(here - there) > 1) == sees, model


def test_hue_is_a_circle():
    reds = np.array([[1.0, 0.0, 0.02], [1.0, 0.02, 0.0]], np.float32)
    hue = SPACES["hsv"](reds)[:, 0]
    assert hue[0] > 0.99
    assert hue[1] < 0.01
    np.testing.assert_allclose(SPACES["cone"](reds)[0], SPACES["cone"](reds)[1], atol=0.03)
    red = replace(SMOOTH, pixels=np.broadcast_to(np.uint8([255, 0, 5]), SMOOTH.pixels.shape).copy())
    view = replace(VIEW, centre=reds[1])
    for space in ("hsv", "cone", "rgb", "lab"):
        assert CentrePixel(space=space, temperature=1.0).on(red).log_likelihood(POSE[None], view)[0] > -0.1, space


def test_colour_spaces_are_those_of_opencv():
    import cv2

    colours = np.random.default_rng(1).random((50, 1, 3), dtype=np.float32)
    hsv = cv2.cvtColor(colours, cv2.COLOR_RGB2HSV)[:, 0] / (360, 1, 1)
    np.testing.assert_allclose(SPACES["hsv"](colours[:, 0]), hsv, atol=1e-4)
    lab = cv2.cvtColor(colours, cv2.COLOR_RGB2Lab)[:, 0] / 100
    np.testing.assert_allclose(SPACES["lab"](colours[:, 0]), lab, atol=3e-3)


def test_a_grey_ceiling_is_refused_by_what_compares_colours():
    grey = replace(CEILING, pixels=np.repeat(CEILING.pixels[..., :1], 3, axis=2))
    for name, model in CEILINGS.items():
        if not model.needs_colour:
            model().on(grey)
            continue
        with pytest.raises(MapError, match=r"grey.*(\n.*)*gradient"):
            model().on(grey)
        assert name


# ---------------------------------------------------------------------------------------------- the whole filter


def run(words: tuple[str, ...], seed: int, init: str, *, gain: float = 1.0, n: int = 120):
    s = build(LocalizeSettings, [source_from_words([w.removeprefix("localize.") for w in words])])[0]
    tracker = ceiling_localizer(s, fields_of_ceiling(CEILING), CEILING)
    view_of = eye(side=s.ceiling.side, spacing_m=s.ceiling.spacing_m, smooth_m=s.ceiling.smooth_m)
    rng = np.random.default_rng(seed)
    truth, belief = drive(n), tracker.start(rng, init)
    for pose in truth:
        sight = CeilingSight(view_of.view(0, photograph(CEILING, pose, gain=gain)), relative(truth[0], pose))
        belief = tracker.predict(rng, belief, sight.odometry)
        belief, _ = tracker.update(rng, tracker.look(belief, sight))
    return relative(belief.estimate().pose, truth[-1]), belief


@pytest.mark.parametrize("words", [(), ("localize.ceiling.model=gradient",)])
def test_the_patch_finds_place_and_heading_from_anywhere(words):
    off, belief = run(words, 1, "everywhere")
    assert np.hypot(*off[:2]) < 0.05
    assert abs(off[2]) < np.deg2rad(2)
    assert belief.modes[0].weight > 0.9


def test_a_lamp_that_burns_dimmer_is_learned():
    off, belief = run(
        ("localize.ceiling.model=patch", "localize.ceiling.model.exposure=1.5"), 1, "everywhere", gain=0.75
    )
    assert np.hypot(*off[:2]) < 0.05
    np.testing.assert_allclose(belief.light.gains, 0.75, atol=0.05)


def test_the_seed_is_a_set_of_settings():
    s = build(LocalizeSettings, [source_from_words([w.removeprefix("localize.") for w in SEED])])[0]
    assert s.ceiling.model == CentrePixel()
    assert s.resampler == "wheel"
    assert s.estimator == "mean"


def test_settings_refuse_a_grid_without_a_middle():
    with pytest.raises(Exception, match="odd"):
        build(CeilingSettings, [Source({"side": 4}, "test")])


def test_of_two_places_that_the_lidar_takes_for_possible_one_is_ruled_out():
    from wallkit.localize.search import Place

    eyes = ceiling_eyes(CeilingSettings(), CEILING)
    twin = compose(POSE, [0.0, 0.0, np.pi])
    left = eyes.tell_apart((Place(twin, 1.0), Place(POSE, 1.0)), np.zeros(3), [(np.zeros(3), VIEW)])
    assert [tuple(place.pose) for place in left] == [tuple(POSE)]


@pytest.mark.parametrize("name", ALL)
@pytest.mark.parametrize("confirmed", [False, True])
def test_lidar_and_ceiling_add_each_by_its_own_temperature(name, confirmed):
    """log w = e (temper * sum of the beams - cost / T): the same models with both at 1 say what the two are worth."""
    caution, temper, T = 0.4, 0.17, 0.035
    fields, scan = fields_of(FLAT), scan_at(FLAT, [3.5, 2.5, 0.3], beams=60)
    settings = build(
        LocalizeSettings,
        [source_from_words([f"ceiling.model={name}", f"ceiling.model.temperature={T}", "ceiling.gain=none"])],
    )[0]
    settings = replace(settings, caution=caution, sensor=LikelihoodField(temper=temper), update_distance_m=0.0)
    tracker, rng = monte_carlo_localizer(settings, fields, SMOOTH), np.random.default_rng(3)
    belief = tracker.predict(rng, tracker.start(rng, "global"), np.zeros(3))
    belief = replace(belief, odometry=np.zeros(3), trust=replace(belief.trust, is_confirmed=confirmed))
    before = belief.particles.log_weights
    belief = tracker.look(belief, CeilingSight(VIEW, np.zeros(3)))
    poses, eyes = belief.particles.poses, tracker.eyes
    cost = -replace(settings.ceiling.model, temperature=1.0).on(eyes.ceiling).log_likelihood(poses, VIEW)
    beams = LikelihoodField(temper=1.0).on(fields).log_likelihood(poses, scan)
    e = 1.0 if confirmed else caution
    np.testing.assert_allclose(belief.particles.log_weights - before, -e * cost / T, rtol=1e-5, atol=1e-5)
    both = tracker._weighed(belief, scan).log_weights - before
    np.testing.assert_allclose(both, e * (temper * beams - cost / T), rtol=1e-4, atol=1e-3)
    assert np.ptp(temper * beams) > 1
    assert np.ptp(cost / T) > 0.2
