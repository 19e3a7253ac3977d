# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Shared code of the command-line programs: options, signals, one-line errors, progress.

Public: other packages may import this module.
"""

import argparse
import atexit
import io
import itertools
import json
import math
import os
import re
import signal
import sys
import textwrap
import threading
import time
import warnings
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from functools import partial
from typing import Any, NamedTuple, NoReturn, TypeAlias

from linkage_ros import __version__
from linkage_ros.errors import (
    ConfigurationError,
    LinkageError,
    ParameterWarning,
    import_failure,
    one_line,
)
from linkage_ros.files import path_exists
from linkage_ros.quantities import Quantity, did_you_mean, shown

# Option names, `Quantity` of a numeric option, and keyword arguments for argparse.
Option: TypeAlias = tuple[tuple[str, ...], Quantity | None, dict[str, Any]]

OVERWRITE: Option = (
    ('--overwrite',), None, {'action': 'store_true', 'help': 'replace existing files'},
)  # fmt: skip
JSON: Option = (
    ('--json',), None, {'action': 'store_true', 'help': 'print JSON instead of text'},
)  # fmt: skip
STOPPED_BY_USER = 130
_POLL_SECONDS = 0.05  # between checks for a request to stop
# After a request to stop, s: before a second signal makes it urgent, and for each thread after it.
_ORDERLY_SECONDS, _URGENT_SECONDS = 1.0, 0.5


class Parser(argparse.ArgumentParser):
    """Argument parser that reports an error in one line, without the usage text.

    Values may be negative angles such as -85deg.
    """

    def __init__(self, **options: Any) -> None:
        """Creates the parser; see `argparse.ArgumentParser`."""
        super().__init__(**options)
        # Python before 3.14 takes -85deg and -1e-3 for options; this is its expression.
        self._negative_number_matcher = re.compile(r'-\.?\d')

    def error(self, message: str) -> NoReturn:
        """Prints the error, what was probably meant, and ends the program with exit code 2."""
        choice = re.search("invalid choice: '(.*)' \\(choose from (.*)\\)", message)
        hint = did_you_mean(choice[1], re.findall(r"[^', ]+", choice[2])) if choice else ''
        if message.startswith('unrecognized arguments'):
            hint = _quotes_hint(sys.argv[1:])
        self.exit(2, f'{self.prog}: {one_line(message + hint)}; see {self.prog} --help\n')


def _quotes_hint(words: Sequence[str]) -> str:
    """Suggests quotes if words of a command line together are the name of a file."""
    for start, end in itertools.combinations(range(len(words) + 1), 2):
        name = ' '.join(words[start:end])
        if end - start > 1 and path_exists(name):
            return f'; write quotes around a name with spaces: "{name}"'
    return ''


def make_parser(
    name: str, purpose: str, examples: tuple[str, ...], notes: str = ''
) -> argparse.ArgumentParser:
    """Creates a parser with --version and examples.

    Args:
        name: Name of the executable.
        purpose: One-sentence description of the executable.
        examples: Command lines, without the name of the executable.
        notes: Text to print below the examples.
    """
    parser = Parser(prog=name, **_described(name, purpose, examples, notes))
    parser.add_argument('--version', action='version', version=f'%(prog)s {__version__}')
    return parser


def add_options(parser: Any, options: Iterable[Option]) -> None:
    """Adds options to a parser or to an argument group.

    Args:
        parser: Parser or argument group.
        options: Options to add. For an option with a quantity, help and error messages include the
            range and the unit; its `note` is appended to the help.
    """
    for names, quantity, others in options:
        given = dict(others)
        if quantity:
            given['type'] = partial(_read_number, names[-1], quantity)
            given['help'] = f'{quantity.meaning}, {quantity.span}{given.pop("note", "")}'
        parser.add_argument(*names, **given)


def _read_number(name: str, quantity: Quantity, text: str) -> object:
    value: object = text
    with suppress(ValueError):
        value = int(text) if quantity.kind == 'whole' else float(text)
    try:
        return quantity.clean(name, value)
    except ConfigurationError as error:
        raise argparse.ArgumentTypeError(f'{shown(text)}: must be {quantity.valid}') from error


class Command(NamedTuple):
    """A command of an executable, such as `info` of linkage_log.

    Attributes:
        run: Function that runs the command with its parsed options; returns an exit code or None.
        purpose: One-sentence description of the command.
        examples: Command lines, without the names of executable and command.
        options: The options and arguments of the command.
        usage: Usage line; by default, argparse generates it.
    """

    run: Callable[[argparse.Namespace], int | None]
    purpose: str
    examples: tuple[str, ...]
    options: tuple[Option, ...]
    usage: str | None = None


def add_commands(parser: argparse.ArgumentParser, commands: Mapping[str, Command]) -> None:
    """Adds commands to a parser; the parsed options hold the command's function as `run`."""
    parsers = parser.add_subparsers(dest='command', required=True, metavar='COMMAND')
    for name, (run, purpose, examples, options, usage) in commands.items():
        words = _described(f'{parser.prog} {name}', purpose, examples)
        command = parsers.add_parser(name, help=purpose, usage=usage, **words)
        add_options(command, options)
        command.set_defaults(run=run)


def _described(
    name: str, purpose: str, examples: tuple[str, ...], notes: str = ''
) -> dict[str, Any]:
    """Returns the arguments of a parser for its description and examples."""
    lines = ['examples:', *(f'  {name} {example}'.rstrip() for example in examples), '', notes]
    sentence = f'{purpose[0].upper()}{purpose[1:].rstrip(".")}.'
    return {
        'description': textwrap.fill(sentence, 80),
        'epilog': '\n'.join(lines).rstrip(),
        'formatter_class': argparse.RawDescriptionHelpFormatter,
    }


class Stop:
    """A request to end the program, set by a signal, for which the main thread waits.

    The signals are SIGINT, SIGTERM, SIGQUIT and, unless it is ignored (as under nohup), SIGHUP.
    Python handles signals in the main thread, and promptly only if it runs or waits in Python.
    Therefore, other threads do the work, or the main thread calls `wait` between its steps.

    The main thread polls, because a threading.Event would deadlock if a signal arrived at the
    start of a wait, and Linux may deliver a signal to another thread, which does not wake it.

    If the end takes longer than a second, a second signal makes it urgent: threads that hang are
    abandoned.

    Attributes:
        signal: Name of the signal that requested the end; empty if none did.
    """

    def __init__(self, *, handles_signals: bool = True) -> None:
        """Handles the signals.

        Args:
            handles_signals: False for a request that only `set` makes.
        """
        self._set_at = math.inf  # monotonic time of the request, s
        self._is_repeated, self.signal = False, ''
        self._signals = list[signal.Signals]()
        if handles_signals:
            self._handle_signals()

    def _handle_signals(self) -> None:
        is_kept = signal.getsignal(signal.SIGHUP) == signal.SIG_IGN
        self._signals = [signal.SIGINT, signal.SIGTERM, signal.SIGQUIT]
        self._signals += [] if is_kept else [signal.SIGHUP]
        for number in self._signals:
            signal.signal(number, self._request)
            # Python restores its own handlers at exit, and a second Ctrl-C would kill the process.
            atexit.register(signal.signal, number, signal.SIG_IGN)

    def _request(self, number: int, _: object) -> None:
        if self.is_set():
            self._is_repeated = True
            for each in self._signals:  # nothing more can be requested
                signal.signal(each, signal.SIG_IGN)
        else:
            self.signal = signal.Signals(number).name
        self.set()

    def set(self) -> None:
        """Requests the end of the program."""
        self._set_at = min(self._set_at, time.monotonic())

    def is_set(self) -> bool:
        """Returns whether the end of the program was requested."""
        return self._set_at < math.inf

    def is_urgent(self) -> bool:
        """Returns whether a second signal requested that hanging threads be abandoned.

        It takes effect after one second, because a launch may send the same signal twice.
        """
        return self._is_repeated and time.monotonic() > self._set_at + _ORDERLY_SECONDS

    def wait(self, timeout: float | None = None) -> bool:
        """Waits, at most for a time, s, until the end is requested; returns whether it is."""
        end = math.inf if timeout is None else time.monotonic() + timeout
        while not self.is_set() and (left := end - time.monotonic()) > 0:
            time.sleep(min(left, _POLL_SECONDS))
        return self.is_set()

    def join(self, thread: threading.Thread, timeout: float = math.inf) -> None:
        """Waits for a thread to end, at most for a time, s; abandons it if the end is urgent."""
        end = time.monotonic() + timeout
        while thread.is_alive() and (left := end - time.monotonic()) > 0 and not self.is_urgent():
            thread.join(min(left, _POLL_SECONDS))
        if self.is_urgent():
            thread.join(_URGENT_SECONDS)


def run(name: str, command: Callable[[], int | None]) -> int:
    """Runs a program and reports its errors on stderr.

    Args:
        name: Name of the executable, for error messages.
        command: Function that runs the program; returns an exit code, or None for 0.

    Returns:
        The exit code: 2 for an error that the user can correct, 130 after Ctrl-C.
    """
    if isinstance(sys.stdout, io.TextIOWrapper):
        # The terminal's encoding may lack characters that occur in paths and logs.
        sys.stdout.reconfigure(errors='backslashreplace')
    code = 0
    try:
        with _warnings_as_notes():
            code = command() or 0
        if sys.stdout is not None:  # None if the process was started with stdout closed
            sys.stdout.flush()
    except KeyboardInterrupt:
        print(file=sys.stderr)
        return STOPPED_BY_USER
    except BrokenPipeError:  # the reader of stdout has closed the pipe
        _discard_stdout()
    except (LinkageError, ImportError, OSError) as error:  # stdout may be a file on a full disk
        words = import_failure(error) if isinstance(error, ImportError) else error
        print_error(name, words)
        if isinstance(error, OSError):
            _discard_stdout()
        return 2
    return code


@contextmanager
def _warnings_as_notes() -> Iterator[None]:
    """Prints each warning about a parameter file once, as a note on stderr."""
    with warnings.catch_warnings():
        warnings.simplefilter('always', ParameterWarning)
        show, printed = warnings.showwarning, set[str]()  # a program may read a file twice

        def show_note(
            message: Warning | str, category: type[Warning], *where: Any, **more: Any
        ) -> None:
            if not issubclass(category, ParameterWarning):
                show(message, category, *where, **more)
            elif str(message) not in printed:
                printed.add(str(message))
                print_error('note', message)

        warnings.showwarning = show_note
        yield


def print_notes(notes: Iterable[str]) -> None:
    """Prints each note on stderr, once; standard output is for results."""
    for line in dict.fromkeys(filter(None, notes)):
        print_error('note', line)


def print_json(value: object) -> None:
    """Prints a value as JSON; numbers that are not finite are null."""
    print(json.dumps(_finite(value), indent=1, allow_nan=False))


def _finite(value: Any) -> Any:
    if isinstance(value, float):
        return float(value) if math.isfinite(value) else None
    if isinstance(value, Mapping):
        return {name: _finite(each) for name, each in value.items()}
    return [*map(_finite, value)] if isinstance(value, (list, tuple)) else value


def leave(code: int) -> int:
    """Exits immediately, without Python's clean-up, if the process uses rclpy.

    During the clean-up, Fast DDS may hang or crash (Fast-DDS#6513), and a second Ctrl-C would
    cause an error. Without rclpy, the exit code is returned.
    """
    if 'rclpy' not in sys.modules:
        return code
    for stream in (sys.stdout, sys.stderr):
        with suppress(OSError, ValueError, AttributeError):  # the stream may be closed or broken
            stream.flush()
    os._exit(code)


def _discard_stdout() -> None:
    """Redirects a failing stdout to /dev/null, so that Python does not fail again at exit."""
    try:
        sys.stdout.flush()
    except OSError:
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())


def print_error(name: str, error: object) -> None:
    """Prints an error as one line on stderr, if stderr is open, with its `lines`, if any."""
    text = str(error) if isinstance(error, LinkageError) else one_line(str(error))
    if sys.stderr is not None:
        with suppress(OSError):
            print(f'{name}: {text}', file=sys.stderr)


def progress_bar(
    items: Iterable[Any] | None = None, *, wanted: bool = True, **options: Any
) -> Any:
    """Creates a progress bar on stderr, if it is a terminal; the bar disappears when it is done.

    Args:
        items: Items that the bar yields; None if the caller updates the bar.
        wanted: Whether to show the bar at all.
        options: Options of tqdm, such as desc, total, unit and delay.
    """
    from tqdm import tqdm  # a third of the time of `--help`

    disable = None if wanted else True  # None: no bar if stderr is not a terminal
    # By default, tqdm would not update the bar for slow items after fast ones.
    options = {'leave': False, 'mininterval': 1.0, 'miniters': 1, **options}
    return tqdm(items, disable=disable, **options)


@contextmanager
def waiting(words: str) -> Iterator[None]:
    """Shows a line on stderr while the block runs, if stderr is a terminal."""
    # Return the cursor to the start of the line, so that other output overwrites it.
    with progress_bar(desc=words, bar_format='{desc}\r'):
        yield


@contextmanager
def working(words: str, after: float = 1.0) -> Iterator[None]:
    """Shows a line while the block runs, as `waiting` does, if it takes longer than `after`, s."""
    is_done = threading.Event()

    def show() -> None:
        if not is_done.wait(after):
            with waiting(words):
                is_done.wait()

    line = threading.Thread(target=show, daemon=True)
    line.start()
    try:
        yield
    finally:
        is_done.set()
        line.join()
