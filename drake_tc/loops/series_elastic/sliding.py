"""A series-elastic joint as a linear analysis takes it, and the diagram at a moment of its scenario."""

from dataclasses import replace

from drake_tc.loops.series_elastic.scenario import SeaScenario, SeaSensors
from drake_tc.sensing.spec import SensorSpec


def sliding_sea(scenario: SeaScenario) -> SeaScenario:
    """The scenario without dry friction, in motor and model, and with sensors that are late but otherwise perfect."""
    sensors = scenario.sensors
    late = {name: SensorSpec(latency=getattr(sensors, name).latency) for name in vars(sensors)}
    return replace(scenario, effects={**scenario.effects, "coulomb": {}}, sensors=SeaSensors(**late))
