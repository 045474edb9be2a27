"""It takes about two minutes; 'serd navigate MODEL --episodes 200' drives more."""

from pathlib import Path
from typing import Annotated, Any

from serd_bag.quantities import counted
from serd_cli.demo.folder import DemoSettings, new_folder, open_folder
from serd_cli.demo.phases import LivePage, run_phases
from serd_cli.errors import RunError
from serd_cli.options import AsJson, opt, resolved_scenario, validated, with_settings
from serd_cli.output.terminal import progress_console
from serd_cli.processes.stack_run import stack_environment
from serd_sim.scenario.scenario import load_scenario


@with_settings(DemoSettings)
def demo(
    output: Annotated[Path, opt("folder that gets a run-N folder")] = Path("demo_output"),
    resume: Annotated[Path | None, opt("continue this run-N folder; its settings count")] = None,
    as_json: AsJson = False,
    **options: Any,
) -> None:
    """Run the phases and print the report's summary; the message at an error names how to go on."""
    if resume is not None:
        folder, settings = open_folder(resume)
    else:
        load_scenario(options["scenario"])
        absolute = {"scenario": resolved_scenario(options["scenario"])}
        settings = validated(DemoSettings, **(options | absolute))
        folder = new_folder(output, settings)
    progress_console.print(
        f"{counted(settings.demonstrations, 'demonstration')} and"
        f" {counted(settings.episodes, 'episode')} through ROS 2; results go to {folder.root}",
        soft_wrap=True,
    )
    try:
        with stack_environment(folder.logs) as environment:
            phases = run_phases(folder, settings, environment, LivePage())
        from serd_cli.demo.report import report_demo

        report_demo(folder, settings, phases, as_json=as_json)
    except (KeyboardInterrupt, RunError):
        progress_console.print(
            f"results are in {folder.root}; resume with: serd demo --resume {folder.root}",
            soft_wrap=True,
        )
        raise
