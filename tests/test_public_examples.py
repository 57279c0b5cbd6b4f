"""Every public name has a docstring with an example, and the examples are right."""

import doctest
import inspect

import pytest
from public_examples import namespace, public_names

from drake_tc.extensions import EFFECTS, LIMITS, TASKS

DOCUMENTED = {name: value for name, value in public_names().items() if inspect.isclass(value) or callable(value)}


@pytest.fixture(scope="module")
def names(tmp_path_factory):
    yield namespace(tmp_path_factory.mktemp("examples"))
    for point, name in ((EFFECTS, "seal"), (LIMITS, "watts"), (TASKS, "mine")):
        point.remove(name)


def test_only_data_is_public_without_an_example():
    assert set(public_names()) - set(DOCUMENTED) == {"LIBRARY"}


WAITS = "RealTimeLoop"
"""Its example compiles a controller, and runs by the clock on the wall."""


@pytest.mark.parametrize(
    "name", [pytest.param(name, marks=[pytest.mark.slow] if name == WAITS else []) for name in DOCUMENTED]
)
def test_a_public_name_has_an_example_that_runs(name, names, capsys):
    text = inspect.getdoc(DOCUMENTED[name])
    examples = doctest.DocTestParser().get_doctest(text or "", dict(names), name, None, None)
    assert examples.examples, f"{name}: no example in its docstring"
    runner = doctest.DocTestRunner(optionflags=doctest.NORMALIZE_WHITESPACE)
    found = runner.run(examples, clear_globs=False)
    assert found.failed == 0, capsys.readouterr().out
