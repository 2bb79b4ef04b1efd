"""Every figure of the registry: readable SVG, words for those who cannot see it, the same bytes twice."""

import base64
import dataclasses
import io
import xml.etree.ElementTree as ET

import numpy as np
import pytest

from wallkit.core.results import Errors
from wallkit.core.steps import Steps
from wallkit.core.types import Health
from wallkit.report import canvas
from wallkit.report.canvas import linear_ticks, round_step
from wallkit.report.data import Snapshot
from wallkit.report.figures import FIGURES, draw_figures

from .worlds import SCANS, SECOND, round_trip, run, steps, stretched

SVG = "{http://www.w3.org/2000/svg}"


def drawn(name, data):
    with canvas.style():
        return FIGURES[name](data)


def texts(picture):
    return [element.text for element in ET.fromstring(picture.svg).iter(f"{SVG}text")]


def only(record: Steps, rows):
    """The record cut to some of its rows."""
    values = {f.name: getattr(record, f.name) for f in dataclasses.fields(record)}
    return Steps(**{name: value[rows] for name, value in values.items()})


@pytest.mark.parametrize("name", FIGURES)
def test_contract_a_figure_is_small_readable_svg_with_words(name):
    picture = drawn(name, run())
    root = ET.fromstring(picture.svg)
    assert root.tag == f"{SVG}svg"
    assert picture.name == name
    assert len(picture.svg) < 300_000
    assert len(texts(picture)) >= 3
    assert all(word.strip() for word in (picture.title, picture.caption, picture.alt))


@pytest.mark.parametrize("name", FIGURES)
def test_contract_the_same_run_gives_the_same_bytes(name):
    assert drawn(name, run()) == drawn(name, run())


@pytest.mark.parametrize("name", FIGURES)
def test_contract_nothing_from_outside_and_nothing_that_runs(name):
    root = ET.fromstring(drawn(name, run()).svg)
    links = [value for element in root.iter() for key, value in element.attrib.items() if key.endswith("href")]
    assert all(link.startswith(("#", "data:image/png;base64,")) for link in links)
    assert not list(root.iter(f"{SVG}script"))


@pytest.mark.parametrize("name", FIGURES)
@pytest.mark.parametrize(
    "changes",
    [
        {"truth": None, "errors": None, "metrics": {}, "episodes": ()},
        {"grid": None, "odometry": None},
        {"steps": only(steps(), slice(0, 1)), "errors": None, "truth": None, "snapshots": ()},
        {
            "steps": dataclasses.replace(
                steps(),
                **dict.fromkeys(("hit_ratio", "short_ratio", "long_ratio", "update_ms"), np.full(SCANS, np.nan)),
            )
        },
    ],
    ids=["without truth", "without map", "one scan", "no update"],
)
def test_contract_what_is_missing_is_left_out(name, changes):
    picture = drawn(name, run(**changes))
    if picture is not None:
        ET.fromstring(picture.svg)


def test_figures_without_data_do_not_appear():
    names = [picture.name for picture in draw_figures(run(snapshots=()))]
    assert names == [name for name in FIGURES if name != "particles"]


def test_the_map_says_where_it_was_worst_and_marks_the_lost():
    picture = drawn("map", run())
    assert "The largest error, 2.00 m, is at 30.0 s." in picture.caption
    assert {"start", "end", "truth", "odometry alone", "filter says LOST", "error 0 to 5 cm", "over 1 m"} <= set(
        texts(picture)
    )


def test_without_truth_the_map_shows_the_spread_and_says_so():
    picture = drawn("map", run(truth=None, errors=None))
    assert "spread 0 to 5 cm" in texts(picture)
    assert "No truth is known" in picture.caption


def test_pieces_without_a_truth_are_drawn_all_the_same():
    e = run().errors
    half = Errors(e.stamps_ns[:30], e.rows[:30], e.position_m[:30], e.heading_deg[:30])
    assert "no truth here" in texts(drawn("map", run(errors=half)))
    assert "no truth here" not in texts(drawn("map", run()))


def test_a_long_slow_log_does_not_make_a_heavy_page():
    """Ten thousand scans on the same round trip: as light as sixty, and still showing the one bad scan."""
    record = stretched(steps(healthy=True), np.full(10_000, int(Health.LOCALIZED)))
    turn = np.linspace(0, 2 * np.pi, 10_000)
    poses = np.column_stack([3 + 2 * np.cos(turn), 2.5 + 1.5 * np.sin(turn), turn])
    position_m = np.full(10_000, 0.02)
    position_m[5000] = 1.5
    errors = Errors(record.stamps_ns, np.arange(10_000), position_m, np.zeros(10_000))
    data = run(steps=dataclasses.replace(record, poses=poses), errors=errors, truth=None, odometry=None, snapshots=())
    picture = drawn("map", data)
    assert len(picture.svg) < 60_000
    assert b"stroke: #7a0c2e" in picture.svg.split(b"over 1 m")[0]
    lines = [e for e in ET.fromstring(picture.svg).iter(f"{SVG}path") if "#7a0c2e" in e.attrib.get("style", "")]
    assert len(lines) == 2  # the piece itself, and its key


def test_the_walls_lie_under_the_path():
    """The picture in the SVG covers the axes: the free cell in the room's middle is drawn at the middle of the room."""
    from PIL import Image

    root = ET.fromstring(drawn("map", run()).svg)
    (image,) = root.iter(f"{SVG}image")
    data = next(value for key, value in image.attrib.items() if key.endswith("href")).split(",")[1]
    picture = np.asarray(Image.open(io.BytesIO(base64.b64decode(data))).convert("L"))
    width, height = float(image.attrib["width"]), float(image.attrib["height"])
    assert picture.shape[1] / picture.shape[0] == pytest.approx(width / height, rel=0.01)
    assert picture[picture.shape[0] // 2, picture.shape[1] // 2] == 255
    left_axis = min(float(p.attrib["d"].split()[1]) for p in root.iter(f"{SVG}path") if p.attrib["d"].startswith("M"))
    assert float(image.attrib["x"]) >= left_axis - 0.1


def test_false_healthy_updates_are_marked():
    record = steps()
    blind = dataclasses.replace(record, health=np.full(SCANS, int(Health.LOCALIZED)))
    assert "lost, yet called LOCALIZED (10 updates)" in texts(drawn("error", run(steps=blind)))
    assert not any("yet called" in text for text in texts(drawn("error", run())))


def test_bands_appear_only_when_the_filter_doubted():
    assert {"filter says LOST", "filter says UNCERTAIN"} <= set(texts(drawn("error", run())))
    healthy = drawn("error", run(steps=steps(healthy=True)))
    assert not any("filter says" in text for text in texts(healthy))


def test_convergence_names_both_the_first_and_the_last_time():
    assert drawn("convergence", run()).caption.startswith(
        "Right from the first update. It stays right from update 41 to the end."
    )


def test_odd_text_does_not_break_a_figure():
    label = "<script>alert(1)</script> $\\frac{ \x01 \ud800 日本"
    picture = drawn(
        "particles", run(snapshots=(Snapshot(SECOND, round_trip().poses, np.full(SCANS, 1 / SCANS), label),))
    )
    assert any("<script>alert(1)</script> $\\frac{" in (text or "") for text in texts(picture))


def test_particles_land_on_their_places():
    """One particle in the view's corner of a map without walls is the only ink."""
    poses = np.array([[1.0, 1.0, 0.0], [3.0, 3.0, 0.0]])
    picture = drawn("particles", run(grid=None, snapshots=(Snapshot(5, poses, np.array([1.0, 0.0]), "one"),)))
    from PIL import Image

    (image,) = ET.fromstring(picture.svg).iter(f"{SVG}image")
    data = next(value for key, value in image.attrib.items() if key.endswith("href")).split(",")[1]
    ink = np.argwhere(np.asarray(Image.open(io.BytesIO(base64.b64decode(data))).convert("L")) < 250)
    truth = round_trip().poses[0, :2]  # the view holds both particles and the truth at (5, 2.5), 1.5 m around, square
    low, high = np.minimum(poses[:, :2].min(axis=0), truth) - 1.5, np.maximum(poses[:, :2].max(axis=0), truth) + 1.5
    side = (high - low).max()
    left, top = (low + high)[0] / 2 - side / 2, (low + high)[1] / 2 + side / 2
    expected = np.array([(top - 1.0), (1.0 - left)]) / side * 320
    np.testing.assert_allclose(ink.mean(axis=0), expected, atol=1.0)
    assert len(ink) == 5


def test_round_numbers():
    assert [round_step(v) for v in (0.7, 1.0, 1.2, 3, 7)] == [1, 1, 2, 5, 10]
    assert linear_ticks(-0.2, 1.01, count=7) == {
        -0.2: "-0.2",
        0.0: "0",
        0.2: "0.2",
        0.4: "0.4",
        0.6: "0.6",
        0.8: "0.8",
        1.0: "1",
    }
