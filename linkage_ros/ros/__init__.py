# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""What a node of ROS 2 is made of: parameters, topics, commands, log and view."""
