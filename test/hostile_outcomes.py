# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Runs hostile input and requires success or a one-line error; other exceptions propagate.

It calls the same functions as the executables.
"""

import io
from contextlib import redirect_stderr, redirect_stdout

from joint_codec import JointStateCodec
from state_messages import messages_at

from linkage_ros import LinkageError
from linkage_ros.errors import MOST_LISTED
from linkage_ros.log.reader import LogReader
from linkage_ros.log.recover import recover
from linkage_ros.log.verify import verify
from linkage_ros.mechanism.conditions import OWN_CONDITIONS
from linkage_ros.messages.topics import JOINT_STATES
from linkage_ros.programs import replay
from linkage_ros.programs.log_commands import info, saved, verdict
from linkage_ros.programs.player import excerpt_of, feed
from linkage_ros.programs.record import record
from linkage_ros.quantities import build, flatten
from linkage_ros.run.states import Simulator
from linkage_ros.settings.configuration import load
from linkage_ros.settings.parameters import parameter_leaves
from linkage_ros.settings.summary import summary

LONGEST = 700  # characters of a line: at most 600 of an error, plus what the command line adds


def outcome(action):
    """Runs an action; returns the error line, or an empty string after success."""
    try:
        action()
    except LinkageError as error:
        return one_line(str(error))
    return ''


def one_line(words):
    """Checks an error message: one printable line, or a list; neither empty nor too long."""
    head, *mistakes = words.split('\n')
    assert not mistakes or head.endswith(' mistakes:'), ascii(words)
    assert len(mistakes) <= MOST_LISTED + 1, ascii(words)
    assert len(head) > 10, ascii(words)
    for line in (head, *mistakes):
        assert line.isprintable(), ascii(words)
        assert len(line) <= LONGEST, ascii(words)
    assert 'MemoryError' not in words, words
    return words


def parameter_file(path):
    """Reads a parameter file, and records its mechanism for a moment."""

    def run():
        configuration = load(str(path))
        summary(configuration.only, Simulator(configuration.only).solver)
        duration = min(0.02, 5 / configuration.session.rate_hz)
        record(configuration, path.with_suffix('.mcap'), duration=duration, overwrite=True)

    return [outcome(run)]


def log_file(path):
    """Inspects, verifies, plays and recovers a log, and verifies the recovered log."""
    out = path.with_suffix('.recovered.mcap')

    def look():
        log = LogReader(path)
        '\n'.join(info(log)).encode()

    def check(file):
        log = LogReader(file)
        '\n'.join(verdict(log, verify(log))).encode()

    def save():
        saved(out, recover(path, out, overwrite=True))
        check(out)

    return [outcome(work) for work in (look, lambda: check(path), lambda: play(path), save)]


def play(path, words=()):
    """Reads the messages that a replay with some options would play."""
    options = replay._parser().parse_args([str(path), *words])
    log = LogReader(path)
    replay._check(options, log)
    piece = excerpt_of(log, options.start_offset, options.playback_duration, options.topics)
    codec = JointStateCodec(Simulator(log.configuration.only).joints)
    states = log.channel(JOINT_STATES)
    with feed(log, piece, loop=False) as items:
        for item in items:
            assert 0 <= item.time < 2**31 * 10**9  # the range of /clock
            if states and item.message.channel == states.number:
                try:
                    codec.decode(item.message.data)
                except ValueError:
                    break


def replay_options(words, path):
    """Replays with some options; returns the exit code and the lines of the process."""
    out, err = io.StringIO(), io.StringIO()
    with redirect_stdout(out), redirect_stderr(err):
        try:
            line = outcome(lambda: play(path, words))
            code = 2 if line else 0
        except SystemExit as stop:
            code, line = stop.code, err.getvalue().removesuffix('\n')
    assert code in {0, 2}
    return [one_line(line) if code else '']


class LiveNode:
    """A node that declares the parameters of a configuration, as linkage_node does.

    Attributes:
        configuration: Current configuration.
        motion: Current motion of the simulator.
    """

    def __init__(self, configuration, context):
        from linkage_ros.node.parameter_node import ParameterNode

        self.configuration = configuration
        self.node = ParameterNode('live', context=context, enable_rosout=False)
        self._simulator = Simulator(configuration.only)
        self.motion = self._simulator.begin(0)
        self._drive, self._stamp = configuration.drive, 0
        leaves = parameter_leaves(configuration.only.kind)
        self.node.declare(leaves, configuration.parameters())
        self.node.set_live = self._set

    def _set(self, name, value):
        assert type(value) is float
        self._drive = build(type(self._drive), {**flatten(self._drive), name: value})

    def request(self, wanted):
        """Sets parameters as the node's service does; returns the reason of each refusal or ''."""
        from rcl_interfaces.msg import Parameter, ParameterValue
        from rcl_interfaces.srv import SetParameters

        parameters = [
            Parameter(name=name, value=ParameterValue(type=number, **{field: value}))
            for name, number, field, value in wanted
        ]
        request = SetParameters.Request(parameters=parameters)
        service = self.node._parameter_service
        response = service._set_parameters_callback(request, SetParameters.Response())
        assert len(response.results) == len(wanted)
        self._step()
        return ['' if r.successful else one_line(r.reason) for r in response.results]

    def _step(self):
        """Continues with the new parameters: with a motion, or a one-line error."""
        self._stamp += 5_000_000

        def go():
            self.motion = self.motion.under(self._stamp, OWN_CONDITIONS, self._drive)
            messages_at(self._simulator, self.motion, self._stamp)

        if outcome(go):
            self.motion, self._stamp = self._simulator.begin(0), 0
