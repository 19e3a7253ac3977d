# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The linkages of a run, and what they have in common: ticks, and messages of their states."""

from collections.abc import Iterable, Mapping

import numpy as np

from linkage_ros.errors import ConfigurationError
from linkage_ros.messages.templates import RunTemplates
from linkage_ros.messages.topics import ROBOT_DESCRIPTION, Topic, topic_of_linkage
from linkage_ros.motion.inputs import SharedInput
from linkage_ros.motion.live_force import LiveForce
from linkage_ros.numeric import Real
from linkage_ros.quantities import shown
from linkage_ros.run.states import RowPart, Simulator
from linkage_ros.run.ticks import TickRate
from linkage_ros.settings.configuration import Configuration


class Robot:
    """The linkages of a run.

    Attributes:
        configuration: Configuration of the run.
        simulators: Simulators of the linkages, by name, in the order of their joints in messages.
        names: Names of the linkages.
        drive: The drive of the first linkage, which has the kind and the topics of all.
        has_efforts: Whether states hold efforts for a controller.
        templates: Templates of the messages of states.
        ticks: Times of the ticks.
    """

    def __init__(self, configuration: Configuration) -> None:
        """Prepares the linkages.

        Raises:
            ConfigurationError: Two loads, or states and efforts, have the same topic.
        """
        self.configuration = configuration
        linkages = configuration.linkages
        self.simulators = dict[str, Simulator]()
        for linkage in linkages:
            other_cranks = [other.crank_joint for other in linkages if other is not linkage]
            simulator = Simulator(linkage, other_cranks)
            self.simulators[simulator.name] = simulator
        self.names = tuple(self.simulators)
        self.drive, session = linkages[0].drive, configuration.session
        topic = self.drive.effort_command_topic
        self.has_efforts = bool(topic)
        numbers = [simulator.numbers for simulator in self.simulators.values()]
        self.templates = RunTemplates(numbers, session.frame_id, topic)
        self.ticks = TickRate(session.rate_hz)
        self._require_distinct_topics()

    def _require_distinct_topics(self) -> None:
        topics = [topic.name for forces in self.live_forces().values() for topic in forces]
        for topic in topics:
            if topics.count(topic) > 1:
                raise ConfigurationError(
                    f'wrench_topic = {shown(topic)}: two loads have it; give each its own'
                )
        efforts = self.drive.effort_command_topic
        if [topic.name for topic in self.templates.topics].count(efforts) > 1:
            raise ConfigurationError(
                f'effort_command_topic = {shown(efforts)}: states have this topic; choose another'
            )

    def descriptions(self) -> dict[Topic, bytes]:
        """Returns the CDR bytes of the robot_description messages that are published, by topic."""
        return {
            topic_of_linkage(ROBOT_DESCRIPTION, name): simulator.description
            for name, simulator in self.simulators.items()
            if simulator.description
        }

    def inputs(self) -> dict[Topic, SharedInput]:
        """Returns the topics that a run receives, with new readers of their messages."""
        every = {name: simulator.inputs() for name, simulator in self.simulators.items()}
        topics = dict.fromkeys(topic for inputs in every.values() for topic in inputs)
        return {
            topic: SharedInput({name: inputs[topic] for name, inputs in every.items()})
            for topic in topics
        }

    def live_forces(self) -> dict[str, dict[Topic, LiveForce]]:
        """Returns the topics of live loads, with new readers of their messages, by linkage."""
        return {name: simulator.live_forces() for name, simulator in self.simulators.items()}

    def row(
        self, parts: Mapping[str, RowPart], held: Mapping[str, Real] | None = None
    ) -> list[Real]:
        """Returns the numbers in the messages of a state.

        Args:
            parts: The numbers of the linkages that the state holds, by name, in their order.
            held: Last efforts of the other linkages; by default 0.
        """
        numbers = [number for part in parts.values() for number in part.numbers]
        if self.has_efforts:
            efforts = {**dict.fromkeys(self.names, 0.0), **(held or {})}
            efforts |= {name: x.effort for name, x in parts.items() if x.effort is not None}
            numbers += efforts.values()
        return numbers


class HeldEfforts:
    """The last effort of each linkage, which a controller holds.

    Attributes:
        efforts: The efforts, by linkage: 0 before the first one, and once it is ended or refused.
    """

    def __init__(self, names: Iterable[str]) -> None:
        self.efforts: dict[str, float] = dict.fromkeys(names, 0.0)

    def clear(self, names: Iterable[str]) -> None:
        """Sets efforts to 0."""
        self.efforts |= dict.fromkeys(names, 0.0)

    def hold(self, parts: Mapping[str, RowPart], row: int = -1) -> None:
        """Keeps the efforts of a state or, of many states, those of one; by default the last."""
        for name, (_, effort) in parts.items():
            if effort is not None:
                self.efforts[name] = effort[row] if isinstance(effort, np.ndarray) else effort
