"""A TOML manifest -> which logs, maps and calibrations, under which configurations, with which seeds."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any, Literal

from wallkit.core.config import Source, build, read_toml, setting
from wallkit.errors import ConfigError
from wallkit.pipelines.batch.expand import Sweep, expanded
from wallkit.pipelines.config import with_files_beside

Job = Literal["localize", "calib verify", "map audit", "simulate"]


@dataclass(frozen=True)
class Manifest:
    """What a batch runs: every log x map x calibration x configuration x seed."""

    job: Job = setting("localize", "what is done: localize (and evaluate), calib verify, map audit or simulate")
    logs: tuple[str, ...] = setting(
        (),
        "files, globs (`**` too), folders, `s3://...`; a folder is a bag, else all logs below it; of `simulate` scenarios",
    )
    maps: tuple[str, ...] = setting((), "one, or alternatives; none: the log's own, or that of the settings")
    calibrations: tuple[str, ...] = setting((), "one, or alternatives; 'front.toml+rear.toml' is two cameras at once")
    truth: str = setting("", "a topic or FILE.tum; empty: what the log calls its truth")
    init: str = setting("", "as `--init`: truth, topic, global, everywhere or X,Y,YAW; empty: topic, else global")
    start_s: float | None = setting(None, "begin so many seconds after the first scan", low=0)
    end_s: float | None = setting(None, "end so many seconds after the first scan", low=0)
    model: str = setting("", "what segments images: FILE.onnx, default or oracle")
    fallback: str = setting("", "`lidar` goes on without cameras that cannot be used")
    board: str = setting("", "of `calib verify`: a board file or words as `--board`; empty: no target")
    lidar_sigma: str = setting("", "of `calib verify`: noise of a range, as `--lidar-sigma`")
    robot: str = setting("", "of `simulate`: a URDF; empty: one with a LiDAR")
    seeds: tuple[int, ...] = setting((0,), "seeds of every run", low=0)
    cache: str = setting(
        "", "folder for copies of inputs at addresses, on each machine; empty: the user's cache folder"
    )
    config: str = setting("", "a wallkit.toml below all configurations; empty: the defaults, whatever the folder holds")


@dataclass(frozen=True)
class Configuration:
    """A name, and what it sets beyond the defaults.

    Attributes:
        table: nested, as in wallkit.toml. flat: the same by dotted key. model: instead of the manifest's; "" for that.
    """

    name: str
    table: Mapping[str, Any]
    model: str = ""

    @property
    def flat(self) -> dict[str, Any]:
        """By dotted key."""
        found = dict(flat(self.table))
        return {**found, "model": self.model} if self.model else found


@dataclass(frozen=True)
class Read:
    """A manifest with everything resolved but the files.

    Attributes:
        swept: keys that a sweep varies. base: the shared settings file. text: of the manifest.
    """

    path: Path
    manifest: Manifest
    configurations: tuple[Configuration, ...]
    swept: tuple[str, ...]
    base: Source | None
    text: str = field(repr=False, default="")


def read_manifest(path: Path) -> Read:
    """A manifest from its file.

    Raises:
        ConfigError: it cannot be read, has a key that does not exist, or two configurations of one name.
    """
    source = read_toml(path)
    table = dict(source.table)
    shared, rows, sweep = table.pop("settings", {}), table.pop("configurations", []), table.pop("sweep", None)
    manifest, _ = build(Manifest, [replace(source, table=table)])
    if not manifest.logs:
        raise ConfigError("names no logs", where=path, hint='logs = ["recordings/*.mcap"]')
    if len(set(manifest.seeds)) < len(manifest.seeds):
        raise ConfigError("names a seed twice", where=source.place(("seeds",)), hint="seeds = [0, 1, 2]")
    if not isinstance(shared, Mapping):
        raise ConfigError("'settings' is a table", where=source.place(("settings",)))
    configurations = tuple(_configurations(rows, shared, source))
    swept: tuple[str, ...] = ()
    if sweep is not None:
        variants, swept = _swept(sweep, source)
        # a sweep over the configurations, or over the defaults
        configurations = tuple(
            Configuration(f"{c.name}-{name}" if rows else name, merged(c.table, variant), c.model)
            for c in configurations
            for name, variant in variants
        )
    shared_file = path.absolute().parent / manifest.config
    base = with_files_beside(read_toml(shared_file), shared_file) if manifest.config else None
    return Read(path, manifest, configurations, swept, base, source.text)


def merged(below: Mapping[str, Any], above: Mapping[str, Any]) -> dict[str, Any]:
    """Two nested tables as one, the second winning key by key."""
    found = dict(below)
    for key, value in above.items():
        old = found.get(key)
        if isinstance(value, Mapping):
            # a bare name becomes its table when one of its settings is named
            old = {"name": old} if isinstance(old, str) else old
            found[key] = merged(old if isinstance(old, Mapping) else {}, value)
        else:
            found[key] = value
    return found


def flat(table: Mapping[str, Any], key: tuple[str, ...] = ()) -> Any:
    """(dotted key, value) of everything in a nested table."""
    for name, value in table.items():
        if isinstance(value, Mapping):
            yield from flat(value, (*key, name))
        else:
            yield ".".join((*key, name)), value


def nested(table: Mapping[str, Any]) -> dict[str, Any]:
    """Dotted keys as tables in tables; other tables stay."""
    found: dict[str, Any] = {}
    for dotted, value in table.items():
        inner: Any = nested(value) if isinstance(value, Mapping) else value
        for name in reversed(dotted.split(".")):
            inner = {name: inner}
        found = merged(found, inner)
    return found


def _configurations(rows: Any, shared: Mapping[str, Any], source: Source) -> Sequence[Configuration]:
    where = source.place(("configurations",))
    if not isinstance(rows, list) or not all(isinstance(row, Mapping) for row in rows):
        raise ConfigError("'configurations' are tables", where=where, hint='[[configurations]] and name = "basic"')
    found: dict[str, Configuration] = {}
    for row in rows:
        if unknown := sorted(set(row) - {"name", "settings", "model"}):
            hint = "one of: name, model, settings; a setting goes into `settings = {...}`"
            raise ConfigError(f"a configuration has no '{unknown[0]}'", where=where, hint=hint)
        name, settings = row.get("name"), row.get("settings", {})
        if not isinstance(name, str) or not name or set(name) & set("/\\") or name.startswith("."):
            hint = "letters, digits, - and _: folders are named by it"
            raise ConfigError(f"a configuration is named {name!r}", where=where, hint=hint)
        if name in found:
            raise ConfigError(f"two configurations are named '{name}'", where=where, hint="give each its own name")
        if not isinstance(settings, Mapping):
            raise ConfigError(f"the settings of '{name}' are a table", where=where, hint='{"localize.particles" = 500}')
        found[name] = Configuration(name, nested(merged(nested(shared), nested(settings))), str(row.get("model", "")))
    return tuple(found.values()) or (Configuration("default", nested(shared)),)


def _swept(table: Any, source: Source) -> tuple[list[tuple[str, dict[str, Any]]], tuple[str, ...]]:
    where = source.place(("sweep",))
    if not isinstance(table, Mapping) or not isinstance(table.get("over"), Mapping) or not table["over"]:
        raise ConfigError(
            "a sweep varies nothing", where=where, hint='[sweep.over] and "localize.particles" = [200, 500]'
        )
    rest = {key: value for key, value in table.items() if key != "over"}
    sweep, _ = build(Sweep, [Source(rest, f"{source.label} [sweep]")])
    over = dict(_ranges(table["over"]))
    points = expanded(sweep, over, where=where)
    width = max(2, math.ceil(math.log10(len(points) + 1)))
    return [(f"sweep-{i:0{width}d}", nested(point)) for i, point in enumerate(points)], tuple(over)


def _ranges(table: Mapping[str, Any], key: tuple[str, ...] = ()) -> Any:
    """(dotted key, list or range) of what is swept; a range is a table with `low` and `high`."""
    for name, value in table.items():
        if isinstance(value, Mapping) and "low" not in value:
            yield from _ranges(value, (*key, name))
        else:
            yield ".".join((*key, name)), value
