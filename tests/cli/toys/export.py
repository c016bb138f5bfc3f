from pneucli.pipeline.context import Context


def run(context: Context) -> dict[str, object]:
    return {"schema": "toy/export/1", "to": context.options["to"], "period_s": 1e-3, "files": []}
