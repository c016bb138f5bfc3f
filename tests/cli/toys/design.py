from pneucli.pipeline.graph import Context, NotApplicable


def run(context: Context) -> dict[str, object]:
    if context.config.rig.cylinder.stroke is None:
        raise NotApplicable("[rig.cylinder]", "there is no cylinder to control")
    return {"schema": "toy/design/1"}
