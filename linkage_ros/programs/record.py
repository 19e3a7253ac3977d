# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""linkage_record: writes the states of a run to a log, as fast as possible."""

import argparse
import gc
import math
import sys
from collections import Counter
from collections.abc import Callable, Iterator, Mapping, Sequence
from fractions import Fraction
from importlib.util import find_spec
from pathlib import Path
from typing import NamedTuple

from linkage_ros import cli
from linkage_ros.errors import (
    ConfigurationError,
    LogError,
    MotionError,
    UnreachableError,
    in_file,
    in_linkage,
)
from linkage_ros.files import is_same_file
from linkage_ros.log.bag import Bag, BagMessage, topic_of
from linkage_ros.log.measured_table import MeasuredTable
from linkage_ros.log.records import LinkageEnd
from linkage_ros.log.writer import LogWriter
from linkage_ros.mechanism.solver import Solver
from linkage_ros.messages.topics import MEASURED_JOINT_STATES, prefix_of, qualified
from linkage_ros.motion.steps import record_steps
from linkage_ros.quantities import Quantity, counted, leaves
from linkage_ros.run.batches import Batch, LinkageStates, batches
from linkage_ros.run.measured import MeasuredRun
from linkage_ros.run.robot import Robot
from linkage_ros.settings.configuration import (
    Configuration,
    configure,
    preset_note,
    read_values,
)
from linkage_ros.settings.help import HELP_PARAMETERS
from linkage_ros.settings.notes import notes
from linkage_ros.settings.parameters import Session
from linkage_ros.settings.presets import preset_names
from linkage_ros.settings.summary import summary
from linkage_ros.units import NS_PER_S

_NAME = 'linkage_record'
_DEFAULT_DURATION = 10.0  # s
_LONGEST = 1e9  # s, thirty years, which is within the range of ROS time
_DURATION = Quantity('number', 'duration', 's', 1e-9, _LONGEST)
_REVOLUTIONS = Quantity('whole', 'rotation of the crank', 'turns', 1, _LONGEST)
_BATCH = 2048  # measurements per batch
_RATE = next(leaf.quantity for leaf in leaves(Session) if leaf.name == 'rate_hz')


def record(
    configuration: Configuration,
    path: Path | str,
    *,
    duration: float | None = None,
    revolutions: int | None = None,
    overwrite: bool = False,
    progress: bool = False,
    stopped: Callable[[], bool] = lambda: False,
    note: Callable[[str], object] = lambda _: None,
) -> int:
    """Writes the states from t = 0 up to, but not including, the end.

    The log time of each message is its stamp.

    Args:
        configuration: Configuration of the run.
        path: Path of the new log.
        duration: Duration of the record, s; by default 10.
        revolutions: Number of crank turns in either direction, instead of a duration.
        overwrite: Whether to replace an existing log.
        progress: Whether to show a progress bar on stderr.
        stopped: Function called before each batch of states; the record ends early if it returns
            True.
        note: Function called with a line for each load curve whose range the motion has left.

    Returns:
        The number of states written.

    Raises:
        ConfigurationError: The duration is out of range, or the crank does not complete the
            revolutions.
        MotionError: A torque-driven motion ends earlier. The log contains the states until then.
        UnreachableError: A state is impossible. The log contains the states before it.
        LogError: The file cannot be written.
    """
    robot = Robot(configuration)
    linkages = [LinkageStates(x, x.begin(0, record_steps)) for x in robot.simulators.values()]
    count, written = count_states(linkages, duration, revolutions), 0
    ends = dict[str, MotionError | UnreachableError]()
    with LogWriter(path, configuration, overwrite=overwrite) as log:
        describe = _add_topics(log, robot)
        for linkage in linkages:
            log.write_motion(linkage.motion.segment, linkage.name)
        describe(0)
        try:
            with cli.progress_bar(
                total=count, wanted=progress, unit=' states', unit_scale=True
            ) as bar:
                for batch in batches(robot, linkages, count, revolutions or 0):
                    ends |= batch.ends
                    if stopped() or not batch.stamps:
                        break
                    _write(log, batch)
                    written += len(batch.stamps)
                    bar.update(len(batch.stamps))
        finally:
            for linkage in linkages:
                for line in linkage.ranges.notes():
                    note(f'{prefix_of(linkage.name, ": ")}{line}')
    if ends:
        which = 'before it' if len(ends) == len(linkages) else 'of the others'
        error = _end_of_run(ends, f'{path} keeps the {counted(written, "state")} {which}')
        raise error
    return written


def _write(log: LogWriter, batch: Batch) -> None:
    for name, error in batch.ends.items():
        log.write_event(LinkageEnd(batch.stamps[0], str(error), name))
    for name, segment in batch.segments.items():
        log.write_motion(segment, name)
    log.write_states(batch.stamps, batch.stamps, batch.numbers, batch.linkages)


def _end_of_run(
    ends: Mapping[str, MotionError | UnreachableError], kept: str
) -> MotionError | UnreachableError:
    """Returns the error of a run with motions that ended early; `kept` is what the log keeps."""
    words = '; '.join(f'{prefix_of(name, ": ")}{error}' for name, error in ends.items())
    first = next(iter(ends.values()))
    if isinstance(first, MotionError):
        return MotionError(f'{words}; {kept}', time=first.time, coordinates=first.coordinates)
    return UnreachableError(f'{words}; {kept}', crank_angle=first.crank_angle, arcs=first.arcs)


def _add_topics(log: LogWriter, robot: Robot) -> Callable[[int], object]:
    """Adds the topics of the states and, if they are published, those of the descriptions.

    Returns:
        A function that writes the descriptions at a log time, ns.
    """
    log.add_states(robot.templates, qualified)
    descriptions = [
        (log.add_topic(topic, qualified(topic)), message)
        for topic, message in robot.descriptions().items()
    ]

    def describe(time: int) -> None:
        log.write_messages((number, time, message) for number, message in descriptions)

    return describe


class Answered(NamedTuple):
    """The outcome of `record_measured`.

    Attributes:
        states: Number of states, one for each accepted measurement.
        rejected: Number of rejected measurements by cause.
    """

    states: int
    rejected: Counter[str]


def record_measured(
    configuration: Configuration,
    path: Path | str,
    bag: Path | str,
    *,
    topic: str = '',
    column: str = '',
    overwrite: bool = False,
    progress: bool = False,
    stopped: Callable[[], bool] = lambda: False,
    note: Callable[[str], object] = lambda _: None,
) -> Answered:
    """Writes the states that a live run would publish for measurements of a bag or a CSV file.

    The log also holds the measurements. Their log times are those of the bag, as are the times of
    receipt that replace missing stamps; the log time of a state is that of its measurement.

    Args:
        configuration: Configuration of the run, with `drive: follow`.
        path: Path of the new log.
        bag: An MCAP file, the folder of a rosbag2 recording, or a CSV file with the columns time
            and angle or, of a driven slide, position, as in a law of motion.
        topic: Topic of the measurements; by default, the only topic that names the crank.
        column: Column of the angles or positions in a CSV file that has another name.
        overwrite: Whether to replace an existing log.
        progress: Whether to show a progress bar on stderr.
        stopped: Function called before each batch of states; True ends the record early.
        note: Function called with a line if loads have topics, whose messages are not read.

    Returns:
        The numbers of states and of rejected measurements.

    Raises:
        ConfigurationError: The crank is not measured.
        LogError: The bag has no positions of the crank or has them on several topics, is damaged
            or incomplete, or the log cannot be written. The log contains the states before the
            damage.
    """
    if not configuration.drive_kind.is_measured:
        raise ConfigurationError('--measured needs drive: follow: the bag has the crank angles')
    robot = Robot(configuration)
    source, name = _source(robot, bag, topic, column)
    if any(is_same_file(str(path), str(file)) for file in source.files):
        raise LogError(f'{path} is the bag itself: choose another name')
    if live := [topic.name for topics in robot.live_forces().values() for topic in topics]:
        note(f'forces on {", ".join(live)} are not read from a recording: the constant force acts')
    run, written = MeasuredRun(robot, robot.inputs()[MEASURED_JOINT_STATES]), 0
    with (
        LogWriter(path, configuration, overwrite=overwrite) as log,
        cli.progress_bar(total=source.size, wanted=progress, unit='B', unit_scale=True) as bar,
    ):
        describe = _add_topics(log, robot)
        number = log.add_topic(MEASURED_JOINT_STATES, qualified(MEASURED_JOINT_STATES))
        try:
            for batch in _batches(source, name, bar.update):
                if not log.mcap.statistics.message_count:
                    describe(batch[0][1])
                log.write_messages((number, time, data) for _, time, data in batch)
                for states in run.answers((time, data) for _, time, data in batch):
                    log.write_states(states.times, states.stamps, states.numbers, states.linkages)
                    written += len(states.stamps)
                if stopped():
                    break
        except LogError as error:
            kept = f'{path} keeps the {counted(written, "state")} before it'
            raise LogError(f'{error}; {kept}') from error
    return Answered(written, run.rejected())


def _source(
    robot: Robot, path: Path | str, topic: str, column: str
) -> tuple[Bag | MeasuredTable, str]:
    """Opens the measurements; returns them and the name of their topic.

    Raises:
        ConfigurationError: An option does not apply to the kind of file.
        LogError: The file cannot be read, or lacks the measurements.
    """
    simulators = [*robot.simulators.values()]
    if Path(path).suffix.lower() != '.csv':
        if column:
            raise ConfigurationError('--column names a column of a CSV file: give --measured CSV')
        bag = Bag(path)
        return bag, topic_of(bag, [simulator.crank_joint for simulator in simulators], topic)
    if topic:
        raise ConfigurationError('--topic names a topic of a bag; of a CSV file, give --column')
    if len(simulators) > 1:
        raise ConfigurationError(f'{path} has one crank alone: give a bag with all of them')
    (simulator,) = simulators
    if simulator.linkage.drive.frame_joint_name:
        raise ConfigurationError(
            f'{path} has the crank alone, but frame_joint is measured, too: give a bag with both'
        )
    slides = simulator.solver.structure.driven_link.slides
    quantity = 'position' if slides else 'angle'
    table = MeasuredTable(path, simulator.crank_joint, quantity, column)
    return table, table.topic.name


def _batches(
    bag: Bag | MeasuredTable, name: str, progress: Callable[[int], object]
) -> Iterator[list[BagMessage]]:
    """Yields the messages of a topic in batches, also before an error.

    Raises:
        LogError: The bag is incomplete or damaged.
    """
    batch = list[BagMessage]()
    try:
        for messages in bag.messages(progress=progress):
            batch += [message for message in messages if message[0].name == name]
            if len(batch) >= _BATCH:
                yield batch
                batch = []
    except LogError:
        if batch:
            yield batch
        raise
    if batch:
        yield batch


def count_states(
    linkages: Sequence[LinkageStates], duration: float | None, revolutions: int | None
) -> int | None:
    """Computes the number of states in a record.

    Args:
        linkages: The linkages of the run.
        duration: Duration of the record, s; None for 10 s.
        revolutions: Number of turns of each crank in either direction, instead of a duration.

    Returns:
        The number of states; None for revolutions of a crank under a torque or along a law, whose
        duration is not known in advance.

    Raises:
        ConfigurationError: A value is out of range, or a crank does not complete the revolutions.
    """
    ticks = linkages[0].simulator.ticks
    if revolutions is None:
        duration = _DEFAULT_DURATION if duration is None else duration
        _DURATION.clean('duration', duration)
        # Use the decimal value, because 0.535 * 10^9 in binary is slightly more than 535000000.
        end = math.ceil(Fraction(repr(float(duration))) * NS_PER_S)
        return ticks.tick_at(end - 1) + 1
    _REVOLUTIONS.clean('revolutions', revolutions)
    ends = list[int]()
    for linkage in linkages:
        with in_linkage(linkage.name):
            turned = _end_of_turns(linkage, revolutions)
        if turned is None:
            return None
        ends.append(turned)
    return ticks.tick_at(max(ends) - 1) + 1


def _end_of_turns(linkage: LinkageStates, revolutions: int) -> int | None:
    """Returns the time after some turns of a crank, ns; None if it is not known in advance.

    Raises:
        ConfigurationError: The crank does not complete the revolutions.
    """
    driven = linkage.simulator.solver.structure.driven_link
    if driven.slides:
        raise ConfigurationError(
            f'a driven {driven.driven_word} makes no revolutions: give a --duration'
        )
    turned = linkage.motion.time_to_turn(revolutions)
    if turned is not None and turned > _LONGEST * NS_PER_S:
        raise ConfigurationError(
            f'the crank does not make {revolutions} revolutions within {_LONGEST:g} s: '
            'give a --duration, fewer revolutions, or a higher rpm'
        )
    return turned


def _parser() -> argparse.ArgumentParser:
    parser = cli.make_parser(
        _NAME,
        'Record the exact states of a mechanism to an MCAP log; needs no ROS.',
        (
            'quadrilateral run.mcap',
            'my_linkage.yaml run.mcap --revolutions 5 --rate 1000',
            'followed.yaml run.mcap --measured robot.mcap',
        ),
    )
    params = f'parameter file, or a preset: {", ".join(preset_names())}'
    cli.add_options(parser, (
        (('params',), None, {'metavar': 'PARAMS', 'help': params}),
        (('out',), None, {'metavar': 'OUT.mcap', 'type': Path, 'help': 'the log to write'}),
        (('--rate',), _RATE, {'note': ' (default: rate_hz of the file)', 'metavar': 'HZ'}),
        cli.OVERWRITE,
        HELP_PARAMETERS,
        (('--topic',), None,
         {'metavar': 'NAME', 'default': '', 'help': 'topic of the joint states in BAG (default: '
          'the only one that names the crank)'}),
        (('--column',), None,
         {'metavar': 'NAME', 'default': '', 'help': 'column of the angle in a CSV file (default: '
          'angle, angle_deg, position or position_mm)'}),
    ))  # fmt: skip
    cli.add_options(parser.add_mutually_exclusive_group(), (
        (('--duration',), _DURATION,
         {'note': f' (default {_DEFAULT_DURATION:g})', 'metavar': 'S'}),
        (('--revolutions',), _REVOLUTIONS, {'metavar': 'N'}),
        (('--measured',), None,
         {'metavar': 'BAG', 'help': 'with drive: follow, an MCAP file or a rosbag2 folder with '
          'joint states of the crank, or a CSV file with its time and angle or angle_deg; each '
          'gives a state'}),
    ))  # fmt: skip
    return parser


def _record(options: argparse.Namespace) -> int:
    stop, values = cli.Stop(), dict(read_values(options.params))
    if options.rate is not None:
        values['rate_hz'] = options.rate
    with in_file(options.params):
        configuration = configure(values)
    cli.print_notes(notes(configuration))
    if options.measured:
        return _record_measured(options, configuration, stop)
    for option in ('topic', 'column'):
        if getattr(options, option):
            raise ConfigurationError(f'--{option} is for measurements: give --measured BAG, too')
    count = record(
        configuration,
        options.out,
        duration=options.duration,
        revolutions=options.revolutions,
        overwrite=options.overwrite or configuration.session.log_overwrite,
        progress=True,
        stopped=stop.is_set,
        note=lambda line: cli.print_notes([line]),
    )
    if prefix := preset_note(values):
        print(prefix + summary(configuration.only, Solver(configuration.mechanism)))
    if stop.is_set():
        print(f'{options.out}: stopped; {counted(count, "state")} kept')
        return cli.STOPPED_BY_USER
    duration = count / configuration.session.rate_hz
    words = f'{options.out}: {counted(count, "state")}, {duration:g} s'
    if options.out.is_file():
        words += '; ' + _next_command(options.out)
    print(words)
    return 0


def _next_command(log: Path) -> str:
    """Names a command that shows a log with what is installed."""
    if find_spec('rerun') is None:
        return f'linkage_log csv {log} - prints it; with rerun-sdk, linkage_replay shows it'
    return f'linkage_replay {log} --viewer web --no-ros shows it'


def _record_measured(
    options: argparse.Namespace, configuration: Configuration, stop: cli.Stop
) -> int:
    states, rejected = record_measured(
        configuration,
        options.out,
        options.measured,
        topic=options.topic,
        column=options.column,
        overwrite=options.overwrite or configuration.session.log_overwrite,
        progress=True,
        stopped=stop.is_set,
        note=lambda line: cli.print_notes([line]),
    )
    causes = ''.join(f', {count} rejected: {cause}' for cause, count in rejected.items())
    print(f'{options.out}: {counted(states, "state")}{causes}')
    return cli.STOPPED_BY_USER if stop.is_set() else 0 if states else 1


def main() -> int:
    """Runs `linkage_record`; returns the exit code. `cli.run` reports its errors."""
    options = _parser().parse_args()
    gc.freeze()  # garbage collections need not visit what is imported
    gc.set_threshold(50_000)  # and rarely what a batch of measurements creates
    return _record(options)


if __name__ == '__main__':
    sys.exit(cli.run(_NAME, main))
