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
    verified,
    wait_for,
    watched,
)
from rosgraph_msgs.msg import Clock

STATES, DESCRIPTION = '/joint_states', '/robot_description'
MS = 10**6
START = 50 * 10**9


def stamps(listener):
    return [stamp for stamp, _ in decoded(listener.received[STATES])]


@pytest.fixture(scope='module')
def simulated(tmp_path_factory):
    """A run whose clock begins late, runs at half rate, stands, goes back and tells no time."""
    path = tmp_path_factory.mktemp('simulated') / 'run.mcap'
    arguments = node_arguments(use_sim_time='true', log=path)
    with watched([STATES, DESCRIPTION], *arguments) as (listener, process):
        publisher = listener.node.create_publisher(Clock, '/clock', 10)

        def tell(now):
            message = Clock()
            message.clock.sec, message.clock.nanosec = divmod(now, 10**9)
            publisher.publish(message)
            return stamps(listener)[-1:] == [now]

        def run(begin, steps, pause):
            """Tells times 10 ms apart, each until there is a state of it."""
            for now in range(begin, begin + (steps + 1) * 10 * MS, 10 * MS):
                wait_for(lambda now=now: tell(now))
                time.sleep(pause)

        wait_for(lambda: listener.received[DESCRIPTION])  # it does not wait for the clock
        assert stamps(listener) == []  # no clock, no time
        run(START, 50, 0.02)
        for _ in range(20):
            tell(START + 500 * MS)
            time.sleep(0.01)
        assert len(stamps(listener)) == 101  # it stood still
        run(START - 10**9, 20, 0.01)
        for seconds, rest in ((2**31 - 1, 2**32 - 1), (-1, 0)):
            message = Clock()
            message.clock.sec, message.clock.nanosec = seconds, rest
            publisher.publish(message)
        run(START - 10**9 + 210 * MS, 4, 0.01)
        output = stop(process)
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


def test_invalid_clock_messages_do_not_end_the_node(simulated):
    got, path, output = simulated
    assert 'message on /clock is left out: 2147483651294967295 ns: must be from 0 to' in output
    assert verified(path).states == len(got)
