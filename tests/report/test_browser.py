"""The pages in a real browser: no complaint on the console, every figure visible, wide and on a phone."""

import os
import re
import shutil
import subprocess

import pytest

from wallkit.report.compare import CompareData, Contender
from wallkit.report.html import compare_html, report_html

from .worlds import run

# appended by the test to a copy of the page: writes each figure's size where --dump-dom shows it
PROBE = """<script>addEventListener("load", () => {
  const size = i => [i.naturalWidth, i.naturalHeight, i.clientWidth, i.clientHeight].join("x");
  const text = [...document.images].map(size).join(" ") + " page " + document.documentElement.scrollWidth;
  document.body.insertAdjacentHTML("beforeend", "<pre id=sizes>" + text + "</pre>");
});</script>"""

PAGES = {
    "report": lambda: report_html(run(title="<script>document.title = 'run'</script>")),
    "compare": lambda: compare_html(CompareData("two", "same", tuple(Contender(n, {}, {}, run()) for n in "ab"))),
}


@pytest.fixture(scope="session")
def chromium():
    names = ("chromium", "chromium-browser", "google-chrome")
    found = next(filter(None, map(shutil.which, names)), None)
    if found is None:
        reason = f"none of {', '.join(names)} is installed"
        if os.environ.get("WALLKIT_REQUIRE_BROWSER") == "1":
            pytest.fail(reason)
        pytest.skip(reason)
    return found


def opened(chromium, path, profile, width_px):
    """(DOM after loading, what was logged)."""
    flags = "headless no-sandbox disable-gpu disable-quic no-first-run disable-background-networking disable-sync"
    command = [chromium, *(f"--{flag}" for flag in flags.split()), "--disable-component-update", "--dump-dom"]
    command += [f"--user-data-dir={profile}", f"--window-size={width_px},900", "--enable-logging=stderr", "--v=0"]
    done = subprocess.run([*command, path.as_uri()], capture_output=True, text=True, timeout=60, check=True)
    return done.stdout, done.stderr


@pytest.mark.parametrize("name", PAGES)
def test_the_console_stays_silent(chromium, tmp_path, name):
    page = tmp_path / "page.html"
    page.write_text(PAGES[name]())
    dom, log = opened(chromium, page, tmp_path / "profile", 1280)
    assert "CONSOLE" not in log
    assert "<title>run</title>" not in dom


@pytest.mark.parametrize(("name", "width_px"), [("report", 1280), ("report", 500), ("compare", 1280)])
def test_every_figure_is_visible(chromium, tmp_path, name, width_px):
    page = tmp_path / "page.html"
    html = re.sub(r"<meta http-equiv[^>]*>", "", PAGES[name]())
    page.write_text(html.replace("</body>", PROBE + "</body>"))
    dom, _ = opened(chromium, page, tmp_path / "profile", width_px)
    sizes, scroll = re.search(r'<pre id="sizes">(.*) page (\d+)</pre>', dom).groups()
    assert len(sizes.split()) == html.count("<img ")
    for size in sizes.split():
        natural_width, natural_height, width, height = map(int, size.split("x"))
        assert min(natural_width, natural_height) > 0, "the picture cannot be decoded"
        assert width > 400
        assert height > 80
        assert width / height == pytest.approx(natural_width / natural_height, rel=0.02)
    assert int(scroll) <= width_px, "the page itself must not scroll sideways"


def test_the_console_check_would_notice(chromium, tmp_path):
    page = tmp_path / "page.html"
    page.write_text(PAGES["compare"]().replace("</body>", "<script>1</script></body>"))
    assert "CONSOLE" in opened(chromium, page, tmp_path / "profile", 1280)[1]
