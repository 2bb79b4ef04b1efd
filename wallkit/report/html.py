"""A run, or several -> one self-contained HTML page: no script, nothing fetched from anywhere.

All text is escaped by jinja2, and a content security policy in the page forbids scripts and network on top of that:
titles, topics and file names come from other people's logs.
"""

from __future__ import annotations

import base64
from pathlib import Path
from typing import Any

from wallkit.errors import OutputError
from wallkit.report.compare import CompareData, compare_figures, compare_rows, difference_rows
from wallkit.report.data import Photo, Picture, ReportData
from wallkit.report.figures import draw_figures
from wallkit.report.wording import doubts, episode_rows, plain, run_rows, value_text

_TEMPLATES = Path(__file__).parent / "templates"
_MARKS = {"good": "✓", "bad": "✗", "unsure": "?"}


def write_report(path: Path, data: ReportData) -> None:
    """Writes the page of one run.

    Raises:
        OutputError: the file cannot be written.
    """
    write_page(path, report_html(data))


def write_comparison(path: Path, data: CompareData) -> None:
    """Writes the page of several runs side by side.

    Raises:
        OutputError: the file cannot be written.
    """
    write_page(path, compare_html(data))


def report_html(data: ReportData) -> str:
    """The page of one run."""
    shown_doubts, left_out = doubts(data.steps)
    headline = [data.metrics[key] for key in data.headline if key in data.metrics]
    others = [value for key, value in data.metrics.items() if key not in data.headline]
    return rendered(
        "report.html",
        data=data,
        headline=headline,
        others=others,
        pictures=draw_figures(data),
        episodes=episode_rows(data),
        doubts=shown_doubts,
        doubts_left_out=left_out,
        changed=[s for s in data.settings if not s.is_default],
        unchanged=[s for s in data.settings if s.is_default],
        run=run_rows(data.run),
        filtering=data.run.get("filtering"),
        photos=[(photo.caption, jpeg_uri(photo)) for photo in data.photos],
    )


def compare_html(data: CompareData) -> str:
    """The page of several runs side by side."""
    return rendered(
        "compare.html",
        data=data,
        rows=compare_rows(data),
        differences=difference_rows(data),
        pictures=compare_figures(data),
    )


def rendered(template: str, **values: Any) -> str:
    """A page of this room's templates; everything in `values` is escaped."""
    import jinja2

    environment = jinja2.Environment(
        loader=jinja2.FileSystemLoader(_TEMPLATES),
        autoescape=True,
        undefined=jinja2.StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    environment.filters.update(value_text=value_text, plain=plain, data_uri=_data_uri)
    return environment.get_template(template).render(marks=_MARKS, **values)


def jpeg_uri(photo: Photo) -> str:
    """The picture itself as an address."""
    return "data:image/jpeg;base64," + base64.b64encode(photo.jpeg).decode()


def _data_uri(picture: Picture) -> str:
    return "data:image/svg+xml;base64," + base64.b64encode(picture.svg).decode()


def write_page(path: Path, page: str) -> None:
    """Writes a page of text.

    Raises:
        OutputError: the file cannot be written.
    """
    # a file name that is not valid text reaches us with lone surrogates, which no encoding can write
    data = page.encode("utf-8", errors="replace")
    try:
        path.write_bytes(data)
    except OSError as error:
        raise OutputError(f"cannot write the report: {error}", where=path, hint="choose another --out") from error
