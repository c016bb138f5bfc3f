"""``simulate``: scenarios of the model, with and without its controller."""

from pneucli.cli.command import Command, Executor, File, HowToRun, executor_option, run_stage


def _simulate(pipeline: File, executor: Executor = None, how: HowToRun = HowToRun()) -> None:
    run_stage("simulate", pipeline, how, executor_option(executor) or None)


COMMAND = Command(_simulate, "pneucli simulate axis-7/pipeline.toml -v", place=70, stage="simulate")
