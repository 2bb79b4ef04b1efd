"""The unit detective: it finds a plan's unit, keeps the declared one where that will do, and shows its evidence."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from wallkit.errors import MapError
from wallkit.maps.importers.units import METRES, Evidence, check_unit, finding_of, judge_units

# a common house: leaves, walls, storeys, all in metres
HOUSE = {
    "door leaf": [0.76, 0.76, 0.81, 0.91],
    "wall thickness": [0.1, 0.1, 0.15, 0.24],
    "storey height": [2.6],
    "extent": [14.0],
}


def drawn_in(unit):
    return [Evidence(kind, np.array(lengths) / METRES[unit]) for kind, lengths in HOUSE.items()]


@pytest.mark.parametrize("unit", METRES)
@pytest.mark.parametrize("declared", METRES)
def test_a_house_drawn_in_any_unit_is_recognised_whatever_its_header_says(unit, declared):
    verdict = judge_units(declared, drawn_in(unit))
    assert verdict.inferred == unit
    assert verdict.contradicts == (declared != unit)


def test_the_declared_unit_stands_where_the_evidence_fits_it_as_well():
    # 6 could be a wall of 6 cm or of 6 in, and an extent of 300 of both
    evidence = [Evidence("wall thickness", np.array([6.0])), Evidence("extent", np.array([1000.0]))]
    assert judge_units("cm", evidence).inferred == "cm"
    assert judge_units("in", evidence).inferred == "in"


@pytest.mark.parametrize(
    "evidence", [[], [Evidence("door leaf", np.array([]))], [Evidence("door leaf", np.array([1e9]))]]
)
def test_without_evidence_nothing_is_inferred_and_nothing_contradicted(evidence):
    verdict = judge_units("mm", evidence)
    assert verdict.inferred is None
    assert finding_of(verdict, Path("plan.dxf")) is None


def test_the_finding_names_both_units_the_evidence_and_what_to_type():
    finding = finding_of(judge_units("mm", [Evidence("door leaf", np.array([30.0, 30.0, 36.0]))]), Path("plan.dxf"))
    assert finding is not None
    assert (finding.code, finding.severity) == ("WK-E041", "error")
    assert "says millimetres, but looks drawn in inches" in finding.message
    assert "door leaf 30 (median of 3): 0.03 m if millimetres, 0.762 m if inches; usual 0.6 to 1.3 m" in finding.message
    assert "--units in" in finding.hint


def test_one_odd_door_does_not_overturn_the_unit():
    assert not judge_units("m", [Evidence("door leaf", np.array([0.8, 0.9, 0.85, 2.9]))]).contradicts


def test_an_unknown_unit_is_refused_with_the_list():
    with pytest.raises(MapError, match=r"no unit 'yd'") as caught:
        check_unit("yd", "--units")
    assert "mm" in caught.value.hint
