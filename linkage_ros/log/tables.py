# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Joint states and points of logs and other bags as arrays, and as tables for a spreadsheet."""

import csv
import math
from array import array
from collections.abc import Callable, Iterable, Iterator, Sequence
from itertools import chain, repeat
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from linkage_ros.errors import LogError
from linkage_ros.files import is_same_file, require_new, text_output
from linkage_ros.log.bag import Bag, BagTopic
from linkage_ros.log.reader import LogReader
from linkage_ros.mechanism.parts import FRAME_NAME
from linkage_ros.messages.cdr import decode_joint_state, decode_point, decode_trajectory
from linkage_ros.messages.joints import link_rows
from linkage_ros.messages.templates import QUANTITIES
from linkage_ros.messages.topics import (
    JOINT_STATE,
    JOINT_STATES,
    JOINT_TRAJECTORY,
    MEASURED_JOINT_STATES,
    MECHANISM_STATE,
    POINT_STAMPED,
)
from linkage_ros.numeric import Array
from linkage_ros.quantities import shown
from linkage_ros.settings.configuration import Linkage
from linkage_ros.settings.joints import measured_from
from linkage_ros.units import NS_PER_S

_TYPES = JOINT_STATE.name, JOINT_TRAJECTORY.name, POINT_STAMPED.name
_POINTS = 'points/'  # in the role of a traced point, between its linkage, if named, and its name
_IN_JOINT_STATE = tuple(name for name in QUANTITIES if name != 'acceleration')


class WrittenTable(NamedTuple):
    """Contents of a CSV file.

    Attributes:
        topic: Name of the topic.
        rows: Number of rows.
        invalid: Number of messages of the topic that could not be decoded, and have no row.
    """

    topic: str
    rows: int
    invalid: int


class LoggedStates(NamedTuple):
    """The states of a log.

    Attributes:
        linkage: The linkage.
        time: Times since the first state, s.
        rows: Positions, rates and accelerations of the links, rad and m, shape (3, links, n).
        torque: Driving torque, N m, or force, N.
    """

    linkage: Linkage
    time: Array
    rows: Array
    torque: Array


class _Table:
    """The joint states or the points of a topic.

    Attributes:
        topic: The topic.
        stamps: Stamp of each row, ns.
        columns: Values by name, such as 'crank.position', or 'x' of a point; NaN where a message
            has none.
        invalid: Number of messages that could not be decoded.
    """

    def __init__(self, topic: BagTopic) -> None:
        self.topic, self.stamps, self.invalid = topic, array('q'), 0
        self.columns: dict[str, array[float]] = {}
        # The columns of each layout of messages, in the order of the values, and the last layout.
        self._layouts: dict[Any, list[array[float]]] = {}
        self._last: Any = None

    @property
    def is_of_points(self) -> bool:
        """Whether the messages are points."""
        return self.topic.type == POINT_STAMPED.name

    def add(self, time: int, data: bytes) -> None:
        """Adds a message with its log time, ns.

        Raises:
            ValueError: The bytes are not a message of the topic's type.
        """
        stamp, names, quantities, rows = self._decoded(data)
        sizes = [*map(len, rows)]
        layout = (*names, *sizes)
        if layout != self._last:
            self._last = layout
            if layout not in self._layouts:
                named = zip(quantities, sizes, strict=True)
                self._layouts[layout] = [*self._columns_of(names, named)]
            self.complete()  # messages of other layouts lack some of its values
        self.stamps.append(stamp or time)
        for column, value in zip(self._layouts[layout], chain(*rows), strict=True):
            column.append(value)

    def _decoded(
        self, data: bytes
    ) -> tuple[int, list[str], Sequence[str], Sequence[tuple[float, ...]]]:
        """Returns stamp, ns, names, quantities, and the values of each quantity, by the names.

        Raises:
            ValueError: The bytes are not a message of the topic's type.
        """
        if self.topic.type == JOINT_STATE.name:
            stamp, names, *rows = decode_joint_state(data)
            return stamp, names, _IN_JOINT_STATE, rows
        if self.is_of_points:
            stamp, place = decode_point(data)
            return stamp, ['x', 'y', 'z'], [''], [place]
        stamp, names, ((*rows, _),) = decode_trajectory(data)  # one point, and its time
        return stamp, names, QUANTITIES, rows

    def _columns_of(
        self, names: Sequence[str], sizes: Iterable[tuple[str, int]]
    ) -> Iterator['array[float]']:
        """Yields the column of each value in a message.

        A value without a unique name gets a column that is not in the table.

        Args:
            names: Names of the joints or axes.
            sizes: Number of values of each quantity; if there are more than names, the last ones
                have no name.
        """
        taken = set[str]()
        for quantity, size in sizes:
            for i in range(size):
                if i >= len(names):
                    yield array('d')
                    continue
                name = f'{names[i]}.{quantity}' if quantity else names[i]
                is_unique = name not in taken
                taken.add(name)
                yield self.columns.setdefault(name, array('d')) if is_unique else array('d')

    def complete(self) -> None:
        """Adds the missing values at the end of each column."""
        for column in self.columns.values():
            column.extend(repeat(math.nan, len(self.stamps) - len(column)))


def _tables(bag: Bag, progress: Callable[[int], object] = lambda _: None) -> list[_Table]:
    """Reads the joint states or points of each topic that has any, except invalid messages.

    Raises:
        LogError: The bag is incomplete or damaged.
    """
    tables = dict[BagTopic, _Table]()
    for topic, time, data in chain.from_iterable(bag.messages(_TYPES, progress)):
        if topic.type == JOINT_TRAJECTORY.name and topic.role != MECHANISM_STATE.role:
            continue  # a command
        table = tables.setdefault(topic, _Table(topic))
        try:
            table.add(time, data)
        except ValueError:
            table.invalid += 1
    filled_tables = [table for table in tables.values() if table.stamps]
    for table in filled_tables:
        table.complete()
    return filled_tables


def read_log(path: Path | str, topic: str | None = None) -> Any:
    """Reads joint states and points as arrays; see `linkage_ros.read_log`.

    Raises:
        LogError: The log cannot be read, or has no such topic.
    """
    tables = {table.topic.name: _arrays(table) for table in _tables(Bag(path))}
    if topic is None:
        return tables
    if topic not in tables:
        names = ', '.join(sorted(tables)) or 'none'
        raise LogError(f'{path} has no states or points on {shown(topic)}: choose one of {names}')
    return tables[topic]


def _arrays(table: _Table) -> dict[str, Array]:
    """Returns the times, s, and the columns of a table."""
    time = np.frombuffer(table.stamps, np.int64) / NS_PER_S
    return {'t': time, **{name: np.frombuffer(x) for name, x in table.columns.items()}}


def logged_states(path: Path | str, most: int, linkage: str = '') -> LoggedStates:
    """Reads the first states of a linkage in a log of this package.

    Args:
        path: Path of the log.
        most: Largest number of states.
        linkage: Name of the linkage; empty for the only one.

    Raises:
        ConfigurationError: There is no such linkage, or a name is needed.
        LogError: The log cannot be read, or a joint is not in it.
    """
    log = LogReader(path)
    own = log.configuration.linkage(linkage)
    (topic,) = (topic.name for topic in log.topics if topic.role == MECHANISM_STATE.role)
    columns, joints = read_log(path, topic), own.robot_joints
    names = [joint.name for joint in joints]
    if '' in names:
        raise LogError(f'{path} lacks a joint: give each joint a name to show the log')

    def rows_of(quantity: str) -> list[Array]:
        return [columns[f'{name}.{quantity}'][:most] for name in names]

    joint_rows = np.array([rows_of(quantity) for quantity in QUANTITIES[:3]])
    driven = own.mechanism.structure().driven
    time = columns['t'][:most]
    torque = columns[f'{names[driven]}.effort'][:most] * joints[driven].ratio
    # Of several linkages, others may have a state where this one has none.
    has_state = np.isfinite(joint_rows).all(axis=(0, 1))
    if not has_state.any():
        raise LogError(f'{path} has no states of {linkage or "the linkage"}')
    time = time[has_state]
    return LoggedStates(
        own, time - time[0], link_rows(joints, joint_rows[..., has_state]), torque[has_state]
    )


def write_csv(
    source: Path | str,
    target: Path | str,
    *,
    topic: str = '',
    overwrite: bool = False,
    progress: Callable[[int], object] = lambda _: None,
) -> WrittenTable:
    """Writes the joint states of a topic as a table, with a row for each message.

    The states of a log are followed by its traced points.

    Args:
        source: An MCAP file, or the folder of a rosbag2 recording.
        target: Path of the table; '-' for standard output.
        topic: Name of the topic; by default, the states of a log, or the only topic of joint
            states of a bag.
        overwrite: Whether to replace an existing file.
        progress: Called with the number of bytes read since the last call.

    Returns:
        The topic, and the number of rows.

    Raises:
        LogError: The source cannot be read, is incomplete or damaged, or has no such topic; or the
            target is the source or cannot be written.
    """
    bag = Bag(source)
    if any(is_same_file(str(file), str(target)) for file in bag.files):
        raise LogError(f'{target} is the log itself: choose another name')
    cure = 'give --overwrite'
    require_new(target, LogError, overwrite=overwrite, cure=cure)
    tables = _tables(bag, progress)
    table = _chosen(source, [x for x in tables if not x.is_of_points], topic)
    labels = {} if table.topic.role == MEASURED_JOINT_STATES.role else _labels(source)
    points = _points_of(table, tables)
    head = ['t [s]', *(labels.get(name, name) for name in table.columns), *points]
    columns = map(_cells, (*table.columns.values(), *points.values()))
    with text_output(target, LogError, overwrite=overwrite, cure=cure) as stream:
        writer = csv.writer(stream, lineterminator='\n')
        writer.writerow(head)
        writer.writerows(zip(map(_seconds, table.stamps), *columns, strict=True))
    return WrittenTable(table.topic.name, len(table.stamps), table.invalid)


def _points_of(states: _Table, tables: Iterable[_Table]) -> dict[str, Sequence[float]]:
    """Returns x and y of the traced points at the stamps of a log's states, by column head.

    They are NaN where a point has no message of that stamp.
    """
    columns = dict[str, Sequence[float]]()
    if states.topic.role not in {MECHANISM_STATE.role, JOINT_STATES.role}:
        return columns
    for table in tables:
        linkage, is_points, name = table.topic.role.rpartition(_POINTS)
        if not is_points:
            continue
        rows: Sequence[int | None] = range(len(table.stamps))
        if table.stamps != states.stamps:  # messages are missing
            row_at = {stamp: row for row, stamp in enumerate(table.stamps)}
            rows = [row_at.get(stamp) for stamp in states.stamps]
        for axis in 'xy':
            column = table.columns[axis]
            cells = array('d', (math.nan if row is None else column[row] for row in rows))
            columns[f'{linkage}{name}.{axis} [m]'] = cells
    return columns


def _chosen(source: Path | str, tables: Sequence[_Table], name: str) -> _Table:
    """Chooses a table; see `write_csv`.

    Raises:
        LogError: There is no such table, or more than one.
    """
    if name:
        candidates = [table for table in tables if table.topic.name == name]
    else:
        states = [table for table in tables if table.topic.role == MECHANISM_STATE.role]
        joint_states = [table for table in tables if table.topic.role == JOINT_STATES.role]
        candidates = states or joint_states or list(tables)
    if len(candidates) == 1:
        return candidates[0]
    names = ', '.join(sorted(table.topic.name for table in tables))
    if names:
        raise LogError(f'{source} has joint states on {names}: give one of these as --topic')
    raise LogError(f'{source} has no joint states, or its messages are compressed or damaged')


def _labels(path: Path | str) -> dict[str, str]:
    """Returns columns with units and references if this package wrote the log; otherwise none."""
    try:
        linkages = LogReader(path).configuration.linkages
    except LogError:
        return {}
    return dict(chain.from_iterable(_labels_of(linkage).items() for linkage in linkages))


def _labels_of(linkage: Linkage) -> dict[str, str]:
    """Returns the columns of a linkage with units and references."""
    labels = dict[str, str]()
    links, joints = linkage.mechanism.structure().links, linkage.robot_joints
    names = {link.name: joint.name for link, joint in zip(links, joints, strict=True)}
    for joint, link in zip(joints, links, strict=True):
        carrier = measured_from(links, link, linkage.joints.get(link.name))
        for quantity, unit in zip(QUANTITIES, link.units, strict=False):
            name, origin = f'{joint.name}.{quantity}', ''
            if carrier != FRAME_NAME and quantity != 'effort':
                origin = f' relative to {names[carrier] or carrier}'
            labels[name] = f'{name}{origin} [{unit}]'
    return labels


def _cells(column: Sequence[float]) -> Iterator[float | str]:
    """Yields the cells of a column, which are empty for NaN."""
    return ('' if math.isnan(value) else value for value in column)


def _seconds(stamp: int) -> str:
    """Formats a stamp, ns, as seconds, without rounding."""
    return f'{"-" * (stamp < 0)}{abs(stamp) // NS_PER_S}.{abs(stamp) % NS_PER_S:09d}'
