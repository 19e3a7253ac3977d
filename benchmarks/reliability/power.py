# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Measures the data lost in a power cut: the disk stops at random moments at 1 kHz.

linkage_node logs to an ext4 file system in an image file. EXT4_IOC_SHUTDOWN, with which the
developers of ext4 simulate power cuts, shuts the file system down: data in memory is not written.
The file system is mounted again, and the log is recovered and verified. The loss is the time from
the last state in the recovered log to the last state that a subscriber received before the cut.
The exit code is 1 if a run lost more than 2 s, or if a log fails verification. It is 77 if the
file system cannot be created or mounted, which takes root, mkfs.ext4 and a loop device.

    python benchmarks/reliability/power.py --out DIR --number 10     two minutes
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
EARLIEST, LATEST = 2.0, 6.0  # s from the first state to the cut
PROMISED = 2.0  # s, promised limit of the loss
SHUTDOWN, NO_FLUSH = 0x8004587D, struct.pack('I', 2)  # EXT4_IOC_SHUTDOWN without the journal


def stop_disk(folder: Path) -> None:
    """Shuts a file system down at once; unwritten data is lost."""
    number = os.open(folder, os.O_RDONLY)
    fcntl.ioctl(number, SHUTDOWN, NO_FLUSH)
    os.close(number)


def cut(folder: Path, seconds: float) -> dict:
    """Stops the disk some seconds after the first state of a run, and recovers the log."""
    image, disk, heard = folder / 'image', folder / 'disk', folder / 'heard.npy'
    system('truncate', '-s', '64M', image)
    system('mkfs.ext4', '-q', image)
    with mounted(disk, '-o', 'loop', image), listening(DOMAIN, heard) as listener:
        os.sync()  # so that only data of the log is unwritten
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
    given = options(__doc__, number=(10, 'power cuts'), seed=(1, 'seed of the moments'))
    return survey('power', given, cut, (EARLIEST, LATEST), PROMISED)


if __name__ == '__main__':
    sys.exit(main())
