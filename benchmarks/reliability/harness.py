# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Starts ROS processes for the benchmarks, and measures them from outside."""

import argparse
import functools
import json
import os
import signal
import subprocess
import sys
import threading
import time
from collections import Counter
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import NoReturn

import numpy as np

from linkage_ros.settings.configuration import read_values

# The tests use lower domains; two concurrent benchmarks rarely get the same one.
DOMAIN = 90 + os.getpid() % 10
LISTENER = Path(__file__).with_name('listener.py')
NOT_HERE = 77  # exit code if this system or user cannot run the benchmark


@functools.cache
def clear_ports(domain: int) -> None:
    """Removes, once, the shared-memory ports that killed processes left in a domain."""
    first = 7400 + 250 * domain
    for port in range(first, first + 250):
        Path(f'/dev/shm/fastrtps_port{port}').unlink(missing_ok=True)


def environment(domain: int) -> dict[str, str]:
    """Returns environment variables for a process in a domain limited to this machine."""
    clear_ports(domain)
    own = {'ROS_DOMAIN_ID': str(domain), 'ROS_AUTOMATIC_DISCOVERY_RANGE': 'LOCALHOST'}
    return {**os.environ, **own, 'PYTHONUNBUFFERED': '1'}


# The parameters of the followed quadrilateral; the preset would also set its motion.
FOLLOWED = {
    **{k: v for k, v in read_values('quadrilateral').items() if k not in {'rpm', 'rate_hz'}},
    'drive': 'follow',
}


def words(parameters: dict[str, object]) -> list[str]:
    """Returns the ROS arguments that set parameters."""
    pairs = (('-p', f'{name}:={value}') for name, value in parameters.items())
    return ['--ros-args', *(word for pair in pairs for word in pair)]


class Process:
    """A process whose output is kept with times, and whose memory and processor time are measured.

    Attributes:
        pid: Process ID.
        lines: Time of arrival on the monotonic clock, s, and text of each line of output.
    """

    def __init__(self, *arguments: object, domain: int, prefix: tuple[str, ...] = ()) -> None:
        """Starts Python with arguments.

        Args:
            *arguments: Arguments of Python, such as '-m', 'linkage_ros.node.linkage_node'.
            domain: ROS domain.
            prefix: Command before the interpreter, such as 'nsenter' and its options.
        """
        command = [*prefix, sys.executable, *map(str, arguments)]
        self._process = subprocess.Popen(
            command, env=environment(domain), text=True,
            stdout=subprocess.PIPE, stderr=subprocess.STDOUT,
        )  # fmt: skip
        self.pid = self._process.pid
        self.lines: list[tuple[float, str]] = []
        self._reader = threading.Thread(target=self._read, daemon=True)
        self._reader.start()

    def _read(self) -> None:
        assert self._process.stdout
        for line in self._process.stdout:
            self.lines.append((time.monotonic(), line.rstrip()))

    @property
    def output(self) -> str:
        """Output so far."""
        return '\n'.join(text for _, text in self.lines)

    @property
    def alive(self) -> bool:
        """Whether the process is running."""
        return self._process.poll() is None

    def send(self, number: int) -> None:
        """Sends a signal."""
        with suppress(ProcessLookupError):
            self._process.send_signal(number)

    def end(self, number: int = signal.SIGINT, patience: float = 60.0) -> int:
        """Sends a signal and waits for the process to end; returns the exit code."""
        self.send(number)
        code = self._process.wait(patience)
        self._reader.join(5.0)
        return code

    def memory(self) -> float:
        """Memory of the process, MiB, including its share of shared memory."""
        text = Path(f'/proc/{self.pid}/smaps_rollup').read_text()
        return int(text.partition('\nPss:')[2].split()[0]) / 1024

    def by_thread(self) -> Counter[str]:
        """Processor time by thread name, ns, from the scheduler's counters, not from samples."""
        found = Counter[str]()
        for thread in Path(f'/proc/{self.pid}/task').iterdir():
            with suppress(FileNotFoundError):
                name = (thread / 'comm').read_text().strip()
                found[name] += int((thread / 'schedstat').read_text().split()[0])
        return found

    def computed(self) -> float:
        """Processor time of all threads, s."""
        return self.by_thread().total() * 1e-9


@contextmanager
def running(*arguments: object, domain: int, prefix: tuple[str, ...] = ()):
    """Runs a process, which is killed at the end of the context if it still runs."""
    process = Process(*arguments, domain=domain, prefix=prefix)
    try:
        yield process
    finally:
        if process.alive:
            process.end(signal.SIGKILL)


def node(
    domain: int,
    prefix: tuple[str, ...] = (),
    remaps: tuple[tuple[str, str], ...] = (),
    **parameters: object,
):
    """Runs linkage_node with parameters and remapped topics."""
    names = (word for pair in remaps for word in ('-r', ':='.join(pair)))
    arguments = '-m', 'linkage_ros.node.linkage_node', *words(parameters), *names
    return running(*arguments, domain=domain, prefix=prefix)


@contextmanager
def listening(domain: int, path: Path, prefix: tuple[str, ...] = (), topic: str = 'joint_states'):
    """Runs listener.py, which at the end writes stamps and times of arrival to a path."""
    with running(LISTENER, path, topic, domain=domain, prefix=prefix) as process:
        wait_for(lambda: 'listening' in process.output)
        yield process
        process.end()


def tool(*arguments: object) -> subprocess.CompletedProcess[str]:
    """Runs `linkage_log ARGUMENTS` in another process."""
    command = [sys.executable, '-m', 'linkage_ros.programs.log_tool', *map(str, arguments)]
    return subprocess.run(command, capture_output=True, text=True, check=False)


class Diagnostics:
    """Subscribes to /diagnostics in this process.

    Attributes:
        parts: Last level, message and values of each part of each node, by a name such as
            'linkage_node: log'.
    """

    def __init__(self, domain: int) -> None:
        """Subscribes; this process must not have other subscriptions."""
        import rclpy
        from diagnostic_msgs.msg import DiagnosticArray
        from rclpy.executors import SingleThreadedExecutor

        self.parts: dict[str, tuple[int, str, dict[str, str]]] = {}
        os.environ.update(environment(domain))
        self._context = rclpy.Context()
        rclpy.init(context=self._context)
        node = rclpy.create_node(f'diagnosed_{domain}', context=self._context)
        node.create_subscription(DiagnosticArray, '/diagnostics', self._hear, 1000)
        self._executor = SingleThreadedExecutor(context=self._context)
        self._executor.add_node(node)
        threading.Thread(target=self._executor.spin, daemon=True).start()

    def _hear(self, message) -> None:
        self.parts |= {
            status.name: (
                status.level[0], status.message, {v.key: v.value for v in status.values},
            )
            for status in message.status
        }  # fmt: skip

    def __enter__(self) -> 'Diagnostics':
        return self

    def __exit__(self, *error: object) -> None:
        self._executor.shutdown()
        self._context.shutdown()


def unavailable(reason: str) -> NoReturn:
    """Ends a benchmark that this system or user cannot run."""
    print(f'cannot be tried here: {reason}', file=sys.stderr)
    sys.exit(NOT_HERE)


def system(*words: object) -> str:
    """Runs a system command and returns its output; ends the benchmark if the command fails."""
    command = ['env', *map(str, words)]  # env reports a missing command as a failure
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    if done.returncode:
        unavailable(f'{" ".join(command[1:])}: {done.stderr.strip()}')
    return done.stdout


@contextmanager
def mounted(folder: Path, *words: object):
    """Mounts a file system on a folder, which requires root.

    Args:
        folder: The folder, created if it does not exist.
        *words: Options of `mount`, and the device.
    """
    folder.mkdir(exist_ok=True)
    system('mount', *words, folder)
    try:
        yield
    finally:
        # Not lazily: if a process still used the file system, the next mount would return it.
        unmount = ['umount', folder]
        wait_for(lambda: not subprocess.run(unmount, check=False, capture_output=True).returncode)


def wait_for(condition, seconds: float = 30.0) -> float:
    """Waits until a condition holds; returns the time that this took, s.

    Raises:
        TimeoutError: The condition does not hold in time.
    """
    begin = time.monotonic()
    while not condition():
        if time.monotonic() > begin + seconds:
            raise TimeoutError(f'the condition does not hold within {seconds} s')
        time.sleep(0.02)
    return time.monotonic() - begin


def missed(stamps: np.ndarray, rate: float) -> int:
    """Counts the ticks without a state between the first and the last stamp.

    Args:
        stamps: Stamps in increasing order, ns.
        rate: Rate of the ticks, Hz.
    """
    return int((np.rint(np.diff(stamps) * 1e-9 * rate) - 1).sum())


def quantiles(values) -> dict[str, float]:
    """Returns median, 99th percentile and maximum."""
    values = np.asarray(values, float)
    p50, p99 = np.quantile(values, (0.5, 0.99))
    return {'p50': float(p50), 'p99': float(p99), 'max': float(values.max())}


def finish(name: str, out: Path, figures: object, promises: dict[str, bool] | None = None) -> int:
    """Writes the figures of a benchmark to DIR/NAME.json, and prints the broken promises.

    Args:
        name: Name of the benchmark.
        out: Output folder.
        figures: Figures to write.
        promises: Whether each promise is kept, by name.

    Returns:
        The exit code: 1 if a promise is broken, else 0.
    """
    out.mkdir(parents=True, exist_ok=True)
    (out / f'{name}.json').write_text(json.dumps(figures, indent=1) + '\n')
    broken = [words for words, kept in (promises or {}).items() if not kept]
    print(*(f'NOT KEPT: {words}' for words in broken), sep='\n', end='\n' * bool(broken))
    return 1 if broken else 0


def options(doc: str, **numbers: tuple[float, str]) -> argparse.Namespace:
    """Parses the options of a benchmark: --out, and numbers with their defaults and meanings."""
    parser = argparse.ArgumentParser(
        description=doc, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    add = parser.add_argument
    out = Path('reliability')
    add('--out', type=Path, default=out, metavar='DIR', help=f'folder for figures (default {out})')
    for name, (value, words) in numbers.items():
        words = f'{words} (default {value:g})'
        add(f'--{name}', type=type(value), default=value, metavar='N', help=words)
    return parser.parse_args()
