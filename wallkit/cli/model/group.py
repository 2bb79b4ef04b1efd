"""`wallkit model`: the words that can follow."""

from __future__ import annotations

import click

from wallkit.cli.model.bench import bench
from wallkit.cli.model.evaluate import evaluate
from wallkit.cli.model.export import export
from wallkit.cli.model.fixture import fixture
from wallkit.cli.model.inspect import inspect
from wallkit.cli.model.quantize import quantize
from wallkit.cli.model.train import train
from wallkit.cli.model.verify import verify


@click.group()
def model() -> None:
    """Judge, compare, shrink and make the segmentation models that look at the camera's pictures."""


for command in (export, inspect, verify, quantize, bench, evaluate, train, fixture):
    model.add_command(command)
