# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""States a second that a log of 10 minutes at 1 kHz is recorded, recovered and verified at.

Beside them the same states without a log, as a ratio within one run, and the memory it all took.
Run: python benchmarks/verify.py [--minutes N]
"""

import argparse
import resource
import tempfile
import time
from pathlib import Path

from linkage_ros.log.reader import LogReader
from linkage_ros.parameters.configuration import configure
from linkage_ros.record import record
from linkage_ros.recovery.recover import recover
from linkage_ros.run.machine import Machine
from linkage_ros.verification.verify import verify


def main():
    """Times them once and prints states a second."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument('--minutes', type=float, default=10, help='of the log')
    seconds = 60 * parser.parse_args().minutes
    configuration = configure({'rate_hz': 1000.0})
    machine = Machine(configuration)
    motion = machine.begin(0)
    with tempfile.TemporaryDirectory() as folder:
        log, saved = Path(folder, 'run.mcap'), Path(folder, 'saved.mcap')

        def verified():
            with LogReader(saved) as reader:
                report = verify(reader)
            assert not report.difference
            return report.states

        def stepped():
            count = round(seconds * 1000)
            for tick in range(count):
                machine.snapshot_at(motion, machine.elapsed(tick))
            return count

        speeds = {}
        for name, work in (
            ('recorded', lambda: record(configuration, log, duration=seconds)),
            ('recovered', lambda: recover(log, saved).messages // len(machine.topics)),
            ('verified', verified),
            ('stepped', stepped),
        ):
            begin = time.perf_counter()
            states = work()
            speeds[name] = states / (time.perf_counter() - begin)
            print(f'{name:10} {states} states, {speeds[name]:8.0f} a second')
        print(f'log        {log.stat().st_size / 1e6:.1f} MB')
    print(f'verified / stepped {speeds["verified"] / speeds["stepped"]:.2f}')
    print(f'memory     {resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1e3:.0f} MB')


if __name__ == '__main__':
    main()
