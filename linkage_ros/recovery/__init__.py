# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Saves what can be read of a log that is cut off or damaged into a complete one."""
