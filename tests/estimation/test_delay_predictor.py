"""The delay predictor: no delay where the model is right, the measured level where it is not, honest when it cannot."""

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal
from pydrake.systems.analysis import Simulator
from pydrake.systems.framework import DiagramBuilder
from pydrake.systems.primitives import ConstantVectorSource, LogVectorOutput, TrajectorySource
from pydrake.trajectories import PiecewisePolynomial

from drake_tc.errors import ParamsError
from drake_tc.estimation.disturbance_observer import DelayPredictor, PredictorSpec
from drake_tc.filtering.savitzky_golay import SavitzkyGolayFilter

DT, WINDOW, BANDWIDTH = 1e-3, 80, 100.0
SLOPE, OFFSET = 30.0, 2.0


def ramp(slope, offset):
    return TrajectorySource(PiecewisePolynomial.FirstOrderHold([0.0, 1.0], [[offset, offset + slope]]))


def predicted(model_error=0.0):
    """(time, tau_now, tau_hat): a rising torque, measured behind the filters; the model's is off by a constant."""
    builder = DiagramBuilder()
    truth = builder.AddSystem(ramp(SLOPE, OFFSET))
    model = builder.AddSystem(ramp(SLOPE, OFFSET + model_error))
    measured = builder.AddSystem(SavitzkyGolayFilter(1, WINDOW, 2, DT))
    again = builder.AddSystem(SavitzkyGolayFilter(1, WINDOW, 2, DT))
    predictor = builder.AddSystem(DelayPredictor(1, PredictorSpec(BANDWIDTH), DT))
    builder.Connect(truth.get_output_port(), measured.get_input_port())
    builder.Connect(predictor.GetOutputPort("model_torque"), again.get_input_port())
    builder.Connect(again.GetOutputPort("value"), predictor.GetInputPort("delayed_model_torque"))
    builder.Connect(measured.GetOutputPort("value"), predictor.GetInputPort("estimated_torque"))
    builder.Connect(model.get_output_port(), predictor.GetInputPort("link_torque"))
    for name, size in (("joint_estimate", 3), ("motion", 3), ("fault", 1), ("position", 1)):
        source = builder.AddSystem(ConstantVectorSource(np.zeros(size)))
        builder.Connect(source.get_output_port(), predictor.GetInputPort(name))
    now = LogVectorOutput(predictor.GetOutputPort("estimated_torque"), builder, DT)
    old = LogVectorOutput(measured.GetOutputPort("value"), builder, DT)
    simulator = Simulator(builder.Build())
    simulator.AdvanceTo(0.6)
    logs = [sink.FindLog(simulator.get_context()) for sink in (now, old)]
    return np.array(logs[0].sample_times()), *(np.array(log.data())[0] for log in logs)


def test_the_delay_is_gone():
    time, now, old = predicted()
    late = time > 0.4
    assert_allclose(old[late], OFFSET + SLOPE * (time[late] - 0.5 * (WINDOW - 1) * DT - DT), rtol=1e-6)
    # the low pass lags as well, but in the bracket by the same: what rises steadily is known without delay
    assert_allclose(now[late], OFFSET + SLOPE * time[late], rtol=1e-4)


def test_the_level_is_the_measured_one_whatever_the_model_says():
    time, right, _ = predicted()
    _, wrong, _ = predicted(model_error=5.0)
    assert_allclose(wrong[time > 0.4], right[time > 0.4], atol=1e-3)


def fixed(predictor, **changed):
    n = 2
    values = {
        "estimated_torque": [1.0, 2.0],
        "joint_estimate": np.arange(3.0 * n),
        "delayed_model_torque": [0.5, -0.5],
        "link_torque": [4.0, 5.0],
        "motion": 10.0 + np.arange(3.0 * n),
        "fault": [0.0],
        "position": [7.0, 8.0],
    }
    context = predictor.CreateDefaultContext()
    for name, value in (values | changed).items():
        predictor.GetInputPort(name).FixValue(context, np.asarray(value, dtype=float))
    return context, {name: np.asarray(value, dtype=float) for name, value in (values | changed).items()}


def test_sound_inputs_give_the_model_over_the_measurement():
    predictor = DelayPredictor(2, PredictorSpec(BANDWIDTH), DT)
    context, given = fixed(predictor)
    context.SetDiscreteState([3.0, 4.0])

    def read(name):
        return predictor.GetOutputPort(name).Eval(context)

    assert_allclose(read("estimated_torque"), [1.0 + 3.0 - 0.5, 2.0 + 4.0 + 0.5])
    assert_array_equal(read("joint_estimate"), given["motion"])
    assert_array_equal(read("position"), given["motion"][:2])
    assert_array_equal(read("model_torque"), [3.0, 4.0])
    assert read("fault")[0] == 0.0
    after = predictor.EvalUniquePeriodicDiscreteUpdate(context).get_vector(0).value()
    assert_allclose(after, [3.0, 4.0] + (1.0 - np.exp(-BANDWIDTH * DT)) * np.array([1.0, 1.0]))


@pytest.mark.parametrize(
    ("name", "value"),
    [
        ("fault", [1.0]),
        ("motion", np.full(6, np.nan)),
        ("link_torque", [np.inf, 0.0]),
        ("delayed_model_torque", [0.0, np.nan]),
        ("position", [1e12, 0.0]),
        ("estimated_torque", [np.nan, 2.0]),
        ("joint_estimate", np.full(6, np.nan)),
    ],
)
def test_what_cannot_be_predicted_passes_as_it_came(name, value):
    predictor = DelayPredictor(2, PredictorSpec(), DT)
    context, given = fixed(predictor, **{name: value})
    context.SetDiscreteState([3.0, 4.0])
    assert predictor.GetOutputPort("fault").Eval(context)[0] == 1.0
    for output in ("estimated_torque", "joint_estimate", "position"):
        assert_array_equal(predictor.GetOutputPort(output).Eval(context), given[output])
    after = predictor.EvalUniquePeriodicDiscreteUpdate(context).get_vector(0).value()
    assert np.isfinite(after).all()


def test_the_model_torque_feeds_no_input_through():
    predictor = DelayPredictor(2, PredictorSpec(), DT)
    output = predictor.GetOutputPort("model_torque").get_index()
    assert not any(predictor.HasDirectFeedthrough(i, output) for i in range(predictor.num_input_ports()))


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: PredictorSpec(0.0), r"bandwidth: expected a positive number"),
        (lambda: DelayPredictor(0, PredictorSpec()), "expected at least one joint, got 0"),
        (lambda: DelayPredictor(1, PredictorSpec(), np.nan), "dt: expected a positive period"),
    ],
)
def test_refusals(make, message):
    with pytest.raises(ParamsError, match=message):
        make()
