"""The JSON schema of the pipeline file as text, with the effects of the catalogue on offer."""

from __future__ import annotations

import json

from pneucli.config.json_schema import json_schema
from pneucli.physics.effects import catalogue_with_sides


def schema_text() -> str:
    """Return the schema as JSON."""
    return json.dumps(json_schema(catalogue_with_sides()), indent=1, ensure_ascii=False) + "\n"
