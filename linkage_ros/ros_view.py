# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The live view of a node, and what its log says of where it is served."""

from __future__ import annotations

from rclpy.node import Node

from linkage_ros.run.configuration import Configuration
from linkage_ros.view.stream import View


def open_view(node: Node, configuration: Configuration) -> View | None:
    """Opens the view that a configuration asks for.

    Args:
        node: Says where a page is, and who can see it.
        configuration: Of the run.

    Returns:
        The view; None: none is asked for.

    Raises:
        ViewerError: It cannot be opened.
    """
    session = configuration.session
    if not session.viewer:
        return None
    view = View(
        configuration, session.viewer, session.viewer_bind, overwrite=session.log_overwrite
    )
    if view.page:
        node.get_logger().info(f'watch it in a browser: {view.page}')
    if view.exposed:
        node.get_logger().warning(
            f'the view is served at {view.url} to whoever reaches it; viewer_bind = 127.0.0.1 '
            'keeps it on this machine'
        )
    return view
