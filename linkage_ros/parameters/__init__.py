# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""What a user may set: parameters of files, presets and command lines, checked once.

Those of mechanisms and drives are declared beside what they describe, in mechanisms and motion;
here are those of the run, and all are put together.
"""
