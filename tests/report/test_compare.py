"""Runs side by side: the best is marked, ties are not, and a difference is put into words with its certainty."""

import re

import pytest

from wallkit.core.results import Comparison, Spread, Value
from wallkit.report.compare import CompareData, Contender, compare_figures, compare_rows, difference_rows
from wallkit.report.html import compare_html, write_comparison

from .worlds import run, steps


def contender(name, numbers, better="lower", data=None):
    metrics = {key: Value(key, number, "m", f"what {key} is", better) for key, number in numbers.items()}
    return Contender(name, metrics, {}, data)


def best(*contenders):
    return [[cell.is_best for cell in row.cells] for row in compare_rows(CompareData("t", "v", contenders))]


def test_the_best_of_each_row_is_marked():
    assert best(contender("a", {"x": 1, "y": 5}), contender("b", {"x": 2, "y": 4})) == [[True, False], [False, True]]
    assert best(contender("a", {"x": 1}, "higher"), contender("b", {"x": 2}, "higher")) == [[False, True]]


def test_what_distinguishes_none_is_not_marked():
    assert best(contender("a", {"x": 1}), contender("b", {"x": 1})) == [[False, False]]
    assert best(contender("a", {"x": 1})) == [[False]]
    assert best(contender("a", {"x": 1}, ""), contender("b", {"x": 2}, "")) == [[False, False]]


def test_a_missing_number_is_never_the_best():
    rows = compare_rows(
        CompareData("t", "v", (contender("a", {"x": None}), contender("b", {"x": 2}), contender("c", {})))
    )
    assert [(cell.text, cell.is_best) for cell in rows[0].cells] == [
        ("none", False),
        ("2.000 m", True),
        ("not measured", False),
    ]


def test_seeds_are_compared_by_their_mean():
    spread = Spread("x", "m", 0.5, 0.1, 0.9, 10, 0)
    seeds = Contender("seeds", {"x": Value("x", 9.0, "m", "")}, {"x": spread})
    row = compare_rows(CompareData("t", "v", (seeds, contender("one", {"x": 0.8}))))[0]
    assert [(cell.text, cell.is_best) for cell in row.cells] == [
        ("0.500 m ± 0.100 m, worst 0.900 m", True),
        ("0.800 m", False),
    ]


@pytest.mark.parametrize(
    ("difference", "better", "p_value", "words"),
    [
        (-0.25, "b", 0.0001, ("new is better: new has 0.250 m less than old", "p < 0.001, 10 pairs")),
        (0.25, "a", 0.0123, ("old is better: new has 0.250 m more than old", "p = 0.012, 10 pairs")),
        (0.01, "neither", 0.5, ("no difference can be told: new has 0.010 m more", "p = 0.500")),
    ],
)
def test_differences_in_words(difference, better, p_value, words):
    found = Comparison("x", "m", difference, difference - 0.1, difference + 0.1, p_value, 10, "Wilcoxon", better)
    ((key, what, sure),) = difference_rows(CompareData("t", "v", (), (("old", "new", found),)))
    assert key == "x"
    assert what.startswith(words[0])
    assert sure.startswith(words[1])


def test_too_few_pairs_have_no_interval_in_words():
    found = Comparison("x", "m", 0.25, None, None, 0.25, 3, "Wilcoxon", "neither")
    ((_, what, _),) = difference_rows(CompareData("t", "v", (), (("old", "new", found),)))
    assert what == "no difference can be told: new has 0.250 m more than old (no 95 % interval of fewer than 6 pairs)"


def test_figures_need_a_truth_and_take_any_number_of_runs():
    assert compare_figures(CompareData("t", "v", (contender("a", {}), contender("b", {}, data=run(errors=None))))) == ()
    many = tuple(contender(f"a very long folder name, longer/run {n}", {}, data=run()) for n in range(7))
    shares, errors = compare_figures(CompareData("t", "v", many))
    for picture in (shares, errors):
        names = re.findall(rb">(\xe2\x80\xa6[^<]*run \d)<", picture.svg)
        assert len(names) == 7


def test_the_page_holds_it_all_and_escapes_names(tmp_path):
    evil = "<script>alert(1)</script>"
    found = Comparison("x", "m", 1.0, 0.5, 1.5, 0.01, 10, "Wilcoxon", "a")
    data = CompareData(
        evil,
        evil,
        (contender(evil, {"x": 1}, data=run()), contender("b", {"x": 2}, data=run(steps=steps(healthy=True)))),
        ((evil, "b", found),),
    )
    write_comparison(tmp_path / "compare.html", data)
    page = (tmp_path / "compare.html").read_text()
    assert page == compare_html(data)
    assert "<script" not in page
    assert page.count("&lt;script&gt;") >= 4
    assert page.count("1.000 m ★") == 1
    assert page.count("data:image/svg+xml") == 2
