"""Names of scenarios and their files; apart from `scenario`, which takes a second to load."""

from pathlib import Path

from serd_bag.nearest import nearest_name
from serd_sim.errors import SimError

_BUILTIN_FOLDER = Path(__file__).parent / "scenarios"


def builtin_scenarios() -> tuple[str, ...]:
    """Names of the scenarios that come with the package."""
    return tuple(sorted(path.stem for path in _BUILTIN_FOLDER.glob("*.yaml")))


def scenario_suite(name: str) -> tuple[str, ...]:
    """Names of the scenarios of a suite that comes with the package; empty where there is none."""
    return tuple(f"{name}/{path.stem}" for path in sorted((_BUILTIN_FOLDER / name).glob("*.yaml")))


def suite_names() -> tuple[str, ...]:
    """Names of the suites: folders of scenarios that stay as they are, for comparisons."""
    return tuple(sorted(path.name for path in _BUILTIN_FOLDER.iterdir() if path.is_dir()))


def scenario_file(name_or_path: str | Path) -> Path:
    """The file of a built-in scenario, or a YAML file itself; SimError for another name."""
    path, name = Path(name_or_path), str(name_or_path)
    if path.suffix in {".yaml", ".yml"}:
        return path
    if name in (*builtin_scenarios(), *scenario_suite(name.partition("/")[0])):
        return _BUILTIN_FOLDER / f"{name}.yaml"
    of_suites = (each for suite in suite_names() for each in scenario_suite(suite))
    meant = nearest_name(name, (*builtin_scenarios(), *of_suites))
    known = ", ".join(builtin_scenarios())
    hint = (
        f"did you mean {meant!r}?" if meant else f"built in are {known}; name the file of another"
    )
    raise SimError(f"scenario must be a built-in name or a .yaml file, got {name!r}; {hint}")
