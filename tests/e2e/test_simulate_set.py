"""`wallkit simulate set`: every scene, crowd and seed once; what is there is kept; the committed set can be recorded."""

from __future__ import annotations

import csv
import json
from pathlib import Path

import numpy as np
import pytest

from tests.maps.random_maps import clean_map
from wallkit.maps.read import load_map
from wallkit.maps.rules import validate
from wallkit.pipelines.simulate.log import prepare
from wallkit.pipelines.simulate.set import SetRequest, requests_of

EVALUATION = Path(__file__).parents[2] / "evaluation"
SET = """
seeds = [1, 2]
sensors = "sensors.toml"
[[scenes]]
name = "room"
map = "m.wkmap.urdf"
scenario = "room.toml"
[[levels]]
crowd = {walkers = 0}
[[levels]]
crowd = {walkers = 0, standing = 3, blockers = 3}
"""


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    folder = tmp_path_factory.mktemp("set") / "places"
    folder.mkdir()
    (folder / "m.wkmap.urdf").write_bytes(clean_map(np.random.default_rng(6), turned=False))
    (folder / "set.toml").write_text(SET)
    (folder / "sensors.toml").write_text("duration_s = 2\n[lidar.scanner]\nbeams = 90\n")
    (folder / "room.toml").write_text("[route]\nrandom_stops = 3\n")
    return folder


@pytest.mark.long
def test_every_log_once_and_what_is_there_is_kept(folder, wallkit, tmp_path):
    first = wallkit("simulate", "set", folder, "--only", "room-6-*", "-o", "out", "--json", "-q")
    assert first.code == 0, first.err
    assert first.json["made"] == ["room-6-1", "room-6-2"]
    stamp = (tmp_path / "out/room-6-1/log.mcap").stat().st_mtime_ns
    plan = wallkit("simulate", "set", folder, "-o", "out", "--dry-run").out.splitlines()
    assert [line.split("  ")[0] for line in plan] == ["would record", "would record", "is there", "is there"]
    done = wallkit("simulate", "set", folder, "-o", "out", "--jobs", "2", "--freeze", "--json", "-q")
    assert done.code == 0, done.err
    assert (sorted(done.json["made"]), done.json["kept"]) == (["room-0-1", "room-0-2"], ["room-6-1", "room-6-2"])
    assert (tmp_path / "out/room-6-1/log.mcap").stat().st_mtime_ns == stamp
    shares = {row["name"]: row["unmapped_share"] for row in done.json["logs"]}
    assert shares["room-0-1"] == shares["room-0-2"] == 0
    assert min(shares["room-6-1"], shares["room-6-2"]) > 0.01

    # the annotated truth says the same
    with (tmp_path / "out/room-6-1/truth.csv").open(newline="") as file:
        rows = list(csv.DictReader(file))
    assert len(rows) == 20
    counted = sum(int(row["unmapped"]) for row in rows) / sum(int(row["returns"]) for row in rows)
    assert counted == pytest.approx(shares["room-6-1"], abs=1e-4)
    rooms = set(load_map(folder / "m.wkmap.urdf").rooms)
    assert {row["room"] for row in rows} <= {*rooms, ""}
    assert all(float(row["nearest_person_m"]) > 0.3 for row in rows)

    # made again elsewhere they have the scans of the frozen hashes; another sensor, and they have not
    again = wallkit("simulate", "set", folder, "--only", "room-0-1", "-o", "again")
    assert "1 of 1 have the scans and poses" in again.out
    hashes = json.loads((folder / "hashes.json").read_text())
    assert set(hashes) == set(shares)
    (folder / "room.toml").write_text("[route]\nrandom_stops = 3\n[lidar.scanner]\nsigma_m = 0.02\n")
    other = wallkit("simulate", "set", folder, "--only", "room-0-1", "-o", "again")
    assert (other.code, "other scans or poses" in other.err) == (0, True)
    assert "recorded 1, kept 0" in other.out


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("seeds = [1]", "has no [[scenes]]"),
        (SET.replace("seeds = [1, 2]", "seeds = [1, 1]"), "the log 'room-0-1' twice"),
        (SET.replace("walkers = 0}", "walkerz = 0}"), "walkerz"),
        (SET.replace("room.toml", "gone.toml"), "gone.toml"),
    ],
)
def test_a_set_that_cannot_be_is_one_message(folder, wallkit, tmp_path, text, message):
    places = tmp_path / "places"
    places.mkdir()
    for name in ("m.wkmap.urdf", "sensors.toml", "room.toml"):
        (places / name).write_bytes((folder / name).read_bytes())
    (places / "set.toml").write_text(text)
    done = wallkit("simulate", "set", "places", "-o", "out")
    assert (done.code, message in done.err) == (2, True), done.err
    assert not (tmp_path / "out").exists()


def test_a_pattern_that_fits_nothing_names_the_closest(folder, wallkit):
    done = wallkit("simulate", "set", folder, "--only", "rom-0-1")
    assert (done.code, "room-0-1" in done.err) == (2, True)


# ------------------------------------------------------------------------------------------- the committed set


def test_the_evaluation_set_is_six_places_five_crowds_three_seeds():
    names = [name.split("-") for name in requests_of(SetRequest(EVALUATION, pictures=False))]
    assert len(names) == 90
    places, people, seeds = (sorted(set(column)) for column in zip(*names, strict=True))
    assert places == ["corridor", "hall", "lab", "office", "restroom", "twins"]
    assert sorted(map(int, people)) == [0, 2, 4, 8, 12]
    assert seeds == ["1", "2", "3"]


@pytest.mark.long
@pytest.mark.parametrize("place", ["corridor", "hall", "lab", "office", "restroom", "twins"])
def test_a_place_has_a_sound_map_and_a_route_of_one_to_two_minutes(place):
    (request,) = requests_of(SetRequest(EVALUATION, (f"{place}-12-1",), pictures=False)).values()
    play = prepare(request)
    assert 60 <= play.duration_s <= 125
    assert len(play.people.agents) == 12
    assert [str(f) for f in validate(request.map_path).findings if f.severity != "info"] == []
