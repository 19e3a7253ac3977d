# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Compares the crank's motion with rational arithmetic and 60 digits of pi.

The expected phases are fractions of turns, computed here from rpm and nanoseconds alone; pi comes
from mpmath. A double is correct if no other double is nearer to the exact value.
"""

import math
import random
from fractions import Fraction

import pytest
from hypothesis import given
from hypothesis import strategies as st
from mechanisms import examples
from mpmath import mp

from linkage_ros.log.records import decode_motion, encode_motion
from linkage_ros.motion.at_speed import SpeedMotion, SpeedSegment
from linkage_ros.motion.drives.speed import SpeedDrive
from linkage_ros.units import TIME_END

MINUTE = 60 * 10**9
# Stamp of a live run: 21 November 2026.
NOW = 1_795_000_000_123_456_789
# Resolution of phases, turns, and speeds, rpm.
GRID = Fraction(1, 2**128)

with mp.workdps(120):
    _man, _exp = (2 * mp.pi).man_exp
TWO_PI = Fraction(_man) * Fraction(2) ** _exp

RPMS = (150.0, 0.1, 1e-6, -33.3, 1e6, -1e6, 1 / 3, 2.0**-20, 59.999999999999996)
ELAPSED = (
    *(0, 1, 2, 3, 999, 10**6, 5 * 10**6, 399_999_999, 4 * 10**8, 400_000_001),
    *(10**9, MINUTE - 1, MINUTE, 86_400 * 10**9 + 7, 10**16 + 1, 123_456_789_012_345_678, 10**18),
)


def begin(rpm, stamp=0, **settings_):
    return SpeedDrive(rpm, **settings_).begin(stamp, None)


def is_nearest(value, exact):
    """Returns whether no double is nearer to a fraction than this one."""
    error = abs(Fraction(value) - exact)
    return all(
        error <= abs(Fraction(math.nextafter(value, side)) - exact)
        for side in (-math.inf, math.inf)
    )


def seam_distance(angle, other):
    """Returns the distance of two angles on the circle of two turns, rad."""
    difference = abs(angle - other)
    return min(difference, abs(4 * math.pi - difference))


class Ramp:
    """Closed-form motion, in mpf, of a crank that accelerates uniformly to its speed; rad, s."""

    def __init__(self, rpm, start_rpm, acceleration, angle=0.0):
        self.start, self.end = (mp.mpf(x) * mp.pi / 30 for x in (start_rpm, rpm))
        self.acceleration = mp.mpf(acceleration) * mp.sign(self.end - self.start)
        self.angle = mp.mpf(angle)
        self.time = abs(self.end - self.start) / mp.mpf(acceleration)

    def at(self, elapsed):
        t = mp.mpf(elapsed) / 10**9
        ramp = min(t, self.time)
        angle = self.angle + self.start * ramp + self.acceleration * ramp**2 / 2
        if t < self.time:
            return angle, self.start + self.acceleration * t, self.acceleration
        return angle + self.end * (t - ramp), self.end, mp.mpf(0)


def ulps(value, exact):
    return abs(mp.mpf(value) - exact) / mp.mpf(math.ulp(float(exact)))


# ---------------------------------------------------------------- constant speed


@pytest.mark.parametrize('rpm', RPMS)
@pytest.mark.parametrize(('crank_angle', 'start'), [(0.0, 0), (-2.5, NOW), (1e6, -NOW)])
def test_phase_is_exact_and_angles_are_correctly_rounded(rpm, crank_angle, start):
    motion = begin(rpm, start, crank_angle=crank_angle)
    for elapsed in ELAPSED:
        crank, turns = motion.at(start + elapsed), Fraction(rpm) * elapsed / MINUTE
        turned = Fraction(crank_angle) + TWO_PI * turns
        assert is_nearest(crank.unwrapped, turned), elapsed
        assert is_nearest(crank.q[0], turned % (2 * TWO_PI)), elapsed
        assert is_nearest(crank.u[0], TWO_PI * Fraction(rpm) / 60)
        assert crank.a[0] == 0.0
        assert motion.speed(start + elapsed) == Fraction(rpm)
        assert abs(motion.phase(start + elapsed) - turned / TWO_PI) < GRID


# ---------------------------------------------------------------- ramps

RAMPS = {
    'from rest': (150.0, 0.0, 20.0, 0.0),
    'to rest': (0.0, 150.0, 3.0, 0.4),
    'through a reversal': (90.0, -120.0, 11.3, -2.0),
    'through a reversal, clockwise': (-90.0, 120.0, 0.7, 100.0),
    'slower, same sense': (10.0, 300.0, 1.9, 5.0),
    'hard': (1e6, -1e6, 1e9, 0.0),
    'for years': (1e6, 0.0, 1e-4, 0.0),
    'a whisker': (math.nextafter(150.0, 200.0), 150.0, 0.5, 0.0),
}


def ramp_stamps(ramp):
    """Returns stamps on the ramp, a nanosecond before and after its end, and later."""
    end = int(mp.floor(ramp.time * 10**9))
    spread = [end * i // 37 for i in range(37)]
    return sorted({*spread, max(0, end - 1), end, end + 1, end + 2, end + 10**9, 3 * end + 17})


@pytest.mark.parametrize('values', RAMPS.values(), ids=RAMPS.keys())
def test_a_ramp_follows_its_closed_form(values):
    rpm, start_rpm, acceleration, angle = values
    motion = begin(
        rpm, NOW, start_rpm=start_rpm, crank_acceleration=acceleration, crank_angle=angle
    )
    with mp.workdps(60):
        ramp = Ramp(*values)
        for elapsed in ramp_stamps(ramp):
            crank, (angle, speed, rate) = motion.at(NOW + elapsed), ramp.at(elapsed)
            assert ulps(crank.unwrapped, angle) <= 0.5
            assert abs(crank.unwrapped - angle) <= 1e-12 * max(1, abs(angle))
            # At a reversal the speed cancels: half an ulp of its terms remains.
            assert ulps(crank.u[0], speed) <= 0.5
            assert crank.a[0] == rate
            two_turns = 4 * mp.pi
            rest = angle - two_turns * mp.floor(angle / two_turns)
            assert abs(crank.q[0] - rest) <= 1e-12


def test_without_acceleration_the_speed_applies_at_once_and_start_rpm_is_ignored():
    plain, other = begin(150.0), begin(150.0, start_rpm=-40.0)
    for elapsed in ELAPSED:
        assert other.at(elapsed) == plain.at(elapsed)
    assert other.speed(0) == 150
    assert other.time_to_turn(1) == 4 * 10**8
    # With an acceleration it matters.
    assert begin(150.0, start_rpm=-40.0, crank_acceleration=1.0).speed(0) == -40


@pytest.mark.parametrize('acceleration', [1e-30, 1e-39, 1e-41, 5e-324])
def test_tiny_acceleration_keeps_the_start_speed(acceleration):
    motion = begin(100.0, start_rpm=50.0, crank_acceleration=acceleration)
    crank = motion.at(MINUTE)
    assert crank.u[0] == pytest.approx(50.0 * math.pi / 30, rel=1e-15)
    assert crank.unwrapped == pytest.approx(100 * math.pi, rel=1e-15)


# ---------------------------------------------------------------- changes


def test_a_change_continues_phase_and_speed():
    motion = begin(150.0, NOW, start_rpm=-20.0, crank_acceleration=7.0, crank_angle=1.0)
    # On the ramp, near its end, and after it.
    for elapsed in (0, 1, 777_777_777, 2_500_000_001, 10**12 + 1):
        stamp = NOW + elapsed
        changed = motion.change(stamp, -60.0)
        assert abs(changed.phase(stamp) - motion.phase(stamp)) <= GRID / 2
        assert abs(changed.speed(stamp) - motion.speed(stamp)) <= GRID / 2
        assert changed.at(stamp) == motion.at(stamp)._replace(a=(-7.0,))
        segment = changed.segment
        assert (segment.stamp, segment.rpm, segment.acceleration) == (stamp, -60.0, 7.0)
        # The log's numbers do not grow from change to change.
        assert {(value / GRID).denominator for value in (segment.phase, segment.speed)} == {1}


@pytest.mark.parametrize('step', [-(10**15), -50_000_001, 0, 3_600 * 10**9, 10**18])
def test_restamped_motion_differs_only_in_its_stamps(step):
    motion = begin(150.0, NOW, start_rpm=10.0, crank_acceleration=2.0)
    for elapsed in (0, 10**9, 10**10 + 1):
        stamp = NOW + elapsed
        plain, moved = motion.change(stamp, 80.0), motion.change(stamp, 80.0, restamp=stamp + step)
        assert moved.segment.stamp == stamp + step
        for later in (0, 1, 10**9, 5 * 10**9, 10**12 + 1):
            assert moved.at(stamp + step + later) == plain.at(stamp + later)


speeds = st.one_of(
    st.just(0.0), st.floats(1e-6, 1e6), st.floats(-1e6, -1e-6), st.sampled_from(RPMS)
)
drives = st.builds(
    SpeedDrive,
    speeds,
    st.one_of(st.none(), speeds),
    st.one_of(st.just(0.0), st.floats(1e-3, 1e9)),
    st.one_of(st.just(0.0), st.floats(1e-6, 1e6), st.floats(-1e6, -1e-6)),
)
times = st.integers(0, 10**12) | st.integers(0, 10**18)


@given(drives, st.lists(times, min_size=1, max_size=6), times)
def test_changing_to_the_same_speed_changes_nothing(drive, stamps, later):
    whole = drive.begin(NOW, None)
    pieces, stamp = whole, NOW
    for step in stamps:
        stamp += step
        pieces = pieces.change(stamp, drive.rpm)
    got, expected = pieces.at(stamp + later), whole.at(stamp + later)
    assert got._replace(q=expected.q) == expected
    # Within 2^-128 of the seam, 0 and 4 pi are the same angle.
    assert seam_distance(got.q[0], expected.q[0]) <= math.ulp(4 * math.pi)


# ---------------------------------------------------------------- time to turn


@pytest.mark.parametrize(
    ('rpm', 'start_rpm', 'acceleration', 'turns'),
    [(0.0, None, 0.0, 1), (0.0, 150.0, 0.0, 1), (0.0, 150.0, 3.0, 7), (0.0, -150.0, 3.0, 7)],
)
def test_crank_that_comes_to_rest_never_completes_the_turns(rpm, start_rpm, acceleration, turns):
    motion = begin(rpm, start_rpm=start_rpm, crank_acceleration=acceleration)
    assert motion.time_to_turn(turns) == TIME_END


@pytest.mark.parametrize('sense', [1, -1])
def test_time_to_turn_detects_a_peak_between_two_nanoseconds(sense):
    """Back by a little over a turn, then forward: a turn is reached near the reversal or late."""
    rng, peaks = random.Random(1), 0
    for _ in range(150):
        acceleration = rng.uniform(1e8, 5e8)
        # Within a nanosecond of the reversal, the crank moves by at most 4e-11 turns.
        speed = math.sqrt(4 * math.pi * acceleration) * (1 + 2e-11 * rng.random()) * 30 / math.pi
        motion = begin(sense * 1e6, start_rpm=-sense * speed, crank_acceleration=acceleration)
        peak_ns = int(Fraction(speed) * TWO_PI / 60 / Fraction(acceleration) * 10**9)
        near = [
            elapsed
            for elapsed in range(peak_ns - 2, peak_ns + 4)
            if abs(motion.phase(elapsed)) >= 1
        ]
        got = motion.time_to_turn(1)
        if near and min(near) > peak_ns - 2:
            peaks += 1
            assert got == min(near), (acceleration, speed)
        elif not near:
            assert got > 2 * peak_ns
    assert peaks > 15


@examples(20)
@given(drives, st.integers(1, 50))
def test_time_to_turn_is_the_first_nanosecond_at_which_the_turns_are_complete(drive, turns):
    motion = drive.begin(NOW, None)
    got = motion.time_to_turn(turns)
    if got == TIME_END:
        assert drive.rpm == 0
        return
    start = motion.phase(NOW)
    assert abs(motion.phase(NOW + got) - start) >= turns
    assert abs(motion.phase(NOW + got - 1) - start) < turns
    for part in range(17):
        assert abs(motion.phase(NOW + got * part // 17) - start) < turns


# ---------------------------------------------------------------- log and limits


@given(drives, times, speeds, times)
def test_the_log_keeps_a_motion_to_the_last_bit(drive, elapsed, rpm, later):
    for motion in (
        drive.begin(NOW, None),
        drive.begin(0, None).change(elapsed, rpm, restamp=NOW),
    ):
        strings = encode_motion(motion.segment)
        assert all(type(text) is str for item in strings.items() for text in item)
        segment = decode_motion(strings, SpeedSegment)
        assert segment == motion.segment
        again = SpeedMotion(segment)
        for stamp in (NOW, NOW + 1, NOW + later):
            assert again.at(stamp) == motion.at(stamp)
            assert again.phase(stamp) == motion.phase(stamp)
            assert again.speed(stamp) == motion.speed(stamp)
