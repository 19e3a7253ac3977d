# Copyright 2026 The linkage_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The live view in Rerun; importing its SDK takes 60 MB and nearly a second."""

import os

# The SDK reads this variable when it is imported. By default it would warn of files without an
# index, which are intended; of flush timeouts, which are expected; and of a full disk, which this
# package reports itself.
os.environ.setdefault('RUST_LOG', 'warn,re_log_encoding=off,re_sdk=off,re_grpc_client=off')
