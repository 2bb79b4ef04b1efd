"""TOML files and --set words -> frozen dataclasses, remembering where each value came from.

A settings class is a frozen dataclass whose fields are made by `setting` (a plain value with its limits), `choice` (the
name of a registered function) or `component` (a registered dataclass with settings of its own). Defaults live in the
class and nowhere else; a later source beats an earlier one: default < file < --set < flag.
"""

from __future__ import annotations

import dataclasses
import importlib
import math
import re
import tomllib
import types
import typing
from collections.abc import Mapping, Sequence
from dataclasses import MISSING, dataclass, field, fields, is_dataclass
from pathlib import Path
from typing import Any, TypeVar

from wallkit.errors import ConfigError, closest

T = TypeVar("T")
Registry = Mapping[str, Any]

# ------------------------------------------------------------------------------------- declaring settings


def setting(default: Any, doc: str, *, low: float | None = None, high: float | None = None) -> Any:
    """A field with a default, one line of documentation and an inclusive range; the unit is the name's suffix."""
    return field(default=default, metadata={"doc": doc, "low": low, "high": high})


def choice(registry: Registry, default: str, doc: str) -> Any:
    """A field that names one entry of a registry of functions."""
    return field(default=default, metadata={"doc": doc, "choice": registry})


def component(registry: Registry, default: str, doc: str) -> Any:
    """A field that holds one of the registry's settings dataclasses, chosen in TOML by its key `name`."""
    return field(default_factory=lambda: registry[default](), metadata={"doc": doc, "registry": registry})


def section(cls: type[T], doc: str) -> T:
    """A field that is a table of its own."""
    return field(default_factory=cls, metadata={"doc": doc})


def tables(cls: type[Any], doc: str) -> Any:
    """A field that is a list of tables, [[like this]], each a settings class of its own; empty by default."""
    return field(default=(), metadata={"doc": doc, "tables": cls})


def pick(registry: Registry, name: str, *, what: str) -> Any:
    """The registry's entry of that name, or a user's own as "package.module:Name".

    Raises:
        ConfigError: no such entry, or the module or name cannot be imported.
    """
    if name in registry:
        return registry[name]
    module, _, attribute = name.partition(":")
    if not attribute:
        raise ConfigError(f"no {what} is called '{name}'", hint=closest(name, registry))
    try:
        return getattr(importlib.import_module(module), attribute)
    except (ImportError, AttributeError) as error:
        raise ConfigError(f"cannot load {what} '{name}': {error}", hint="write it as package.module:Name") from error


def name_in(registry: Registry, entry: object) -> str:
    """The name an entry is registered under: of a class for its instances, else of the entry itself."""
    for name, registered in registry.items():
        if registered is entry or registered is type(entry):
            return name
    cls = type(entry)
    return f"{cls.__module__}:{cls.__qualname__}"


# ------------------------------------------------------------------------------------- reading settings


@dataclass(frozen=True)
class Source:
    """A table of settings and where it stands, so that every complaint can name the line."""

    table: Mapping[str, Any]
    label: str
    text: str = ""

    def place(self, key: Sequence[str]) -> str:
        """`file:line` of a dotted key, as far as the text tells."""
        line = line_of(self.text, key) if self.text else None
        return f"{self.label}:{line}" if line else self.label


def read_toml(path: Path) -> Source:
    """A TOML file as a source.

    Raises:
        ConfigError: it cannot be read or is not TOML (with the line).
    """
    try:
        text = path.read_text(encoding="utf-8")
    except (OSError, UnicodeDecodeError) as error:
        raise ConfigError(
            f"cannot read the settings: {error}", where=path, hint="name another file with --config"
        ) from error
    try:
        return Source(tomllib.loads(text), str(path), text)
    except tomllib.TOMLDecodeError as error:
        raise ConfigError(
            f"not valid TOML: {error}", where=path, hint="strings need quotes; see https://toml.io"
        ) from error


def source_from_words(words: Sequence[str], label: str = "--set") -> Source:
    """`key.sub=value` words as a source; a value is TOML, or a bare string.

    Raises:
        ConfigError: a word without '='.
    """
    table: dict[str, Any] = {}
    for word in words:
        key, equals, value = word.partition("=")
        if not equals or not key:
            raise ConfigError(
                f"'{word}' is not KEY=VALUE", where=label, hint="for example --set localize.particles=5000"
            )
        _set_deep(table, key.strip().split("."), _value_from_word(value))
    return Source(table, label)


def build(cls: type[T], sources: Sequence[Source]) -> tuple[T, dict[str, str]]:
    """An instance of a settings class from sources, the later ones winning, and the origin of every key.

    Returns:
        The settings, and {dotted key: "default" | "file:line" | label of the source}.

    Raises:
        ConfigError: an unknown key, a value of the wrong type or out of range; with place and closest name.
    """
    origins: dict[str, str] = {}
    return _build(cls, [(s, s.table) for s in sources], (), origins), origins


def table_from(settings: Any) -> dict[str, Any]:
    """The nested table (JSON- and TOML-able) that would build these settings again."""
    table: dict[str, Any] = {}
    for f in fields(settings):
        value = getattr(settings, f.name)
        if is_dataclass(value):
            sub = table_from(value)
            if "registry" in f.metadata:
                sub = {"name": name_in(f.metadata["registry"], value), **sub}
            table[f.name] = sub
        elif isinstance(value, tuple):
            table[f.name] = [table_from(item) if is_dataclass(item) else item for item in value]
        elif isinstance(value, Path):
            table[f.name] = str(value)
        else:
            table[f.name] = value
    return table


def line_of(text: str, key: Sequence[str]) -> int | None:
    """Line (from 1) where a dotted key is set in TOML text; None when it cannot be found.

    `tomllib` keeps no positions, so headers and keys are looked up again in the text; the last match wins.
    """
    header: tuple[str, ...] = ()
    found = None
    for number, line in enumerate(text.splitlines(), start=1):
        stripped = line.strip()
        if match := re.match(r"\[+\s*([^\]]+?)\s*\]+", stripped):
            header = _split_key(match[1])
            if header[: len(key)] == tuple(key):
                found = found or number
        elif match := re.match(r"([A-Za-z0-9_\-.\"' ]+?)\s*=", stripped):
            here = (*header, *_split_key(match[1]))
            if here == tuple(key) or (len(here) > len(key) and here[: len(key)] == tuple(key)):
                found = number
    return found


# -------------------------------------------------------------------------------------------- details


def _split_key(dotted: str) -> tuple[str, ...]:
    return tuple(part.strip().strip("\"'") for part in dotted.split("."))


def _value_from_word(word: str) -> Any:
    """A TOML value; numbers as people type them (.5), and anything else as the text it is."""
    try:
        return tomllib.loads(f"v = {word}")["v"]
    except tomllib.TOMLDecodeError:
        pass
    try:
        return float(word)
    except ValueError:
        return word


def _set_deep(table: dict[str, Any], key: list[str], value: Any) -> None:
    for part in key[:-1]:
        inner = table.get(part)
        if not isinstance(inner, dict):
            # `--set a.b=name --set a.b.x=1`: the component's bare name becomes its table
            inner = {"name": inner} if isinstance(inner, str) else {}
            table[part] = inner
        table = inner
    table[key[-1]] = value


def _build(
    cls: type[T], sources: list[tuple[Source, Mapping[str, Any]]], key: tuple[str, ...], origins: dict[str, str]
) -> T:
    hints = typing.get_type_hints(cls)
    known = {f.name: f for f in fields(cls)}  # type: ignore[arg-type]
    values: dict[str, Any] = {}
    for source, table in sources:
        for name in table:
            if name not in known:
                where = source.place((*key, name))
                table_name = f"[{'.'.join(key)}] has" if key else "there is"
                raise ConfigError(f"{table_name} no setting '{name}'", where=where, hint=closest(name, known))
    for name, f in known.items():
        here = (*key, name)
        given = [(s, t[name]) for s, t in sources if name in t]
        if "registry" in f.metadata:
            values[name] = _build_component(f, given, here, origins)
        elif "tables" in f.metadata:
            values[name] = _build_tables(f.metadata["tables"], given, here, origins)
        elif is_dataclass(hints[name]):
            for source, value in given:
                if not isinstance(value, Mapping):
                    raise ConfigError(f"'{'.'.join(here)}' is a table, not {value!r}", where=source.place(here))
            values[name] = _build(hints[name], given, here, origins)
        elif given:
            source, value = given[-1]
            values[name] = _checked(value, hints[name], f, source, here)
            origins[".".join(here)] = source.place(here)
        else:
            origins[".".join(here)] = "default"
    where = next((s.place(key) for s, _ in reversed(sources)), "")
    try:
        return cls(**values)
    except ConfigError as error:
        raise ConfigError(error.message, where=error.where or where, hint=error.hint) from error
    except ValueError as error:
        raise ConfigError(str(error), where=where, hint=f"see `wallkit config show` for [{'.'.join(key)}]") from error


def _build_component(
    f: dataclasses.Field[Any], given: list[tuple[Source, Any]], here: tuple[str, ...], origins: dict[str, str]
) -> Any:
    registry = f.metadata["registry"]
    default = f.default_factory() if f.default_factory is not MISSING else f.default
    name, origin = name_in(registry, default), "default"
    tables: list[tuple[Source, Mapping[str, Any]]] = []
    for source, value in given:
        table = {"name": value} if isinstance(value, str) else value
        if not isinstance(table, Mapping):
            raise ConfigError(f"'{'.'.join(here)}' is a name or a table, not {value!r}", where=source.place(here))
        if "name" in table and table["name"] != name:
            # settings of the component named before do not belong to the new one
            name, tables = table["name"], []
        if "name" in table:
            origin = source.place((*here, "name"))
        tables.append((source, {k: v for k, v in table.items() if k != "name"}))
    try:
        cls = pick(registry, name, what=here[-1])
    except ConfigError as error:
        raise ConfigError(error.message, where=origin, hint=error.hint) from error
    origins[".".join((*here, "name"))] = origin
    return _build(cls, tables, here, origins)


def _build_tables(
    cls: type[Any], given: list[tuple[Source, Any]], here: tuple[str, ...], origins: dict[str, str]
) -> tuple[Any, ...]:
    """One instance per table of the last source that has any; a source replaces the list as a whole."""
    origins[".".join(here)] = "default"
    if not given:
        return ()
    source, rows = given[-1]
    if not isinstance(rows, list) or not all(isinstance(row, Mapping) for row in rows):
        raise ConfigError(f"'{'.'.join(here)}' is a list of tables, not {rows!r}", where=source.place(here))
    origins[".".join(here)] = source.place(here)
    return tuple(_build(cls, [(source, row)], here, {}) for row in rows)


def _checked(value: Any, hint: Any, f: dataclasses.Field[Any], source: Source, here: tuple[str, ...]) -> Any:
    key = ".".join(here)
    try:
        value = _converted(value, hint)
    except TypeError as error:
        raise ConfigError(f"'{key}' is {value!r}, but must be {error}", where=source.place(here)) from error
    if registry := f.metadata.get("choice"):
        try:
            pick(registry, value, what=here[-1])
        except ConfigError as error:
            raise ConfigError(error.message, where=source.place(here), hint=error.hint) from error
    low, high = f.metadata.get("low"), f.metadata.get("high")
    for number in _flat(value):
        if isinstance(number, (int, float)) and not isinstance(number, bool):
            # written so that NaN fails
            if low is not None and not number >= low:
                raise ConfigError(f"'{key}' is {value!r}, but must be at least {low}", where=source.place(here))
            if high is not None and not number <= high:
                raise ConfigError(f"'{key}' is {value!r}, but must be at most {high}", where=source.place(here))
            if not math.isfinite(number) and number not in (low, high):
                raise ConfigError(f"'{key}' is {value!r}, but must be a finite number", where=source.place(here))
    return value


def _flat(value: Any) -> list[Any]:
    return [inner for v in value for inner in _flat(v)] if isinstance(value, tuple) else [value]


def _converted(value: Any, hint: Any) -> Any:
    """The value as the annotated type, or TypeError naming the type in words."""
    origin, args = typing.get_origin(hint), typing.get_args(hint)
    if origin in (typing.Union, types.UnionType):
        plain = [a for a in args if a is not type(None)]
        return None if value in ("none", None) and len(plain) < len(args) else _converted(value, plain[0])
    if origin is typing.Literal:
        if value not in args:
            raise TypeError("one of " + ", ".join(str(a) for a in args))
        return value
    if origin is tuple:
        if not isinstance(value, list | tuple) or (args[-1] is not ... and len(value) != len(args)):
            raise TypeError("a list" if args[-1] is ... else f"a list of {len(args)} values")
        inner = [args[0]] * len(value) if args[-1] is ... else args
        return tuple(_converted(v, a) for v, a in zip(value, inner, strict=True))
    if hint is bool and isinstance(value, bool):
        return value
    if hint is int and isinstance(value, int) and not isinstance(value, bool):
        return value
    if hint is float and isinstance(value, int | float) and not isinstance(value, bool):
        return float(value)
    if hint is str and isinstance(value, str):
        return value
    if hint is Path and isinstance(value, str):
        return Path(value)
    words = {bool: "true or false", int: "a whole number", float: "a number", str: "text", Path: "a path"}
    raise TypeError(words.get(hint, str(hint)))
