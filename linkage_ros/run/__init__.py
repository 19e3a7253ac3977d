# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""A configured mechanism at work: ticks on time, a state and its messages at each, health."""
