# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Exceptions of linkage_ros.

Attributes of an exception are for programs. Its message is for users: one line that states the
value, the valid range and a remedy.
"""

from collections.abc import Iterator
from contextlib import contextmanager, nullcontext

_LONGEST = 600  # largest length of an error message, and of a mistake in a list, characters
MOST_LISTED = 20  # number of mistakes that a message lists; it counts the others


def printable(text: str) -> str:
    """Escapes non-printable characters of a text, which may come from untrusted files."""
    if text.isprintable():
        return text
    parts = (c if c.isprintable() else c.encode('unicode_escape').decode() for c in text)
    return ''.join(parts)


def shortened(text: str, longest: int) -> str:
    """Shortens a text to a number of characters: its start and end are joined by ' ... '."""
    if len(text) <= longest:
        return text
    return f'{text[: longest // 2]} ... {text[5 - longest // 2 :]}'


def one_line(text: str) -> str:
    """Formats a text from untrusted files for an error message: a line of 600 characters."""
    words = shortened(' '.join(text.split()), _LONGEST)
    return shortened(printable(words), _LONGEST)


# For each module: the feature that requires it, and the arguments of `pip install`.
_LIBRARIES = {
    'mcap': ('logs need mcap', 'mcap lz4 zstandard'),
    'lz4': ('logs need lz4', 'mcap lz4 zstandard'),
    'zstandard': ('logs need zstandard', 'mcap lz4 zstandard'),
    # A new rerun-sdk installs NumPy 2, which is incompatible with Ubuntu's SciPy and Matplotlib.
    'rerun': ('the viewer needs rerun-sdk', 'rerun-sdk scipy matplotlib'),
    'scipy': ('records of a motion under a torque need scipy', 'scipy'),
    'yaml': ('parameter files need PyYAML', 'PyYAML'),
}


_UBUNTU = 'with the ROS 2 of Ubuntu, use a virtual environment (docs/ros2.md)'


def missing_library(name: str, reason: str = '') -> str:
    """Returns one line on a missing library: what requires it, and how to install it.

    Args:
        name: Name of the library, without submodules.
        reason: Reason why it cannot be imported although it is installed; empty if it is not.
    """
    state = f'is too old or damaged ({reason})' if reason else 'is not installed'
    if name.startswith('rcl') or name.endswith('_msgs'):
        return (
            f'ROS 2 topics need {name}, which {state}: source ROS 2 Jazzy, or, without '
            "ROS 2 on Linux x86-64, pip install 'linkage_ros[ros]'"
        )
    need, packages = _LIBRARIES.get(name, (f'this program needs {name}', name))
    return f'{need}, which {state}: pip install --upgrade {packages}; {_UBUNTU}'


def import_failure(error: ImportError) -> str:
    """Returns one line on a failed import, with the cause and a remedy.

    The error names a module, or none if a library fails while it is loaded.
    """
    module, reason = error.name or '', one_line(str(error))
    name = module.partition('.')[0]
    if not name:
        return f'a library does not fit the others ({reason}): install it again; {_UBUNTU}'
    if name == __name__.partition('.')[0]:
        return f'{name} is incomplete or mixes two versions ({reason}): install it again'
    is_absent = isinstance(error, ModuleNotFoundError) and module == name
    return missing_library(name, '' if is_absent else reason)


class ParameterWarning(UserWarning):
    """A parameter file that can be used, but probably contains a mistake."""


class LinkageError(Exception):
    """Base class of all exceptions of this package; its message is one line."""

    def __str__(self) -> str:
        return one_line(super().__str__())


class ConfigurationError(LinkageError, ValueError):
    """A parameter, file or argument has an invalid value.

    Attributes:
        mistakes: The messages of all mistakes, if there are several.
        lines: Lines that follow the message: the list of several mistakes, or what to write in a
            parameter file instead; usually empty.
    """

    mistakes: tuple[str, ...] = ()
    lines: str = ''

    def __str__(self) -> str:
        return '\n'.join(filter(None, (super().__str__(), self.lines)))


class Mistakes:
    """Collects errors of a configuration, so that they are reported together.

    As a context manager, it collects the error that its block raises.
    """

    def __init__(self) -> None:
        self._errors: list[ConfigurationError] = []
        self._more = 0

    def count(self, number: int) -> None:
        """Counts further errors, which are not explained; at least two others must be."""
        self._more += number

    def add(self, words: str) -> None:
        """Collects a mistake that has no error yet."""
        self._errors.append(ConfigurationError(words))

    def add_new(self, error: ConfigurationError) -> None:
        """Collects the mistakes of an error that are not collected yet."""
        known = self._descriptions()
        for words in error.mistakes or (str(error),):
            if words not in known:
                self.add(words)

    def _descriptions(self) -> tuple[str, ...]:
        """Returns the mistakes of all collected errors."""
        return tuple(words for error in self._errors for words in error.mistakes or (str(error),))

    def __bool__(self) -> bool:
        """Whether there is a mistake."""
        return bool(self._errors)

    def __enter__(self) -> None:
        """Begins a block."""

    def __exit__(self, _: object, error: BaseException | None, __: object) -> bool:
        """Collects the error of the block, if it is a ConfigurationError."""
        if isinstance(error, ConfigurationError):
            self._errors.append(error)
            return True
        return False

    def check(self) -> None:
        """Raises the collected errors.

        Raises:
            ConfigurationError: There is an error. If there are several, the message lists them,
                one in a line.
        """
        if len(self._errors) == 1:
            raise self._errors[0]
        if not self._errors:
            return
        mistakes = self._descriptions()
        total = len(mistakes) + self._more
        error = ConfigurationError(f'{total} mistakes:')
        lines = [f'({number}) {words}' for number, words in enumerate(mistakes[:MOST_LISTED], 1)]
        more = total - len(lines)
        if more:
            lines.append(f'and {more} more')
        error.lines = '\n'.join(lines)
        error.mistakes = mistakes
        raise error


@contextmanager
def in_file(path: str) -> Iterator[None]:
    """Adds the name of a file, as the user gave it, to the errors of a block.

    Raises:
        ConfigurationError: The block raised this error.
    """
    try:
        yield
    except ConfigurationError as error:
        located = type(error)(f'{path}: {str(error).removesuffix(error.lines)}')
        located.lines = error.lines
        located.mistakes = tuple(f'{path}: {words}' for words in error.mistakes)
        raise located from error


@contextmanager
def in_linkage(name: str) -> Iterator[None]:
    """Adds the name of a linkage to the errors of a block; nothing if it is empty.

    Raises:
        ConfigurationError: The block raised this error.
    """
    with in_file(name) if name else nullcontext():
        yield


class MechanismError(ConfigurationError):
    """The mechanism is invalid, or does not support the requested operation."""


class UnreachableError(LinkageError, ValueError):
    """No finite state exists at the requested coordinates, for example if the loop cannot close.

    Attributes:
        crank_angle: The first requested crank angle that is rejected, rad; NaN if the coordinate
            is the slider's position.
        arcs: Reachable arcs of the crank angle as pairs (start, end), rad; empty if unknown.
    """

    def __init__(
        self, message: str, *, crank_angle: float, arcs: tuple[tuple[float, float], ...]
    ) -> None:
        super().__init__(message)
        self.crank_angle = crank_angle
        self.arcs = arcs


class MotionError(LinkageError):
    """A motion under a torque or along a law cannot continue.

    Attributes:
        time: Time at which the motion ends, s.
        coordinates: Coordinates at that time: crank angle, rad, and for a wind pump also the
            slider position, m.
    """

    def __init__(self, message: str, *, time: float, coordinates: tuple[float, ...]) -> None:
        super().__init__(message)
        self.time = time
        self.coordinates = coordinates


class LogError(LinkageError):
    """A log cannot be written or read."""


class ViewerError(LinkageError):
    """The viewer cannot be started or reached."""
