# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""What a power cut costs: the disk stops at random moments at 1 kHz, with all it was not told.

linkage_node logs to an ext4 file system in a file of its own, which is shut down as file system
developers do it to try a power cut: at once, without writing what waits in memory. It is mounted
again, and the log recovered and verified. What is lost is what lies between the last state that
a subscriber received before the cut and the last one in the recovered log. Exit code 1 if that
is more than 2 s at any time, or if a log does not verify; 77 if no disk can be made here, which
takes root.

    python benchmarks/reliability/power.py --out DIR --number 10     in two minutes
"""

import fcntl
import os
import signal
import struct
import sys
import time
from pathlib import Path

import numpy as np
from harness import DOMAIN, listening, mounted, node, options, system, wait_for
from killed import recovered, survey

RATE = 1000.0
EARLIEST, LATEST = 2.0, 6.0  # s of the run in which the disk stops
PROMISED = 2.0  # s
SHUTDOWN, AT_ONCE = 0x8004587D, struct.pack('I', 2)  # EXT4_IOC_SHUTDOWN, without its journal


def stop_disk(folder: Path) -> None:
    """Ends all writing to a disk at once; what was not written never will be."""
    number = os.open(folder, os.O_RDONLY)
    fcntl.ioctl(number, SHUTDOWN, AT_ONCE)
    os.close(number)


def cut(folder: Path, seconds: float) -> dict:
    """A run whose disk stops, and what is left of its log."""
    image, disk, heard = folder / 'image', folder / 'disk', folder / 'heard.npy'
    system('truncate', '-s', '64M', image)
    system('mkfs.ext4', '-q', image)
    with mounted(disk, '-o', 'loop', image), listening(DOMAIN, heard) as listener:
        os.sync()  # the disk as it would be found: made long ago
        with node(DOMAIN, rate_hz=RATE, log=disk / 'run.mcap') as process:
            wait_for(lambda: 'heard' in listener.output)
            time.sleep(seconds)
            stop_disk(disk)
            moment = time.time_ns()
            process.end(signal.SIGKILL)
    states = np.load(heard)[:, 0]
    last = int(states[states <= moment].max())
    with mounted(disk, '-o', 'loop', image):
        found = recovered(disk / 'run.mcap', folder / 'saved.mcap', last)
    return {'cut_after': seconds, **found}


def main() -> int:
    given = options(__doc__, number=(10, 'cuts of the power'), seed=(1, 'of the moments'))
    return survey('power', given, cut, (EARLIEST, LATEST), PROMISED)


if __name__ == '__main__':
    sys.exit(main())
