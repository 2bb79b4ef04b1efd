"""The command line: every word that can follow `wallkit`."""

from __future__ import annotations

import click

import wallkit
from wallkit.cli.batch import batch
from wallkit.cli.bench.group import bench
from wallkit.cli.calib.group import calib
from wallkit.cli.ceiling import ceiling
from wallkit.cli.common import CONTEXT, WallkitGroup
from wallkit.cli.config import completion, config
from wallkit.cli.dataset import dataset
from wallkit.cli.demo import demo
from wallkit.cli.doctor import doctor
from wallkit.cli.evaluate import compare, evaluate, report
from wallkit.cli.localize import localize
from wallkit.cli.log import log
from wallkit.cli.map.group import map_group
from wallkit.cli.model.group import model
from wallkit.cli.simulate.group import simulate


@click.group(cls=WallkitGroup, context_settings=CONTEXT)
@click.version_option(wallkit.__version__, message="%(prog)s %(version)s")
def main() -> None:
    """Finds where an indoor robot is, from recorded LiDAR + camera logs and a map of walls.

    \b
    Start here:
      wallkit demo                                   the main job on the sample inside the package
      wallkit log info log.mcap                      what is in a log, and can it be localized?
      wallkit localize log.mcap --map floor.yaml     where was the robot?

    Exit codes: 0 good, 1 bad verdict, 2 could not do it, 3 done but data was lost, 4 cannot tell, 130 interrupted.
    """


COMMANDS = (
    *(demo, log, map_group, calib, ceiling, model, localize, evaluate, compare, report, simulate, dataset),
    *(batch, bench, config, completion, doctor),
)
for command in COMMANDS:
    main.add_command(command)
