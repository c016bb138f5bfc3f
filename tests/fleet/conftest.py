"""Keys of the local S3-like store: there before the first process is forked, since workers have its environment."""

from __future__ import annotations

import os

os.environ.update(AWS_ACCESS_KEY_ID="nobody", AWS_SECRET_ACCESS_KEY="nothing", AWS_EC2_METADATA_DISABLED="true")
