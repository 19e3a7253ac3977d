# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""linkage_replay: publishes a log on its topics, byte for byte and in its rhythm."""

from __future__ import annotations

import argparse
import itertools
import os
import sys
import time
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from dataclasses import replace
from functools import partial

from linkage_ros import cli
from linkage_ros.errors import ConfigurationError
from linkage_ros.log.reader import LogReader
from linkage_ros.parameters.viewers import VIEWERS
from linkage_ros.playback.excerpt import Excerpt, excerpt_of
from linkage_ros.playback.feed import feed
from linkage_ros.playback.keyboard import Keyboard
from linkage_ros.playback.pace import FASTEST, SLOWEST, Pace
from linkage_ros.playback.player import KEYS, Player, Show, Sink
from linkage_ros.playback.replay_view import ReplayView
from linkage_ros.progress import progress_bar, waiting
from linkage_ros.quantities import Quantity
from linkage_ros.run.scheduling import freeze_heap, minimize_timer_slack, shorten_switch_interval
from linkage_ros.units import NS_PER_S

_NAME = 'linkage_replay'
_CLOCK_HZ = 40.0
_SHOW_SECONDS = 1.0
# What its options may be.
_RATE = Quantity('number', 'log time over real time', low=SLOWEST, high=FASTEST)
_OFFSET = Quantity('number', 'skip the beginning', 's of the log', 0.0, 1e9)
_DURATION = Quantity(
    'number', 'play this much from there, the end excluded', 's of the log', 1e-9, 1e9
)
_DELAY = Quantity('number', 'wait before the start', 's', 0.0, 1e6)
_CLOCK = Quantity('number', 'publish the log time on /clock', 'Hz', 0.01, 1e3)


@contextmanager
def _status(log: LogReader, excerpt: Excerpt, pace: Pace) -> Iterator[Show]:
    """A line on stderr: where in the log, at which rate, whether paused; only on a terminal."""
    end = (min(excerpt.end, log.end) - log.start) / NS_PER_S
    bar = progress_bar(
        total=max(end, 1e-9),
        bar_format='{percentage:3.0f}%|{bar}| {n:.3f}/{total:.3f} s{postfix}',
    )  # fmt: skip
    due, shown = 0.0, ''

    def show(moment: int) -> None:
        nonlocal due, shown
        words = f'rate {pace.rate:g}{", paused" if pace.paused else ""}'
        if bar.disable or (words == shown and time.monotonic() < due):
            return
        due, shown = time.monotonic() + _SHOW_SECONDS, words
        bar.n = max(0.0, min((moment - log.start) / NS_PER_S, end))
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
    parser.usage = '%(prog)s LOG.mcap [options]'  # behind --topics it would be one of them
    parser.epilog = f'{KEYS}\n\n{parser.epilog}'
    add, number = parser.add_argument, partial(cli.add_number, parser)
    # fmt: off
    add('log', metavar='LOG.mcap', type=cli.path, help='the log')
    number('-r', '--rate', quantity=_RATE, note=' (default 1)', default=1.0, metavar='R')
    add('-l', '--loop', action='store_true',
        help='begin again at the end, until Ctrl-C; the time on /clock goes on')
    number('--start-offset', quantity=_OFFSET, default=0.0, metavar='S')
    number('--playback-duration', quantity=_DURATION, metavar='S')
    add('-p', '--start-paused', action='store_true', help='wait for a key before the start')
    number('-d', '--delay', quantity=_DELAY, default=0.0, metavar='S')
    number('--clock', quantity=_CLOCK, note=f' (default {_CLOCK_HZ:g})', nargs='?',
           const=_CLOCK_HZ, metavar='HZ')
    add('--topics', nargs='+', metavar='NAME', help='replay these topics only')
    add('--viewer', default='', metavar='TARGET',
        help=f'also show it in Rerun: {VIEWERS}')
    add('--no-ros', action='store_true', help='do not publish, only view')
    # fmt: on
    return parser


def _check(options: argparse.Namespace, log: LogReader) -> None:
    length = (log.end - log.start) / NS_PER_S
    replace(_OFFSET, high=length).clean('--start-offset', options.start_offset)
    names = [topic.name for topic in log.topics]
    for name in options.topics or ():
        if name not in names:
            raise ConfigurationError(f'--topics {name}: the log has {", ".join(names)}')
    if options.no_ros and not options.viewer:
        raise ConfigurationError('--no-ros leaves nothing to do: give --viewer as well')
    if options.no_ros and options.clock is not None:
        raise ConfigurationError('--clock publishes a topic, which --no-ros rules out')
    if options.start_paused and not os.isatty(0):
        raise ConfigurationError('--start-paused needs a terminal, whose space bar goes on')


def _split(arguments: list[str]) -> tuple[list[str], list[str]]:
    """Our arguments, and ROS's from --ros-args to -- or the end."""
    if '--ros-args' not in arguments:
        return arguments[1:], arguments[:1]
    start = arguments.index('--ros-args')
    rest = arguments[start:]
    end = start + rest.index('--') if '--' in rest else len(arguments)
    return arguments[1:start] + arguments[end + 1 :], arguments[:1] + arguments[start:end]


def _sinks(
    stack: ExitStack, options: argparse.Namespace, of_ros: list[str], log: LogReader,
    excerpt: Excerpt, pace: Pace,
) -> list[Sink]:  # fmt: skip
    topics = None
    if not options.no_ros:
        try:
            from linkage_ros.playback.republish import republishing
        except ModuleNotFoundError as error:
            if not options.viewer or options.clock is not None:
                raise ConfigurationError(
                    'rclpy is not installed, so there are no topics: give --viewer'
                    + (', and no --clock' if options.clock is not None else '')
                ) from error
        else:
            topics = republishing(_NAME, of_ros, log, excerpt.topics, pace, options.clock)
    # A wrong viewer is said at once, topics wait for listeners; but messages go to topics first.
    views: list[Sink] = []
    if options.viewer:
        view = ReplayView(_NAME, log, options.viewer, alone=topics is None)
        views = [stack.enter_context(view)]
    if topics is None:
        return views
    with waiting('looks for listeners'):
        return [stack.enter_context(topics), *views]


def _run(arguments: list[str]) -> int:
    own, of_ros = _split(arguments)
    options = _parser().parse_args(own)
    stop = cli.Stop()
    with ExitStack() as stack:
        log = stack.enter_context(LogReader(options.log))
        _check(options, log)
        if any(b.stamp < a.stamp for a, b in itertools.pairwise(log.motions)):
            cli.print_error(
                _NAME, 'the clock was set back during this run: messages are played in the order '
                'of their log times, which mixes what came before and after',
            )  # fmt: skip
        excerpt = excerpt_of(log, options.start_offset, options.playback_duration, options.topics)
        pace = Pace(excerpt.start, options.rate)
        sinks = _sinks(stack, options, of_ros, log, excerpt, pace)
        keyboard = stack.enter_context(Keyboard())
        freeze_heap()
        shorten_switch_interval()
        minimize_timer_slack()
        if options.delay:
            with waiting(f'begins in {options.delay:g} s'):
                stop.wait(options.delay)
        items = stack.enter_context(feed(log, excerpt, loop=options.loop))
        show = stack.enter_context(_status(log, excerpt, pace))
        player = Player(pace, keyboard, stop, show)
        count = player.play(items, sinks, paused=options.start_paused)
    print(f'{options.log}: {count} messages replayed')
    return 0


def main() -> int:
    """Entry point."""
    return cli.run(_NAME, lambda: _run(sys.argv))


if __name__ == '__main__':
    sys.exit(cli.leave(main()))
