"""`wallkit model`: the words that can follow."""

from __future__ import annotations

import click

from wallkit.cli.model_bench import bench
from wallkit.cli.model_evaluate import evaluate
from wallkit.cli.model_export import export
from wallkit.cli.model_fixture import fixture
from wallkit.cli.model_inspect import inspect
from wallkit.cli.model_quantize import quantize
from wallkit.cli.model_train import train
from wallkit.cli.model_verify import verify


@click.group()
def model() -> None:
    """Judge, compare, shrink and make the segmentation models that look at the camera's pictures."""


for command in (export, inspect, verify, quantize, bench, evaluate, train, fixture):
    model.add_command(command)
