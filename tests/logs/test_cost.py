"""What reading costs: memory that does not grow with the file, and imports that stay out of the way."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from tests.logs.drawn import SECOND_NS, START_NS, write, write_bag, write_with_library
from wallkit.core.types import CameraImage

READ = """
import sys
from pathlib import Path
from wallkit.logs.reader import open_log
log = open_log([Path(sys.argv[1])])
assert sum(1 for _ in log.messages()) == int(sys.argv[2])
print(next(line.split()[1] for line in open("/proc/self/status") if line.startswith("VmHWM:")))
"""
WRITERS = {
    "indexed": write,
    "unchunked": lambda path, messages: write_with_library(path, messages, use_chunking=False, with_summary=False),
    "ROS 1 bag": write_bag,
}


def run(*arguments):
    """What another Python prints."""
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join(sys.path)}
    command = [sys.executable, *map(str, arguments)]
    return subprocess.run(command, capture_output=True, text=True, env=environment, timeout=120, check=True).stdout


def peak_memory_mb(path, count):
    """Of a process of its own, as Linux counts it; `getrusage` would also count what the parent held when it forked."""
    return float(run("-c", READ, path, count)) / 1024


@pytest.mark.skipif(not Path("/proc/self/status").exists(), reason="peak memory is read from /proc")
@pytest.mark.parametrize("name", WRITERS)
def test_memory_does_not_grow_with_the_file(tmp_path, name):
    """Ten times the recording, 10 MB against 100 MB, takes the same memory within the size of a few chunks."""
    noise = np.random.default_rng(2).integers(0, 256, 500_000, dtype=np.uint8).tobytes()
    peaks = []
    for count in (20, 200):
        images = [CameraImage(START_NS + k * SECOND_NS, "cam", "jpeg", bytes([k % 256]) + noise) for k in range(count)]
        path = tmp_path / f"{count}.log"
        WRITERS[name](path, [(i.stamp_ns, "/camera", i) for i in images])
        peaks.append(peak_memory_mb(path, count))
        path.unlink()
    assert peaks[1] - peaks[0] < 15


def test_reading_imports_nothing_heavy():
    """Cameras, robot descriptions and Foxglove are only paid for by those who have them."""
    heavy = {"cv2", "yourdfpy", "google.protobuf", "rosbags.typesys.stores", "scipy", "matplotlib", "numba", "av"}
    code = "import sys, wallkit.logs.sync, wallkit.logs.results, wallkit.logs.info; print(*sys.modules)"
    assert heavy & set(run("-c", code).split()) == set()
