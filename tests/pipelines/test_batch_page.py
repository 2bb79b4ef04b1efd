"""The page of many logs: what it says is what was found, and names of other people's files stay text."""

import re
from dataclasses import replace

from tests.pipelines.batch_runs import SEEDS, drawn, drawn_rows
from wallkit.pipelines.batch.compare import Question, compare_batch
from wallkit.pipelines.batch.gather import gather
from wallkit.pipelines.batch.labels import labels_of_runs
from wallkit.report.batch_figures import batch_figures
from wallkit.report.batch_page import batch_html

EVIL = "<script>alert(1)</script>"


def test_the_page_says_who_is_better_and_what_is_not_there():
    gone = [("soft", "hall-0-1", s) for s in SEEDS]
    runs = drawn({"basic": 1.0, "soft": 0.8, "hard": 1.3}, left_out=gone, failing=[("hard", "lab-2-1", 0)])
    data = compare_batch(runs, Question(by=("crowd",)), title="night")
    page = batch_html(data, (), link_to=lambda folder: f"{folder}/report.html")
    assert "Better than basic: soft; worse than basic: hard." in page
    assert "1 run failed and 3 are missing." in page
    worst = re.findall(r'<a href="([^"]+)">', page)[0]
    assert worst == f"runs/{data.worst[0].configuration}/{data.worst[0].log}/{data.worst[0].seed}/report.html"
    assert data.worst[0].configuration == "hard"
    assert page.count("no scans on /scan") == 1
    assert "Mean error by crowd" in page
    names = [picture.name for picture in batch_figures(data)]
    assert names == ["spread", "differences", "trade", "by-crowd"]
    assert "://" not in page


def test_names_stay_text():
    rows = [
        replace(r, configuration=f"{EVIL}{r.configuration}", message=EVIL) for r in drawn_rows({"a": 1.0, "b": 0.9})
    ]
    runs = gather([*rows[:-1], replace(rows[-1], status=1, metrics={})], labels_of_runs())
    data = compare_batch(runs, Question(), title=EVIL)
    page = batch_html(data, (), link_to=lambda folder: f'"{folder}')
    assert "<script" not in page
    assert "&lt;script&gt;" in page
    assert 'href="%22runs/' in page


def test_one_configuration_alone_is_told_without_a_comparison():
    data = compare_batch(drawn({"basic": 1.0}), Question(), title="night")
    assert "Is the difference real?" not in batch_html(data, (), link_to=lambda folder: "")
    assert [picture.name for picture in batch_figures(data)] == ["spread"]
