"""What was measured in each epoch -> a CSV and a picture of the losses and of how well classes are found."""

from __future__ import annotations

import csv
import io
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

_FIXED = ("epoch", "train_loss", "val_loss", "mean_iou", "rate", "width")
# classes of which the picture shows a curve, if the model has them; all are in the CSV
_SHOWN = ("wall + partition", "wall", "door", "person", "floor", "toilet", "sink", "mirror")
_INK, _FAINT = "#22252a", "#9aa1ab"


@dataclass(frozen=True)
class Epoch:
    """One epoch. width: of the pictures trained on [px]. ious: by class, and of classes together."""

    number: int
    train_loss: float
    val_loss: float
    mean_iou: float
    rate: float
    width: int
    ious: Mapping[str, float]

    def row(self) -> dict[str, float]:
        """As a line of the CSV."""
        fixed = (self.number, self.train_loss, self.val_loss, self.mean_iou, self.rate, self.width)
        return {**dict(zip(_FIXED, fixed, strict=True)), **{f"iou {name}": iou for name, iou in self.ious.items()}}

    @classmethod
    def of(cls, row: Mapping[str, float]) -> Epoch:
        """The other way."""
        ious = {name.removeprefix("iou "): float(value) for name, value in row.items() if name.startswith("iou ")}
        number, train, val, mean, rate, width = (float(row[name]) for name in _FIXED)
        return cls(int(number), train, val, mean, rate, int(width), ious)


def csv_of(epochs: Sequence[Epoch]) -> str:
    """One line an epoch."""
    text = io.StringIO()
    rows = [epoch.row() for epoch in epochs]
    writer = csv.DictWriter(text, list(rows[0]), lineterminator="\n")
    writer.writeheader()
    for row in rows:
        writer.writerow({name: f"{value:.6g}" for name, value in row.items()})
    return text.getvalue()


def draw_curves(
    epochs: Sequence[Epoch],
    path: Path,
    *,
    title: str,
    measure: str = "intersection over union",
    mean_label: str = "mean of all classes",
) -> None:
    """Losses on the left, how well classes are found on the right, as a PNG.

    Args:
        measure: what `ious` and `mean_iou` are, in words.
    """
    from matplotlib.figure import Figure
    from matplotlib.ticker import MaxNLocator

    figure = Figure(figsize=(11.5, 4.2), dpi=120, layout="constrained")
    losses, overlaps = figure.subplots(1, 2)
    numbers = [epoch.number for epoch in epochs]
    losses.plot(numbers, [epoch.train_loss for epoch in epochs], color=_FAINT, label="training, changed pictures")
    losses.plot(numbers, [epoch.val_loss for epoch in epochs], color=_INK, label="validation")
    losses.set(xlabel="epoch", ylabel="loss", ylim=(0, None))
    losses.legend(frameon=False)
    ious = epochs[-1].ious
    for name in [name for name in _SHOWN if name in ious] or list(ious):
        curve = [epoch.ious.get(name, float("nan")) for epoch in epochs]
        overlaps.plot(numbers, curve, lw=1.4, label=f"{name}  {curve[-1]:.2f}")
    mean = [epoch.mean_iou for epoch in epochs]
    overlaps.plot(numbers, mean, color=_INK, lw=2, ls="--", label=f"{mean_label}  {mean[-1]:.2f}")
    overlaps.set(xlabel="epoch", ylabel=f"{measure}, validation scenes", ylim=(0, 1))
    overlaps.legend(frameon=False, fontsize=9, loc="center left", bbox_to_anchor=(1.01, 0.5))
    for axes in (losses, overlaps):
        axes.xaxis.set_major_locator(MaxNLocator(integer=True))
        axes.grid(alpha=0.25)
        axes.spines[["top", "right"]].set_visible(False)
    figure.suptitle(title, fontsize=11)
    figure.savefig(path)
