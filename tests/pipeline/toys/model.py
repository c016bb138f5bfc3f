"""Its generation is that of raw."""

from pneucli.pipeline.graph import Context
from tests.pipeline.toys import work


def run(context: Context) -> dict[str, object]:
    return work(context, context.answers["raw"]["generation"], 0.02)
