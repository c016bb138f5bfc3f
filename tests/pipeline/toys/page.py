"""Its generation is that of judge."""

from pneucli.pipeline.graph import Context
from tests.pipeline.toys import work


def run(context: Context) -> dict[str, object]:
    return work(context, context.answers["judge"]["generation"], 0.02)
