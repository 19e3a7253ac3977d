# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""linkage_replay: publishes the messages of a log at the logged times, or shows them."""

import argparse
import functools
import itertools
import os
import sys
from collections.abc import Iterator, Sequence
from contextlib import ExitStack, contextmanager
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, cast

import numpy as np

from linkage_ros import cli
from linkage_ros.errors import ConfigurationError, ViewerError
from linkage_ros.log.reader import LogReader
from linkage_ros.messages.cdr import decode_joint_state
from linkage_ros.messages.joints import link_rows
from linkage_ros.messages.topics import JOINT_STATES
from linkage_ros.node.workers import Worker, freeze_heap, wake_on_time
from linkage_ros.numeric import Array
from linkage_ros.programs.keyboard import Keyboard
from linkage_ros.programs.player import (
    KEYS,
    MAX_RATE,
    MIN_RATE,
    Excerpt,
    Item,
    Pace,
    Show,
    Sink,
    excerpt_of,
    feed,
    play,
)
from linkage_ros.quantities import Quantity, counted
from linkage_ros.run.robot import Robot
from linkage_ros.run.states import Simulator
from linkage_ros.settings.parameters import VIEWERS, WEB
from linkage_ros.units import NS_PER_S

if TYPE_CHECKING:
    from linkage_ros.view.rerun_connection import LinkMotion

_NAME = 'linkage_replay'
_CLOCK_HZ, _POLL_SECONDS = 40.0, 0.2
_VIEW_CAPACITY, _VIEW_CLOSE_SECONDS = 1_000_000, 10.0  # samples, s
_OFFSET = Quantity('number', 'length to skip at the beginning', 's of the log', 0.0, 1e9)
_DURATION = replace(_OFFSET, meaning='length to replay, excluding the end', low=1e-9)
_OPTIONS: list[cli.Option] = [
    (('log',), None, {'metavar': 'LOG.mcap', 'type': Path, 'help': 'the log'}),
    (('-r', '--rate'),
     Quantity('number', 'ratio of log time to real time', low=MIN_RATE, high=MAX_RATE),
     {'note': ' (default 1)', 'default': 1.0, 'metavar': 'R'}),
    (('-l', '--loop'), None,
     {'action': 'store_true',
      'help': 'repeat the log until Ctrl-C, as --viewer web --no-ros always does; the time on '
              '/clock keeps increasing'}),
    (('--start-offset',), _OFFSET, {'default': 0.0, 'metavar': 'S'}),
    (('--playback-duration',), _DURATION, {'metavar': 'S'}),
    (('-p', '--start-paused'), None,
     {'action': 'store_true', 'help': 'wait for a key before the start'}),
    (('-d', '--delay'), Quantity('number', 'wait before the start', 's', 0.0, 1e6),
     {'default': 0.0, 'metavar': 'S'}),
    (('--clock',), Quantity('number', 'publish the log time on /clock', 'Hz', 0.01, 1e3),
     {'note': f' (default {_CLOCK_HZ:g})', 'nargs': '?', 'const': _CLOCK_HZ, 'metavar': 'HZ'}),
    (('--topics',), None,
     {'nargs': '+', 'metavar': 'NAME', 'help': 'replay these topics only'}),
    (('--viewer',), None,
     {'default': '', 'metavar': 'TARGET', 'help': f'also show the log in Rerun: {VIEWERS}'}),
    cli.OVERWRITE,
    (('--no-ros',), None,
     {'action': 'store_true', 'help': 'show the log in the viewer without publishing it'}),
    (('--no-open',), None,
     {'action': 'store_true',
      'help': 'with --viewer web: print the address of the page, but open no browser'}),
]  # fmt: skip


@contextmanager
def _status(log: LogReader, excerpt: Excerpt, pace: Pace) -> Iterator[Show]:
    """Shows position, rate and pause on one line of stderr, if it is a terminal."""
    end = (min(excerpt.end, log.end) - log.start) / NS_PER_S
    bar = cli.progress_bar(
        total=max(end, 1e-9),
        miniters=0,
        bar_format='{percentage:3.0f}%|{bar}| {n:.3f}/{total:.3f} s{postfix}',
    )  # fmt: skip

    def show(moment: int) -> None:
        if not bar.disable:
            bar.update(max(0.0, min((moment - log.start) / NS_PER_S, end)) - bar.n)
            words = f'rate {pace.rate:g}{", paused: press space" if pace.paused else ""}'
            if words != bar.postfix:
                bar.set_postfix_str(words)

    with bar:
        yield show


def _parser() -> argparse.ArgumentParser:
    parser = cli.make_parser(
        _NAME,
        'Replay a log of linkage_ros on its topics, in the Rerun viewer, or both.',
        ('run.mcap', 'run.mcap --rate 0.5 --start-offset 2 --topics /joint_states',
         'run.mcap --loop --clock', 'run.mcap --viewer spawn --no-ros'),
    )  # fmt: skip
    # LOG.mcap must come first, because after --topics it would be parsed as a topic.
    parser.usage = '%(prog)s LOG.mcap [options]'
    parser.epilog = f'{KEYS}\n\n{parser.epilog}'
    cli.add_options(parser, _OPTIONS)
    return parser


def _check(options: argparse.Namespace, log: LogReader) -> None:
    """Rejects options that do not fit the log or each other.

    Raises:
        ConfigurationError: There are such options.
    """
    length = (log.end - log.start) / NS_PER_S
    replace(_OFFSET, high=length).clean('--start-offset', options.start_offset)
    names = [topic.name for topic in log.topics]
    unknown = [name for name in options.topics or () if name not in names]
    if unknown:
        raise ConfigurationError(f'--topics {" ".join(unknown)}: the log has {", ".join(names)}')
    if options.no_ros and not options.viewer:
        raise ConfigurationError('--no-ros leaves nothing to do: give --viewer as well')
    if options.no_open and options.viewer != WEB:
        raise ConfigurationError('--no-open is for a page in a browser: give --viewer web as well')
    if options.no_ros and options.clock is not None:
        raise ConfigurationError('--clock publishes a topic, so it cannot be used with --no-ros')
    if options.start_paused and not os.isatty(0):
        raise ConfigurationError(
            '--start-paused needs a terminal, whose space bar starts the replay'
        )


def _split(arguments: list[str]) -> tuple[list[str], list[str]]:
    """Splits a command line into the arguments of this program and those of ROS.

    The ROS arguments are the program name and everything from --ros-args to -- or the end.
    """
    start = arguments.index('--ros-args') if '--ros-args' in arguments else len(arguments)
    end = arguments.index('--', start) if '--' in arguments[start:] else len(arguments)
    return arguments[1:start] + arguments[end + 1 :], [arguments[0], *arguments[start:end]]


def motions_in(robot: Robot, samples: Sequence[tuple[int, bytes]]) -> 'dict[str, LinkMotion]':
    """Reads the motion of each linkage from messages on joint_states, for a `View`.

    A sample is the shift of the stamp, ns, and the CDR bytes of a message.
    """
    # Parts of each linkage's motion, from groups of adjacent messages with the same joints.
    parts: dict[str, list[LinkMotion]] = {}
    for names, group in itertools.groupby(samples, lambda sample: _linkages_in(robot, sample[1])):
        shifts, messages = zip(*group, strict=True)
        stamps, numbers = robot.templates.of(names).joint_states.read(b''.join(messages))
        counts = [len(robot.simulators[name].joints) for name in names]
        table = np.reshape(numbers.T, (3, sum(counts), -1))
        first = 0  # joint of the linkage
        for name, count in zip(names, counts, strict=True):
            own = table[:, first : first + count]
            motion = stamps + np.array(shifts), *_motion_in(robot.simulators[name], own)
            parts.setdefault(name, []).append(motion)
            first += count
    return {name: _concatenated(motions) for name, motions in parts.items()}


def _concatenated(motions: 'Sequence[LinkMotion]') -> 'LinkMotion':
    """Returns the motion whose arrays are those of several motions, one after another."""
    return cast('LinkMotion', tuple(map(np.concatenate, zip(*motions, strict=True))))


def _linkages_in(robot: Robot, message: bytes) -> tuple[str, ...]:
    """Returns the linkages whose joints a message on joint_states holds."""
    if len(robot.names) == 1:
        return robot.names
    joints = {*decode_joint_state(message).names}
    return tuple(x.name for x in robot.simulators.values() if {*x.joints} <= joints)


def _motion_in(simulator: Simulator, table: Array) -> tuple[Array, Array, Array]:
    """Returns positions, rates and torques of a linkage; see `LinkMotion`.

    Args:
        simulator: Simulator of the linkage.
        table: Positions, rates and efforts of its joints, shape (3, joints, n).
    """
    joints = simulator.robot_joints
    driven_joint = joints[simulator.driven]
    driven = simulator.joints.index(driven_joint.name)  # among the published joints
    positions, rates, efforts = table
    if len(simulator.joints) < len(joints):  # the others follow from the driven joint
        place, rate = driven_joint.own(positions[driven]), rates[driven] / driven_joint.ratio
        state = simulator.solver.state(place, rate, 0.0 * rate)
        positions, rates = np.array([state.position, state.velocity])
    else:
        positions, rates = link_rows(joints, table[:2])
    torque = efforts[driven, :, np.newaxis] * driven_joint.ratio
    return positions.T, rates.T, torque


@contextmanager
def showing(
    log: LogReader,
    target: str,
    stop: cli.Stop,
    *,
    loop: bool = False,
    browser: bool = False,
    overwrite: bool = False,
) -> Iterator[Sink]:
    """Opens a view of a replay that only this machine can access.

    Args:
        log: The log to show.
        target: Target of the view; see `View`.
        stop: A request to end the program, which ends the wait for a page.
        loop: Whether the replay starts when a page connects, and repeats until Ctrl-C.
        browser: Whether to open the page in a browser, if there is a screen.
        overwrite: Whether to replace an existing .rrd file.

    Yields:
        A function that shows a message if it contains joint states, and ignores other messages.

    Raises:
        ViewerError: No viewer answers, the view cannot be opened, or it has ended.
    """
    states = log.channel(JOINT_STATES)
    view = _opened_view(log, target, loop=loop, browser=browser, overwrite=overwrite)
    worker: Worker[Any] = Worker(
        'view', view, capacity=_VIEW_CAPACITY, period=view.period, on_error=lambda _: None
    )

    def show(item: Item) -> None:
        _require_running(worker)
        if states and item.message.channel == states.number:
            # In a loop, the stamps of each round continue those of the previous round.
            worker.offer((item.time - item.message.time, item.message.data))

    try:
        if loop and view.page:
            with cli.waiting('waiting for a page'):
                while not view.is_watched() and not stop.wait(_POLL_SECONDS):
                    pass
        yield show
    finally:
        worker.close(_VIEW_CLOSE_SECONDS)
        lost = worker.dropped + view.dropped
        if lost and worker.error is None:
            words = f'{counted(lost, "state")} not shown: the viewer lagged or ended'
            cli.print_error(_NAME, words)
    _require_running(worker)


def _require_running(worker: 'Worker[Any]') -> None:
    """Raises the error that ended a view, if any.

    Raises:
        ViewerError: The view has ended.
    """
    if worker.error:
        raise ViewerError(f'the view ended: {worker.error}') from worker.error


def _opened_view(
    log: LogReader, target: str, *, loop: bool, browser: bool, overwrite: bool
) -> Any:
    """Opens the view, and its page in a browser; see `showing`.

    Raises:
        ViewerError: No viewer answers, or the view cannot be opened.
    """
    from linkage_ros.view.rerun_connection import View
    from linkage_ros.view.viewer_process import open_page

    read = functools.partial(motions_in, Robot(log.configuration))
    view = View(log.configuration, target, overwrite=overwrite, read=read)
    if view.trouble:
        raise ViewerError(f'no viewer answers at {target}: start one there first with `rerun`')
    if view.page:
        how = 'starts when a page connects, repeats until Ctrl-C; ' if loop else ''
        print(f'{how}watch it in a browser: {view.page}', flush=True)
        if browser:
            open_page(view.page)
    return view


def _replay(
    options: argparse.Namespace, ros_arguments: list[str], log: LogReader, stop: cli.Stop
) -> int:
    """Replays a log; returns the number of messages."""
    excerpt = excerpt_of(log, options.start_offset, options.playback_duration, options.topics)
    pace = Pace(excerpt.start, options.rate)
    publishers, viewers = list[Sink](), list[Sink]()
    with ExitStack() as stack:
        if options.viewer:  # opened first, because its errors occur immediately
            viewer = showing(
                log,
                options.viewer,
                stop,
                loop=options.loop,
                browser=not options.no_open,
                overwrite=options.overwrite,
            )
            viewers.append(stack.enter_context(viewer))
        if not options.no_ros:
            from linkage_ros.node.republish import republishing

            publishing = republishing(
                _NAME, ros_arguments, log, excerpt.topics, pace.position, options.clock
            )
            with cli.waiting('waiting for subscribers'):
                publish = stack.enter_context(publishing)
            publishers.append(lambda item: publish(item.message))
        keyboard = stack.enter_context(Keyboard())
        freeze_heap()
        wake_on_time()
        if options.delay:
            with cli.waiting(f'the replay begins in {options.delay:g} s'):
                stop.wait(options.delay)
        if options.start_paused:  # the line of the status needs a wide enough terminal
            print('paused: press the space bar to start', flush=True)
        items = stack.enter_context(feed(log, excerpt, loop=options.loop))
        show = stack.enter_context(_status(log, excerpt, pace))
        sinks = [*publishers, *viewers]  # a message is published before it is shown
        return play(items, sinks, pace, keyboard, stop, show, paused=options.start_paused)


def main() -> int:
    """Runs `linkage_replay`; returns the exit code. `cli.run` reports its errors."""
    own, ros_arguments = _split(sys.argv)
    options = _parser().parse_args(own)
    stop, log = cli.Stop(), LogReader(options.log)
    _check(options, log)
    # A page that ends with the log would be gone before somebody opens it.
    options.loop |= options.no_ros and options.viewer == WEB
    count = _replay(options, ros_arguments, log, stop)
    print(f'{options.log}: {counted(count, "message")} replayed')
    return 0


if __name__ == '__main__':
    sys.exit(cli.leave(cli.run(_NAME, main)))
