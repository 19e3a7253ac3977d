# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Charts as pictures; the only folder that knows matplotlib."""
