# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Measures how much torque feed-forward improves a speed controller.

linkage_node simulates the quadrilateral as a torque-driven plant at 1 kHz; linkage_controller
controls it from another process over DDS. Each case runs without and with feed-forward. The ripple
of the crank speed is computed from the second half of each log. DIR receives logs, figure and
JSON.

    python benchmarks/controller.py --out DIR           all cases, in two minutes
    python benchmarks/controller.py --out DIR --quick   one speed and the case "as it is"
"""

import argparse
import json
import math
import os
import sys
import tempfile
import threading
import time
from collections import deque
from contextlib import ExitStack
from pathlib import Path

import numpy as np
import rclpy
from reliability.harness import DOMAIN, environment, node, running, words
from sensor_msgs.msg import JointState

from linkage_ros.cli import progress_bar
from linkage_ros.log.reader import LogReader
from linkage_ros.log.verify import verify
from linkage_ros.messages.cdr import decode_joint_state
from linkage_ros.palette import FIRST, SECOND, fractions
from linkage_ros.run.robot import Robot
from linkage_ros.settings.presets import preset_path
from linkage_ros.units import radians_per_second

RATE, SECONDS = 1000.0, 6.0
TICK = 1 / RATE
# Name, factor on the masses in the controller's model, additional delay of commands, s.
CASES = (('as it is', 1.0, 0.0), ('5 % mass error', 1.05, 0.0), ('2 ms extra delay', 1.0, 0.002))
SPEEDS = (150.0, 600.0)
# If a larger share of the ticks is missed or has no command in time, the machine is too busy for
# the comparison. On an idle machine the share is 0.2 to 1.1 %.
BUSY = 0.02


def heavier(factor: float, folder: Path) -> Path:
    """Writes a parameter file of the quadrilateral with scaled masses and inertias."""
    import yaml

    document = yaml.safe_load(preset_path('quadrilateral').read_text())
    parameters = document['/**']['ros__parameters']
    for name in ('crank', 'coupler', 'rocker'):
        for key in ('mass', 'inertia'):
            parameters[name][key] *= factor
    path = folder / f'believed_{factor}.yaml'
    path.write_text(yaml.safe_dump(document))
    return path


class Relay(threading.Thread):
    """Forwards commands after a delay, like a slow network."""

    def __init__(self, delay: float) -> None:
        """Starts the forwarding thread.

        Args:
            delay: Delay of each command, s.
        """
        super().__init__()
        rclpy.init()
        self._delay, self._queue, self._stop_asked = delay, deque(), threading.Event()
        self._node = rclpy.create_node('relay')
        self._publisher = self._node.create_publisher(JointState, 'joint_commands', 10)
        self._node.create_subscription(JointState, 'slow_commands', self._hear, 10, raw=True)
        self.start()

    def _hear(self, data: bytes) -> None:
        self._queue.append((time.monotonic() + self._delay, data))

    def run(self) -> None:
        """Publishes each command when it is due."""
        while not self._stop_asked.is_set():
            left = self._queue[0][0] - time.monotonic() if self._queue else 0.05
            rclpy.spin_once(self._node, timeout_sec=max(0.0, left))
            while self._queue and self._queue[0][0] <= time.monotonic():
                self._publisher.publish(self._queue.popleft()[1])

    def close(self) -> None:
        """Stops the thread."""
        self._stop_asked.set()
        self.join()
        self._node.destroy_node()
        rclpy.shutdown()


def run(path: Path, rpm: float, plant: Path, delay: float, *, feed_forward: bool) -> None:
    """Runs plant and controller once; writes the log to a path."""
    given = words(
        {
            'plant': plant, 'rpm': rpm, 'feed_forward': str(feed_forward).lower(),
            'lead_time': 1.5 * TICK + delay,
        }
    )  # fmt: skip
    driven = {
        'drive': 'torque', 'start_rpm': rpm, 'rate_hz': RATE, 'log': path, 'log_overwrite': 'true',
    }  # fmt: skip
    remap = ['-r', 'joint_commands:=slow_commands'] if delay else []
    with ExitStack() as stack:
        if delay:
            stack.callback(Relay(delay).close)
        command = '-m', 'linkage_ros.programs.controller', *given, *remap
        controller = stack.enter_context(running(*command, domain=DOMAIN))
        time.sleep(1.5)
        with node(DOMAIN, **driven) as turning:
            time.sleep(SECONDS + 1.5)
            turning.end()
        controller.end()


def measure(path: Path, rpm: float) -> tuple[dict[str, float], np.ndarray]:
    """Evaluates a log.

    Args:
        path: The log.
        rpm: Set speed, rpm.

    Returns:
        Figures of the second half of the log; and crank angle, deg, relative speed error and
        torque, N m, over the last whole turn, as an array of shape (3, states).
    """
    log = LogReader(path)
    difference = verify(log).difference
    assert not difference, difference
    data = b''.join(message.data for message in log.messages(['/joint_states']))
    columns = Robot(log.configuration).templates.of(('',)).joint_states.read(data)
    rows = list(zip(*(column.tolist() for column in columns), strict=True))
    commands = list(log.messages(['/joint_commands']))
    speed, effort = np.array([values[3] for _, values in rows]), np.array([v[6] for _, v in rows])
    half = len(rows) // 2
    ripple = speed / radians_per_second(rpm) - 1
    # Runs end at different angles, so the last whole turn of each is drawn over the crank angle.
    # Turns are counted from -180 deg, which puts the peaks, near 0 deg, in the middle.
    turns = np.array([values[0] for _, values in rows]) / (2 * math.pi) + 0.5
    last = np.floor(turns) == math.floor(turns[-1]) - 1
    figures = {
        'peak_ripple': float(np.abs(ripple[half:]).max()),
        'p99_ripple': float(np.quantile(np.abs(ripple[half:]), 0.99)),
        'rms_ripple': float(np.sqrt(np.mean(ripple[half:] ** 2))),
        'peak_effort': float(np.abs(effort[half:]).max()),
        'states': len(rows),
        'missed': 1 - len(rows) / (1 + round((rows[-1][0] - rows[0][0]) * 1e-9 / TICK)),
        **respond(rows, commands),
    }
    return figures, np.array([360 * (turns[last] % 1) - 180, ripple[last], effort[last]])


def respond(rows, commands) -> dict[str, float]:
    """Measures the delay from the stamp of a state to its command, and to the command's effect."""
    answers, ages = {}, []
    for command in commands:
        heard = decode_joint_state(command.data)
        stamp, (effort,) = heard.stamp, heard.efforts
        answers[effort] = stamp
        ages.append((command.time - stamp) * 1e-6)
    efforts = np.array(sorted(answers))
    ticks = []
    for stamp, values in rows[len(rows) // 2 :]:
        near = efforts[np.abs(efforts - values[6]).argmin()]  # the motor line may round it
        ticks.append(round((stamp - answers[near]) * 1e-9 / TICK))
    p50, p99 = np.quantile(ages, (0.5, 0.99))
    return {
        'command_age_p50_ms': float(p50),
        'command_age_p99_ms': float(p99),
        'acts_after_ticks': float(np.median(ticks)),
        'acts_then': float(np.mean(np.array(ticks) == np.median(ticks))),
    }


def say(rpm: float, name: str, alone: dict[str, float], fed: dict[str, float]) -> str:
    """Describes a case: p99 of the speed error, peaks and delays."""
    ratio = alone['p99_ripple'] / fed['p99_ripple']
    words = (
        f'{rpm:5g} rpm, {name:17}: 99 % of states within {100 * alone["p99_ripple"]:.3g} % of the '
        f'speed by PI alone, {100 * fed["p99_ripple"]:.3g} % with feed-forward: {ratio:.3g} times '
        f'closer\n    peaks {100 * alone["peak_ripple"]:.3g} and '
        f'{100 * fed["peak_ripple"]:.3g} %; commands {fed["command_age_p50_ms"]:.2f} ms after the '
        f'stamp (p99 {fed["command_age_p99_ms"]:.2f}), act {fed["acts_after_ticks"]:g} tick later '
        f'in {100 * fed["acts_then"]:.1f} %'
    )
    late = max(1 - one['acts_then'] * (1 - one['missed']) for one in (alone, fed))
    if late > BUSY:
        words += (
            f'\n    the machine was busy: {100 * late:.1f} % of ticks were missed or had no '
            'command in time, which makes every figure worse; run it again at rest'
        )
    return words


def draw(curves: dict[tuple[float, str, bool], np.ndarray], path: Path) -> None:
    """Draws ripple and torque over the last turn of the crank, without and with feed-forward."""
    from linkage_lab.output import chart

    speeds = list(dict.fromkeys(rpm for rpm, _, _ in curves))
    names = list(dict.fromkeys(name for _, name, _ in curves))
    rows = 2 * len(speeds)
    with chart([path], 1.0 + 2.0 * rows) as figure:
        axes = figure.subplots(rows, len(names), squeeze=False, sharex=True, sharey='row')
        for (rpm, name, fed), (degrees, ripple, effort) in curves.items():
            above, below = axes[2 * speeds.index(rpm) :, names.index(name)][:2]
            color, law = (SECOND, 'with feed-forward') if fed else (FIRST, 'PI alone')
            above.plot(degrees, 100 * ripple, color=fractions(color), label=law)
            below.plot(degrees, effort, color=fractions(color))
            above.set_title(f'{rpm:g} rpm, {name}')
        for above, below in zip(axes[::2, 0], axes[1::2, 0], strict=True):
            above.set_ylabel('speed error, %')
            below.set_ylabel('applied torque, N m')
        for one in axes[-1]:
            one.set(xlabel='crank angle, deg', xticks=range(-180, 181, 90))
        figure.legend(
            *axes[0, 0].get_legend_handles_labels(), loc='outside upper center', ncols=2,
            title='The last whole turn of each run',
        )  # fmt: skip


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument(
        '--out', type=Path, default=Path('controller'), metavar='DIR', help='folder for results'
    )
    parser.add_argument('--quick', action='store_true', help='one speed and one case')
    options = parser.parse_args()
    options.out.mkdir(parents=True, exist_ok=True)
    os.environ.update(environment(DOMAIN))  # so that no other plant is commanded
    cases = CASES[:1] if options.quick else CASES
    speeds = SPEEDS[:1] if options.quick else SPEEDS
    records, curves = [], {}
    total = 2 * len(speeds) * len(cases)
    with (
        tempfile.TemporaryDirectory() as folder,
        progress_bar(total=total, desc='linkage_controller and its plant', unit=' runs') as bar,
    ):
        for rpm in speeds:
            for name, factor, delay in cases:
                for feed_forward in (False, True):
                    law = 'feed_forward' if feed_forward else 'pi'
                    path = options.out / f'{rpm:g}_{name.replace(" ", "_")}_{law}.mcap'
                    plant = heavier(factor, Path(folder))
                    run(path, rpm, plant, delay, feed_forward=feed_forward)
                    figures, curves[rpm, name, feed_forward] = measure(path, rpm)
                    records.append(
                        {'rpm': rpm, 'case': name, 'feed_forward': feed_forward, **figures}
                    )
                    bar.update()
                bar.write(say(rpm, name, *records[-2:]))
                sys.stdout.flush()
    (options.out / 'controller.json').write_text(json.dumps(records, indent=1) + '\n')
    draw(curves, options.out / 'controller.png')
    print(options.out / 'controller.png')


if __name__ == '__main__':
    try:
        main()
    except KeyboardInterrupt:
        sys.exit(130)
