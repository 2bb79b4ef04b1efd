"""What the editing verbs share: lengths, angles and places as words, their options, and how an edit is made and said."""

from __future__ import annotations

import math
import re
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeVar

import click

from wallkit.cli import common

if TYPE_CHECKING:
    from wallkit.pipelines.map.edit import EditedFile

F = TypeVar("F", bound=Callable[..., Any])

FILE = click.argument("file", type=click.Path(path_type=Path), metavar="FILE")
# of more new findings the rest is counted
_SHOWN = 5
_SIGNED = re.compile(r"-[.0-9]")

edit_options = common.options(
    click.option("--dry-run", is_flag=True, help="Print the patch and write nothing."), common.json_option
)


class Numbers(click.ParamType):  # type: ignore[type-arg]  # generic only in click 8.3
    """Numbers with commas between, each with an optional unit: 1.5,200mm or 0,90deg."""

    def __init__(self, *kinds: str, fewest: int | None = None) -> None:
        """kinds: "length" or "angle" for each number; fewest: how many must be there."""
        self.kinds = kinds
        self.fewest = len(kinds) if fewest is None else fewest
        self.name = "number"

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> tuple[float, ...]:
        if isinstance(value, tuple):
            return value
        words = [word.strip() for word in str(value).split(",")]
        if not self.fewest <= len(words) <= len(self.kinds):
            wanted = f"{self.fewest}" if self.fewest == len(self.kinds) else f"{self.fewest} to {len(self.kinds)}"
            self.fail(f"'{value}' has {len(words)} numbers, {wanted} are wanted, with commas between", param, ctx)
        return tuple(self._one(word, kind, param, ctx) for word, kind in zip(words, self.kinds, strict=False))

    def _one(self, word: str, kind: str, param: click.Parameter | None, ctx: click.Context | None) -> float:
        for unit, factor in UNITS[kind].items():
            head = word.removesuffix(unit)
            if head != word or not unit:
                try:
                    number = float(head) * factor
                except ValueError:
                    continue
                if math.isfinite(number):
                    return number if kind == "length" else _angle(head, unit, number, param, ctx)
        usual = "metres, or 900mm, 90cm, 35in" if kind == "length" else "radians, or 90deg"
        raise click.BadParameter(f"'{word}' is no {kind}: {usual}", ctx, param)


class SignedCommand(click.Command):
    """A command whose arguments may be numbers below zero: -90cm is no row of short flags."""

    def parse_args(self, ctx: click.Context, args: list[str]) -> list[str]:
        # a space keeps click from looking for flags, and Numbers strips it
        return super().parse_args(ctx, [f" {arg}" if _SIGNED.match(arg) else arg for arg in args])


def _angle(head: str, unit: str, angle_rad: float, param: click.Parameter | None, ctx: click.Context | None) -> float:
    """An angle that can be meant: 1.57 is a right angle, and 90 forgets its unit."""
    from wallkit.maps.numbers import meant_angle

    if abs(angle_rad) > 2 * math.pi + 1e-2:
        turns = angle_rad / (2 * math.pi)
        unitless = "" if unit == "deg" else f"; plain numbers are radians, degrees are written {head}deg"
        raise click.BadParameter(f"{head} {unit or 'rad'} is {turns:.3g} turns{unitless}", ctx, param)
    meant = None if unit == "deg" else meant_angle(head)
    return angle_rad if meant is None else meant


class Number(Numbers):
    """One of them, within limits."""

    def __init__(
        self, kind: str, *, least: float = -math.inf, most: float = math.inf, above: float = -math.inf
    ) -> None:
        super().__init__(kind)
        self.least, self.most, self.above = least, most, above

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> Any:
        number = value if isinstance(value, float) else super().convert(value, param, ctx)[0]
        if number > self.above and self.least <= number <= self.most:
            return number
        limits = {"above": self.above, "at least": self.least, "at most": self.most}
        said = " and ".join(f"{words} {limit:g}" for words, limit in limits.items() if math.isfinite(limit))
        raise click.BadParameter(f"{number:g} is not {said}", ctx, param)


class Plane(Number):
    """A height, or the word lidar: the map's scan plane."""

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> Any:
        return value if value == "lidar" else super().convert(value, param, ctx)


# longer units before those they end in; the empty one last
UNITS: dict[str, dict[str, float]] = {
    "length": {"mm": 1e-3, "cm": 1e-2, "in": 0.0254, "ft": 0.3048, "m": 1.0, "": 1.0},
    "angle": {"deg": math.pi / 180, "rad": 1.0, "": 1.0},
}
LENGTH = Number("length")
HEIGHT = Number("length", least=0.0)
PLANE = Plane("length")
ANGLE = Number("angle")
POINT = Numbers("length", "length")
POINT_3 = Numbers("length", "length", "length", fewest=2)
POSE = Numbers("length", "length", "angle", fewest=2)
BOX = Numbers("length", "length", "length")


def finish(edited: EditedFile, *, dry_run: bool, as_json: bool) -> None:
    """Write the file, or print the patch; say what changed, and warn of what is wrong now and was not before."""
    if not dry_run:
        edited.write()
    if as_json:
        findings = [
            {"rule": f.code, "severity": f.severity, "message": f.message, "line": f.line, "column": f.column}
            for f in edited.caused
        ]
        written = not dry_run and edited.after != edited.before
        common.emit({"file": edited.path, "written": written, "changes": edited.said, "findings": findings})
    else:
        if dry_run:
            click.echo(edited.patch, nl=False)
        for line in edited.said:
            click.echo(line, err=dry_run)
        if edited.after == edited.before:
            click.echo(f"{edited.path}: nothing changes", err=dry_run)
    for finding in edited.caused[:_SHOWN]:
        common.warn(
            f"{finding.file}:{finding.line}:{finding.column}: new {finding.severity} {finding.code}: {finding.message}"
        )
    if len(edited.caused) > _SHOWN:
        common.warn(f"{len(edited.caused) - _SHOWN} more new findings: wallkit map validate {edited.path}")
