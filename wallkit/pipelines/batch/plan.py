"""A manifest -> its runs, each with a key of what it depends on, in pieces that one process does one after the other."""

from __future__ import annotations

import hashlib
import itertools
import json
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import wallkit
from wallkit.batch.rows import Asked
from wallkit.core.config import Source, build, table_from
from wallkit.errors import ConfigError
from wallkit.pipelines.batch.files import BESIDE, LOGS, Digests, digest, find_logs, named_by, short_names
from wallkit.pipelines.batch.manifest import Configuration, Manifest, Read, merged
from wallkit.pipelines.config import Config
from wallkit.simulate.scenario import Scenario

# so many runs over one log go to one process, which reads it once; the next go to whoever is free
PIECE = 16
ALONE = 1


@dataclass(frozen=True)
class Task:
    """One run as a worker gets it: everything it needs, and nothing that is not a plain value.

    Attributes:
        name, key: of the run. log, map, calibrations, truth: absolute paths, or words; "" for none.
        table: of the settings, below it `base`.
        folder: absolute, where the results go. home: that of the manifest.
    """

    name: str
    key: str
    log: str
    map: str
    calibrations: tuple[str, ...]
    truth: str
    model: str
    seed: int
    manifest: Manifest
    table: dict[str, Any]
    folder: str
    home: str
    reports: bool = False


@dataclass(frozen=True)
class Inputs:
    """What the runs of one log, map and calibration share.

    Attributes:
        label: readable, and unique in the batch. files: absolute paths by role. contents: hash of their digests.
    """

    label: str
    log: Path
    files: Mapping[str, Sequence[str]]
    contents: str


@dataclass(frozen=True)
class Variant:
    """What the runs of one configuration share: its table over the shared settings, a hash of what follows, its model."""

    configuration: Configuration
    table: dict[str, Any]
    effective: str
    model: str
    model_content: str


@dataclass(frozen=True)
class Plan:
    """Everything a batch does, in the order in which it does it: runs are made as they are asked for, never all held."""

    manifest: Manifest
    inputs: tuple[Inputs, ...]
    variants: tuple[Variant, ...]
    out: Path
    home: Path
    reports: bool = False

    def __len__(self) -> int:
        return len(self.inputs) * len(self.variants) * len(self.manifest.seeds)

    def asked(self) -> Iterator[Asked]:
        """The runs as the table has them."""
        for name, key, inputs, variant, seed in self._runs():
            calibrations = "+".join(_word(Path(p), self.home) for p in inputs.files["calibrations"])
            yield Asked(
                name, key, self.manifest.job, _word(inputs.log, self.home), _word_of(inputs.files["map"], self.home),
                calibrations, variant.configuration.name, seed, wallkit.__version__, variant.configuration.flat,
            )  # fmt: skip

    def tasks(self) -> Iterator[Task]:
        """The runs as workers get them."""
        for name, key, inputs, variant, seed in self._runs():
            files = inputs.files
            yield Task(
                name, key, str(inputs.log), "".join(files["map"]), tuple(files["calibrations"]),
                "".join(files["truth"]) or self.manifest.truth, variant.model, seed, self.manifest, variant.table,
                str(self.out.absolute() / "runs" / name), str(self.home), self.reports,
            )  # fmt: skip

    def pieces(self, is_wanted: Callable[[str], bool]) -> Iterator[tuple[Task, ...]]:
        """The runs whose keys are wanted; those of one log together."""
        size = PIECE if self.manifest.job == "localize" else ALONE
        wanted = (task for task in self.tasks() if is_wanted(task.key))
        for _, of_log in itertools.groupby(wanted, key=lambda task: task.log):
            while piece := tuple(itertools.islice(of_log, size)):
                yield piece

    def _runs(self) -> Iterator[tuple[str, str, Inputs, Variant, int]]:
        """(name, key, inputs, variant, seed) of every run."""
        for inputs, variant, seed in itertools.product(self.inputs, self.variants, self.manifest.seeds):
            name = f"{inputs.label}/{variant.configuration.name}/seed-{seed}"
            yield name, _key(name, self.manifest, inputs, variant), inputs, variant, seed


def plan_of(read: Read, out: Path, known: Digests, *, reports: bool = False) -> Plan:
    """The runs of a manifest.

    Args:
        known: digests of files by path, remembered from last time; added to.
        reports: whether every run gets its full page, which is no part of the key.

    Raises:
        ConfigError: a word names no file, or a configuration has an unknown setting.
    """
    manifest, folder, where = read.manifest, read.path.absolute().parent, str(read.path)
    is_simulation = manifest.job == "simulate"
    logs = find_logs(manifest.logs, folder, suffixes=(".toml",) if is_simulation else LOGS, where=where)
    _check_words(manifest, folder, where)
    maps, calibrations = manifest.maps or ("",), manifest.calibrations or ("",)
    inputs: dict[str, Inputs] = {}
    for log, name in zip(logs, short_names(logs), strict=True):
        for (map_word, map_name), (cal_words, cal_name) in itertools.product(_named(maps), _named(calibrations)):
            label = name + (f"@{map_name}" if len(maps) > 1 else "") + (f"+{cal_name}" if len(calibrations) > 1 else "")
            if label in inputs:
                raise ConfigError(f"two runs are named '{label}'", where=where, hint="rename a map or a calibration")
            files = _files(manifest, log, map_word, cal_words, folder)
            contents = {role: [digest(Path(p), known) for p in paths] for role, paths in files.items()}
            inputs[label] = Inputs(label, log, files, _hash(contents))
    variants = tuple(_variant(configuration, read, known) for configuration in read.configurations)
    return Plan(manifest, tuple(inputs.values()), variants, out, folder, reports)


def settings_of(manifest: Manifest, table: dict[str, Any]) -> Any:
    """The settings class of the job, filled from a table."""
    return build(Scenario if manifest.job == "simulate" else Config, [Source(table, "[settings]")])[0]


def _variant(configuration: Configuration, read: Read, known: Digests) -> Variant:
    table, effective = _effective(configuration, read)
    model = _file_or_word(configuration.model or read.manifest.model, read.path.absolute().parent)
    return Variant(configuration, table, _hash(_with_content(effective, known)), model, _content_of(model, known))


def _effective(configuration: Configuration, read: Read) -> tuple[dict[str, Any], dict[str, Any]]:
    """What a configuration sets over the shared file, and all that follows from it.

    Raises:
        ConfigError: a setting that does not exist, or of an impossible value.
    """
    if read.manifest.job == "simulate":
        return dict(configuration.table), {"scenario": dict(configuration.table)}
    table = merged(read.base.table if read.base else {}, configuration.table)
    try:
        return table, table_from(settings_of(read.manifest, table))
    except ConfigError as error:
        place = f"{read.path}, configuration '{configuration.name}'"
        raise ConfigError(error.message, where=place, hint=error.hint) from error


def _files(manifest: Manifest, log: Path, map_word: str, cal_words: str, folder: Path) -> dict[str, list[str]]:
    """Absolute paths by role."""
    return {
        "log": [str(log)],
        "map": [str(named_by(map_word, log, folder))] if map_word else [],
        "calibrations": [str(named_by(word, log, folder)) for word in cal_words.split("+") if word],
        "truth": [str(named_by(manifest.truth, log, folder))] if manifest.truth.endswith(".tum") else [],
        "board": [str(p)] if manifest.board and (p := folder / manifest.board).is_file() else [],
        "robot": [str(folder / manifest.robot)] if manifest.robot else [],
    }


def _check_words(manifest: Manifest, folder: Path, where: str) -> None:
    """Files that every run needs are looked for once, before the first.

    Raises:
        ConfigError: one is missing.
    """
    calibrations = [part for words in manifest.calibrations for part in words.split("+")]
    robot = [manifest.robot] if manifest.robot else []
    for what, words in (("map", manifest.maps), ("calibration", calibrations), ("robot", robot)):
        for word in words:
            if not word.startswith(BESIDE) and not (folder / Path(word).expanduser()).exists():
                hint = f"looked from {folder}; {BESIDE}NAME is looked for beside each log"
                raise ConfigError(f"there is no {what} '{word}'", where=where, hint=hint)
    if manifest.job in ("map audit", "simulate") and not manifest.maps:
        raise ConfigError(f"{manifest.job} needs a map", where=where, hint='maps = ["floor.wkmap.urdf"]')
    if manifest.job == "calib verify" and not manifest.calibrations:
        raise ConfigError("calib verify needs a calibration", where=where, hint='calibrations = ["front.toml"]')


def _key(run: str, manifest: Manifest, inputs: Inputs, variant: Variant) -> str:
    """Equal for runs of one name that must have equal results; where files lie is no part of it.

    The name, which has the seed in it, tells apart what is the same twice: a copy of a log, or two names of one setting.
    """
    m = manifest
    words = [run, m.job, m.truth if not m.truth.endswith(".tum") else "", m.init, m.start_s, m.end_s, m.fallback]
    words += [m.board if not inputs.files["board"] else "", m.lidar_sigma, variant.model_content, wallkit.__version__]
    return _hash([words, inputs.contents, variant.effective])


def _hash(value: Any) -> str:
    return hashlib.sha256(json.dumps(value, sort_keys=True, default=str).encode()).hexdigest()[:32]


def _with_content(effective: dict[str, Any], known: Digests) -> dict[str, Any]:
    """Settings that name a model by its content instead."""
    segment = effective.get("segment")
    if not isinstance(segment, dict) or not segment.get("model"):
        return effective
    return {**effective, "segment": {**segment, "model": _content_of(str(segment["model"]), known)}}


def _content_of(words: str, known: Digests) -> str:
    return digest(Path(words), known) if words and Path(words).is_file() else words


def _file_or_word(words: str, folder: Path) -> str:
    return str(folder / words) if words and (folder / words).is_file() else words


def _named(words: Sequence[str]) -> list[tuple[str, str]]:
    """Each word with a short name."""
    names = short_names([Path("/", word.removeprefix(BESIDE)) for word in words]) if any(words) else list(words)
    return list(zip(words, names, strict=True))


def _word_of(paths: Sequence[str], folder: Path) -> str:
    return _word(Path(paths[0]), folder) if paths else ""


def _word(path: Path, folder: Path) -> str:
    """As seen from the manifest, if it lies below."""
    return path.relative_to(folder).as_posix() if path.is_relative_to(folder) else str(path)
