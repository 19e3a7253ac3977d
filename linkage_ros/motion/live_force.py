# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Forces of loads that are set by messages during a run."""

import math
from typing import TypeAlias

from linkage_ros.mechanism.loads.force import LINK, Force
from linkage_ros.messages.cdr import decode_wrench
from linkage_ros.messages.topics import WRENCHES, prefix_of
from linkage_ros.messages.urdf import link_of
from linkage_ros.motion.inputs import Expiring, Input

Vector: TypeAlias = tuple[float, float]

TAKEN, REJECTED, TIMEOUTS = 'wrenches taken', 'wrenches rejected', 'wrench timeouts'
_LARGEST = 1e12  # N, as for the parameter


class LiveForce(Input):
    """Stores the last force of a load until it expires, and counts messages.

    Attributes:
        name: Name of the load.
        topic: Topic of the messages.
        held: The force [x, y], N.
        counts: Numbers of messages, by their names in diagnostics.
    """

    def __init__(self, load: Force, joint_prefix: str, frame_id: str, linkage: str = '') -> None:
        """Initializes with the force of a load that has a `wrench_topic`."""
        prefix = prefix_of(linkage, '.')
        self.name = load.name
        self.topic = WRENCHES._replace(
            name=load.wrench_topic, parameter=f'{prefix}{load.label}.{WRENCHES.name}'
        )
        self.held: Expiring[Vector] = Expiring(load.force, load.wrench_timeout)
        self.counts = dict.fromkeys((TAKEN, REJECTED), 0)
        turns = load.axes == LINK
        self._frame_id = link_of(f'{joint_prefix}{load.link}') if turns else frame_id

    def read(self, data: bytes, _: int) -> Vector:
        """Returns the force [x, y], N, in a WrenchStamped, and counts it; see `Input.read`.

        Raises:
            ValueError: The message has another frame_id, or its force is not finite.
        """
        try:
            force = self._decode(data)
        except ValueError:
            self.counts[REJECTED] += 1
            raise
        self.counts[TAKEN] += 1
        return force

    def _decode(self, data: bytes) -> Vector:
        frame_id, x, y = decode_wrench(data)
        if frame_id not in {'', self._frame_id}:
            words = ascii(frame_id)[1:-1]
            raise ValueError(f'frame_id {words:.80}: must be {self._frame_id} or empty')
        if not math.hypot(x, y) <= _LARGEST:
            raise ValueError(f'force not finite, or beyond {_LARGEST:g} N: [{x}, {y}]')
        return x, y

    def troubles(self, topic: str) -> list[str]:
        """Returns a warning if messages stopped, or stop often."""
        if not self.held.is_lost:
            return []
        when = f'within wrench_timeout{self.held.losses.note}'
        return [f'no message on {topic} {when}: the force of the parameters acts']

    def diagnostics(self) -> dict[str, str]:
        """Returns the force and the counts of messages, for diagnostics."""
        x, y = self.held.value
        counts = {**self.counts, TIMEOUTS: self.held.timeouts}
        found = {'force, N': f'[{x:.6g}, {y:.6g}]', **{k: str(v) for k, v in counts.items()}}
        return {f'{self.name}: {key}': value for key, value in found.items()}
