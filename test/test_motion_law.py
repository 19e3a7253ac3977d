# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Compares laws of motion with their own formulas in 50 digits.

The reference of a spline is the polynomial of each interval, found by one linear system of the
conditions that define the spline, all coefficients unknown.
"""

import math
import struct
from bisect import bisect_right
from contextlib import nullcontext
from dataclasses import replace
from fractions import Fraction
from itertools import pairwise

import pytest
from live_logs import live, ticks
from mechanisms import LIMITED, of
from mpmath import mp
from oracle import oracle_of

from linkage_ros import ConfigurationError, Solver
from linkage_ros.errors import MotionError
from linkage_ros.log.expected_states import check_motions
from linkage_ros.log.reader import LogReader
from linkage_ros.log.records import decode_motion, encode_motion
from linkage_ros.log.verify import verify
from linkage_ros.motion.along_law import LawMotion, LawSegment, require_possible
from linkage_ros.motion.drives import law as law_drive
from linkage_ros.motion.drives.law import LawDrive
from linkage_ros.motion.law import Sine
from linkage_ros.programs.record import record
from linkage_ros.quantities import build
from linkage_ros.run.states import Simulator
from linkage_ros.settings.configuration import configure, load, read_values

NOW = 1_795_000_000_123_456_789
TIMES = (0.0, 0.31, 0.5, 0.500000017, 1.25, 2.0)
TURN = math.tau
LAWS = {
    'quintic': {'times': TIMES, 'angles': (0.2, 1.4, 1.1, 1.1, -3.0, 0.4)},
    'cubic': {'times': TIMES, 'angles': (0.2, 1.4, 1.1, 1.1, -3.0, 0.4), 'spline': 'cubic'},
    'two points': {'times': (0.0, 0.7), 'angles': (-1.0, 2.0)},
    'quintic, repeated': {
        'times': TIMES, 'angles': (0.2, 1.4, 1.1, 1.1, 2.0, 0.2 + 3 * TURN), 'repeat': True,
    },
    'cubic, repeated backwards': {
        'times': TIMES, 'angles': (0.2, 1.4, 1.1, 1.1, 2.0, 0.2 - TURN), 'repeat': True,
        'spline': 'cubic',
    },
    'to and fro': {'times': (0.0, 0.4, 1.0), 'angles': (0.3, 1.5, 0.3), 'repeat': True},
    'a steady turn': {'times': (0.0, 2.5), 'angles': (0.1, 0.1 + TURN), 'repeat': True},
    'speeds': {'times': (0, 0.5, 1.5), 'angles': (0, 1.0, -2.0), 'speeds': (0.5, 3.0, 0.0)},
    'speeds and accelerations, repeated': {
        'times': (0, 0.5, 1.5), 'angles': (0, 1.0, TURN), 'speeds': (3.0, -1.0, 3.0),
        'accelerations': (7.0, 0.0, 7.0), 'repeat': True,
    },
    'sine': {'center': 1.5, 'amplitude': 0.5, 'frequency': 0.3, 'phase': 0.7},
    'fast sine': {'center': -9.0, 'amplitude': -2.0, 'frequency': 33.3},
}  # fmt: skip


def drive_of(**values):
    return build(LawDrive, {f'motion.{name}': value for name, value in values.items()})


def falling(n, k):
    return math.factorial(n) // math.factorial(n - k) if n >= k else 0


def derivatives(row, t):
    """Returns value and first four derivatives of a polynomial."""
    row = list(row)
    powers = [t**n for n in range(len(row))]
    return [
        sum(falling(n, k) * c * powers[n - k] for n, c in enumerate(row) if n >= k)
        for k in range(5)
    ]


class Reference:
    """A law in mpf: its formula, from the parameters alone."""

    def __init__(self, values):
        self.values, self.period, self.turns = values, None, 0
        if 'times' not in values:
            self.scale = self.period = 1 / mp.mpf(values['frequency'])
            return
        self.ns = [round(Fraction(t) * 10**9) for t in values['times']]
        angles = [mp.mpf(x) for x in values['angles']]
        if values.get('repeat'):
            self.period = self.ns[-1]
            self.turns = round((values['angles'][-1] - values['angles'][0]) / TURN)
            angles[-1] = angles[0] + self.turns * 2 * mp.pi
        self.rows = self.solve(angles)

    def solve(self, angles):
        """Solves for all coefficients of all intervals at once."""
        values, count = self.values, len(angles) - 1
        lengths = [mp.mpf(b - a) / 10**9 for a, b in pairwise(self.ns)]
        slopes = [values[name] for name in ('speeds', 'accelerations') if name in values]
        size = 2 + 2 * len(slopes) if slopes else 4 if values.get('spline') == 'cubic' else 6
        matrix, right = [], []

        def add(value, *terms):
            line = [mp.mpf(0)] * (size * count)
            for sign, i, k, t in terms:
                for n in range(k, size):
                    line[size * i + n] += sign * falling(n, k) * t ** (n - k)
            matrix.append(line)
            right.append(value)

        for i, h in enumerate(lengths):
            add(angles[i], (1, i, 0, mp.mpf(0)))
            add(angles[i + 1], (1, i, 0, h))
            for k, row in enumerate(slopes, 1):
                add(mp.mpf(row[i]), (1, i, k, mp.mpf(0)))
                add(mp.mpf(row[i + 1]), (1, i, k, h))
        if not slopes:
            joints = [*range(1, count), *([0] if self.period else [])]
            for i, k in ((i, k) for i in joints for k in range(1, size - 1)):
                add(
                    mp.mpf(0),
                    (1, i - 1 if i else count - 1, k, lengths[i - 1]),
                    (-1, i, k, mp.mpf(0)),
                )
            for k in range(1, size // 2) if not self.period else ():
                add(mp.mpf(0), (1, 0, k, mp.mpf(0)))
                add(mp.mpf(0), (1, count - 1, k, lengths[-1]))
        found = mp.lu_solve(mp.matrix(matrix), mp.matrix(right))
        return [list(found[size * i : size * (i + 1)]) for i in range(count)]

    def at(self, time):
        """Returns angle with all turns, rate and acceleration at a time, ns."""
        values = self.values
        if 'times' not in values:
            w = 2 * mp.pi * mp.mpf(values['frequency'])
            x, a = w * time / 10**9 + mp.mpf(values.get('phase', 0)), mp.mpf(values['amplitude'])
            return values['center'] + a * mp.sin(x), a * w * mp.cos(x), -a * w * w * mp.sin(x)
        turns = 0
        if self.period:
            turns, time = divmod(time, self.period)
        elif time >= self.ns[-1]:
            return mp.mpf(values['angles'][-1]), mp.mpf(0), mp.mpf(0)
        i = bisect_right(self.ns, time) - 1
        angle, *rates = derivatives(self.rows[i], mp.mpf(time - self.ns[i]) / 10**9)
        return angle + 2 * mp.pi * turns * self.turns, *rates[:2]


def moments(law):
    """Returns times, ns: in and at the ends of all intervals, and 1e9 s later."""
    knots = getattr(law, 'times', (0, law.duration // 3, law.duration))
    near = {
        t for a, b in pairwise(knots)
        for t in (a, b - 1, b, *(a + (b - a) * n // 5 for n in range(1, 5)))
    }  # fmt: skip
    repeats = getattr(law, 'turns', 0) is not None
    far = 10**18 // law.duration * law.duration
    return sorted(near | ({t + far for t in near} if repeats else {10**18}))


each_law = pytest.mark.parametrize('values', LAWS.values(), ids=LAWS)


@each_law
def test_motion_and_torque_follow_the_formula(values):
    drive, mechanism = drive_of(**values), load('compressor').mechanism
    mechanism = replace(mechanism, loads=())
    solver, motion = Solver(mechanism), LawMotion.begin(drive.motion.law, NOW)
    with mp.workdps(50):
        law, oracle = Reference(values), oracle_of(mechanism)
        found = []
        for time in moments(drive.motion.law):
            (q,), (u,), (a,), unwrapped, *_ = motion.at(NOW + time)
            angle, rate, acceleration = law.at(time)
            torque = oracle.solve(angle % (4 * mp.pi), rate, acceleration).torque
            assert abs(unwrapped - angle) <= 2.1e-16 * abs(angle) + 1e-14
            turns = (angle - mp.mpf(q)) / (4 * mp.pi)
            apart = 4 * mp.pi * (turns - mp.nint(turns))
            got = solver.state(q, u, a).torque
            due = rate, acceleration, torque
            pairs = ((x - y, y) for x, y in zip((u, a, got), due, strict=True))
            found.append([(apart, 1), *pairs])
        for pairs in zip(*found, strict=True):
            error, size = (max(map(abs, row)) for row in zip(*pairs, strict=True))
            assert error <= 1e-13 * (size or 1)


def test_sines_of_a_law_are_accurate_to_two_ulp():
    law = drive_of(amplitude=1.0, frequency=1.0).motion.law
    with mp.workdps(50):
        for n in range(2000):
            time = n * 10**9 // 1999 if n % 2 else (n % 9) * 125_000_000 + n * n // 2000
            found, angle = law.at(time), 2 * mp.pi * time / 10**9
            cosine = found.rate / mp.mpf(2 * math.pi)
            for value, exact in ((found.angle, mp.sin(angle)), (cosine, mp.cos(angle))):
                assert abs(value - exact) <= 5e-16 * abs(exact) + mp.mpf('1e-40')


@each_law
def test_many_times_and_a_logged_segment_give_equal_bits(values):
    motion = LawMotion.begin(drive_of(**values).motion.law, NOW)
    stamps = [NOW + time for time in moments(motion.segment.law)]
    again = LawMotion(decode_motion(encode_motion(motion.segment), LawSegment))
    assert again.segment == motion.segment
    together = motion.at_all(stamps)
    for i, stamp in enumerate(stamps):
        (q,), (u,), (a,), unwrapped, *_ = one = motion.at(stamp)
        assert again.at(stamp) == one
        row = together.q[0][i], together.u[0][i], together.a[0][i], together.unwrapped[i]
        assert row == (q, u, a, unwrapped)


@each_law
def test_a_step_of_the_clock_changes_no_bit(values):
    motion = LawMotion.begin(drive_of(**values).motion.law, NOW)
    stepped = motion.restamp(NOW + 123_456_789, 5).restamp(7, NOW)
    assert decode_motion(encode_motion(stepped.segment), LawSegment) == stepped.segment
    for time in (0, 1, 333, 10**9, 10**18):
        assert stepped.at(NOW + time) == motion.at(NOW + time + 123_456_791)


def test_a_law_that_ends_moving_ends_the_motion():
    values = {'times': (0.0, 1.0), 'angles': (0.0, 1.0), 'speeds': (0.0, 2.0)}
    motion = LawMotion.begin(drive_of(**values).motion.law, NOW)
    assert motion.at(NOW + 10**9).u == (2.0,)
    with pytest.raises(MotionError, match=r'ends 1 s after .* still 2 rad/s') as raised:
        motion.at(NOW + 10**9 + 1)
    assert raised.value.time == 1.0
    assert len(motion.at_all([NOW, NOW + 10**9, NOW + 10**9 + 1]).unwrapped) == 2
    resting = LawMotion.begin(drive_of(**{**values, 'speeds': (0.0, 0.0)}).motion.law, NOW)
    assert resting.at(NOW + 10**18)[:3] == ((1.0,), (0.0,), (0.0,))
    still = LawMotion.begin(drive_of(times=(0.0,), angles=(0.7,)).motion.law, NOW)
    assert still.at(NOW)[:3] == still.at(NOW + 10**18)[:3] == ((0.7,), (0.0,), (0.0,))


# ---------------------------------------------------------------- limited cranks

BOUNDS = [(mechanism, arc) for name in LIMITED for mechanism in [of(LIMITED[name], 0.3)]
          for arc in Solver(mechanism).reach.arcs]  # fmt: skip


@pytest.mark.parametrize(('mechanism', 'arc'), BOUNDS)
@pytest.mark.parametrize('turns', [0, -2])
def test_a_law_may_approach_the_ends_of_its_arc_but_not_reach_them(mechanism, arc, turns):
    solver = Solver(mechanism)
    low, high = (x + turns * TURN for x in arc)
    middle, half = 0.5 * (low + high), 0.5 * (high - low)

    def laws(swing):
        yield drive_of(center=middle, amplitude=swing, frequency=0.3, phase=1.0)
        yield drive_of(times=(0, 1, 2), angles=(middle, middle + swing, middle), repeat=True)
        yield drive_of(times=(0.0,), angles=(middle - swing,))

    for drive in laws(half * (1 - 1e-9)):
        require_possible(drive.motion.law, solver)
    near = middle - half * (1 - 1e-3)
    # A spline that overshoots its points.
    beyond = drive_of(times=(0, 1, 2, 3), angles=(middle, near, near, middle), spline='cubic')
    for drive in (*laws(half * (1 + 1e-9)), beyond):
        with pytest.raises(ConfigurationError, match=r'at t = .* s, .* cannot move at .*reaches'):
            require_possible(drive.motion.law, solver)


SERVO = {
    **{k: v for k, v in read_values('quadrilateral').items() if k != 'rpm'},
    'drive': 'motion', 'crank.length': 0.3, 'rate_hz': 333.3,
}  # fmt: skip


def configured(values, **others):
    return configure({
        **SERVO, **others, **{f'motion.{name}': value for name, value in values.items()},
    })  # fmt: skip


SERVO_LAWS = {
    'sine': {'center': math.pi / 2, 'amplitude': math.pi / 6, 'frequency': 0.5},
    'rise': {'times': (0.0, 0.3, 1.0), 'angles': (1.2, 2.0, 1.0)},
    'repeated': {'times': (0.0, 0.3, 1.0), 'angles': (1.2, 2.0, 1.2), 'repeat': True},
}


@pytest.mark.parametrize('values', SERVO_LAWS.values(), ids=SERVO_LAWS)
def test_a_record_of_a_limited_crank_verifies_to_the_bit(tmp_path, values):
    path, ahead = tmp_path / 'run.mcap', {'effort_command_topic': 'torque', 'lead_time': 0.0123}
    configuration = configured(values, **ahead)
    assert not Solver(configuration.mechanism).reach.turns_fully
    assert record(configuration, path, duration=2.0) == 667
    log = LogReader(path)
    assert log.configuration == configuration
    done = verify(log)
    assert (done.states, done.difference, done.ulp) == (667, '', 0.0)
    motion = LawMotion.begin(configuration.drive.motion.law, 0)
    assert log.motions[''] == (motion.segment,)
    solver = Solver(configuration.mechanism)
    torques = [message.data for message in log.messages({'/torque'})]
    for stamp, data in zip((0, 3_000_300), torques, strict=False):
        (q,), (u,), (a,), *_ = motion.at(stamp + 12_300_000)
        assert struct.unpack('<d', data[-8:]) == (solver.state(q, u, a).torque,)


@pytest.mark.parametrize('values', SERVO_LAWS.values(), ids=SERVO_LAWS)
def test_a_live_log_with_clock_steps_verifies_to_the_bit(tmp_path, values):
    plan = [*ticks(50), ('step', 10**9), *ticks(70), ('step', -(10**10)), ('skip', 7), *ticks(80)]
    path = live(tmp_path / 'run.mcap', configured(values), plan)
    log = LogReader(path)
    done = verify(log)
    assert (done.states, done.missed, done.difference, done.ulp) == (202, 7, '', 0.0)
    assert len(log.motions['']) == 3


def test_a_record_keeps_the_states_before_the_end(tmp_path):
    values = {'times': (0.0, 0.5), 'angles': (1.0, 1.2), 'speeds': (0.0, 1.0)}
    for lead in (0.0, 0.1):
        path = tmp_path / f'{lead}.mcap'
        ahead = {'effort_command_topic': 'torque', 'lead_time': lead, 'rate_hz': 100.0}
        with pytest.raises(MotionError, match=r'still 1 rad/s.* keeps the (51|41) states'):
            record(configured(values, **ahead), path, duration=2.0)
        assert not verify(LogReader(path)).difference


def test_revolutions_of_a_law(tmp_path):
    turning = {'times': (0.0, 1.0, 2.0), 'angles': (0.0, 0.0, TURN), 'repeat': True}
    wheel = {'crank.length': 0.1, 'rate_hz': 100.0}
    configuration = configured(turning, **wheel)
    path = tmp_path / 'run.mcap'
    assert record(configuration, path, revolutions=3) == 600
    swinging = configured({'amplitude': 0.75 * TURN, 'frequency': 1.0}, **wheel)
    with pytest.raises(ConfigurationError, match=r'at most 0\.75 .*give a --duration'):
        record(swinging, path, revolutions=1)


# ---------------------------------------------------------------- forged logs and bad input


def logged_law(**changes):
    law = drive_of(**LAWS['quintic']).motion.law
    return encode_motion(LawSegment(0, law._replace(**changes)))


@pytest.mark.parametrize(
    'changes',
    [
        {'times': (0, 5, 5, 6, 7, 8)}, {'times': (1, 2, 3, 4, 5, 6)}, {'times': (0, 1)},
        {'turns': 1}, {'rows': ((math.nan,),) * 6}, {'rows': ((),) * 6}, {'times': ()},
    ],
)  # fmt: skip
def test_a_malformed_law_of_a_log_is_refused(changes):
    with pytest.raises((ValueError, IndexError)):
        decode_motion(logged_law(**changes), LawSegment)


def test_verification_finds_a_forged_law(tmp_path):
    configuration = configured(SERVO_LAWS['rise'])
    simulator, motion = (
        Simulator(configuration.only),
        LawMotion.begin(configuration.drive.motion.law, 0),
    )
    joined = motion.join(10**8, [2 * 10**8, 3 * 10**8], [1.3, 1.1])
    stepped = joined.restamp(2 * 10**8, 10**10)
    good = motion.segment, joined.segment, stepped.segment
    assert not check_motions(simulator, good)
    first, *others = joined.segment.law.rows
    jump = joined.segment.law._replace(rows=((first[0] + 1e-9, *first[1:]), *others))
    other = motion.segment.law._replace(times=(0, 2 * 10**8, 10**9))
    sine = Sine(1.2, 0.0, 1.0, 0.0)
    for number, forged in (
        (0, {'law': other}), (0, {'turns': 1}), (0, {'time': 1}), (1, {'law': jump}),
        (1, {'turns': 1}), (1, {'time': 5}), (1, {'law': sine}), (2, {'law': jump}),
        (2, {'time': 5}), (2, {'old_stamp': 3 * 10**8}),
    ):  # fmt: skip
        segments = [*good]
        segments[number] = replace(segments[number], **forged)
        assert f'motion record {number + 1} has' in check_motions(simulator, tuple(segments))


POINTS = {'times': (0.0, 1.0), 'angles': (1.5, 1.6)}


@pytest.mark.parametrize(
    ('values', 'words'),
    [
        ({}, 'times and angles, or file, or amplitude and frequency'),
        (
            {'amplitude': 1.0, 'frequency': 1.0, 'repeat': True},
            'motion.repeat = True: .* not for a sine',
        ),
        (
            {'amplitude': 1.0, 'frequency': 1.0, 'spline': 'cubic'},
            "spline = 'cubic': .* not for a sine",
        ),
        ({**POINTS, 'amplitude': 1.0}, r'motion.amplitude = 1.0: .* not for points'),
        ({**POINTS, 'phase': 1.0}, r'motion.phase = 1.0: .* not for points'),
        ({'times': (0, 1)}, 'times and angles'),
        ({**LAWS['sine'], 'times': (0, 1), 'angles': (0, 1)}, 'times and angles'),
        ({'times': (0, 1), 'angles': (0, 1), 'spline': 'linear'}, 'quintic, cubic'),
        ({'times': (0, 1, 1 + 1e-10), 'angles': (0, 1, 2)}, 'must increase by 1 ns or more'),
        ({'times': (0, 1, 0.5), 'angles': (0, 1, 2)}, 'number 3, 0.5, follows 1.0'),
        ({'times': (1, 2), 'angles': (0, 1)}, 'motion.times begins with 1: must be 0.0'),
        ({'times': (0, 1), 'angles': (0, 1, 2)}, 'angles has 3 numbers and motion.times 2'),
        ({'times': (0, 1), 'angles': (0, math.nan)}, 'motion.angles = .* must be a list of'),
        ({'times': (0, 1), 'angles': (0, 1), 'repeat': True}, 'must be 0, or whole turns of'),
        ({'times': (0,), 'angles': (0,), 'repeat': True}, 'give two points or more'),
        ({'times': (0,), 'angles': (0,), 'speeds': (1,)}, 'give two points or more'),
        ({'times': (0,), 'angles': (0,), 'speeds': (0,), 'accelerations': (1,)}, 'two points or'),
        ({'times': (0, 1), 'angles': (0, 1), 'accelerations': (0, 1)}, 'give motion.speeds as we'),
        (
            {'times': (0, 1), 'angles': (0, 0), 'speeds': (0, 1), 'repeat': True},
            'motion.speeds ends with 1: must equal the first, 0',
        ),
        ({'times': (0, 1e-9), 'angles': (0, 1)}, r'up to .* rad/s\^2: must be at most 1e\+12'),
        ({'amplitude': 1.0, 'frequency': 1e6}, r'must be at most 1e\+12 rad/s\^2'),
        ({'times': (0, 1), 'angles': (1.0, -1.0)}, 't = 1 s, .* -57.29.* deg.*reaches .*-22.98'),
        # The points are within the arc of another turn.
        (
            {'times': (0, 1), 'angles': (1.0, 1.0 + TURN), 'repeat': True},
            'motion: at t = 1 s, .* 417.29.* deg.*it reaches .*-22.98.* to 292.98',
        ),
    ],
)
def test_bad_laws_are_refused_in_one_line(values, words):
    with pytest.raises(ConfigurationError, match=words):
        configured(values)


@pytest.mark.parametrize('turns', [-2, 1, 300])
@pytest.mark.parametrize('first', [0.3, -77.7, 1234.5, -98765.4, 900000.1])
def test_a_law_from_a_large_angle_advances_by_exact_turns(first, turns):
    """The sum of the angle and the turns is rounded, but the motion repeats exactly."""
    values = {'times': (0.0, 1.0), 'repeat': True}
    law = drive_of(**values, angles=(first, first + turns * TURN)).motion.law
    assert law.turns == turns
    assert law.at(7 * 10**9)[:2] == (7 * turns, first)
    before, after = law.at(10**9 - 1), law.at(10**9)
    assert before.angle + before.rate * 1e-9 - turns * TURN == pytest.approx(
        after.angle, abs=4 * math.ulp(first + turns * TURN)
    )
    with pytest.raises(ConfigurationError, match=r'motion\.angles'):
        drive_of(**values, angles=(first, first + turns * TURN + 1e-8))


def test_a_law_has_at_most_10000_points(monkeypatch):
    splines = []
    monkeypatch.setattr(law_drive, 'interpolated', lambda *x, **_: splines.append(len(x[0])))
    for count in (10_000, 10_001):
        row = tuple(map(float, range(count)))
        with pytest.raises(ConfigurationError, match='10001') if count > 10_000 else nullcontext():
            law_drive.Prescribed(times=row, angles=row)
    assert splines == [10_000]


def test_values_of_a_law_are_checked_in_python_too():
    with pytest.raises(ConfigurationError, match=r'frequency = -1\.0'):
        law_drive.Prescribed(amplitude=0.1, frequency=-1.0)


def test_a_csv_file_gives_the_points(tmp_path):
    path = tmp_path / 'law.csv'
    path.write_text('time,angle_deg,speed,acceleration_deg\n0,90,0,0\n1.5,120,0,-90\n')
    drive = drive_of(file=str(path)).motion
    assert drive == drive_of(
        times=(0.0, 1.5), angles=(math.pi / 2, math.radians(120)), speeds=(0.0, 0.0),
        accelerations=(0.0, -math.pi / 2),
    ).motion  # fmt: skip
    path.write_text('"time", "angle"\n"0",1\n1,2\n')
    assert drive_of(file=str(path)) == drive_of(times=(0.0, 1.0), angles=(1.0, 2.0))
    for text, problem in (
        ('time,angle,angle_deg\n', 'names time, angle, angle_deg: give each quantity once'),
        ('', "names ''"),
        ('time angel\n', "names 'time angel'"), ('time_deg,angle\n', "names 'time_deg'"),
        ('time,angle\n', 'must be 2 numbers'), ('time,angle\n0,1\n1\n', 'from 2 to 1 at row 2'),
    ):  # fmt: skip
        path.write_text(text)
        words = rf'motion\.file = [^;]*: [^;]*{problem}; give the path of a'
        with pytest.raises(ConfigurationError, match=words):
            drive_of(file=str(path))
    with pytest.raises(ConfigurationError, match='times, angles'):
        drive_of(file=str(path), times=(0.0, 1.0))


# ---------------------------------------------------------------- trajectories


@pytest.mark.parametrize('values', SERVO_LAWS.values(), ids=SERVO_LAWS)
@pytest.mark.parametrize('slopes', [None, [(0.5,), (0.0,)], [(0.5, 3.0), (0.0, 0.0)]])
def test_a_trajectory_joins_without_a_jump(values, slopes):
    motion = LawMotion.begin(drive_of(**values).motion.law, NOW)
    leave, points = NOW + 123_456_789, [NOW + 2 * 10**8, NOW + 10**9]
    joined = motion.join(leave, points, [1.5, 1.0], slopes)
    assert joined.at(leave) == motion.at(leave)
    law, first = joined.segment.law, points[0] - leave
    before, after = LawMotion(LawSegment(0, law)), joined.at(points[0])
    assert after.unwrapped == 1.5
    if slopes is not None:
        assert after.u == (0.5,)
    short = before.at(first - 1)
    assert abs(short.u[0] - after.u[0]) < 1e-6
    assert abs(short.a[0] - after.a[0]) < 1e-4
    assert joined.at(points[1] + 10**12)[:3] == ((1.0,), (0.0,), (0.0,))
    # The joint is a quintic: its sixth difference vanishes.
    with mp.workdps(50):
        samples = [derivatives(map(mp.mpf, law.rows[0]), mp.mpf(n))[0] for n in range(7)]
        assert abs(sum((-1) ** n * math.comb(6, n) * x for n, x in enumerate(samples))) < 1e-30
    assert len(law.rows[0]) == 6


def test_a_trajectory_after_years_of_turns_loses_no_digit():
    values = {'times': (0.0, 1.0), 'angles': (0.3, 0.3 + 2 * TURN), 'repeat': True}
    motion, leave = LawMotion.begin(drive_of(**values).motion.law, 5), 5 + 10**18 + 250_000_000
    turned = 2 * 10**9 * TURN
    joined = motion.join(leave, [leave + 10**9], [turned + 20.0])
    before, after = motion.at(leave), joined.at(leave)
    assert (before.u, before.a, before.unwrapped) == (after.u, after.a, after.unwrapped)
    assert abs(math.remainder(before.q[0] - after.q[0], TURN)) < 4e-15
    assert decode_motion(encode_motion(joined.segment), LawSegment) == joined.segment
