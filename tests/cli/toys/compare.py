from pneucli.pipeline.context import Context


def run(context: Context) -> dict[str, object]:
    error = 3.0 - len(context.answers["identify"]["effects"])
    return {"schema": "toy/compare/1", "pipeline": context.config.name, "error": {"train": None, "test": error}}
