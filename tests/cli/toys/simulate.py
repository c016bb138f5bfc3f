from pneucli.pipeline.graph import Context, NotApplicable


def run(context: Context) -> dict[str, object]:
    raise NotApplicable("bench", "nothing to simulate")
