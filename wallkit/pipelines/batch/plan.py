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
from wallkit.pipelines.batch.copies import Copied, named_in, seen
from wallkit.pipelines.batch.files import (
    BESIDE,
    LOGS,
    Digests,
    digest,
    find_logs,
    is_there,
    named_by,
    path_of,
    short_names,
)
from wallkit.pipelines.batch.manifest import Configuration, Manifest, Read, merged
from wallkit.pipelines.batch.remote import bare, is_address
from wallkit.pipelines.config import Config
from wallkit.segment.default import model_path
from wallkit.simulate.scenario import Scenario

# so many runs over one log go to one process, which reads it once; the next go to whoever is free
PIECE = 16
ALONE = 1


@dataclass(frozen=True)
class Task:
    """One run as a worker gets it: everything it needs, and nothing that is not a plain value.

    Attributes:
        name, key: of the run. log, map, calibrations, truth: absolute paths, addresses, or words; "" for none.
        remote: those of its files that have to be fetched.
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
    remote: tuple[Copied, ...] = ()
    reports: bool = False


@dataclass(frozen=True)
class Inputs:
    """What the runs of one log, map and calibration share.

    Attributes:
        label: readable, and unique in the batch. files: absolute paths or addresses by role. contents: hash of their
            digests. remote: those at addresses.
    """

    label: str
    log: str
    files: Mapping[str, Sequence[str]]
    contents: str
    remote: tuple[Copied, ...] = ()


@dataclass(frozen=True)
class Variant:
    """What the runs of one configuration share: its table over the shared settings, a hash of what follows, its model.

    Attributes:
        remote: the model, if it has to be fetched.
    """

    configuration: Configuration
    table: dict[str, Any]
    effective: str
    model: str
    model_content: str
    remote: tuple[Copied, ...] = ()


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
            calibrations = "+".join(_word(p, self.home) for p in inputs.files["calibrations"])
            yield Asked(
                name, key, self.manifest.job, _word(inputs.log, self.home), _word_of(inputs.files["map"], self.home),
                calibrations, variant.configuration.name, seed, wallkit.__version__, variant.configuration.flat,
            )  # fmt: skip

    def tasks(self) -> Iterator[Task]:
        """The runs as workers get them."""
        for name, key, inputs, variant, seed in self._runs():
            files = inputs.files
            yield Task(
                name, key, inputs.log, "".join(files["map"]), tuple(files["calibrations"]),
                "".join(files["truth"]) or self.manifest.truth, variant.model, seed, self.manifest, variant.table,
                str(self.out.absolute() / "runs" / name), str(self.home), (*inputs.remote, *variant.remote), self.reports,
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
    copied: dict[str, Copied] = {}
    for log, name in zip(logs, short_names(logs), strict=True):
        for (map_word, map_name), (cal_words, cal_name) in itertools.product(_named(maps), _named(calibrations)):
            label = name + (f"@{map_name}" if len(maps) > 1 else "") + (f"+{cal_name}" if len(calibrations) > 1 else "")
            if label in inputs:
                raise ConfigError(f"two runs are named '{label}'", where=where, hint="rename a map or a calibration")
            files = _files(manifest, log, map_word, cal_words, folder)
            addresses = {p: role for role, paths in files.items() for p in paths if is_address(p)}
            for url in addresses.keys() - copied.keys():
                copied[url] = seen(url, is_map=addresses[url] == "map", known=known)
            contents = {
                role: [copied[p].content if p in copied else digest(Path(p), known) for p in paths]
                for role, paths in files.items()
            }
            contents["in the map"] = [digest(path, known) for p in files["map"] for path in _named_in(p)]
            inputs[label] = Inputs(label, log, files, _hash(contents), tuple(copied[url] for url in addresses))
    variants = tuple(_variant(configuration, read, known) for configuration in read.configurations)
    return Plan(manifest, tuple(inputs.values()), variants, out, folder, reports)


def settings_of(manifest: Manifest, table: dict[str, Any]) -> Any:
    """The settings class of the job, filled from a table."""
    return build(Scenario if manifest.job == "simulate" else Config, [Source(table, "[settings]")])[0]


def _variant(configuration: Configuration, read: Read, known: Digests) -> Variant:
    table, effective = _effective(configuration, read)
    words = configuration.model or read.manifest.model
    model = _file_of(words, read.path.absolute().parent) or words
    remote = (seen(model, is_map=False, known=known),) if is_address(model) else ()
    content = remote[0].content if remote else _content_of(model, known)
    return Variant(configuration, table, _hash(_with_content(effective, known)), model, content, remote)


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


def _files(manifest: Manifest, log: str, map_word: str, cal_words: str, folder: Path) -> dict[str, list[str]]:
    """Absolute paths or addresses by role."""
    board = _file_of(manifest.board, folder)
    return {
        "log": [log],
        "map": [named_by(map_word, log, folder)] if map_word else [],
        "calibrations": [named_by(word, log, folder) for word in cal_words.split("+") if word],
        "truth": [named_by(manifest.truth, log, folder)] if _is_file_of_truth(manifest.truth) else [],
        "board": [board] if board else [],
        "robot": [named_by(manifest.robot, log, folder)] if manifest.robot else [],
    }


def _check_words(manifest: Manifest, folder: Path, where: str) -> None:
    """Files that every run needs are looked for once, before the first.

    Raises:
        ConfigError: one is missing.
    """
    calibrations = [part for words in manifest.calibrations for part in words.split("+")]
    robot = [manifest.robot] if manifest.robot else []
    # a truth that is missing fails its run; an address that nobody can read is told now
    others = [w for w in (manifest.truth, manifest.board, manifest.model) if is_address(w)]
    for what, words in (("map", manifest.maps), ("calibration", calibrations), ("robot", robot), ("file", others)):
        for word in words:
            if not word.startswith(BESIDE) and not is_there(word, folder):
                hint = "" if is_address(word) else f"looked from {folder}; "
                hint += f"{BESIDE}NAME is looked for beside each log"
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
    words = [run, m.job, m.truth if not _is_file_of_truth(m.truth) else "", m.init, m.start_s, m.end_s, m.fallback]
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
    """The digest of a model's file, the package's own too; words that name none (the oracle) as they are."""
    path = model_path(Path(words)) if words else None
    return digest(path, known) if path is not None and path.is_file() else words


def _file_of(words: str, folder: Path) -> str:
    """The address or absolute path of a file, "" if the words name none."""
    if not words or is_address(words):
        return words
    path = folder / path_of(words)
    return str(path) if path.is_file() else ""


def _is_file_of_truth(word: str) -> bool:
    return bare(word).endswith(".tum")


def _named_in(map_file: str) -> list[Path]:
    """The files on this machine that a map here is made of, beside its own."""
    path = Path(map_file)
    if is_address(map_file) or not path.is_file():
        return []
    return [path.parent / name for name in named_in(path.read_bytes())]


def _named(words: Sequence[str]) -> list[tuple[str, str]]:
    """Each word with a short name."""
    names = short_names([_rooted(word.removeprefix(BESIDE)) for word in words]) if any(words) else list(words)
    return list(zip(words, names, strict=True))


def _rooted(word: str) -> str:
    return word if is_address(word) else str(Path("/", word))


def _word_of(files: Sequence[str], folder: Path) -> str:
    return _word(files[0], folder) if files else ""


def _word(file: str, folder: Path) -> str:
    """As seen from the manifest, if it lies below."""
    path = Path(file)
    return path.relative_to(folder).as_posix() if not is_address(file) and path.is_relative_to(folder) else file
