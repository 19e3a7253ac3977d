# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The live view of a node."""

from __future__ import annotations

from rclpy.node import Node

from linkage_ros.parameters.configuration import Configuration
from linkage_ros.run.health import Health
from linkage_ros.run.scheduling import accompany_ticker
from linkage_ros.run.worker import Worker
from linkage_ros.view.rerun_view import Sample, View

_CAPACITY = 4_000  # states that wait for the viewer, 4 s at 1 kHz


class LiveView:
    """Shows the states of a node, in a separate thread."""

    def __init__(self, node: Node, configuration: Configuration) -> None:
        """Opens the view that a configuration asks for.

        Args:
            node: Its logger reports the page's address, who can read the data, and errors.
            configuration: Configuration of the run.

        Raises:
            ViewerError: It cannot be opened.
        """
        session, self._logger = configuration.session, node.get_logger()
        self._target = session.viewer
        self._view = view = View(
            configuration, session.viewer, session.viewer_bind, overwrite=session.log_overwrite
        )
        if view.page:
            self._logger.info(f'watch it in a browser: {view.page}')
        if view.sender.exposed:
            self._logger.warning(
                f'the view is served at {view.sender.url} to whoever reaches it; viewer_bind = '
                '127.0.0.1 keeps it on this machine'
            )
        self._worker: Worker[Sample] = Worker(
            'view',
            view,
            capacity=_CAPACITY,
            period=view.period,
            on_error=self._report,
            on_start=accompany_ticker,
        )

    def offer(self, joint_states: bytes) -> None:
        """Shows a message of joint states, CDR bytes, once the viewer is ready for it."""
        self._worker.offer((0, joint_states))

    def health(self) -> Health:
        """Health of the view: lost states, fatal error, current problem."""
        # States are lost on the way to the view, and in the view if the viewer lags.
        lost = self._worker.dropped + self._view.dropped
        return Health(self._target, lost, self._worker.error, self._view.sender.trouble)

    def close(self) -> None:
        """Disconnects from the viewer."""
        self._worker.close(timeout=5.0)

    def discard(self) -> None:
        """Closes the view and removes its file, if any."""
        self.close()
        self._view.discard()

    def _report(self, error: Exception) -> None:
        self._logger.error(f'the view ends here, the motion goes on: {error}')
