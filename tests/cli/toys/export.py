from pneucli.pipeline.graph import Context, NotApplicable


def run(context: Context) -> dict[str, object]:
    if "design" not in context.answers and set(context.options["to"]) - {"fmu"}:
        raise NotApplicable("bench", "no controller to export")
    return {"schema": "toy/export/1", "to": context.options["to"], "files": []}
