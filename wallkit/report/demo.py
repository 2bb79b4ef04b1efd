"""What the demo found -> one page: the answer, what was judged, the table, what the camera saw, and the errors over time."""

from __future__ import annotations

from dataclasses import dataclass

from wallkit.report.compare import CompareData, compare_figures
from wallkit.report.data import Photo
from wallkit.report.html import jpeg_uri, rendered
from wallkit.report.paper import Column, paper_differences, paper_headers, paper_rows

# the paper's, but for the error: the robot does not know where it starts, and a mean would be of the first guess
COLUMNS = (
    Column("time per update", "update_median_ms"),
    Column("CPU", "cpu_percent"),
    Column("median error", "ate_median_m"),
    Column("sd over runs", "ate_median_m", "sd"),
    Column("updates to converge", "updates_to_converge"),
    Column("memory", "peak_memory_mb"),
    Column("false healthy", "false_healthy"),
    Column("kept", "kept_share"),
)


@dataclass(frozen=True)
class DemoData:
    """What the page shows.

    Attributes:
        answers: (what, the answer) in words: what was judged, and what the table says.
        compared: the methods. photos: what the camera saw, and the returns before and after the filter.
        pages: (name, file relative to the page) of each method's own.
    """

    answers: tuple[tuple[str, str], ...]
    compared: CompareData
    photos: tuple[Photo, ...]
    pages: tuple[tuple[str, str], ...]


def demo_html(data: DemoData) -> str:
    """The page."""
    return rendered(
        "demo.html",
        data=data.compared,
        answers=data.answers,
        pages=data.pages,
        headers=demo_headers(),
        rows=demo_rows(data.compared),
        differences=paper_differences(data.compared),
        photos=[(photo.caption, jpeg_uri(photo)) for photo in data.photos],
        pictures=compare_figures(data.compared),
    )


def demo_headers() -> list[str]:
    """Of `demo_rows`."""
    return paper_headers(COLUMNS)


def demo_rows(data: CompareData) -> list[list[str]]:
    """A row for each method."""
    return paper_rows(data, COLUMNS)
