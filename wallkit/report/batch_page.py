"""A batch -> one page: which configuration is better and how sure that is, where and in which runs it fails."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path
from urllib.parse import quote

from wallkit.report import batch_tables as tables
from wallkit.report import batch_words as words
from wallkit.report import canvas
from wallkit.report.batch import BatchData, OneRun
from wallkit.report.batch_figures import batch_figures
from wallkit.report.batch_map import Places, places_figure
from wallkit.report.html import rendered, write_page

# of the runs that are not there
_MOST_LISTED = 200
LinkTo = Callable[[str], str]


def write_batch_page(path: Path, data: BatchData, places: Sequence[Places], *, link_to: LinkTo) -> None:
    """Writes the page.

    Args:
        link_to: from a run's folder to what the page links to, relative to it; "" for nothing.

    Raises:
        OutputError: the file cannot be written.
    """
    write_page(path, batch_html(data, places, link_to=link_to))


def batch_html(data: BatchData, places: Sequence[Places], *, link_to: LinkTo) -> str:
    """The page as text."""
    contest, *_ = words.contest_lines(data.contest, data.key) if len(data.summaries) > 1 else [""]
    with canvas.style():
        maps = [places_figure(one) for one in places]
    return rendered(
        "batch.html",
        data=data,
        verdict=words.verdict_lines(data),
        word=words.word_of(data.key),
        errors=tables.error_table(data),
        others=tables.other_table(data),
        tested=[
            (
                words.tested_line(key, data.baseline, len(found)),
                list(words.difference_lines(found, key, data.baseline)),
            )
            for key, found in data.differences.items()
            if found
        ],
        contest=contest,
        candidates=tables.candidate_table(data),
        pictures=batch_figures(data),
        places=maps,
        factors=[
            (f"Mean {words.word_of(key)} by {factor.key}", *tables.factor_table(factor, key))
            for factor in data.factors
            for key in data.differences
        ],
        star=words.star_line(data),
        worst=[_row(run, words.mean_text(run.value or 0.0, data.unit), link_to) for run in data.worst],
        absent=[
            (_heading(runs, what), [_row(run, run.message, link_to) for run in runs[:_MOST_LISTED]])
            for runs, what in ((data.failed, "failed"), (data.missing, "missing"))
            if runs
        ],
    )


def _row(run: OneRun, text: str, link_to: LinkTo) -> tuple[str, str, str]:
    link = link_to(run.folder) if run.folder else ""
    return words.run_name(run), text, quote(link)


def _heading(runs: Sequence[OneRun], what: str) -> str:
    more = f", the first {_MOST_LISTED}" if len(runs) > _MOST_LISTED else ""
    return f"{words.count_text(len(runs), 'run')} {what}{more}"
