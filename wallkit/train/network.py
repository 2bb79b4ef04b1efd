"""The network: an RGB picture -> scores of every class at half its resolution.

A residual encoder halves the picture five times; a light decoder of the U-Net kind (Ronneberger et al., MICCAI 2015) brings
what the whole picture says back to a quarter of the resolution, and a sub-pixel head (Shi et al., CVPR 2016) to half.
Plain 3x3 convolutions: on CPUs they are faster than depthwise ones of equal quality, in training and after it.
"""

from __future__ import annotations

from dataclasses import dataclass

import torch
from torch import Tensor, nn
from torch.nn import functional

# pixels per score, along each side
STRIDE = 2
# what the encoder needs of a picture's sides
MULTIPLE = 16
# of the pictures of rooms that it is trained on, about; inside the network, so that callers give plain RGB in [0, 1]
_MEAN, _SCALE = 0.45, 0.25


@dataclass(frozen=True)
class Widths:
    """Channels at 1/2, 1/4, 1/8, 1/16 and 1/32 of the picture's size, and of the decoder."""

    levels: tuple[int, int, int, int, int] = (16, 32, 48, 96, 144)
    decoder: int = 48
    fine: int = 32


class SemanticNet(nn.Module):
    """Scores (B, C, H / 2, W / 2) of pictures (B, 3, H, W) in [0, 1]."""

    def __init__(self, classes: int, widths: Widths = Widths()) -> None:
        super().__init__()
        w, d = widths.levels, widths.decoder
        self.stem = _conv(3, w[0], stride=2)
        self.down = nn.ModuleList(
            nn.Sequential(_conv(w[k], w[k + 1], stride=2), *(Residual(w[k + 1]) for _ in range(1 if k == 0 else 2)))
            for k in range(4)
        )
        self.context = Context(w[4])
        self.across = nn.ModuleList(nn.Conv2d(w[k], d, 1) for k in (2, 3, 4))
        self.mix = nn.ModuleList(_conv(d, d) for _ in range(2))
        self.narrow = nn.Conv2d(d, w[1], 1)
        self.last = _conv(w[1], widths.fine)
        self.head = nn.Conv2d(widths.fine, 4 * classes, 1)

    def forward(self, images: Tensor) -> Tensor:
        x = self.stem((images - _MEAN) / _SCALE)
        levels = []
        for stage in self.down:
            x = stage(x)
            levels.append(x)
        x = self.across[2](self.context(x))
        for k in (1, 0):
            x = self.mix[k](_grown(x, levels[k + 1]) + self.across[k](levels[k + 1]))
        x = self.last(_grown(self.narrow(x), levels[0]) + levels[0])
        return functional.pixel_shuffle(self.head(x), 2)


class Residual(nn.Module):
    """Two convolutions beside a short cut (He et al., CVPR 2016)."""

    def __init__(self, width: int) -> None:
        super().__init__()
        self.first = _conv(width, width)
        self.second = nn.Sequential(nn.Conv2d(width, width, 3, padding=1, bias=False), nn.BatchNorm2d(width))

    def forward(self, x: Tensor) -> Tensor:
        return functional.relu(x + self.second(self.first(x)))


class Context(nn.Module):
    """Every place learns what the picture as a whole shows (squeeze and excitation, Hu et al., CVPR 2018)."""

    def __init__(self, width: int) -> None:
        super().__init__()
        self.squeeze = nn.Conv2d(width, width // 4, 1)
        self.excite = nn.Conv2d(width // 4, width, 1)

    def forward(self, x: Tensor) -> Tensor:
        whole = x.mean((2, 3), keepdim=True)
        return x * torch.sigmoid(self.excite(functional.relu(self.squeeze(whole))))


def parameters_of(net: nn.Module) -> int:
    """How many numbers are learnt."""
    return sum(parameter.numel() for parameter in net.parameters())


def _conv(inputs: int, outputs: int, *, stride: int = 1) -> nn.Sequential:
    return nn.Sequential(
        nn.Conv2d(inputs, outputs, 3, stride=stride, padding=1, bias=False), nn.BatchNorm2d(outputs), nn.ReLU()
    )


def _grown(x: Tensor, like: Tensor) -> Tensor:
    return functional.interpolate(x, size=like.shape[2:], mode="bilinear", align_corners=False)
