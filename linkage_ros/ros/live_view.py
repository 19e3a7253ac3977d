# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The live view of a node."""

from __future__ import annotations

from ipaddress import ip_address

from rclpy.node import Node

from linkage_ros.parameters.configuration import Configuration
from linkage_ros.parameters.session import SPAWN, WEB
from linkage_ros.run.health import Health
from linkage_ros.run.threads import Worker, accompany_ticker
from linkage_ros.view.rerun_view import Sample, View

_CAPACITY = 4_000  # states that wait for the viewer, 4 s at 1 kHz


class LiveView(Worker[Sample]):
    """Shows the states of a node, in a separate thread."""

    def __init__(self, node: Node, configuration: Configuration) -> None:
        """Opens the view that a configuration specifies.

        Args:
            node: Node whose logger reports the page's address, public access, and errors.
            configuration: Configuration of the run.

        Raises:
            ViewerError: The view cannot be opened.
        """
        session, logger = configuration.session, node.get_logger()
        self._view = view = View(
            configuration, session.viewer, session.viewer_bind, overwrite=session.log_overwrite
        )
        if view.page:
            logger.info(f'watch it in a browser: {view.page}')
        if session.viewer in (SPAWN, WEB) and not ip_address(session.viewer_bind).is_loopback:
            logger.warning(
                f'the view is served at {session.viewer_bind} to whoever reaches it; viewer_bind '
                '= 127.0.0.1 keeps it on this machine'
            )
        self._target = session.viewer
        super().__init__(
            'view',
            view,
            capacity=_CAPACITY,
            period=view.period,
            on_error=lambda error: logger.error(f'the run continues without a view: {error}'),
            on_start=accompany_ticker,
        )

    def health(self) -> Health:
        """Returns the health of the view: lost states, fatal error, current problem."""
        # States are lost on the way to the view, and in the view if the viewer lags.
        lost = self.dropped + self._view.dropped
        return Health(self._target, lost, self.error, self._view.trouble)

    def discard(self) -> None:
        """Closes the view and removes its file, if any."""
        self.close(5.0)
        self._view.discard()
