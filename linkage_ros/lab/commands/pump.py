# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""linkage_chart pump: steady states of a wind pump, for various starts and motor torques."""

import argparse
import os
import signal

from linkage_ros.errors import ConfigurationError
from linkage_ros.lab.output import DPI, folder, progress, save_records
from linkage_ros.lab.pump.analysis import analyse
from linkage_ros.lab.sweep.spread import processes
from linkage_ros.model.wind_pump import WindPump
from linkage_ros.motion.drives import TorqueDrive


def pump(options: argparse.Namespace) -> None:
    """Finds the steady states of a wind pump, draws them, and writes their numbers.

    Args:
        options: Parsed command-line options.

    Raises:
        ConfigurationError: The mechanism is not a wind pump, or the folder cannot be written.
    """
    # On a busy machine, BLAS with several threads takes many times as long for matrices of this
    # size. BLAS reads this variable when a process starts.
    os.environ['OPENBLAS_NUM_THREADS'] = '1'
    with processes(1) as worker:
        handler = signal.signal(signal.SIGINT, signal.SIG_IGN)  # which the worker inherits
        worker.submit(_start)
        signal.signal(signal.SIGINT, handler)
        # The worker starts during these imports, and computes during those of Matplotlib below.
        from linkage_ros.parameters.configuration import load
        from linkage_ros.parameters.descriptions import motor_line
        from linkage_ros.parameters.presets import find_file

        configuration = load(options.params)
        mechanism, drive = configuration.mechanism, configuration.drive
        if not (isinstance(mechanism, WindPump) and isinstance(drive, TorqueDrive)):
            raise ConfigurationError(
                f'{options.params} is not a wind_pump: try the preset wind_pump'
            )
        name = find_file(options.params).stem
        title = f'{name}: {motor_line(drive.motor)}'
        records, picture = (options.out / f'{name}_settled.{end}' for end in ('json', 'png'))
        with folder(options.out):
            analysis = worker.submit(
                analyse, mechanism, drive.motor, speeds=options.speeds, progress=progress
            )
            from linkage_ros.lab.pump.chart import draw_pump, states_table

            found = analysis.result()
            save_records(records, [found.record()])
            draw_pump(found, title, picture, DPI / 2 if options.quick else DPI)
    print(records, *states_table(found), picture, sep='\n')


def _start() -> None:
    """Does nothing; submitting it starts the worker process, which then imports this module."""
