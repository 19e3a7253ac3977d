# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Parts of a ROS 2 node: parameters, publishers, subscribers, log and view."""
