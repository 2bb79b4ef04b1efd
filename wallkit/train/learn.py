"""Labelled pictures -> a trained network: epochs of batches, a running mean of the weights, and a row of figures each epoch.

Each picture of each epoch is changed by a generator of its own, so a run that was stopped goes on as if it had not been.
"""

from __future__ import annotations

import os
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import torch
from torch import Tensor, nn
from torch.nn import functional

from wallkit.core.types import Float64Array, Int64Array
from wallkit.train.augment import Changes, changed
from wallkit.train.balance import balancing
from wallkit.train.curves import Epoch
from wallkit.train.network import MULTIPLE, STRIDE, SemanticNet
from wallkit.train.pictures import UNLABELLED, Pictures, class_weights, pixel_counts, showing_odds
from wallkit.train.score import confusion, mean_iou, scores_of


@dataclass(frozen=True)
class Lesson:
    """How it is trained.

    Attributes:
        epochs: each as many pictures as there are, drawn by `showing_odds`. size: width, height the network is for.
        rate, decay: AdamW's (Loshchilov and Hutter, ICLR 2019); the rate rises and falls as one cycle (Smith, 2018).
        averaged: share of the running mean of the weights that each step keeps.
        growth: (until this share of the epochs, pictures are so large); small ones first saves half of the time.
        dice: weight of the overlap loss beside cross entropy.
        threads: of PyTorch; more than there are free cores waste time by waiting for each other.
    """

    epochs: int = 30
    size: tuple[int, int] = (256, 192)
    batch: int = 8
    rate: float = 3e-3
    decay: float = 0.03
    averaged: float = 0.998
    growth: tuple[tuple[float, float], ...] = ((0.55, 0.75), (1.0, 1.0))
    dice: float = 0.5
    threads: int = 1
    seed: int = 0
    changes: Changes = Changes()


@dataclass(frozen=True, eq=False)
class Learnt:
    """What was learnt.

    Attributes:
        net: in evaluation mode. epochs: the figures of every one.
        matrix: (C, C) confusion on the validation pictures. added: (C,) to the scores of each class, see `balance`.
    """

    net: SemanticNet
    epochs: tuple[Epoch, ...]
    matrix: Int64Array
    added: Float64Array


def learn(
    train: Pictures,
    val: Pictures,
    names: Sequence[str],
    lesson: Lesson,
    checkpoint: Path,
    *,
    told: Callable[[Epoch], None] = lambda _: None,
) -> Learnt:
    """Trains, and writes a checkpoint after every epoch; goes on from the one that is there.

    Args:
        told: hears of every epoch that is done.
    """
    torch.manual_seed(lesson.seed)
    torch.set_num_threads(lesson.threads)
    device = torch.device("cuda" if torch.cuda.is_available() else "cpu")
    net = SemanticNet(len(names)).to(device, memory_format=torch.channels_last)
    mean = SemanticNet(len(names)).to(device, memory_format=torch.channels_last).eval()
    mean.load_state_dict(net.state_dict())
    counts = pixel_counts(train.classes, len(names))
    odds = showing_odds(counts)
    weights = torch.tensor(class_weights(counts), dtype=torch.float32, device=device)
    steps = -(-len(train) // lesson.batch)
    optimiser = torch.optim.AdamW(_groups(net, lesson.decay), lr=lesson.rate)
    cycle = torch.optim.lr_scheduler.OneCycleLR(
        optimiser, max_lr=lesson.rate, total_steps=lesson.epochs * steps + 1, pct_start=0.12
    )
    state = _State(net, mean, optimiser, cycle)
    done = state.load(checkpoint) if checkpoint.exists() else []
    other = list(names).index("other") if "other" in names else UNLABELLED
    for number in range(len(done), lesson.epochs):
        size = _size(lesson, number)
        losses = []
        net.train()
        for step, (images, classes) in enumerate(_batches(train, odds, lesson, number, size, other)):
            loss = _step(net, images.to(device), classes.to(device), weights, lesson, number + step)
            optimiser.zero_grad(set_to_none=True)
            loss.backward()
            nn.utils.clip_grad_norm_(net.parameters(), 5.0)
            optimiser.step()
            cycle.step()
            _average(mean, net, min(lesson.averaged, (number * steps + step + 1) / (number * steps + step + 10)))
            losses.append(float(loss.detach()))
        val_loss, matrix = judged(mean, val, len(names), weights, lesson)
        found = {score.name: score.iou for score in scores_of(matrix, names)}
        rate = float(cycle.get_last_lr()[0])
        epoch = Epoch(number + 1, float(np.mean(losses)), val_loss, mean_iou(matrix), rate, size[0], found)
        done.append(epoch)
        state.save(checkpoint, done)
        told(epoch)
    added = balance(mean, val, tuple(names), lesson.batch)
    _, matrix = judged(mean, val, len(names), weights, lesson)
    return Learnt(mean.cpu().eval(), tuple(done), matrix, added)


@torch.no_grad()
def balance(net: SemanticNet, pictures: Pictures, names: tuple[str, ...], batch: int) -> Float64Array:
    """(C,) what `balancing` finds on every ninth score of pictures; the network's last layer is changed by it."""
    net.eval()
    device = net.head.weight.device
    scores, truth = [], []
    for start in range(0, len(pictures), batch):
        given = net(_tensor(pictures.images[start : start + batch]).to(device))[..., ::3, ::3]
        scores.append(given.movedim(1, -1).reshape(-1, len(names)).float().cpu().numpy())
        truth.append(pictures.classes[start : start + batch, :: 3 * STRIDE, :: 3 * STRIDE].ravel())
    added = balancing(np.concatenate(scores), np.concatenate(truth), names)
    # a class has one channel for each pixel under a score of the decoder
    net.head.bias += torch.from_numpy(added).to(net.head.bias).repeat_interleave(STRIDE * STRIDE)
    return added


@torch.no_grad()
def judged(
    net: SemanticNet, pictures: Pictures, count: int, weights: Tensor, lesson: Lesson
) -> tuple[float, Int64Array]:
    """The loss on pictures, and (C, C) their confusion at full resolution."""
    net.eval()
    device = weights.device
    matrix = np.zeros((count, count), dtype=np.int64)
    losses = []
    for start in range(0, len(pictures), lesson.batch):
        images = _tensor(pictures.images[start : start + lesson.batch]).to(device)
        classes = pictures.classes[start : start + lesson.batch]
        with _autocast(device):
            scores = net(images)
        scores = scores.float()
        truth = torch.from_numpy(classes[:, ::STRIDE, ::STRIDE].astype(np.int64)).to(device)
        losses.append(float(_loss(scores, truth, weights, lesson.dice)))
        full = functional.interpolate(scores, size=classes.shape[1:], mode="bilinear", align_corners=False)
        matrix += confusion(full.argmax(1).to(torch.uint8).cpu().numpy(), classes, count)
    return float(np.mean(losses)), matrix


# -------------------------------------------------------------------------------------------- a step


def _step(net: SemanticNet, images: Tensor, classes: Tensor, weights: Tensor, lesson: Lesson, number: int) -> Tensor:
    """The loss of a batch. Which of the pixels under a score is its truth takes turns, so that none of them is favoured."""
    row, column = divmod(number % (STRIDE * STRIDE), STRIDE)
    with _autocast(images.device):
        scores = net(images)
    return _loss(scores.float(), classes[:, row::STRIDE, column::STRIDE], weights, lesson.dice)


def _loss(scores: Tensor, truth: Tensor, weights: Tensor, dice: float) -> Tensor:
    """Weighted cross entropy, and one minus the overlap of the classes that are there (Milletari et al., 3DV 2016)."""
    known = truth != UNLABELLED
    entropy = functional.cross_entropy(scores, torch.where(known, truth, -100), weight=weights, ignore_index=-100)
    if dice == 0:
        return entropy
    # every fourth pixel says as much of the overlap
    scores, truth, known = scores[..., ::2, ::2], truth[:, ::2, ::2], known[:, ::2, ::2]
    odds = scores.softmax(1) * known[:, None]
    is_it = functional.one_hot(torch.where(known, truth, 0), scores.shape[1]).movedim(-1, 1) * known[:, None]
    both, either = (odds * is_it).sum((0, 2, 3)), (odds + is_it).sum((0, 2, 3))
    there = is_it.sum((0, 2, 3)) > 0
    overlap = (2 * both[there] + 1) / (either[there] + 1)
    return entropy + dice * (1 - overlap.mean())


@torch.no_grad()
def _average(mean: SemanticNet, net: SemanticNet, kept: float) -> None:
    for old, new in zip(mean.state_dict().values(), net.state_dict().values(), strict=True):
        if old.dtype.is_floating_point:
            old.lerp_(new, 1 - kept)
        else:
            old.copy_(new)


def _groups(net: SemanticNet, decay: float) -> list[dict[str, Any]]:
    """Weights of convolutions decay; biases and normalisations do not."""
    matrices = [p for p in net.parameters() if p.ndim > 1]
    rest = [p for p in net.parameters() if p.ndim <= 1]
    return [{"params": matrices, "weight_decay": decay}, {"params": rest, "weight_decay": 0.0}]


def _autocast(device: torch.device) -> torch.autocast:
    """bfloat16 where the processor multiplies it: twice as fast, and no worse in the end."""
    able = device.type == "cuda" or torch.cpu._is_avx512_bf16_supported()
    return torch.autocast(device.type, dtype=torch.bfloat16, enabled=able)


# -------------------------------------------------------------------------------------------- batches


def _size(lesson: Lesson, epoch: int) -> tuple[int, int]:
    """Width, height of an epoch's pictures."""
    share = (epoch + 1) / lesson.epochs
    gain = next((gain for until, gain in lesson.growth if share <= until + 1e-9), 1.0)
    width, height = (max(MULTIPLE, round(side * gain / MULTIPLE) * MULTIPLE) for side in lesson.size)
    return width, height


def _batches(
    pictures: Pictures, odds: Float64Array, lesson: Lesson, epoch: int, size: tuple[int, int], other: int
) -> Iterator[tuple[Tensor, Tensor]]:
    """Changed pictures and their labels; the next batches are made while one is learnt from."""
    order = np.random.default_rng([lesson.seed, epoch]).choice(len(pictures), len(pictures), p=odds)
    starts = range(0, len(order) - lesson.batch + 1, lesson.batch) or range(1)

    def make(start: int) -> tuple[Tensor, Tensor]:
        made = []
        for place, number in enumerate(order[start : start + lesson.batch].tolist(), start):
            rng = np.random.default_rng([lesson.seed, epoch, place])
            made.append(
                changed(rng, pictures.images[number], pictures.classes[number], size, lesson.changes, other=other)
            )
        images = _tensor(np.stack([image for image, _ in made]))
        return images, torch.from_numpy(np.stack([classes for _, classes in made]).astype(np.int64))

    workers = max(1, (os.cpu_count() or 2) // 2)
    with ThreadPoolExecutor(workers) as pool:
        waiting = [pool.submit(make, start) for start in starts[: workers + 1]]
        for start in [*starts[workers + 1 :], *[-1] * len(waiting)]:
            ready = waiting.pop(0).result()
            if start >= 0:
                waiting.append(pool.submit(make, start))
            yield ready


def _tensor(images: np.ndarray) -> Tensor:
    """(B, 3, H, W) in [0, 1], with channels last in memory: five times as fast on a CPU."""
    return torch.from_numpy(images).permute(0, 3, 1, 2).float().div_(255)


# -------------------------------------------------------------------------------------------- checkpoint


@dataclass(frozen=True, eq=False)
class _State:
    net: SemanticNet
    mean: SemanticNet
    optimiser: torch.optim.Optimizer
    cycle: torch.optim.lr_scheduler.LRScheduler

    def save(self, path: Path, epochs: Sequence[Epoch]) -> None:
        partial = path.with_suffix(".partial")
        parts = {name: getattr(self, name).state_dict() for name in ("net", "mean", "optimiser", "cycle")}
        torch.save({**parts, "epochs": [epoch.row() for epoch in epochs]}, partial)
        partial.replace(path)

    def load(self, path: Path) -> list[Epoch]:
        """Puts everything back as it was; the epochs that were done."""
        kept = torch.load(path, weights_only=True)
        for name in ("net", "mean", "optimiser", "cycle"):
            getattr(self, name).load_state_dict(kept[name])
        return [Epoch.of(row) for row in kept["epochs"]]
