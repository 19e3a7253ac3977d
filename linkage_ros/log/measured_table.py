# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Reads the CSV log of a board, such as one with an encoder, as the measurements of a bag."""

import csv
import os
from collections.abc import Callable, Iterator
from contextlib import suppress
from decimal import Decimal
from itertools import islice
from pathlib import Path
from typing import BinaryIO

from linkage_ros.columns import Place, measured_places
from linkage_ros.errors import LogError
from linkage_ros.files import open_file
from linkage_ros.log.bag import BagMessage, BagTopic
from linkage_ros.messages.fields import Template
from linkage_ros.messages.templates import joint_state
from linkage_ros.messages.topics import JOINT_STATE
from linkage_ros.quantities import shown
from linkage_ros.units import NS_PER_S, TIME_END

_LONGEST = 1 << 16  # bytes of a line
_BATCH = 2048  # messages


class MeasuredTable:
    """The measurements of one joint in a CSV file, read as a `Bag` with a single topic.

    Attributes:
        path: Path of the file.
        files: The same path alone.
        size: Size of the file, bytes.
        topic: The topic of the messages.
    """

    def __init__(self, path: Path | str, joint: str, quantity: str, column: str = '') -> None:
        """Reads the names of the columns.

        Args:
            path: Path of the file, in UTF-8.
            joint: Name of the joint in the messages.
            quantity: What is measured, 'angle' or 'position'.
            column: Name of its column; by default, the column that has the name of the quantity.

        Raises:
            LogError: The file cannot be read, or lacks a column.
        """
        self.path, self.files = Path(path), [Path(path)]
        self.topic = BagTopic('measured', JOINT_STATE.name, '')
        self._template = Template(joint_state([joint], ''))
        try:
            with open_file(path) as stream:
                self.size = os.fstat(stream.fileno()).st_size
                head, _ = next(self._rows(stream), ([], 0))
        except OSError as error:
            raise LogError(f'{path} cannot be read: {error.strerror or error}') from error
        try:
            self._places = measured_places(head, quantity, column)
        except ValueError as error:
            raise LogError(f'{path}: {error}') from error

    def messages(
        self, progress: Callable[[int], object] = lambda _: None
    ) -> Iterator[list[BagMessage]]:
        """Yields the rows in batches, as messages whose log time is their stamp.

        A cell that is not a number becomes NaN, so that the measurement is rejected and counted.

        Args:
            progress: Called with the number of bytes read since the last call.

        Raises:
            LogError: A time is not valid, or a line is too long; all rows before it were yielded.
        """
        bytes_read, number = 0, 0
        with open_file(self.path) as stream:
            rows = self._rows(stream)
            next(rows)  # the names
            is_complete = False
            while not is_complete:
                batch, problem = list[BagMessage](), None
                try:
                    for row, number in islice(rows, _BATCH):  # noqa: B007, for errors
                        batch.append(self._message(row))
                except ValueError as error:
                    problem = LogError(f'{self.path}, line {number}: {error}')
                if batch:
                    yield batch
                progress(stream.tell() - bytes_read)
                bytes_read = stream.tell()
                if problem:
                    raise problem
                is_complete = len(batch) < _BATCH

    def _message(self, row: list[str]) -> BagMessage:
        """Converts a row to a message.

        Raises:
            ValueError: The time in the row is not valid.
        """
        text = _cell(row, self._places['time'])
        try:
            stamp = round(Decimal(text) * self._places['time'].decimal * NS_PER_S)
        except (ArithmeticError, ValueError):
            stamp = -1
        if not 0 <= stamp < TIME_END:
            raise ValueError(f'time = {shown(text)}: must be a number of 0 or more')
        position = _number(row, self._places.get('measured'))
        velocity = _number(row, self._places.get('speed'))
        seconds, nanoseconds = divmod(stamp, NS_PER_S)
        data = self._template.pack(seconds, nanoseconds, position, velocity, float('nan'))
        return self.topic, stamp, data

    @staticmethod
    def _rows(stream: BinaryIO) -> Iterator[tuple[list[str], int]]:
        """Yields the cells of each line that has any, and the number of the line.

        Raises:
            ValueError: A line is too long.
        """
        number = 0
        while line := stream.readline(_LONGEST + 1):
            number += 1
            if len(line) > _LONGEST:
                raise ValueError(f'the next line has more than {_LONGEST} bytes')
            text = line.decode('utf-8-sig', errors='replace').replace('\0', ' ').strip()
            if text and not text.startswith('#'):
                yield next(csv.reader([text])), number


def _cell(row: list[str], place: Place) -> str:
    return row[place.at].strip() if place.at < len(row) else ''


def _number(row: list[str], place: Place | None) -> float:
    """Returns the number in a cell, in SI units; NaN if there is none."""
    if place is not None:
        with suppress(ValueError):
            return float(_cell(row, place)) * place.factor
    return float('nan')
