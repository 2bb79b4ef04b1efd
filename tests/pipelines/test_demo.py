"""The demo notices when the sample is not localized as it should be."""

from __future__ import annotations

import copy
import json
from dataclasses import replace

import pytest
from click.testing import CliRunner

from wallkit.cli.app import main
from wallkit.pipelines import demo
from wallkit.pipelines.config import default_config
from wallkit.pipelines.demo import FILTERED, METHODS, expected_answers, folder_of, run_demo, surprises


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """What the demo writes."""
    return tmp_path_factory.mktemp("demo") / "out"


@pytest.fixture(scope="module")
def found(folder):
    """Two methods, and under the name of the camera's filter one that keeps people instead of cubicles."""
    with pytest.MonkeyPatch.context() as patch:
        broken = replace(METHODS[FILTERED], words=(*METHODS[FILTERED].words, 'points.wall_mask.keep=["wall","person"]'))
        patch.setattr(demo, "METHODS", {"basic": METHODS["basic"], FILTERED: broken})
        patch.setattr(demo, "SEEDS", 2)
        # settings of the folder it is started in must not change the answer
        (folder.parent / "wallkit.toml").write_text("[localize]\nparticles = 50\n[evaluate]\nconverged_m = 0.001\n")
        patch.chdir(folder.parent)
        yield run_demo(folder)


@pytest.fixture
def expected():
    """Of the two methods."""
    every = expected_answers()
    return {**every, "methods": {name: every["methods"][name] for name in ("basic", FILTERED)}}


@pytest.mark.long
def test_a_filter_that_does_not_filter_is_noticed_however_small_the_error(found, expected):
    said = surprises(found, expected)
    assert said
    assert all(line.startswith(FILTERED) and "kept_share" in line for line in said)
    for name in ("partition", "person"):
        assert any(f"kept_share of {name} is" in line for line in said)


def test_it_uses_the_defaults_whatever_wallkit_toml_says(found):
    run = found.runs["basic"][0][0].run
    assert run["config"]["localize"]["particles"] == default_config().config.localize.particles != 50
    assert (run["config_file"], run["origins"]["localize.particles"]) == (None, "default")
    assert found.runs["basic"][0][1].metrics["updates_to_converge"].value is not None


def test_its_folders_are_read_like_those_of_several_seeds(found, folder):
    basic, masked = folder / "basic", folder / folder_of(FILTERED)
    assert sorted(path.name for path in basic.iterdir()) == ["metrics.json", "run.json", "seed-0", "seed-1"]
    assert f'href="{folder_of(FILTERED)}/seed-0/report.html"' in (folder / "report.html").read_text("utf-8")
    assert (basic / "seed-0" / "report.html").is_file()
    done = CliRunner().invoke(main, ["compare", str(basic), str(masked), "--json"])
    (key, *_) = (d for d in json.loads(done.output)["differences"])
    assert key["pairs"] == 2
    assert "over 2 runs" in CliRunner().invoke(main, ["evaluate", str(basic)]).output


def test_the_verdicts_of_map_and_calibration_are_compared(found, expected):
    known = surprises(found, expected)
    doubtful = replace(found, calibration=replace(found.calibration, verdict="CANNOT TELL"))
    assert set(surprises(doubtful, expected)) - set(known) == {"calibration: is CANNOT TELL, expected PASS"}
    other = copy.deepcopy(expected) | {"map": "good: 0 errors, 3 warnings"}
    (line,) = set(surprises(found, other)) - set(known)
    assert line.startswith("map: is good: 0 errors, 0 warnings")
