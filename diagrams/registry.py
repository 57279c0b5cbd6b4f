"""The diagrams that commands know by name."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path

from drake_tc.diagrams.scenarios.scenario import Scenario, load_scenario, scenario_names
from drake_tc.diagrams.torque_loop import Loop, build_loop

from drake_tc.errors import ParamsError

HERE = Path(__file__).parent


@dataclass(frozen=True)
class DiagramEntry:
    """One diagram.

    Attributes:
        name: As commands take it.
        title: One line.
        scenario_file: Its committed scenarios; the first is the default.
        build: Scenario to loop.
    """

    name: str
    title: str
    scenario_file: Path
    build: Callable[[Scenario], Loop] = build_loop

    def scenarios(self) -> list[str]:
        """Names of the committed scenarios."""
        names: list[str] = scenario_names(self.scenario_file)
        return names

    def scenario(self, name: str | None = None, file: Path | None = None, text: str | None = None) -> Scenario:
        """A scenario, from the committed file unless another is given; the first of the file when no name is.

        Raises:
            ParamsError: a file without scenarios; otherwise see `load_scenario`.
        """
        path = self.scenario_file if file is None else file
        if name is None:
            names = scenario_names(path)
            if not names:
                raise ParamsError(f"{path}: wanted at least one scenario; the file has none")
            name = names[0]
        return load_scenario(path, name, text)


DIAGRAMS: Mapping[str, DiagramEntry] = {
    entry.name: entry
    for entry in (
        DiagramEntry(
            "hrp2_leg", "a hanging leg in torque control, or under its vendor's servo", HERE / "hrp2_leg.scenario.yaml"
        ),
        DiagramEntry(
            "hrp2_leg_contact",
            "the foot on a rigid object: force control",
            HERE / "hrp2_leg_contact.scenario.yaml",
        ),
    )
}


def diagram_entry(name: str) -> DiagramEntry:
    """The diagram of that name.

    Raises:
        ParamsError: there is none; the message lists those there are.
    """
    if name not in DIAGRAMS:
        raise ParamsError(f"no diagram {name!r}; diagrams: {', '.join(DIAGRAMS)}")
    return DIAGRAMS[name]
