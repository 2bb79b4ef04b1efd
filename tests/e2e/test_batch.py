"""`wallkit batch`: every run once, whatever dies on the way, here and on a cluster."""

from __future__ import annotations

import csv
import io
import json
import os
import random
import shutil
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest

import wallkit as package

SAMPLE = Path(package.__file__).parent / "sample"
MANIFEST = """
logs = ["logs"]
maps = ["beside:floor.wkmap.urdf"]
init = "truth"
end_s = 2
seeds = [0, 1]
[settings.localize]
particles = 50
[[configurations]]
name = "basic"
[[configurations]]
name = "line"
settings = {"points.filters" = ["line_fit"]}
"""
MAIN = "from wallkit.cli.app import main; main()"


@pytest.fixture
def fleet(tmp_path):
    return made(tmp_path, "one", "two")


def made(folder: Path, *logs: str) -> Path:
    for name in logs:
        (folder / "logs" / name).mkdir(parents=True)
        (folder / "logs" / name / "log.mcap").symlink_to(SAMPLE / "log.mcap")
        (folder / "logs" / name / "floor.wkmap.urdf").symlink_to(SAMPLE / "floor.wkmap.urdf")
    (folder / "fleet.toml").write_text(MANIFEST)
    return folder


def table(out: Path) -> str:
    """The CSV without its timing columns."""
    rows = list(csv.reader(io.StringIO((out / "batch.csv").read_text())))
    first = next(i for i, name in enumerate(rows[0]) if name.startswith("timing."))
    return "\n".join(",".join(row[:first]) for row in rows)


def start(fleet: Path, *words: object) -> subprocess.Popen[str]:
    command = [sys.executable, "-c", MAIN, "batch", "fleet.toml", *map(str, words)]
    return subprocess.Popen(command, cwd=fleet, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)


def end(process: subprocess.Popen[str]) -> tuple[int, str]:
    """Exit code and stderr."""
    err = process.communicate(timeout=300)[1]
    return process.returncode, err


def wait_for(found, seconds: float = 120.0) -> None:
    until = time.monotonic() + seconds
    while not found():
        assert time.monotonic() < until, "it did not happen"
        time.sleep(0.05)


@pytest.mark.long
def test_bad_logs_among_good_ones_and_what_is_done_is_not_done_again_even_on_a_cluster(wallkit, tmp_path):
    fleet = made(tmp_path, "one")
    for name in ("bad", "mapless"):
        (fleet / "logs" / name).mkdir()
    (fleet / "logs" / "bad" / "log.mcap").write_bytes(b"no recording at all")
    (fleet / "logs" / "mapless" / "log.mcap").symlink_to(SAMPLE / "log.mcap")
    done = wallkit("batch", "fleet.toml", "--out", "o", cwd=fleet)
    assert done.code == 3, done.err
    assert "done     4 of 12 runs" in done.out
    assert "logs/bad/log.mcap" in done.out
    assert "logs/mapless/floor.wkmap.urdf" in done.out
    assert "Traceback" not in done.out + done.err
    first, row = table(fleet / "o"), fleet / "o" / "runs" / "one" / "line" / "seed-1"
    stamp = (row / "outcome.json").stat().st_mtime_ns
    said = wallkit("compare", "o", cwd=fleet)
    assert said.code == 0, said.err
    assert "basic" in said.out
    assert "failed" in said.out
    with quick_cluster(fleet) as address:
        elsewhere = wallkit("batch", "fleet.toml", "--out", "c", "--scheduler", address, cwd=fleet)
        assert elsewhere.code == 3, elsewhere.err
        assert "dashboard http" in elsewhere.err
        assert table(fleet / "c") == first
        shutil.copy(SAMPLE / "floor.wkmap.urdf", fleet / "logs" / "mapless")
        words = ("batch", "fleet.toml", "--out", "o", "--scheduler", address, "--retry", "--json")
        again = wallkit(*words, cwd=fleet)
        assert (again.json["runs"], again.json["before"], again.json["failed"]) == (12, 4, 4)
        assert (row / "outcome.json").stat().st_mtime_ns == stamp
        assert {line for line in first.splitlines() if "done" in line} <= set(table(fleet / "o").splitlines())
        one_worker_pretends_to_have(address, "0.0.1")
        refused = wallkit(*words, cwd=fleet)
        assert refused.code == 2
        assert "has wallkit 0.0.1, this is" in refused.err
        assert "hint: install the same wallkit everywhere" in refused.err


@contextmanager
def quick_cluster(folder: Path) -> Iterator[str]:
    """Address of the scheduler."""
    pytest.importorskip("distributed")
    command = [sys.executable, "-m", "tests.e2e.cluster", str(folder)]
    root = Path(__file__).parents[2]
    with subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True, cwd=root) as process:
        assert process.stdin is not None
        assert process.stdout is not None
        yield process.stdout.readline().strip()
        process.stdin.close()


def one_worker_pretends_to_have(address: str, version: str) -> None:
    import distributed

    with distributed.Client(address, set_as_default=False) as client:
        client.run(setattr, package, "__version__", version, workers=list(client.nthreads())[:1])


@pytest.mark.long
def test_other_things_are_not_touched(wallkit, fleet):
    done = wallkit("batch", "fleet.toml", "--out", "logs", cwd=fleet)
    assert done.code == 2
    assert "is not empty" in done.err
    dry = wallkit("batch", "fleet.toml", "--dry-run", cwd=fleet)
    assert "runs     8" in dry.out
    assert not (fleet / "fleet.batch").exists()
    lost = wallkit("batch", "fleet.toml", "--scheduler", "tcp://127.0.0.1:9", "--out", "o", cwd=fleet)
    assert lost.code == 2
    assert "no scheduler answers" in lost.err
    assert "Traceback" not in lost.err


@pytest.mark.slow
@pytest.mark.parametrize("sent", [signal.SIGINT, signal.SIGTERM])
def test_ctrl_c_and_a_scheduler_stop_it_cleanly_and_the_next_start_goes_on(fleet, sent):
    whole = start(fleet, "--out", "whole", "-q")
    assert end(whole)[0] == 0
    run = start(fleet, "--out", "o", "-q")
    wait_for(lambda: list((fleet / "o" / "runs").glob("*/*/*/outcome.json")))
    run.send_signal(sent)
    assert end(run) == (130, "\nInterrupted\n")
    assert 1 <= len(list((fleet / "o" / "runs").glob("*/*/*/outcome.json"))) < 8
    after = start(fleet, "--out", "o", "-q")
    assert end(after)[0] == 0
    assert table(fleet / "o") == table(fleet / "whole")
    assert not list((fleet / "o").glob("**/.*.partial-*"))


@pytest.mark.slow
def test_a_process_that_is_killed_takes_nothing_with_it(fleet):
    whole = start(fleet, "--out", "whole", "-q")
    assert end(whole)[0] == 0
    run = start(fleet, "--out", "o", "-q", "--jobs", 2)
    wait_for(lambda: list((fleet / "o" / "runs").glob("*/*/*/outcome.json")))
    os.kill(pid_of_first(fleet / "o"), signal.SIGKILL)
    assert end(run) == (0, "")
    assert table(fleet / "o") == table(fleet / "whole")
    assert (
        len({row["timing.worker"] for row in csv.DictReader((fleet / "o" / "batch.csv").read_text().splitlines())}) == 3
    )


def pid_of_first(out: Path) -> int:
    """The process that did the first run found."""
    outcome = json.loads(next((out / "runs").glob("*/*/*/outcome.json")).read_text())
    return int(outcome["worker"].split(":")[1])


@pytest.mark.slow
def test_killed_at_any_moment_it_ends_with_the_same_table(fleet):
    whole = start(fleet, "--out", "whole", "-q")
    began = time.monotonic()
    assert end(whole)[0] == 0
    span, rng = time.monotonic() - began, random.Random(8)
    for number in range(20):
        out = f"o{number}"
        run = start(fleet, "--out", out, "-q", "--jobs", 2)
        time.sleep(rng.uniform(0, span))
        run.kill()
        end(run)
        after = start(fleet, "--out", out, "-q", "--jobs", 2)
        assert end(after) == (0, "")
        assert table(fleet / out) == table(fleet / "whole")


class Cluster:
    """A scheduler and two workers on loopback, each a process of its own."""

    def __init__(self, folder: Path) -> None:
        self.file = folder / "scheduler.json"
        dask = [sys.executable, "-m", "dask"]
        options = ["--host", "127.0.0.1", "--port", "0", "--dashboard-address", "127.0.0.1:0"]
        self.scheduler = self._begin([*dask, "scheduler", *options, "--scheduler-file", str(self.file)])
        self.workers = [
            self._begin(
                [*dask, "worker", "--scheduler-file", str(self.file), "--nthreads", "1", "--no-dashboard",
                 "--host", "127.0.0.1", "--no-nanny", "--local-directory", str(folder / f"w{i}")]
            )
            for i in range(2)
        ]  # fmt: skip
        wait_for(self.file.is_file)

    @property
    def address(self) -> str:
        return str(json.loads(self.file.read_text())["address"])

    def _begin(self, command: list[str]) -> subprocess.Popen[bytes]:
        return subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)

    def end(self) -> None:
        for process in (*self.workers, self.scheduler):
            process.kill()
            process.wait()


@pytest.fixture
def cluster(tmp_path):
    pytest.importorskip("distributed")
    (tmp_path / "dask").mkdir()
    found = Cluster(tmp_path / "dask")
    yield found
    found.end()


@pytest.mark.slow
def test_a_cluster_makes_the_same_table_and_survives_a_worker(fleet, cluster):
    whole = start(fleet, "--out", "whole", "-q")
    assert end(whole)[0] == 0
    run = start(fleet, "--out", "o", "-q", "--scheduler", cluster.address)
    wait_for(lambda: list((fleet / "o" / "runs").glob("*/*/*/outcome.json")))
    os.kill(pid_of_first(fleet / "o"), signal.SIGKILL)
    code, err = end(run)
    assert code == 0, err
    assert "dashboard http" in err
    assert table(fleet / "o") == table(fleet / "whole")


@pytest.mark.slow
def test_a_scheduler_that_goes_away_leaves_what_is_done(fleet, cluster):
    run = start(fleet, "--out", "o", "-q", "--scheduler", cluster.address)
    wait_for(lambda: list((fleet / "o" / "runs").glob("*/*/*/outcome.json")))
    cluster.scheduler.kill()
    code, err = end(run)
    assert code == 2, err
    assert "the scheduler went away" in err
    assert "hint:" in err
    assert "Traceback" not in err
    after = start(fleet, "--out", "o", "-q")
    assert end(after)[0] == 0
    whole = start(fleet, "--out", "whole", "-q")
    assert end(whole)[0] == 0
    assert table(fleet / "o") == table(fleet / "whole")
