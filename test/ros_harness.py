# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Starts real processes on DDS for the tests, listens to them from outside, and stops them."""

import fcntl
import gc
import itertools
import os
import re
import signal
import subprocess
import sys
import tempfile
import threading
import time
from collections import deque
from contextlib import contextmanager
from pathlib import Path

import rclpy
from forked import LAB, Forked
from joint_codec import JointStateCodec
from rcl_interfaces.msg import Parameter, ParameterValue
from rcl_interfaces.srv import GetParameters, ListParameters, SetParameters
from rclpy.context import Context
from rclpy.exceptions import InvalidHandle
from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node
from rclpy.qos import DurabilityPolicy, QoSProfile
from rosgraph_msgs.msg import Clock
from sensor_msgs.msg import JointState

from linkage_ros.log.reader import LogReader
from linkage_ros.log.verify import verify
from linkage_ros.messages.cdr import stamp_of
from linkage_ros.messages.topics import JOINT_COMMANDS, SIMULATED_CLOCK, TOPICS, point_topic
from linkage_ros.node.endpoints import message_class
from linkage_ros.units import NS_PER_S

# Time, s, after which a wait counts as a hang; no load of a machine reaches it.
PATIENCE = 300.0

# Each test process (pytest -n 3) uses a third of these domains. Benchmarks use domains from 90
# on; a test also runs one, in a separate network but with the same shared memory.
_WORKER = int(os.environ.get('PYTEST_XDIST_WORKER', 'gw0')[2:]) % 3
_OWN = 26
_domains = (10 + _OWN * _WORKER + n % _OWN for n in itertools.count(os.getpid()))
# Locked files of the latest domains; older ones are in use, so that their ports are open.
_claims, _CLAIMS = deque[int](), 8
_TYPES = {
    topic.name.rpartition('/')[2]: topic.interface.name
    for topic in (*TOPICS, point_topic('coupler_point'), JOINT_COMMANDS, SIMULATED_CLOCK)
}
# The package may be in the source tree next to the tests, or installed.
PACKAGE_PATH = os.pathsep.join(
    filter(None, (str(Path(__file__).parents[1]), os.environ.get('PYTHONPATH')))
)
CODEC = JointStateCodec(('crank', 'coupler', 'rocker'))


def taken_domains():
    """Returns the domains that are in use on this machine; RTPS assigns 250 UDP ports to each."""
    sockets = Path('/proc/net/udp').read_text().splitlines()[1:]
    ports = [int(line.split()[1].rpartition(':')[2], 16) for line in sockets]
    return {(port - 7400) // 250 for port in ports}


def clear_ports(domain, folder=Path('/dev/shm')):
    """Removes Fast DDS ports that killed processes left in an unused domain.

    An incomplete one would block every later process of the domain.
    """
    first = 7400 + 250 * domain
    for port in range(first, first + 250):
        folder.joinpath(f'fastrtps_port{port}').unlink(missing_ok=True)


def claim(domain):
    """Reserves a domain against other test processes; returns whether it was free.

    A domain counts as taken when its ports are open, which may be seconds after its choice.
    """
    path = Path(tempfile.gettempdir(), f'linkage_ros_{os.getuid()}_domain_{domain}')
    file = os.open(path, os.O_CREAT | os.O_WRONLY)
    try:
        fcntl.lockf(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError:
        os.close(file)
        return False
    _claims.append(file)
    if len(_claims) > _CLAIMS:
        os.close(_claims.popleft())
    return True


def _next_unused():
    taken = taken_domains()
    candidates = itertools.islice(_domains, _OWN)
    return next((n for n in candidates if n not in taken and claim(n)), None)


def fresh_domain():
    """Returns an unused domain, isolated from leftovers and other test runs."""
    domain = _next_unused()
    if domain is None:
        # A node that was refused in this process keeps its domain until its cycles are collected.
        gc.collect()
        domain = _next_unused()
    clear_ports(domain)
    return domain


def environment(domain):
    return {
        **os.environ,
        'PYTHONPATH': os.pathsep.join((os.environ.get('PYTHONPATH', ''), PACKAGE_PATH)),
        'ROS_DOMAIN_ID': str(domain),
        'ROS_AUTOMATIC_DISCOVERY_RANGE': 'LOCALHOST',
        'PYTHONUNBUFFERED': '1',
    }


def command(program, *arguments):
    """Returns the command line of a program, to start it as a new Python process."""
    place = f'linkage_ros.executables import {program}'
    if program in LAB:
        place = f'linkage_lab.{LAB[program]} import main'
    code = f'import sys; from {place} as run; sys.exit(run())'
    return [sys.executable, '-c', code, *map(str, arguments)]


_HIDE = """
import os
from importlib.machinery import PathFinder

find_spec, hidden = PathFinder.find_spec, os.environ['HIDDEN_LIBRARIES'].split(',')


def find(name, path=None, target=None):
    return None if name.partition('.')[0] in hidden else find_spec(name, path, target)


PathFinder.find_spec = find
"""


def hiding(folder, names):
    """Returns environment variables that hide libraries from new Python processes.

    Args:
        folder: A folder for the file that hides them.
        names: Names of top-level modules.
    """
    folder.mkdir(exist_ok=True)
    (folder / 'sitecustomize.py').write_text(_HIDE)
    path = os.pathsep.join((str(folder), os.environ.get('PYTHONPATH', '')))
    return {'PYTHONPATH': path, 'HIDDEN_LIBRARIES': ','.join(names)}


def node_arguments(**parameters):
    words = [word for name, value in parameters.items() for word in ('-p', f'{name}:={value}')]
    return ['--ros-args', *words]


def _start(program, *arguments, **options):
    if isinstance(program, list):
        words = map(str, (*program, *arguments))
        return subprocess.Popen([*words], **{'stdout': subprocess.PIPE, 'text': True, **options})
    return Forked(program, *arguments, **options)


@contextmanager
def running(program, *arguments, domain, **options):
    """Runs a program for the duration of the block.

    Args:
        program: Program of `Forked`, or the words of a command, which starts a new process.
        *arguments: Arguments of the program.
        domain: DDS domain.
        **options: Options of the process.

    Yields:
        The process.
    """
    options = {'env': environment(domain), 'stderr': subprocess.PIPE, **options}
    process = _start(program, *arguments, **options)
    try:
        yield process
    finally:
        process.kill()
        process.communicate()
        if isinstance(process, Forked):
            process.close()


@contextmanager
def watched(topics, *arguments, program='node', domain=None, **options):
    """Starts a listener and a process in a domain of their own.

    Args:
        topics: Names, whose last word determines the type; or types by name.
        *arguments: Arguments of the process.
        program: Program to run; see `running`.
        domain: Domain to use instead of a new one.
        **options: Options of the process.

    Yields:
        The listener and the process.
    """
    if not isinstance(topics, dict):
        topics = {name: _TYPES[name.rpartition('/')[2]] for name in topics}
    domain = domain or fresh_domain()
    with (
        Listener(domain, topics) as listener,
        running(program, *arguments, domain=domain, **options) as process,
    ):
        yield listener, process


def stop(process, number=signal.SIGINT, code=0):
    """Ends a process by a signal, checks its exit code, and returns its output."""
    process.send_signal(number)
    printed = ''.join(process.communicate(timeout=PATIENCE))
    assert process.returncode == code, printed
    assert 'Traceback' not in printed
    return printed


def finished(program, *arguments, domain=None, **options):
    """Runs a program to its end; returns its exit code and output."""
    with running(program, *arguments, domain=domain or fresh_domain(), **options) as process:
        printed = process.communicate(timeout=PATIENCE)
        return subprocess.CompletedProcess(process.args, process.returncode, *printed)


def assert_refused(code, out, err, words):
    """Asserts exit code 2 and, on stderr, one short, printable line a mistake, which matches."""
    assert (code, out) == (2, ''), err
    line = r'[^\n]{,690}\n'
    one_or_list = rf'linkage_\w+( \w+)?: ({line}|[^\n]{{,200}}\d+ mistakes:\n(\(\d+\) {line})+)'
    assert re.fullmatch(one_or_list, err), err
    assert all(part.isprintable() for part in err.splitlines()), ascii(err)
    assert re.search(words, err), err


def report_of(path):
    """Verifies a log; returns the report."""
    log = LogReader(path)
    return verify(log)


def verified(path):
    """Verifies a log, asserts that all bits are equal, and returns the report."""
    report = report_of(path)
    assert (report.difference, report.ulp) == ('', 0.0)
    return report


def logged(path):
    """Reads a log; returns the reader and the messages by topic."""
    log = LogReader(path)
    messages = {topic.name: [] for topic in log.topics}
    for message in log.messages():
        messages[message.topic].append(message)
    return log, messages


def decoded(messages):
    """Decodes joint states of a four-bar to pairs of stamp and numbers."""
    return [CODEC.decode(data) for data in messages]


class Listener:
    """Subscribes to topics in this process, and keeps the received bytes.

    Attributes:
        received: Messages by topic.
        sent: Times at which the publisher sent them, s, by topic.
    """

    def __init__(self, domain, topics):
        self.received = {topic: [] for topic in topics}
        self.sent = {topic: [] for topic in topics}
        self._context = Context()
        os.environ['ROS_AUTOMATIC_DISCOVERY_RANGE'] = 'LOCALHOST'
        rclpy.init(context=self._context, domain_id=domain)
        self.node = Node('listener', context=self._context)
        for topic, kind in topics.items():
            latched = topic.endswith('robot_description')
            durability = DurabilityPolicy.TRANSIENT_LOCAL if latched else DurabilityPolicy.VOLATILE
            self.node.create_subscription(
                message_class(kind),
                topic,
                lambda data, info, topic=topic: self._hear(topic, data, info),
                QoSProfile(depth=1 if latched else 1000, durability=durability),
                raw=True,
            )
        self._executor = SingleThreadedExecutor(context=self._context)
        self._executor.add_node(self.node)
        self._is_closing = False
        self._thread = threading.Thread(target=self._spin, daemon=True)
        self._thread.start()

    def _spin(self):
        try:
            self._executor.spin()
        except (InvalidHandle, AttributeError):
            # Raised by rclpy if it is shut down within a callback or while it prepares to wait.
            if not self._is_closing:
                raise

    def _hear(self, topic, data, info):
        self.sent[topic].append(info['source_timestamp'] / 1e9)
        self.received[topic].append(bytes(data))

    def await_more(self, count, topic='/joint_states'):
        """Waits until a number of further messages have arrived."""
        received = self.received[topic]
        due = len(received) + count
        wait_for(lambda: len(received) >= due)

    def __enter__(self):
        return self

    def __exit__(self, *error):
        self._is_closing = True
        self._executor.shutdown()
        self._thread.join()
        self.node.destroy_node()
        self._context.shutdown()


def unbroken(heard, sent):
    """Returns whether received messages are consecutive sent messages, from first to last.

    On a busy machine, a subscriber may be matched late, and end before it has received everything.
    """
    begin = sent.index(heard[0])
    return heard == sent[begin : begin + len(heard)]


def wait_for(condition, seconds=PATIENCE, pause=0.01):
    """Waits until a condition holds, and pauses between attempts, s; fails if it never does."""
    end = time.monotonic() + seconds
    while not condition():
        assert time.monotonic() < end, f'not within {seconds} s'
        time.sleep(pause)


def call(listener, kind, name, request, namespace=''):
    """Calls a service, and returns its response.

    On a busy machine, Fast DDS drops the response to a client that its service has not matched
    within 0.1 s, and the client waits in vain; the request is then sent again.
    """
    client = listener.node.create_client(kind, f'{namespace}/linkage_node/{name}')
    assert client.wait_for_service(PATIENCE)
    futures, sent = [], 0.0

    def answered():
        nonlocal sent
        if time.monotonic() > sent + 5:
            futures.append(client.call_async(request))
            sent = time.monotonic()
        return any(future.done() for future in futures)

    wait_for(answered)
    listener.node.destroy_client(client)
    return next(future.result() for future in futures if future.done())


def set_parameter(listener, name, namespace='', **value):
    parameter = Parameter(name=name, value=ParameterValue(**value))
    request = SetParameters.Request(parameters=[parameter])
    return call(listener, SetParameters, 'set_parameters', request, namespace).results[0]


def dump(listener):
    """Returns the values of all parameters by name, requested as by `ros2 param dump`."""
    listed = call(listener, ListParameters, 'list_parameters', ListParameters.Request())
    names = sorted(listed.result.names)
    got = call(listener, GetParameters, 'get_parameters', GetParameters.Request(names=names))
    return dict(zip(names, got.values, strict=True))


def measurement(stamp, positions, **fields):
    """Makes a message with positions by joint, and a stamp, ns."""
    message = JointState(name=[*positions], position=[*positions.values()], **fields)
    message.header.stamp.sec, message.header.stamp.nanosec = divmod(stamp, NS_PER_S)
    return message


class SteppedClock:
    """Simulated time of a node, which passes one tick after the other.

    A step waits for the state and, with a controller, for its answer, so that the motion does not
    depend on the speed of the machine.
    """

    def __init__(self, listener, period, start=100 * NS_PER_S):
        self._listener, self._period, self._now = listener, period, start
        self._times = listener.node.create_publisher(Clock, '/clock', 10)

    def go_on(self, step):
        """Lets a time pass, ns, without waiting for a state."""
        self._now += step
        self._tell()

    def _tell(self):
        message = Clock()
        message.clock.sec, message.clock.nanosec = divmod(self._now, NS_PER_S)
        self._times.publish(message)

    def step(self, is_answered=lambda _: True):
        """Steps by a period, and waits until the state of a time, ns, is there and answered."""
        self._now += self._period
        states = self._listener.received['/joint_states']
        wait_for(
            lambda: any(stamp_of(data) == self._now for data in states[-9:]) or self._tell(),
            pause=0.001,
        )
        wait_for(lambda: is_answered(self._now), pause=0.0005)

    def pass_until(self, condition, is_answered=lambda _: True):
        """Steps until a condition holds, for 20 s at most."""
        steps = range(20 * NS_PER_S // self._period)
        assert any(condition() or self.step(is_answered) for _ in steps)

    def await_controller(self):
        """Steps until a new controller answers; either direction may be connected late."""
        states, commands = (
            self._listener.received[topic] for topic in ('/joint_states', '/joint_commands')
        )
        before = len(commands)
        # States before this listener is connected are lost, so that time must go on.
        wait_for(lambda: states or self.go_on(self._period), pause=0.05)

        def has_answered():
            time.sleep(0.01)
            return len(commands) > before

        wait_for(lambda: has_answered() or self.step())
