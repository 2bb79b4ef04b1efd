"""Rows of runs <-> one SQLite file that only the driver writes, a transaction for every run that ends.

The file is `batch.sqlite` in the batch's folder:

    runs      one line for each run, by its readable `name`; `settings`, `tags` and `metrics` are JSON objects, flat, so that
              SELECT name, metrics ->> 'ate_rmse_m' FROM runs WHERE planned AND status = 'done'
              works. `planned` is 0 for runs of an earlier manifest that the last one no longer asks for: they are kept,
              and count again when it does.
    measures  unit, definition and better direction of every metric, and whether it is a time
    about     schema, version of wallkit, the manifest's text, the names of its configurations in their order,
              and under 'swept' the settings that a sweep varies

A rollback journal and not a write-ahead log: the folder may be on a network file system, where the latter does not work
(https://sqlite.org/wal.html).
"""

from __future__ import annotations

import json
import os
import sqlite3
from collections.abc import Iterable, Iterator, Mapping
from contextlib import closing, contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any, get_args

from wallkit.batch.rows import Asked, Measure, Outcome, Row, Status
from wallkit.errors import OutputError, WallkitError

FILE = "batch.sqlite"
LOCK = ".batch.lock"
SCHEMA = 1

_TABLES = f"""
CREATE TABLE IF NOT EXISTS runs (
    name TEXT PRIMARY KEY, key TEXT NOT NULL, job TEXT NOT NULL, log TEXT NOT NULL, map TEXT NOT NULL,
    calibration TEXT NOT NULL, configuration TEXT NOT NULL, seed INTEGER NOT NULL, version TEXT NOT NULL,
    settings TEXT NOT NULL, tags TEXT NOT NULL, planned INTEGER NOT NULL, folder TEXT NOT NULL,
    status TEXT NOT NULL CHECK (status IN {get_args(Status)}), verdict TEXT NOT NULL, exit_code INTEGER NOT NULL,
    message TEXT NOT NULL, metrics TEXT NOT NULL, worker TEXT NOT NULL, started REAL NOT NULL, seconds REAL NOT NULL,
    cpu_s REAL NOT NULL
) WITHOUT ROWID;
CREATE UNIQUE INDEX IF NOT EXISTS runs_by_key ON runs (key);
CREATE TABLE IF NOT EXISTS measures (
    name TEXT PRIMARY KEY, unit TEXT NOT NULL, definition TEXT NOT NULL, better TEXT NOT NULL, is_timing INTEGER NOT NULL
) WITHOUT ROWID;
CREATE TABLE IF NOT EXISTS about (name TEXT PRIMARY KEY, value TEXT NOT NULL) WITHOUT ROWID;
"""
_ASKED = ("name", "key", "job", "log", "map", "calibration", "configuration", "seed", "version", "settings", "tags")
_CAME = ("status", "verdict", "exit_code", "message", "metrics", "worker", "started", "seconds", "cpu_s")


@dataclass(frozen=True)
class Store:
    """The table, open for writing; see `open_store`."""

    folder: Path
    connection: sqlite3.Connection

    def plan(self, asked: Iterable[Asked], about: Mapping[str, Any]) -> None:
        """Make the table what the manifest asks for: what is there with the same key stays, the rest waits."""
        columns = ", ".join((*_ASKED, "planned", "folder", *_CAME))
        waiting = "1, '', 'waiting', '', 0, '', '{}', '', 0, 0, 0"
        sql = (
            f"INSERT INTO runs ({columns}) VALUES ({', '.join('?' * len(_ASKED))}, {waiting}) ON CONFLICT (name) DO UPDATE"
            " SET planned = 1 WHERE key = excluded.key"
        )
        stale = "DELETE FROM runs WHERE (name = ? AND key <> ?) OR (key = ? AND name <> ?)"
        with self.connection as rows:
            rows.execute("UPDATE runs SET planned = 0")
            for run in asked:
                rows.execute(stale, (run.name, run.key, run.key, run.name))
                rows.execute(sql, (*(getattr(run, name) for name in _ASKED[:-2]), _text(run.settings), _text(run.tags)))
            rows.execute("DELETE FROM runs WHERE NOT planned AND status = 'waiting'")
            values = {"schema": SCHEMA, **about}
            rows.executemany("REPLACE INTO about VALUES (?, ?)", ((k, _text(v)) for k, v in values.items()))

    def forget_failures(self) -> None:
        """Let the failed runs wait again."""
        with self.connection as rows:
            rows.execute("UPDATE runs SET status = 'waiting', message = '' WHERE planned AND status = 'failed'")

    def add(self, outcome: Outcome, folder: str = "") -> None:
        """Note what came of a run; on the disk when this returns."""
        self.add_all([(outcome, folder)])

    def add_all(self, outcomes: Iterable[tuple[Outcome, str]]) -> None:
        """Note what came of some runs and where it lies; all on the disk when this returns, or none."""
        assignments = ", ".join(f"{name} = ?" for name in ("folder", *_CAME))
        with self.connection as rows:
            for outcome, folder in outcomes:
                values = [getattr(outcome, name) for name in _CAME]
                values[_CAME.index("metrics")] = _text(outcome.metrics)
                rows.execute(f"UPDATE runs SET {assignments} WHERE key = ?", (folder, *values, outcome.key))

    def add_measures(self, measures: Iterable[Measure]) -> None:
        """Note what metrics are; those that are known stay as they are."""
        rows = ((m.name, m.unit, m.definition, m.better, int(m.is_timing)) for m in measures)
        with self.connection as connection:
            connection.executemany("INSERT OR IGNORE INTO measures VALUES (?, ?, ?, ?, ?)", rows)

    def is_waiting(self, key: str) -> bool:
        """Whether a run is still to be done."""
        sql = "SELECT 1 FROM runs WHERE key = ? AND planned AND status = 'waiting'"
        return self.connection.execute(sql, (key,)).fetchone() is not None

    def name_of(self, key: str) -> str:
        """The name of a run that is in the table."""
        return str(self.connection.execute("SELECT name FROM runs WHERE key = ?", (key,)).fetchone()[0])

    def counts(self) -> dict[Status, int]:
        """Planned runs by status."""
        sql = "SELECT status, count(*) FROM runs WHERE planned GROUP BY status"
        found = dict(self.connection.execute(sql).fetchall())
        return {status: found.get(status, 0) for status in get_args(Status)}


@contextmanager
def open_store(folder: Path) -> Iterator[Store]:
    """The store of a batch's folder, made if it is not there, and held: a second driver is refused.

    Raises:
        OutputError: another process writes it, it cannot be written, or it is of another schema.
    """
    try:
        folder.mkdir(parents=True, exist_ok=True)
        lock = sqlite3.connect(folder / LOCK, timeout=0, isolation_level=None)
    except (OSError, sqlite3.Error) as error:
        raise OutputError(f"cannot be written: {error}", where=folder, hint="choose another --out") from error
    with closing(lock):
        try:
            # the system lets go of it when this process ends, however it ends
            lock.execute("BEGIN EXCLUSIVE")
        except sqlite3.Error as error:
            hint = "let the other `wallkit batch` finish or stop it, or choose another --out"
            raise OutputError("is being written by another batch", where=folder, hint=hint) from error
        with closing(_connect(folder / FILE)) as connection:
            yield Store(folder, connection)


def is_batch(folder: Path) -> bool:
    """Whether a folder holds a batch."""
    return (folder / FILE).is_file()


def read_rows(folder: Path) -> Iterator[Row]:
    """Every planned run by its name, one at a time; also while a batch is writing.

    Raises:
        WallkitError: the folder holds no batch, or a damaged one.
    """
    columns = ", ".join((*_ASKED, *_CAME, "folder"))
    for row in _select(folder, f"SELECT {columns} FROM runs WHERE planned ORDER BY name"):
        asked, came = dict(zip(_ASKED, row, strict=False)), dict(zip(_CAME, row[len(_ASKED) :], strict=False))
        for values, name in ((asked, "settings"), (asked, "tags"), (came, "metrics")):
            values[name] = json.loads(values[name])
        yield Row(Asked(**asked), Outcome(key=asked["key"], **came), row[-1])


def read_measures(folder: Path) -> dict[str, Measure]:
    """What every metric is, by name.

    Raises:
        WallkitError: see read_rows.
    """
    rows = _select(folder, "SELECT name, unit, definition, better, is_timing FROM measures ORDER BY name")
    return {
        name: Measure(name, unit, definition, better, bool(timing)) for name, unit, definition, better, timing in rows
    }


def read_about(folder: Path) -> dict[str, Any]:
    """The table `about`: "schema", "wallkit", "manifest", "configurations" and "swept".

    Raises:
        WallkitError: see read_rows.
    """
    return {name: json.loads(value) for name, value in _select(folder, "SELECT name, value FROM about ORDER BY name")}


def _select(folder: Path, sql: str) -> Iterator[tuple[Any, ...]]:
    path = folder / FILE
    if not path.is_file():
        hint = "name an --out of `wallkit batch`"
        raise WallkitError(f"no batch of wallkit ({FILE} is missing)", where=folder, hint=hint)
    try:
        with closing(sqlite3.connect(f"{path.absolute().as_uri()}?mode=ro", uri=True, timeout=30)) as connection:
            yield from connection.execute(sql)
    except sqlite3.Error as error:
        raise WallkitError(f"cannot be read: {error}", where=path, hint="run the batch again") from error


def _connect(path: Path) -> sqlite3.Connection:
    is_new = not path.exists()
    try:
        connection = sqlite3.connect(path, timeout=30)
        with connection:
            connection.execute("PRAGMA journal_mode = TRUNCATE")
            connection.executescript(_TABLES)
            if is_new:
                connection.execute("INSERT INTO about VALUES ('schema', ?)", (str(SCHEMA),))
            found = connection.execute("SELECT value FROM about WHERE name = 'schema'").fetchone()
    except sqlite3.Error as error:
        hint = "choose another --out; nothing of it was changed"
        raise OutputError(f"cannot be used: {error}", where=path, hint=hint) from error
    if found is None or found[0] != str(SCHEMA):
        connection.close()
        hint = "read it with the wallkit that wrote it, or choose another --out"
        raise OutputError(f"is of schema {found and found[0]}, this wallkit writes {SCHEMA}", where=path, hint=hint)
    return connection


def _text(value: Any) -> str:
    return json.dumps(value, sort_keys=True, allow_nan=False, default=os.fspath)
