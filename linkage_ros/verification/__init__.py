# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Recomputes every state of a log, and reports the first message that differs."""
