# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Writes the golden logs anew: the first states of each preset, in test/data.

A log is replaced only if every message of a state is the same, bit for bit. Run this if the format
of logs, or a name in them, changes on purpose.
"""

import sys
from pathlib import Path

from mcap.reader import make_reader

from linkage_ros import load, preset_names
from linkage_ros.programs.record import record

STATES = 20
LOGS = {name: Path(__file__).parent / 'data' / f'{name}.mcap' for name in preset_names()}
DESCRIPTION = '/robot_description'


def main():
    """Records each preset; returns the exit code."""
    code = 0
    for preset, path in LOGS.items():
        new, configuration = path.with_suffix('.new.mcap'), load(preset)
        record(configuration, new, duration=STATES / configuration.session.rate_hz, overwrite=True)
        if path.exists() and (wrong := first_difference(path, new)):
            new.unlink()
            print(f'{preset}: {wrong}')
            code = 1
        else:
            new.replace(path)
    return code


def first_difference(old, new):
    """Describes the first message of a state in which two logs differ."""
    before, after = messages(old), messages(new)
    for topic in before.keys() | after.keys():
        pair = before.get(topic, []), after.get(topic, [])
        for number, (one, other) in enumerate(zip(*pair, strict=False), 1):
            if one != other:
                return f'{topic}: message {number} differs'
        if len(pair[0]) != len(pair[1]):
            return f'{topic}: {len(pair[0])} messages before, {len(pair[1])} now'
    return ''


def messages(path):
    """Returns log times and bytes of the messages of states, by topic."""
    found = {}
    with path.open('rb') as stream:
        for _, channel, message in make_reader(stream).iter_messages():
            if channel.topic != DESCRIPTION:
                found.setdefault(channel.topic, []).append((message.log_time, message.data))
    return found


if __name__ == '__main__':
    sys.exit(main())
