# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Starts programs quickly, by forking a process that has already imported everything."""

import multiprocessing
import os
import runpy
import sys
from contextlib import contextmanager
from importlib import import_module
from pathlib import Path

from ros_harness import PATIENCE

from linkage_ros import cli

_PROCESSES = multiprocessing.get_context('forkserver')
_PROCESSES.set_forkserver_preload(
    [
        'linkage_ros.node.linkage_node',
        *(f'linkage_ros.programs.{name}' for name in ('record', 'replay', 'log_tool')),
        *('linkage_lab.command_line', 'linkage_lab.charts.motion'),
        *('matplotlib.figure', 'matplotlib.backends.backend_agg', 'rerun'),
    ]
)


@contextmanager
def forked(program, *arguments, folder, variables=None):
    """Runs a module, or a script, as a process for the duration of the block.

    Args:
        program: Full name of a module, or path of a script.
        *arguments: Arguments of the program.
        folder: Working folder; the output goes to a file `printed` in it.
        variables: Additional environment variables.

    Yields:
        The process.
    """
    words = [str(word) for word in (program, *arguments)]
    environment = {**os.environ, **(variables or {})}
    process = _PROCESSES.Process(target=_run, args=(words, str(folder), environment))
    process.start()
    try:
        yield process
    finally:
        process.kill()
        process.join()


def _run(words, folder, variables):
    os.environ.clear()
    os.environ.update(variables)
    os.chdir(folder)
    printed = os.open('printed', os.O_WRONLY | os.O_CREAT | os.O_TRUNC)
    os.dup2(printed, 1)
    os.dup2(printed, 2)
    program, *_ = sys.argv = words
    if program.endswith('.py'):
        sys.path.insert(0, str(Path(program).parent))
        runpy.run_path(program, run_name='__main__')
    else:
        sys.exit(cli.run(program, import_module(program).main))


def run_forked(program, *arguments, folder, variables=None):
    """Runs a program; returns its exit code, None if it hangs, and its output."""
    with forked(program, *arguments, folder=folder, variables=variables) as process:
        process.join(PATIENCE)
        return process.exitcode, Path(folder, 'printed').read_text()
