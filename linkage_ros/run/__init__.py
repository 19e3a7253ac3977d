# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""States of a configured mechanism as messages, and the messages that it receives."""
