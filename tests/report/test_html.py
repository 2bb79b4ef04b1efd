"""The page: everything is on it, nothing on it runs, and nothing comes from anywhere else."""

import re
from html.parser import HTMLParser

import numpy as np
import pytest

from wallkit.core.results import Value
from wallkit.core.types import Health
from wallkit.errors import OutputError
from wallkit.report.data import Setting, settings_from_tables
from wallkit.report.figures import FIGURES
from wallkit.report.html import report_html, write_report

from .worlds import run, steps, stretched

EVIL = "<script>alert('x')</script>\"><img src=x onerror=alert(1)>"


class Page(HTMLParser):
    """Tags with attributes, and the text."""

    def __init__(self, page):
        super().__init__()
        self.tags, self.text = [], ""
        self.feed(page)

    def handle_starttag(self, tag, attrs):
        self.tags.append((tag, dict(attrs)))

    def handle_data(self, data):
        self.text += data


def test_top_down_it_says_what_a_reader_asks_first():
    text = Page(report_html(run())).text
    order = [
        *("room.mcap on room.yaml", "Localized, lost once", "ate_rmse_m", "0.818 m", "root mean square distance"),
        *("Where the robot was", "When it was wrong", "few beams end on the map", "What was dropped", "Settings"),
        *(
            "localize.particles",
            "5000",
            "2000",
            "wallkit.toml:3",
            "Where this comes from",
            "wallkit localize 'a log.mcap'",
        ),
    ]
    places = [text.index(words) for words in order]
    assert places == sorted(places)


def test_every_figure_is_inside_with_words():
    images = [attrs for tag, attrs in Page(report_html(run())).tags if tag == "img"]
    assert len(images) == len(FIGURES)
    assert all(attrs["src"].startswith("data:image/svg+xml;base64,") and attrs["alt"] for attrs in images)


def test_nothing_is_fetched_and_nothing_runs():
    page = report_html(run())
    tags = Page(page).tags
    assert not {"script", "link", "iframe", "object", "a"} & {tag for tag, _ in tags}
    assert not re.search(r"https?://|url\(|@import", page)
    policy = next(attrs["content"] for tag, attrs in tags if attrs.get("http-equiv") == "Content-Security-Policy")
    assert policy.startswith("default-src 'none'")
    assert len(page) < 3_000_000


def test_text_from_logs_and_maps_stays_text():
    odd = run(
        title=EVIL,
        verdict=EVIL,
        run={EVIL: EVIL, "argv": [EVIL], "inputs": {EVIL: {"sha256": EVIL}}},
        metrics={"ate_rmse_m": Value(EVIL, 1.0, EVIL, EVIL)},
        dropped={EVIL: 3},
        settings=(Setting(EVIL, EVIL, "", EVIL), Setting(EVIL, EVIL, EVIL)),
        steps=run().steps,
    )
    plain, evil = Page(report_html(run())), Page(report_html(odd))
    assert {tag for tag, _ in evil.tags} == {tag for tag, _ in plain.tags}
    assert not any(key.startswith("on") for _, attrs in evil.tags for key in attrs)
    assert evil.text.count(EVIL) >= 10


def test_the_same_run_gives_the_same_page():
    assert report_html(run()) == report_html(run())


def test_a_run_without_truth_says_so_and_a_faultless_one_too():
    without = Page(report_html(run(truth=None, errors=None, episodes=()))).text
    assert "No truth is known" in without
    assert "never more than" not in without
    faultless = Page(report_html(run(steps=steps(healthy=True), episodes=(), dropped={}, settings=(), run={}))).text
    for words in (
        "never more than 1 m or 30° off",
        "LOCALIZED at every scan",
        "Nothing.",
        "All settings are the defaults",
    ):
        assert words in faultless


def test_a_number_that_does_not_exist_is_not_zero():
    metrics = {key: Value(key, None, "m", "") for key in ("ate_rmse_m", "updates_to_converge")}
    rows = re.findall(r'<td class="number">([^<]*)</td>', report_html(run(metrics=metrics)))
    assert rows[:2] == ["none", "never"]


def test_only_the_longest_doubts_are_listed_and_the_rest_counted():
    flicker = np.where(np.arange(80) % 2, Health.LOCALIZED, Health.UNCERTAIN)
    page = Page(
        report_html(run(steps=stretched(steps(), flicker), truth=None, errors=None, odometry=None, snapshots=()))
    )
    assert page.text.count("UNCERTAIN") == 30
    assert "10 shorter stretches are left out" in page.text


def test_settings_keep_their_origin_and_default():
    found = settings_from_tables({"a": {"b": 1, "c": [2]}}, {"a": {"b": 0, "c": [2]}}, {"a.b": "--set"})
    assert found == (Setting("a.b", 1, 0, "--set"), Setting("a.c", [2], [2]))
    assert [setting.is_default for setting in found] == [False, True]


def test_a_file_name_that_is_no_text_does_not_stop_the_report(tmp_path):
    write_report(tmp_path / "report.html", run(title="log\udcff.mcap"))
    assert "log?.mcap" in (tmp_path / "report.html").read_text(encoding="utf-8")
    with pytest.raises(OutputError, match="cannot write"):
        write_report(tmp_path / "no" / "report.html", run())
