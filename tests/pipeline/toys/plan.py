"""Applies only where the pipeline file has a table [plan]."""

from pneucli.pipeline.graph import Context, NotApplicable
from tests.pipeline.toys import work


def run(context: Context) -> dict[str, object]:
    if "[plan]" not in context.path.read_text():
        raise NotApplicable(f"{context.path}", "no [plan]", "a table [plan]")
    return work(context, context.answers["model"]["generation"])
