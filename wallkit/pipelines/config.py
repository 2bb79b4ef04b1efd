"""wallkit.toml, --set words and flags -> the settings of every room."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from wallkit.calib.settings import CalibSettings
from wallkit.core.config import Source, build, read_toml, section, setting, source_from_words
from wallkit.localize.settings import LocalizeSettings
from wallkit.logs.sync import SyncConfig
from wallkit.maps.audit.settings import AuditSettings
from wallkit.maps.grids.fields import MapsSettings
from wallkit.maps.rules.tolerances import Tolerances
from wallkit.pipelines.cameras import ORACLE_MODEL
from wallkit.pipelines.evaluate import EvaluateSettings
from wallkit.pipelines.recorder import ResultSettings
from wallkit.points.filters import PointsSettings
from wallkit.segment.default import DEFAULT
from wallkit.segment.settings import USERS, SegmentSettings

DEFAULT_FILE = Path("wallkit.toml")


@dataclass(frozen=True)
class Config:
    """One table per room; `wallkit config show` prints it."""

    map: str = setting("", "map used when --map is not given; relative to this file")
    ceiling: str = setting("", "ceiling used when --ceiling is not given; relative to this file")
    logs: SyncConfig = section(SyncConfig, "how messages become frames")
    maps: MapsSettings = section(MapsSettings, "how maps become fields")
    rules: Tolerances = section(Tolerances, "where the rules of `wallkit map validate` draw the line")
    audit: AuditSettings = section(AuditSettings, "how `wallkit map audit` compares a map with a log")
    segment: SegmentSettings = section(SegmentSettings, "what the camera sees")
    calib: CalibSettings = section(CalibSettings, "where calibration draws the line")
    points: PointsSettings = section(PointsSettings, "which returns are trusted")
    localize: LocalizeSettings = section(LocalizeSettings, "the filter")
    evaluate: EvaluateSettings = section(EvaluateSettings, "when an estimate is right or wrong")
    results: ResultSettings = section(ResultSettings, "what is written")


@dataclass(frozen=True)
class LoadedConfig:
    """The settings, where each came from, and the file they were read from."""

    config: Config
    origins: dict[str, str]
    path: Path | None


def load_config(path: Path | None, words: Sequence[str] = (), flags: dict[str, Any] | None = None) -> LoadedConfig:
    """Settings from a file (or ./wallkit.toml if there is one), then --set words, then flags.

    Args:
        flags: dotted key -> (value, name of the flag); None values are flags not given.

    Raises:
        ConfigError: see core.config.
    """
    if path is None and DEFAULT_FILE.is_file():
        path = DEFAULT_FILE
    sources: list[Source] = []
    if path is not None:
        sources.append(with_files_beside(read_toml(path), path))
    sources.append(source_from_words(words))
    for key, (value, flag) in (flags or {}).items():
        if value is not None:
            sources.append(_source_of_flag(key, value, flag))
    config, origins = build(Config, sources)
    return LoadedConfig(config, origins, path)


def default_config(words: Sequence[str] = ()) -> LoadedConfig:
    """The defaults with --set words, whatever a ./wallkit.toml says: for results that are to be the same everywhere.

    Raises:
        ConfigError: see core.config.
    """
    config, origins = build(Config, [source_from_words(words)])
    return LoadedConfig(config, origins, None)


def with_files_beside(source: Source, path: Path) -> Source:
    """The source with its map, model and cache named from here, not from the file's folder."""
    table = _beside(_beside(source.table, "map", path), "ceiling", path)
    if isinstance(table.get("segment"), dict):
        segment = _beside(table["segment"], "model", path, but=(DEFAULT, ORACLE_MODEL))
        table = {**table, "segment": _beside(segment, "cache", path, but=(USERS,))}
    return replace(source, table=table)


def _beside(table: Mapping[str, Any], key: str, path: Path, *, but: Sequence[str] = ()) -> dict[str, Any]:
    """The table with the file under a key named from here; words in `but` are no files, nor are addresses."""
    name = table.get(key)
    if not isinstance(name, str) or not name or name in but or "://" in name or Path(name).is_absolute():
        return dict(table)
    return {**table, key: str(path.parent / name)}


def _source_of_flag(key: str, value: Any, flag: str) -> Source:
    table: dict[str, Any] = {}
    inner = table
    *parents, last = key.split(".")
    for parent in parents:
        inner = inner.setdefault(parent, {})
    inner[last] = value
    return Source(table, flag)
