# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The live view in Rerun; importing its SDK takes 60 MB and most of a second."""

import os

# Before the SDK is imported, which reads it. It would warn that files get no index, which is
# intended, that flushes time out, which is how they are used here, and that a disk is full, which
# is reported here.
os.environ.setdefault('RUST_LOG', 'warn,re_log_encoding=off,re_sdk=off,re_grpc_client=off')
