# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Starts programs quickly, by forking a process that has already imported everything."""

import atexit
import multiprocessing
import os
import runpy
import signal
import sys
from concurrent.futures import ThreadPoolExecutor
from importlib import import_module
from pathlib import Path
from subprocess import PIPE, STDOUT
from unittest.mock import patch

_PROCESSES = multiprocessing.get_context('forkserver')
# rclpy is imported here, and initialised by each program.
_PROCESSES.set_forkserver_preload(
    [
        'linkage_ros.executables',
        'linkage_ros.node.linkage_node',
        *(
            f'linkage_ros.programs.{name}'
            for name in ('controller', 'log_tool', 'record', 'replay')
        ),
        *('linkage_lab.charts.motion', 'linkage_lab.robots.import_tool', 'linkage_lab.export'),
        *('matplotlib.figure', 'matplotlib.backends.backend_agg', 'rerun', 'scipy.integrate'),
    ]
)
_VARIABLES = dict(os.environ)
# Modules of linkage_lab by program.
LAB = {'chart': 'command_line', 'export': 'export', 'import': 'robots.import_tool'}


class Forked:
    """A running program, with the interface of `subprocess.Popen` as far as tests use it.

    Its stdin is empty, and its stdout is line-buffered.

    Attributes:
        args: Program and arguments.
        pid: ID of the process.
        stdout, stderr: What it prints, as text files; stderr may be None.
    """

    def __init__(self, program, *arguments, env, cwd=None, stderr=PIPE):
        """Starts a program.

        Args:
            program: Name of an executable without `linkage_`, path of a script, or source code of
                several lines.
            *arguments: Arguments of the program.
            env: Environment variables.
            cwd: Working folder; by default, that of this process.
            stderr: PIPE, or STDOUT to combine both outputs.
        """
        self.args = [str(word) for word in (program, *arguments)]
        pipes = [_PROCESSES.Pipe(duplex=False) for _ in range(1 if stderr == STDOUT else 2)]
        writers = [writer for _, writer in pipes]
        self._process = _PROCESSES.Process(
            target=_run, args=(self.args, dict(env), str(cwd or Path.cwd()), *writers)
        )
        # The first start starts the process that forks, which a test's variables must not change.
        with patch.dict(os.environ, _VARIABLES, clear=True):
            self._process.start()
        self.pid = self._process.pid
        self._files = [os.fdopen(os.dup(reader.fileno())) for reader, _ in pipes]
        for end in (end for pipe in pipes for end in pipe):
            end.close()
        self.stdout, self.stderr = (*self._files, None)[:2]

    @property
    def returncode(self):
        """The exit code, minus the number of a signal, or None."""
        return self._process.exitcode

    def poll(self):
        return self.returncode

    def wait(self, timeout=None):
        self._process.join(timeout)
        return self.returncode

    def send_signal(self, number):
        if self.poll() is None:
            os.kill(self.pid, number)

    def terminate(self):
        self.send_signal(signal.SIGTERM)

    def kill(self):
        self.send_signal(signal.SIGKILL)

    def communicate(self, timeout=None):
        """Waits for the end; returns the rest of stdout and stderr.

        Raises:
            TimeoutError: The program does not end within a time, s.
        """
        pool = ThreadPoolExecutor(len(self._files))
        texts = [pool.submit(file.read) for file in self._files]
        pool.shutdown(wait=False)
        out, err = (*(text.result(timeout) for text in texts), None)[:2]
        self.wait(timeout)
        return out, err

    def close(self):
        """Kills the program if it runs, and closes its pipes."""
        self.kill()
        self._process.join()
        for file in self._files:
            file.close()


def _run(words, variables, folder, stdout, stderr=None):
    os.environ.clear()
    os.environ.update(variables)
    os.chdir(folder)
    os.dup2(stdout.fileno(), 1)
    os.dup2((stderr or stdout).fileno(), 2)
    sys.stdout, sys.stderr = (os.fdopen(number, 'w', 1, closefd=False) for number in (1, 2))
    sys.argv = words
    try:
        sys.exit(_call(words[0]))
    finally:
        atexit._run_exitfuncs()


def _call(program):
    if '\n' in program:
        return exec(compile(program, 'program', 'exec'), {'__name__': '__main__'})
    if program.endswith('.py'):
        sys.path.insert(0, str(Path(program).parent))
        return runpy.run_path(program, run_name='__main__') and None
    if program in LAB:
        return import_module(f'linkage_lab.{LAB[program]}').main()
    return getattr(import_module('linkage_ros.executables'), program)()
