# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Verifies logs by recomputing every state; reports the first difference."""
