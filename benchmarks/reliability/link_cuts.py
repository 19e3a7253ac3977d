# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""What cuts of the link cost: from a log on one side, and what the other heard (for hosts.py)."""

from pathlib import Path
from typing import Any

import numpy as np

from linkage_ros.errors import LogError
from linkage_ros.log.reader import LogReader
from linkage_ros.verification.verify import verify
from linkage_ros.wire.cdr import stamp_of

RATE = 200.0
TIMED_OUT = b'no command within command_timeout'


def read(path: Path) -> dict[str, Any]:
    """What a log holds: stamps of the states, times of commands and of words on their absence."""
    found: dict[str, list[int]] = {'/joint_states': [], '/joint_commands': [], '/diagnostics': []}
    try:
        with LogReader(path) as log:
            difference = verify(log).difference
            for message in log.messages(list(found)):
                if message.topic == '/joint_states':
                    found[message.topic].append(stamp_of(message.data))
                elif message.topic == '/joint_commands' or TIMED_OUT in message.data:
                    found[message.topic].append(message.time)
    except LogError as error:
        difference = str(error)
    states, commands, timed_out = map(np.array, found.values())
    return {
        'difference': difference, 'states': states, 'commands': commands, 'timed_out': timed_out
    }  # fmt: skip


def after(times: Any, begin: int) -> float:
    """s from a time to the first of some times that follows; infinite if none does."""
    later = times[times > begin]
    return float(later.min() - begin) * 1e-9 if later.size else float('inf')


def judge(what: dict[str, Any], one: dict[str, Any]) -> dict[str, Any]:
    """Figures of one cut."""
    begin, restored = one.pop('begin'), one.pop('restored')
    arrived, states, commands = what['arrived'], what['states'], what['commands']
    back = after(arrived[:, 1], restored)
    end = restored + back * 1e9
    inside = states[(states >= begin) & (states < end)]
    gaps = np.rint(np.diff(states) * RATE / 1e9) - 1
    missed = gaps[(states[1:] >= begin) & (states[1:] < end)].sum()
    last = commands[commands < restored]
    return {
        **one,
        'states_back': back,
        'commands_back': after(commands, restored),
        'commands_ended': float(last.max() - begin) * 1e-9 if last.size else float('inf'),
        'time_out_said': bool(((what['timed_out'] > begin) & (what['timed_out'] < end)).any()),
        'unheard': int(np.setdiff1d(inside, arrived[:, 0]).size),
        'logged': int(inside.size),
        'ticks_missed': int(missed),
    }


def summary(what: dict[str, Any]) -> dict[str, Any]:
    """Figures of a run with cuts."""
    cuts = [judge(what, one) for one in what['cuts']]
    states, arrived = what['states'], what['arrived']
    since = states[states >= arrived[0, 0]] if arrived.size else states
    unheard = np.setdiff1d(since, arrived[:, 0]).size - sum(one['unheard'] for one in cuts)
    missed = (np.rint(np.diff(states) * RATE / 1e9) - 1).sum()
    return {
        'discovered': what['discovered'], 'bytes_crossed': what['crossed'],
        'heard': len(arrived), 'states_logged': len(states), 'states_published': what['published'],
        'log_verifies': not what['difference'], 'exit_code': what['exit_code'], 'cuts': cuts,
        'unheard_besides': int(unheard),
        'ticks_missed_besides': int(missed - sum(one['ticks_missed'] for one in cuts)),
    }  # fmt: skip
