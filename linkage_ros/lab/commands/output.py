# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Output of linkage_chart: result folder, files and progress."""

from __future__ import annotations

import csv
import json
import os
import platform
import re
from collections.abc import Iterable, Iterator, Sequence
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any

import numpy as np

from linkage_ros import __version__
from linkage_ros.errors import ConfigurationError
from linkage_ros.progress import progress_bar


@contextmanager
def folder(path: Path) -> Iterator[None]:
    """Makes the folder for results; reports a failure to write in one line.

    Raises:
        ConfigurationError: The folder or a file cannot be written.
    """
    try:
        path.mkdir(parents=True, exist_ok=True)
        yield
    except OSError as error:
        raise ConfigurationError(f'{path} cannot be written: {error.strerror}') from error


def progress(items: Iterable[Any], words: str) -> Iterable[Any]:
    """Iterates over items with a progress bar."""
    return progress_bar(items, desc=words, unit=' steps')


def about() -> dict[str, str]:
    """Versions and machine of a measurement."""
    models: list[str] = []
    with suppress(OSError):
        models = re.findall(r'model name\s*: (.*)', Path('/proc/cpuinfo').read_text())
    return {
        'linkage_ros': __version__,
        'Python': platform.python_version(),
        'NumPy': np.__version__,
        'system': f'{platform.system()} {platform.machine()}',
        'processors': f'{os.cpu_count()} x {models[0]}' if models else str(os.cpu_count()),
    }


def save_records(path: Path, records: list[dict[str, Any]]) -> None:
    """Writes records as JSON, with versions and machine."""
    path.write_text(json.dumps({'about': about(), 'records': records}, indent=1) + '\n')


def save_csv(path: Path, head: Sequence[str], rows: Iterable[Iterable[object]]) -> None:
    """Writes a table, floats to the last bit and None as an empty cell, once it is complete."""
    new = path.with_suffix('.csv.new')
    with new.open('w', newline='', encoding='utf-8') as stream:
        writer = csv.writer(stream, lineterminator='\n')
        writer.writerow(head)
        writer.writerows(rows)
    new.replace(path)
