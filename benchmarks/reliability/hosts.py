# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Cuts and restores the link between two hosts.

The hosts are network namespaces on this machine, connected by a virtual cable (`network.py`). A
torque-driven linkage_node with a log runs on one host; a subscriber and linkage_controller, which
answers each state with a command, run on the other. The cable is pulled for a short time, and for
longer than the 20 s after which DDS forgets a host; then one host leaves the network while the
link stays up. The exit code is 1 if a promise is broken, and 77 if the hosts cannot be created.

    python benchmarks/reliability/hosts.py --out DIR             two minutes
    python benchmarks/reliability/hosts.py --out DIR --long 0    only the short cut
"""

import contextlib
import re
import sys
import tempfile
import time
from pathlib import Path

import numpy as np
from harness import (
    DOMAIN,
    Process,
    finish,
    listening,
    missed,
    node,
    options,
    running,
    wait_for,
    words,
)
from network import Host, two_hosts

from linkage_ros.errors import LogError
from linkage_ros.log.reader import LogReader
from linkage_ros.log.verify import verify
from linkage_ros.messages.cdr import stamp_of

RATE, SETTLED, PATIENCE = 200.0, 2.0, 40.0
TIMED_OUT = b'within command_timeout'


def heard(listener: Process) -> int:
    """Returns how many times states have started to arrive."""
    return sum(text == 'heard' for _, text in listener.lines)


def on(host: Host, reach: str = 'SUBNET') -> tuple[str, ...]:
    """Returns the command prefix that runs a ROS process on a host."""
    return host.prefix(ROS_AUTOMATIC_DISCOVERY_RANGE=reach)


def cut(kind: str, host: Host, seconds: float, listener: Process) -> dict:
    """Cuts and restores the link; returns the time of each, ns on the wall clock."""
    time.sleep(SETTLED)
    count = heard(listener)
    begin = time.time_ns()
    host.unplug() if kind == 'cable' else host.vanish()
    time.sleep(seconds)
    restored = time.time_ns()
    host.plug()
    with contextlib.suppress(TimeoutError):  # reported in the figures
        wait_for(lambda: heard(listener) > count, PATIENCE)
    return {'kind': kind, 'seconds': seconds, 'begin': begin, 'restored': restored}


def run(there: Host, here: Host, kinds: list[tuple[str, float]], folder: Path) -> dict:
    """Runs node, subscriber and controller while the link is cut; returns the recorded data."""
    log, times = folder / 'run.mcap', folder / 'times.npy'
    # Low torque and bandwidth keep the speed bounded if a busy machine delays the controller.
    driven = {'drive': 'torque', 'torque_limit': 5.0, 'motor.damping': 0.3}
    tame = words({'feed_forward': 'false', 'bandwidth': 0.5, 'rpm': 60.0})
    with (
        listening(DOMAIN, times, on(here)) as listener,
        listening(DOMAIN, folder / 'commands.npy', on(here), 'joint_commands') as answers,
        running('-m', 'linkage_ros.programs.controller', *tame, domain=DOMAIN, prefix=on(here)),
    ):
        time.sleep(1.0)
        with node(DOMAIN, on(there), rate_hz=RATE, log=log, **driven) as turning:
            wait_for(lambda: 'linkage_node' in turning.output)
            discovered = wait_for(lambda: heard(listener))
            # A command can time out only after a first one, and the controller may start late.
            wait_for(lambda: heard(answers))
            bytes_before = here.received()
            cuts = [cut(kind, here, seconds, listener) for kind, seconds in kinds]
            time.sleep(SETTLED)
            crossed = here.received() - bytes_before
            code = turning.end()
    if code:
        print(f'the node ends with {code}: {turning.output[-600:]}')
    said = re.search(r'(\d+) states', turning.output)
    return {
        'discovered': discovered, 'crossed': crossed, 'cuts': cuts, 'exit_code': code,
        'published': int(said[1]) if said else -1, 'arrived': np.load(times),
        **read(log),
    }  # fmt: skip


def reaches(there: Host, here: Host, reach: str, folder: Path, *, late: bool = False) -> bool:
    """Returns whether a node with a discovery range is discovered on the other host.

    Args:
        there: Host of the node.
        here: Host of the subscriber.
        reach: The discovery range.
        folder: Folder for the output of the subscriber.
        late: Whether to plug in the node's end of the cable only after the node has started.
    """
    if late:
        there.unplug()
    with (
        listening(DOMAIN, folder / 'other.npy', on(here)) as listener,
        node(DOMAIN, on(there, reach)) as turning,
    ):
        wait_for(lambda: 'linkage_node' in turning.output)
        there.plug()
        time.sleep(12.0 if late else 4.0)
        return heard(listener) > 0


def read(path: Path) -> dict:
    """Verifies a log; returns stamps of states, and times of commands and of reported timeouts."""
    found: dict[str, list[int]] = {'/joint_states': [], '/joint_commands': [], '/diagnostics': []}
    try:
        log = LogReader(path)
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


def after(times, begin: int) -> float:
    """Returns the time, s, from a moment to the next of some times; infinite if there is none."""
    later = times[times > begin]
    return float(later.min() - begin) * 1e-9 if later.size else float('inf')


def judge(what: dict, one: dict) -> dict:
    """Returns the figures of one cut."""
    begin, restored = one.pop('begin'), one.pop('restored')
    arrived, states, commands = what['arrived'], what['states'], what['commands']
    back = after(arrived[:, 1], restored)
    end = restored + back * 1e9
    first, past = np.searchsorted(states, (begin, end))
    last = commands[commands < restored]
    return {
        **one,
        'states_back': back,
        'commands_back': after(commands, restored),
        'commands_ended': float(last.max() - begin) * 1e-9 if last.size else float('inf'),
        'time_out_said': bool(((what['timed_out'] > begin) & (what['timed_out'] < end)).any()),
        'unheard': int(np.setdiff1d(states[first:past], arrived[:, 0]).size),
        'logged': int(past - first),
        'ticks_missed': missed(states[first - 1 : past], RATE),
    }


def summary(what: dict) -> dict:
    """Returns the figures of a run with cuts."""
    cuts = [judge(what, one) for one in what['cuts']]
    states, arrived = what['states'], what['arrived']
    since = states[states >= arrived[0, 0]] if arrived.size else states
    unheard = np.setdiff1d(since, arrived[:, 0]).size - sum(one['unheard'] for one in cuts)
    return {
        'discovered': what['discovered'], 'bytes_crossed': what['crossed'],
        'heard': len(arrived), 'states_logged': len(states), 'states_published': what['published'],
        'log_verifies': not what['difference'], 'exit_code': what['exit_code'], 'cuts': cuts,
        'unheard_besides': int(unheard),
        'ticks_missed_besides': missed(states, RATE) - sum(one['ticks_missed'] for one in cuts),
    }  # fmt: skip


def promises(figures: dict) -> dict[str, bool]:
    """Returns whether each promise was kept."""
    states = figures['states_logged']
    kept = {
        'the log verifies and is complete': figures['log_verifies'] and figures['exit_code'] == 0,
        'every state that was published is in the log': states == figures['states_published'],
        'the received states crossed the cable': figures['bytes_crossed']
        > 200 * figures['heard'] / 2,
        'a node limited to its own host is not heard on the other': not figures['local_is_heard'],
    }
    for one in figures['cuts']:
        name = f'{one["kind"]}, {one["seconds"]:g} s: '
        kept[name + 'states resume'] = one['states_back'] < PATIENCE
        kept[name + 'commands resume'] = one['commands_back'] < PATIENCE
        kept[name + 'the timeout of commands is reported'] = one['time_out_said']
        # Only a long cut shows whether missing receivers delay the node, because a busy machine
        # may also miss ticks for a moment.
        little = one['seconds'] < 20 or one['ticks_missed'] < one['logged'] / 10
        kept[name + 'the node keeps its rate'] = little
    return kept


def show(figures: dict) -> None:
    """Prints the figures."""
    print(
        f'discovered in {figures["discovered"]:.2f} s; {figures["heard"]} states heard, '
        f'{figures["bytes_crossed"]} bytes came over the cable; log of {figures["states_logged"]} '
        f'states verifies: {figures["log_verifies"]}'
    )
    for one in figures['cuts']:
        print(
            f'{one["kind"]:6} {one["seconds"]:4g} s: states again after '
            f'{one["states_back"]:.2f} s, commands after {one["commands_back"]:.2f} s; of '
            f'{one["logged"]} logged states {one["unheard"]} were never heard; '
            f'{one["ticks_missed"]} ticks missed'
        )
    print(
        f'besides: {figures["unheard_besides"]} states unheard, '
        f'{figures["ticks_missed_besides"]} ticks missed; range LOCALHOST heard elsewhere: '
        f'{figures["local_is_heard"]}; begun before the cable was plugged in, heard: '
        f'{figures["late_is_heard"]}'
    )


def main() -> int:
    given = options(__doc__, short=(5.0, 's of the short cut'), long=(30.0, 's of the long cut'))
    kinds = [('cable', given.short)]
    if given.long:
        kinds += [('cable', given.long), ('silent', given.long)]
    with two_hosts() as (there, here), tempfile.TemporaryDirectory() as name:
        for host in (there, here):
            host.plug()
        wait_for(lambda: there.connected() and here.connected())
        figures = summary(run(there, here, kinds, Path(name)))
        figures['local_is_heard'] = reaches(there, here, 'LOCALHOST', Path(name))
        late = given.long and reaches(there, here, 'SUBNET', Path(name), late=True)
        figures['late_is_heard'] = bool(late) if given.long else None
    show(figures)
    return finish('hosts', given.out, figures, promises(figures))


if __name__ == '__main__':
    sys.exit(main())
