# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""A replay: what is played of a log, at which pace, steered by which keys, shown where."""
