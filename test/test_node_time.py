# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The real node on simulated time."""

import time
from itertools import pairwise

import pytest
from ros_harness import (
    decoded,
    logged,
    node_arguments,
    stop,
    wait_for,
    watched,
)
from rosgraph_msgs.msg import Clock

from linkage_ros.log.reader import LogReader
from linkage_ros.verification.verify import verify

STATES, DESCRIPTION = '/joint_states', '/robot_description'
MS = 10**6
START = 50 * 10**9


class FakeClock:
    """Publishes /clock as a simulator does."""

    def __init__(self, listener):
        self._listener = listener
        self._publisher = listener.node.create_publisher(Clock, '/clock', 10)
        self.now = START

    def publish(self, seconds, rest):
        message = Clock()
        message.clock.sec, message.clock.nanosec = seconds, rest
        self._publisher.publish(message)

    def tell(self):
        self.publish(*divmod(self.now, 10**9))

    def reach(self, now):
        """Tells a time until there is a state of it: who lags hears the latest time only."""
        self.now = now
        wait_for(lambda: self.tell() or stamps(self._listener)[-1:] == [now])

    def run(self, seconds, rate=1.0, step=0.01):
        """Lets it run for a while of its own time, at a rate of real time or slower."""
        for _ in range(round(seconds / step)):
            time.sleep(step / rate)
            self.reach(self.now + round(step * 1e9))


def stamps(listener):
    return [stamp for stamp, _ in decoded(listener.received[STATES])]


@pytest.fixture(scope='module')
def simulated(tmp_path_factory):
    """A run whose clock begins late, runs at half rate, stands, goes back and tells no time."""
    path = tmp_path_factory.mktemp('simulated') / 'run.mcap'
    arguments = node_arguments(use_sim_time='true', log=path)
    with watched([STATES, DESCRIPTION], *arguments) as (listener, process):
        wait_for(lambda: listener.received[DESCRIPTION])  # it does not wait for the clock
        assert stamps(listener) == []  # no clock, no time
        clock = FakeClock(listener)
        clock.reach(START)
        clock.run(0.5, rate=0.5)
        for _ in range(20):
            clock.tell()
            time.sleep(0.01)
        assert len(stamps(listener)) == 101  # it stood still
        clock.reach(START - 10**9)
        clock.run(0.2)
        for seconds, rest in ((2**31 - 1, 2**32 - 1), (-1, 0)):
            clock.publish(seconds, rest)
        clock.run(0.05)
        code, output = stop(process)
    assert code == 0, output
    return stamps(listener), path, output


def test_states_follow_a_clock_that_runs_at_half_rate_stands_and_goes_back(simulated):
    got, path, output = simulated
    assert 'the clock was stepped by -1.505 s' in output
    assert got[:101] == [START + 5 * MS * i for i in range(101)]
    assert got[101:] == [START - 10**9 + 5 * MS * i for i in range(51)]
    # The crank goes on from where it was. The log is in the order of publishing.
    log, messages = logged(path)
    numbers = [values for _, values in decoded(m.data for m in messages[STATES])]
    turned = [b[0] - a[0] for a, b in pairwise(numbers)]
    assert turned == pytest.approx([numbers[0][3] * 0.005] * 151, rel=1e-9)
    assert [motion.stamp for motion in log.motions] == [START, START - 10**9]


def test_a_clock_that_tells_no_time_ends_nothing(simulated):
    got, path, output = simulated
    assert 'message on /clock is left out: 2147483651294967295 ns: must be from 0 to' in output
    assert 'Traceback' not in output
    with LogReader(path) as log:
        report = verify(log)
    assert (report.states, report.difference) == (len(got), '')
