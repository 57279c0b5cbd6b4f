"""Pages and schemas of input files come from the files' models: complete, and they agree with the reader."""

from pathlib import Path

import pytest
from jsonschema import Draft202012Validator

import drake_tc.models
from drake_tc.actuation.model_file import EffectKeys, ModelDocument
from drake_tc.cli.schema_command import Document, document_model, document_page, document_schema
from drake_tc.config.keys import HIDDEN, default_of
from drake_tc.config.page import key_table, nested
from drake_tc.config.records import validated
from drake_tc.config.yaml_file import read_yaml
from drake_tc.effects.library import all_effects
from drake_tc.errors import ParamsError
from drake_tc.registry import DIAGRAMS, registered, runnable
from drake_tc.robot.document import RobotDocument
from drake_tc.tsid.configuration import ControllerDocument

MODELS = Path(drake_tc.models.__file__).parent
FILES = {
    Document.robot: sorted(
        path for path in MODELS.rglob("*.yaml") if "urdf" in read_yaml(path) and "joints" in read_yaml(path)
    ),
    Document.actuator: sorted(path for path in MODELS.rglob("*.yaml") if "drive:" in path.read_text(encoding="utf-8")),
    Document.controller: sorted(path for path in MODELS.rglob("*.yaml") if "tasks" in read_yaml(path)),
}
EVERY_FILE = [(document, path) for document, paths in FILES.items() for path in paths]
KINDS = {
    "torque": Document.scenario,
    "whole_body": Document.whole_body_scenario,
    "series_elastic": Document.series_elastic_scenario,
}
EVERY_MODEL = [
    pytest.param(model, id=f"{document}-{place}")
    for document in Document
    if document != Document.rig
    for place, model in (("top", document_model(document)), *nested(document_model(document)))
]


@pytest.mark.parametrize("document", [each for each in Document if each != Document.rig])
def test_the_page_has_the_table_of_every_mapping(document):
    page = document_page(document)
    assert key_table(document_model(document)) in page
    for place, model in nested(document_model(document)):
        assert f"## `{place}`" in page and key_table(model) in page


@pytest.mark.parametrize("model", EVERY_MODEL)
def test_every_key_is_explained(model):
    rows = key_table(model).splitlines()[2:]
    for name, field in model.model_fields.items():
        if not (field.alias or name).startswith(HIDDEN):
            assert field.description.endswith("."), name
            meaning = field.description.replace("|", "\\|")
            assert any(row.startswith(f"| `{field.alias or name}` | {meaning} |") for row in rows)
            assert default_of(field)


@pytest.mark.parametrize(("document", "path"), EVERY_FILE, ids=lambda value: getattr(value, "stem", str(value)))
def test_committed_files_agree_with_reader_and_schema(document, path):
    data = read_yaml(path)
    validated(document_model(document), data, str(path))
    Draft202012Validator(document_schema(document)).validate(data)


REFUSED = [
    (
        RobotDocument,
        Document.robot,
        {"name": "arm", "urdf": "a.urdf", "base": "b", "fixed_base": True, "joints": ["j"]},
    ),
    (ControllerDocument, Document.controller, {"robot": "r.yaml", "tasks": {"a": {"kind": "torque"}}}),
    (ModelDocument, Document.actuator, {"joints": {"j": {"drive": {"kind": "current", "gain": 1.0}}}}),
]
CHANGES = {
    Document.robot: [
        {"joints": []},
        {"fixed_base": 1},
        {"name": 3},
        {"imu": {"a": {"link": "b", "xyz": [1, 2]}}},
        {"limits": {"j": {"effort": 0}}},
        {"rotor_inertia": {"j": -1.0}},
        {"unknown": 1},
        {"force_torque": {"a": {"link": "b", "mass_beyond": 2.0}}},
    ],
    Document.controller: [
        {"robot": 3},
        {"tasks": {}},
        {"task": {}},
        {"contacts": {"a": {}}},
        {"contacts": {"a": {"link": "b", "kind": "line"}}},
        {"contacts": {"a": {"link": "b", "extents": [1, 2, 3]}}},
        {"formulation": {"measure": "best"}},
        {"formulation": {"iterations": 0}},
        {"solver": "simplex"},
        {"period": "soon"},
        {"rotor_inertia": {"j": -1.0}},
        {"sigma": True},
    ],
    Document.actuator: [
        {"joints": {}},
        {"joints": {"j": {"drive": {"kind": "steam", "gain": 1.0}}}},
        {"joints": {"j": {"drive": {"kind": "current", "gain": 0.0}}}},
        {"joints": {"j": {"drive": {"kind": "current", "gain": 1.0}, "effects": [{"effect": "viscous"}]}}},
        {"joints": {"j": {"drive": {"kind": "current", "gain": 1.0}, "effects": [{"effect": "slime", "slime": 1}]}}},
        {
            "joints": {
                "j": {"drive": {"kind": "current", "gain": 1.0}, "effects": [{"effect": "viscous", "viscous": -1}]}
            }
        },
    ],
}


@pytest.mark.parametrize(("model", "document", "good"), REFUSED)
def test_reader_and_schema_refuse_the_same(model, document, good):
    schema = Draft202012Validator(document_schema(document))
    validated(model, good, "f")
    assert schema.is_valid(good)
    for change in CHANGES[document]:
        with pytest.raises(ParamsError, match=r"^f: ") as caught:
            validated(model, good | change, "f")
        assert "\n" not in str(caught.value)
        assert not schema.is_valid(good | change), change


@pytest.mark.parametrize("name", registered(DIAGRAMS))
def test_committed_scenarios_agree_with_the_schema(name):
    entry = runnable(name)
    schema = Draft202012Validator(document_schema(KINDS[entry.kind]))
    document = read_yaml(entry.scenario_file)
    schema.validate(document)
    assert not schema.is_valid({**document, "one": {"durration": 1.0}})
    assert not schema.is_valid({**document, "one": {"duration": "long"}})
    assert not schema.is_valid({**document, "one": {"extends": ["b"]}})


def test_the_schema_has_a_branch_for_every_effect():
    branches = EffectKeys.model_json_schema()["anyOf"]
    assert [branch["properties"]["effect"]["enum"] for branch in branches] == [
        sorted({each.id, each.key}) for each in all_effects()
    ]
