# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The MCAP log, written and read; the files named untrusted_ believe no byte of it."""
